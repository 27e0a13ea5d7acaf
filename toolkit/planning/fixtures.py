"""What a laboratory can load: its fixtures, declared once, and the loads that they make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from toolkit.declared import Above, AtLeast, Distinct, Entry, Fault, Format, Keyed, Quantity, Size, Unit
from toolkit.errors import ConfigError
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.session.table import Table

_SAME_DIRECTION = 0.02  # of a load that was put on before, in parts of the largest: as read, not as meant


@dataclass(frozen=True, slots=True, kw_only=True)
class Fixture:
    """A way to hang weights: the loads that a newton makes, and the weights that can hang there."""

    name: Annotated[str, Entry("as the operator knows it", example="lateral pull")]
    per_newton: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Size(1),
        Entry("load by newton of weight: 1 for a force, the lever arm in metres for a moment",
              example={"FY": 1.0}),
    ]  # fmt: skip
    weights_N: Annotated[
        tuple[float, ...], Unit("N"), Above(0), Size(1), Distinct(),
        Entry("what can hang there, all that hangs counted", key="weights",
              example={"value": [500, 1000], "unit": "N"}),
    ]  # fmt: skip
    both: Annotated[bool, Entry("whether it can be turned to pull the other way")] = True
    minutes: Annotated[float, AtLeast(0), Entry("from one reading to the next")] = 2.0
    setup_minutes: Annotated[float, AtLeast(0), Entry("to mount it, each time and each way")] = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadingFixtures:
    """The fixtures of an instrument's calibration."""

    FORMAT: ClassVar[Format] = Format(title="loading fixtures", schema=1)

    instrument: Annotated[str, Entry("what they calibrate", example="rig")]
    run_minutes: Annotated[float, AtLeast(0), Entry("before every run: preload, rest, zero")] = 10.0
    limits: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Unit("N", "N*m"), Above(0),
        Entry("largest load that may be put on, by load", key="limit",
              example={"FY": {"value": 6000, "unit": "N"}}),
    ] = ()  # fmt: skip
    fixtures: Annotated[
        tuple[Fixture, ...], Size(1), Distinct("name"), Entry("one entry a fixture", key="fixture")
    ]

    def faults(self) -> Iterator[Fault]:
        """Yield a fixture that makes no load at all."""
        for number, fixture in enumerate(self.fixtures):
            if not any(arm for _, arm in fixture.per_newton):
                yield Fault(
                    key=("fixture", number, "per_newton"), got=dict(fixture.per_newton),
                    expected="a load that is not zero", what="the fixture makes no load",
                )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FeasibleLoads:
    """The loads that can be put on, the empty hub first.

    ``loads`` (candidates, loads) in the record's units; ``mount`` (candidates,) names the fixture and its
    way, "" of the empty hub; ``amount`` (candidates,) orders the loads of a mount by size, ``label`` says
    them. ``minutes`` (candidates,) and ``setup_minutes`` are None where nobody stated them.
    """

    source: str
    loads: NDArray[np.float64]
    mount: tuple[str, ...]
    label: tuple[str, ...]
    amount: NDArray[np.float64]
    minutes: NDArray[np.float64] | None
    setup_minutes: Mapping[str, float] | None
    run_minutes: float | None
    refused: int = 0

    def unloadable(self) -> NDArray[np.intp]:
        """Return the loads that can be reached from above: the empty hub, all below the top of a mount."""
        top: dict[str, float] = {}
        for mount, amount in zip(self.mount, self.amount.tolist(), strict=True):
            top[mount] = max(top.get(mount, 0.0), amount)
        below = [
            not mount or amount < top[mount]
            for mount, amount in zip(self.mount, self.amount.tolist(), strict=True)
        ]
        return np.flatnonzero(below)


def loads_of_fixtures(stated: LoadingFixtures, record: CalibrationRecord, path: Path) -> FeasibleLoads:
    """Return the loads of declared fixtures in the record's units.

    Raises
    ------
    ConfigError
        ``plan-fixtures``: a load that the record does not have, limits that no weight keeps
    """
    names = [fit.load for fit in record.loads]
    scale = {fit.load: unit(fit.unit).factor for fit in record.loads}
    strange = sorted(
        {load for fixture in stated.fixtures for load, _ in fixture.per_newton}.difference(names)
        | {load for load, _ in stated.limits}.difference(names)
    )
    if strange:
        raise ConfigError(
            "a fixture names a load that the instrument does not have", where=path, got=", ".join(strange),
            expected=", ".join(names), next_step="name the record's loads; nothing was written",
            rule="plan-fixtures",
        )  # fmt: skip
    limits = np.array([dict(stated.limits).get(name, np.inf) / scale[name] for name in names])
    rows, mounts, labels, amounts, minutes = [np.zeros(len(names))], [""], ["no load"], [0.0], [0.0]
    setup: dict[str, float] = {}
    refused = 0
    for fixture in stated.fixtures:
        arms = np.array([dict(fixture.per_newton).get(name, 0.0) / scale[name] for name in names])
        for sign in (1.0, -1.0)[: 2 if fixture.both else 1]:
            mount = fixture.name + ("" if not fixture.both else ", +" if sign > 0 else ", -")
            for weight in sorted(fixture.weights_N):
                load = sign * arms * weight
                if (np.abs(load) > limits * (1 + 1e-9)).any():
                    refused += 1
                    continue
                rows.append(load)
                mounts.append(mount)
                labels.append(_written(weight))
                amounts.append(weight)
                minutes.append(fixture.minutes)
                setup[mount] = fixture.setup_minutes
    if len(rows) == 1:
        raise ConfigError(
            "the limits leave no weight of any fixture", where=path,
            got=f"{refused} loads, each beyond a limit", expected="lighter weights, or higher limits",
            next_step="state weights that the instrument may bear; nothing was written", rule="plan-fixtures",
        )  # fmt: skip
    minutes[0] = float(np.mean(minutes[1:]))
    return FeasibleLoads(
        source=str(path), loads=np.array(rows), mount=tuple(mounts), label=tuple(labels),
        amount=np.array(amounts), minutes=np.array(minutes), setup_minutes=setup,
        run_minutes=stated.run_minutes, refused=refused,
    )  # fmt: skip


def _written(weight: float) -> str:
    """Return a weight as the file has it."""
    size, name = (weight.value, weight.unit) if isinstance(weight, Quantity) else (weight, "N")
    return f"{size:.6g} {name}"


def loads_of_record(record: CalibrationRecord, tables: list[Table]) -> FeasibleLoads:
    """Return the loads of the record's own session: what was put on can be put on again.

    Loads of one direction, told from their parts of the largest ones, are those of one mount.
    """
    names = [fit.load for fit in record.loads]
    largest = np.array([fit.largest for fit in record.loads])
    parts = np.concatenate([table.matrix(names) for table in tables]) / largest
    parts = np.round(parts / _SAME_DIRECTION) * _SAME_DIRECTION
    _, first = np.unique(parts, axis=0, return_index=True)
    loads = np.concatenate([table.matrix(names) for table in tables])[np.sort(first)]
    size = np.abs(loads / largest).max(axis=1)
    used = size > _SAME_DIRECTION
    loads, size = loads[used], size[used]
    mounts = [_direction(load, names) for load in loads / largest / size[:, None]]
    return FeasibleLoads(
        source=f"the loads of {record.id}'s own session",
        loads=np.vstack([np.zeros(len(names)), loads]),
        mount=("", *mounts),
        label=("no load", *(f"{100 * share:.0f} %" for share in size.tolist())),
        amount=np.append(0.0, size),
        minutes=None, setup_minutes=None, run_minutes=None,
    )  # fmt: skip


def _direction(share: NDArray[np.float64], names: list[str]) -> str:
    """Return which loads a direction has and their signs, ``+FY -MX``; parts below a twentieth are none."""
    return " ".join(
        f"{'+' if part > 0 else '-'}{name}" + ("" if abs(part) > 0.95 else f"*{abs(part):.1f}")
        for part, name in zip(share.tolist(), names, strict=True)
        if abs(part) >= 0.05
    )
