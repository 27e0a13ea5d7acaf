"""What a laboratory can load: the loads that its fixtures make, or those of the last session."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import Quantity
from toolkit.errors import ConfigError
from toolkit.planning.session_reach import AS_READ, calibrated_interval
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.session.table import Table
    from toolkit.machine.hub import Loading

_NONE: Mapping[str, float] = MappingProxyType({})
_MOST = 600  # loads that a search weighs within its minute
_BEYOND = 1.1  # of the largest load that was put on: further the record says nothing of the cells


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FeasibleLoads:
    """The loads that can be put on, the empty hub first.

    ``loads`` (candidates, loads) in the record's units; ``mount`` (candidates,) names the fixture and its
    way, "" of the empty hub; ``amount`` (candidates,) orders the loads of a mount by size, ``label`` says
    them. ``minutes`` (candidates,) and ``setup_minutes`` are None where nobody stated them; ``refused``
    loads of the fixtures were beyond a limit, and so many ``mounts_left_out`` are much like others (`few`).
    """

    source: str
    loads: Array
    mount: tuple[str, ...]
    label: tuple[str, ...]
    amount: Array
    minutes: Array | None
    setup_minutes: Mapping[str, float] | None
    run_minutes: float | None
    refused: int = 0
    mounts_left_out: int = 0

    def few(self) -> FeasibleLoads:
        """Return the loads of as many mounts as a search has time for.

        Those of the largest loads of each kind and sense, then always the one whose largest load is farthest
        from those of all others; of alike ones the quickest.
        """
        if len(self.mount) <= _MOST:
            return self
        numbers, mount_of = np.unique(np.array(self.mount), return_inverse=True)
        count = np.bincount(mount_of)
        tops = np.zeros((len(numbers), self.loads.shape[1]))
        order = np.argsort(self.amount, kind="stable")
        tops[mount_of[order]] = self.loads[order]  # the last, which is the largest, stays
        tops /= np.maximum(np.abs(self.loads).max(axis=0), 1e-300)
        slow = np.zeros(len(numbers))
        if self.minutes is not None and self.setup_minutes is not None:
            slow[mount_of] = self.minutes
            slow += [self.setup_minutes.get(name, 0.0) for name in numbers.tolist()]
        quickest = np.argsort(slow, kind="stable")
        ends = np.concatenate([tops[quickest], -tops[quickest]], axis=1).argmax(axis=0)
        chosen = dict.fromkeys([int(np.flatnonzero(numbers == "")[0]), *quickest[ends].tolist()])
        apart = np.min([np.linalg.norm(tops - tops[at], axis=1) for at in chosen], axis=0)
        while apart.max() > 0:
            at = int(quickest[np.argmax(apart[quickest])])
            if count[[*chosen, at]].sum() > _MOST:
                break
            chosen[at] = None
            apart = np.minimum(apart, np.linalg.norm(tops - tops[at], axis=1))
        kept = np.flatnonzero(np.isin(mount_of, [*chosen])).tolist()
        return dataclasses.replace(
            self, loads=self.loads[kept], mount=tuple(self.mount[at] for at in kept),
            label=tuple(self.label[at] for at in kept), amount=self.amount[kept],
            minutes=None if self.minutes is None else self.minutes[kept],
            mounts_left_out=len(numbers) - len(chosen),
        )  # fmt: skip

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


def loads_of_fixtures(
    stated: Loading, record: CalibrationRecord, path: Path | str, rated: Mapping[str, float] = _NONE
) -> FeasibleLoads:
    """Return the loads of declared fixtures in the record's units.

    A load may be as large as its stated limit, else as the instrument's rated one [N, N*m], else a tenth
    above the largest of the record; in a sense that was calibrated less far, by as much less, and in one
    that was not, not at all.

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
    bounds = {**rated, **dict(stated.limits)}
    limits = np.array(
        [bounds[fit.load] / scale[fit.load] if fit.load in bounds else _BEYOND * fit.largest
         for fit in record.loads]
    )  # fmt: skip
    low, high = _bounds(record, limits)
    rows, mounts, labels, amounts, minutes = [np.zeros(len(names))], [""], ["no load"], [0.0], [0.0]
    setup: dict[str, float] = {}
    refused = 0
    for fixture in stated.fixtures:
        arms = np.array([dict(fixture.per_newton).get(name, 0.0) / scale[name] for name in names])
        for sign in (1.0, -1.0)[: 2 if fixture.both else 1]:
            mount = fixture.name + ("" if not fixture.both else ", +" if sign > 0 else ", -")
            for weight in sorted(fixture.weights_N):
                load = sign * arms * weight + 0.0  # no -0 in anything that is written
                if ((load < low * (1 + 1e-9)) | (load > high * (1 + 1e-9))).any():
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
            got=f"{refused} loads, each beyond a limit",
            expected="loads within "
            + ", ".join(
                f"{fit.load} {one:.4g} to {other:.4g} {fit.unit}"
                for fit, one, other in zip(record.loads, low.tolist(), high.tolist(), strict=True)
            )
            + f", as {record.id} is calibrated",
            next_step="state weights, and the sign of per_newton, that the instrument may bear and is "
            "calibrated for; nothing was written",
            rule="plan-fixtures",
        )  # fmt: skip
    minutes[0] = float(np.mean(minutes[1:]))
    return FeasibleLoads(
        source=str(path), loads=np.array(rows), mount=tuple(mounts), label=tuple(labels),
        amount=np.array(amounts), minutes=np.array(minutes), setup_minutes=setup,
        run_minutes=stated.run_minutes, refused=refused,
    )  # fmt: skip


def _bounds(record: CalibrationRecord, limits: Array) -> tuple[Array, Array]:
    """Return the lowest and the highest load (loads,) that may be put on, by limits of their sizes (loads,).

    Each sense goes as much beyond what was calibrated of it as the largest load may; what a fixture makes of
    a load aside, as small as loads differ as they are read, is allowed.
    """
    ends = np.array([calibrated_interval(fit) for fit in record.loads]).T
    largest = np.array([fit.largest for fit in record.loads])
    sizes = np.maximum(np.abs(ends) * np.maximum(limits / largest, 1.0), AS_READ * largest)
    low, high = np.minimum(sizes, limits)
    return -low, high


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
    parts = np.round(parts / AS_READ) * AS_READ
    _, first = np.unique(parts, axis=0, return_index=True)
    loads = np.concatenate([table.matrix(names) for table in tables])[np.sort(first)]
    size = np.abs(loads / largest).max(axis=1)
    loaded = size > AS_READ
    loads, size = loads[loaded], size[loaded]
    mounts = [_direction(load, names) for load in loads / largest / size[:, None]]
    return FeasibleLoads(
        source=f"the loads of {record.id}'s own session",
        loads=np.vstack([np.zeros(len(names)), loads]),
        mount=("", *mounts),
        label=("no load", *(f"{100 * share:.0f} %" for share in size.tolist())),
        amount=np.append(0.0, size),
        minutes=None, setup_minutes=None, run_minutes=None,
    )  # fmt: skip


def _direction(share: Array, names: list[str]) -> str:
    """Return which loads a direction has and their signs, ``+FY -MX``; parts below a twentieth are none."""
    return " ".join(
        f"{'+' if part > 0 else '-'}{name}" + ("" if abs(part) > 0.95 else f"*{abs(part):.1f}")
        for part, name in zip(share.tolist(), names, strict=True)
        if abs(part) >= 0.05
    )
