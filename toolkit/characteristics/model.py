"""Characteristics: what a requester reads off a test, as rows, with their uncertainty."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from toolkit.characteristics.catalogue import by_name, summary, tables
from toolkit.characteristics.characteristic import BOTH, Characteristic
from toolkit.characteristics.groups import DirectionFit
from toolkit.characteristics.sweep_fit import SweepFit
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.estimate import Estimate
from toolkit.findings import Finding

if TYPE_CHECKING:
    import pandas as pd


_SAME_LOAD = 0.04  # loads within this part of a summary's load are its load


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One characteristic of one load.

    Attributes
    ----------
    name : key of the catalogue
    load_N : load [N]
    rotation : ``forward``, ``reverse``, or ``both`` for what belongs to a load and no direction
    SA_rad : slip angle [rad] of a value at one; None for all others
    estimate : value, standard uncertainty and degrees of freedom, SI; None where it is lacking
    lacking : what the test lacks for it; None where there is an estimate
    sources : the budget, (source, standard uncertainty [unit of the estimate]); none at slip angles
    parts : the signed parts of the uncertainty, by which what two tests share cancels; a row of a reduced
        test has none (`characterise.characteristic_rows` gives them)
    """

    name: str
    load_N: float
    rotation: str
    SA_rad: float | None = None
    estimate: Estimate | None = None
    lacking: str | None = None
    sources: tuple[tuple[str, float], ...] = ()
    parts: tuple[Part, ...] = field(default=(), compare=False, repr=False)

    @classmethod
    def of(
        cls, name: str, number: Uncertain, *, load_N: float, rotation: str = BOTH, SA_rad: float | None = None
    ) -> Row:
        """Return the row of a number that knows its parts."""
        return cls(
            name=name,
            load_N=load_N,
            rotation=rotation,
            SA_rad=SA_rad,
            estimate=number.estimate(),
            sources=number.by_source() if SA_rad is None else (),
            parts=number.parts,
        )

    @property
    def series(self) -> tuple[str, str, float | None]:
        """What is the same at every load: (name, rotation, slip angle)."""
        return self.name, self.rotation, self.SA_rad

    @property
    def characteristic(self) -> Characteristic:
        """What the catalogue declares of it."""
        return by_name()[self.name]

    @property
    def number(self) -> Uncertain:
        """The value with the parts of its uncertainty.

        Raises
        ------
        ValueError
            the row is lacking, or is one of a reduced test, without parts
        """
        if self.estimate is None or (self.estimate.u and not self.parts):
            raise ValueError(f"{self.name} at {self.load_N:g} N has no parts: {self.lacking or 'not stored'}")
        return Uncertain(value=self.estimate.value, unit=self.estimate.unit, parts=self.parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One condition as measured, with its whole uncertainty.

    ``u_FY`` [N] and ``u_MZ`` [N·m] are standard uncertainties of FY and MZ at the measured slip angle and
    load, from every source that the budget names.
    """

    file: str
    first_row: int
    u_FY: float
    u_MZ: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Characteristics:
    """All of a test: the fitted curves, and a row for each characteristic of each load and direction.

    ``rows`` stand in the catalogue's order: first those of loads, lightest first, then those of each
    direction with its values at slip angles. What the test cannot give is a row too, and says what lacks.
    ``sweeps`` are the fits of the recordings in time.
    """

    fits: tuple[DirectionFit, ...]
    rows: tuple[Row, ...]
    findings: tuple[Finding, ...]
    points: tuple[Point, ...] = ()
    sweeps: tuple[SweepFit, ...] = ()

    @property
    def loads_N(self) -> tuple[float, ...]:
        """The loads that have rows [N], lightest first."""
        return tuple(sorted({row.load_N for row in self.rows}))

    def of(self, name: str, *, rotation: str | None = None) -> tuple[Row, ...]:
        """Return the rows of a characteristic, of one direction or of all."""
        return tuple(row for row in self.rows if row.name == name and rotation in (None, row.rotation))

    def at(self, name: str, load_N: float, rotation: str = BOTH, SA_rad: float | None = None) -> Row | None:
        """Return one row; None where the test has none of that load, direction and slip angle."""
        key = (name, rotation, SA_rad)
        return next((row for row in self.rows if row.load_N == load_N and row.series == key), None)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the rows as a table, SI: value, u, U and its interval at 95 %, k, dof, unit."""
        import pandas as pd

        table = pd.DataFrame([_record(row) for row in self.rows], columns=_COLUMNS)
        return table.astype(dict.fromkeys(_NUMBERS, float))


def in_order(rows: Iterable[Row], fits: Iterable[DirectionFit]) -> tuple[Row, ...]:
    """Return rows in the order of `Characteristics`, that of the rows of a kind unchanged."""
    listed = tuple(rows)
    by_group: dict[tuple[float, str], list[Row]] = {(fit.load_N, fit.rotation): [] for fit in fits}
    for row in sorted(listed, key=lambda row: row.SA_rad is not None):
        by_group.setdefault((row.load_N, row.rotation), []).append(row)
    loads = [row for (_, rotation), group in by_group.items() for row in group if rotation == BOTH]
    single = [row for (_, rotation), group in by_group.items() for row in group if rotation != BOTH]
    return (*loads, *single)


def answer_lists(rows: Iterable[Row]) -> dict[str, list[dict[str, Any]]]:
    """Return rows as the lists of the JSON answer: an entry a load, direction and slip angle.

    Each entry has ``load_N``, ``rotation`` and ``SA_rad`` where its list has them, then an `Estimate` or None
    under the name of each characteristic.
    """
    lists: dict[str, dict[tuple[object, ...], dict[str, Any]]] = {table.answer: {} for table in tables()}
    for row in rows:
        table = row.characteristic.table
        key: dict[str, Any] = {"load_N": row.load_N}
        if table.scope != "load":
            key["rotation"] = row.rotation
        if table.scope == "angle":
            key["SA_rad"] = row.SA_rad
        entry = lists[table.answer].setdefault(tuple(key.values()), key)
        entry[row.name] = row.estimate
    return {answer: list(entries.values()) for answer, entries in lists.items()}


_NUMBERS = ("load_N", "SA_rad", "value", "u", "U", "k", "dof", "low_95", "high_95")
_COLUMNS = (
    "characteristic", "title", "channel", "load_N", "rotation", "SA_rad", "value", "u", "U", "k", "dof",
    "low_95", "high_95", "unit", "lacking",
)  # fmt: skip


def _record(row: Row) -> tuple[object, ...]:
    declared, estimate = row.characteristic, row.estimate
    head = (row.name, declared.title, declared.channel, row.load_N, row.rotation, row.SA_rad)
    if estimate is None:
        return (*head, *(None,) * 7, declared.unit, row.lacking)
    U, k = estimate.expanded()
    interval = (estimate.value - U, estimate.value + U)
    return (*head, estimate.value, estimate.u, U, k, estimate.dof, *interval, estimate.unit, None)


def summary_load(characteristics: Characteristics, rated_load_N: float | None) -> float | None:
    """Return the load of the summary [N]: the one nearest the rated load, else the middle one."""
    loads = characteristics.loads_N
    if not loads:
        return None
    if rated_load_N:
        return min(loads, key=lambda load: abs(load - rated_load_N))
    return loads[len(loads) // 2]


def summary_estimates(
    characteristics: Characteristics, rated_load_N: float | None
) -> dict[str, Estimate | None]:
    """Return the values of the summary by their names, in printed units; of directions the forward run."""
    load = summary_load(characteristics, rated_load_N)
    estimates: dict[str, Estimate | None] = {}
    for characteristic in summary():
        rotation = "forward" if characteristic.scope == "direction" else None
        rows = characteristics.of(characteristic.name, rotation=rotation)
        near = (row for row in rows if load is not None and abs(row.load_N - load) <= _SAME_LOAD * load)
        row = next(near, None)
        estimate = None if row is None else row.estimate
        estimates[str(characteristic.summary)] = (
            None if estimate is None else estimate.scaled(characteristic.factor, "")
        )
    return estimates
