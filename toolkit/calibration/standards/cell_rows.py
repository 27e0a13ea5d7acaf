"""One indication under one load: the rows of a session that a standard for one force may be applied to.

ASTM E74 and ISO 376 know an instrument of one force and one indication. Of a session with several loads
only the rows in which no other load acts belong to that; tension and compression are evaluated apart.
Deflections are indications less the zero: the reading without load at the beginning of the run, else the
session's [[zero]] before, else none in a tared session. Where no zero was read the indication stands for
its deflection, and that is a reason against a class.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import SessionError
from toolkit.units import unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from toolkit.calibration.records.record import Zero
    from toolkit.calibration.session.statements import Statements
    from toolkit.calibration.session.table import Table

_NO_LOAD = 1e-6
_OTHER_LOAD = 1e-3
_CREEP_SECONDS = (30.0, 300.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellSource:
    """A session's data as fitted: its rows, statements, zero and names of the loads."""

    table: Table
    statements: Statements
    zero: Zero
    loads: tuple[str, ...]
    indications: tuple[str, ...]
    where: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellRun:
    """One run: forces (n,) > 0 of one sense and deflections (n,), in the order of the rows.

    ``up`` (n,) tells increasing forces; ``u`` (n,) standard uncertainty of the force, None where not stated.
    ``zero_before`` and ``zero_after`` are the readings without load, None where not read.
    """

    number: int
    rotation_deg: float | None
    force: Array
    deflection: Array
    up: NDArray[np.bool_]
    u: Array | None
    zero_before: float | None
    zero_after: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellRows:
    """The runs of one indication under one load in one sense; ``left_out`` rows had another load acting.

    ``resolution`` in the indication's unit; ``creep`` readings at 30 s and 300 s; None where not stated.
    """

    load: str
    load_unit: str
    indication: str
    indication_unit: str
    sense: str
    runs: tuple[CellRun, ...]
    resolution: float | None
    creep: tuple[float, float] | None
    zero_read: bool
    left_out: int


def cell_rows(source: CellSource, load: str, indication: str) -> tuple[CellRows, ...]:
    """Return the rows of an indication under a load, one result a sense (positive force first).

    Raises
    ------
    SessionError
        ``standard``: no such load or indication, or no row in which the load acts alone
    """
    for kind, name, names in (("load", load, source.loads), ("indication", indication, source.indications)):
        if name not in names:
            raise _refused(source.where, f"there is no {kind} {name}", name, ", ".join(names))
    table = source.table
    force, reading = table.column(load), table.column(indication)
    acting, alone = _acting(table, load, source.loads)
    if not (acting & alone).any():
        raise _refused(
            source.where, f"there is no row in which {load} acts alone", f"{table.rows} rows", "such rows"
        )
    before, after = _stated_zeros(source, indication)
    creep = _creep(source, load, indication)
    run = np.zeros(table.rows) if table.run is None else table.run
    cells = []
    for sense, sign in (("positive", 1.0), ("negative", -1.0)):
        mine = acting & alone & (np.sign(force) == sign)
        runs = []
        for number in dict.fromkeys(run[mine].tolist()):
            rows = np.flatnonzero(mine & (run == number))
            zero = np.flatnonzero(alone & ~acting & (run == number))
            early, late = zero[zero < rows[0]], zero[zero > rows[-1]]
            first = float(reading[early[-1]]) if early.size else before
            last = float(reading[late[0]]) if late.size else after
            runs.append(_run(table, load, rows, reading, int(number), first, last))
        if runs:
            cells.append(
                CellRows(
                    load=load,
                    load_unit=table.unit(load),
                    indication=indication,
                    indication_unit=table.unit(indication),
                    sense=sense,
                    runs=tuple(runs),
                    resolution=source.statements.cell(indication).resolution,
                    creep=creep,
                    zero_read=source.zero != "included" or all(run.zero_before is not None for run in runs),
                    left_out=int((acting & ~alone).sum()),
                )
            )
    return tuple(cells)


def _acting(table: Table, load: str, loads: Sequence[str]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return in which rows (rows,) a load acts, and in which no other of the loads does."""
    force = table.column(load)
    alone = np.ones(table.rows, dtype=bool)
    for load_name in loads:
        if load_name != load:
            values = np.abs(table.column(load_name))
            alone &= values <= _OTHER_LOAD * values.max(initial=0.0)
    return np.abs(force) > _NO_LOAD * np.abs(force).max(), alone


def e74_points(table: Table, load: str, loads: Sequence[str]) -> int:
    """Return how many points ASTM E74 counts of a load in a session: of one sense, ascending, not zero.

    Of the senses the one with more points; rows without a direction count as ascending.
    """
    acting, alone = _acting(table, load, loads)
    up = np.ones(table.rows, dtype=bool) if table.up is None else table.up
    force = table.column(load)
    return max(int(np.count_nonzero(acting & alone & up & (sign * force > 0))) for sign in (1, -1))


def _run(
    table: Table,
    load: str,
    rows: NDArray[np.intp],
    reading: Array,
    number: int,
    before: float | None,
    after: float | None,
) -> CellRun:
    name = f"u_{load}"
    u = None
    if table.has(name):
        u = table.column(name)[rows] * (unit(table.unit(name)).factor / unit(table.unit(load)).factor)
    return CellRun(
        number=number,
        rotation_deg=None if table.rotation is None else float(table.rotation[rows[0]]),
        force=np.abs(table.column(load)[rows]),
        deflection=reading[rows] - (before or 0.0),
        up=np.ones(len(rows), dtype=bool) if table.up is None else table.up[rows],
        u=u,
        zero_before=before,
        zero_after=after,
    )


def _stated_zeros(source: CellSource, indication: str) -> tuple[float | None, float | None]:
    zeros: dict[str, float] = {}
    for entry in source.statements.zero:
        zeros |= {entry.when.casefold(): dict(entry.values)[indication]} if indication in dict(
            entry.values
        ) else {}  # fmt: skip
    return zeros.get("before"), zeros.get("after")


def _creep(source: CellSource, load: str, indication: str) -> tuple[float, float] | None:
    readings: dict[str, dict[float, float]] = {}
    for entry in source.statements.creep:
        indicated = dict(entry.values)
        if indication in indicated and (entry.load not in source.loads or entry.load == load):
            readings.setdefault(entry.load, {})[entry.seconds] = indicated[indication]
    early, late = _CREEP_SECONDS
    pairs = [
        (reading[early], reading[late])
        for reading in readings.values()
        if early in reading and late in reading
    ]
    return max(pairs, key=lambda pair: abs(pair[1] - pair[0])) if pairs else None


def _refused(where: object, problem: str, actual: object, expected: object) -> SessionError:
    return SessionError(
        problem,
        where=where,
        got=actual,
        expected=expected,
        next_step="name one of the record's with --load and --indication",
        rule="standard",
    )
