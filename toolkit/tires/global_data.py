"""Measured rows for models over all loads: declared axes, load blocks, and what varies in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Axes, signs
from toolkit.reduction.selection import CONDITIONS, parted
from toolkit.tires.global_model import Rows, make_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.tires.table import TireTable

# Load blocks of a table: the gaps in the sorted loads, not a list of nominal ones.

_SEPARATE = 0.06  # of the load above: a smaller gap, as of a load held to +-3 %, never parts two blocks
_APART = 0.10  # a larger one always does; between them two loads are two where both have the same angles
_SAME_ANGLE, _SHARED = np.radians(0.25), 0.5
_RESOLVED = 0.008  # gaps below this are all alike


def load_blocks(load: Array, SA: Array | None = None) -> tuple[NDArray[np.intp], ...]:
    """Return the rows of each load block, ascending in load, rows in their order.

    Parameters
    ----------
    load : (rows,) N, not negative
    SA : (rows,) rad; a load that scatters from row to row falls on other angles each time, while loads that
        were set are each measured at the angles of the others

    Gaps are taken relative to the load above them, for the spread within a block grows with the load.

    >>> [block.tolist() for block in load_blocks(np.array([1000.0, 2000.0, 1010.0, 1995.0]))]
    [[0, 2], [1, 3]]
    """
    blocks = parted(load, gap=_SEPARATE, resolved=_RESOLVED, relative=True)
    joined = list(blocks[:1])
    for block in blocks[1:]:
        below = joined[-1]
        near = load[block].min() - load[below].max() < _APART * load[block].min()
        if SA is not None and near and not _share_angles(SA[below], SA[block]):
            joined[-1] = np.sort(np.concatenate([below, block]))
        else:
            joined.append(block)
    return tuple(joined)


def _share_angles(one: Array, other: Array) -> bool:
    few, many = sorted((np.unique(np.rint(angles / _SAME_ANGLE)) for angles in (one, other)), key=len)
    return float(np.isin(few, many).mean()) >= _SHARED


def loaded_blocks(load: Array, SA: Array) -> tuple[NDArray[np.intp], ...]:
    """Return the load blocks without those in the air, or whose load was not recorded."""
    return tuple(block for block in load_blocks(load, SA) if load[block].mean() >= _NO_LOAD)


CHANNELS = ("FX", "FY", "MZ")
_NO_LOAD = 1.0  # N: a block below stands in the air
_HELD = 0.01  # of the load
_FEW = 3  # distinct values that a square needs
_CAMBER, _ANGLE = np.radians(0.5), np.radians(0.5)
_PRESSURE, _SPEED, _SLIP, _LOAD = 0.05, 0.10, 0.01, 0.2  # relative, but for the slip
_TAIL = 2.0  # percent of the rows at either end that a control's ripple may fill
_BIN, _WIDEST = np.radians(0.25), np.radians(2.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """Rows with what was measured at them, all in ``axes``.

    ``FX FY`` [N] ``MZ`` [N·m] (rows,), None where the table has no such column; ``block`` (rows,) numbers the
    load blocks in ascending load and ``loads`` (blocks,) are their mean loads [N]. ``recorded`` are the
    conditions that the data have a column of, as they stand there: in ``rows`` a speed has no sign, and
    pressure and speed that were not recorded hold a nominal value.
    """

    rows: Rows
    axes: Axes
    block: NDArray[np.intp]
    loads: Array
    recorded: Mapping[str, Array]
    FX: Array | None = None
    FY: Array | None = None
    MZ: Array | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that were measured."""
        return tuple(name for name in CHANNELS if getattr(self, name) is not None)

    def __getitem__(self, channel: str) -> Array:
        """Return a channel that was measured."""
        column: Array | None = getattr(self, channel)
        if column is None:
            raise KeyError(channel)
        return column

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Measured:
        """Return some of the rows; blocks and loads keep their numbers."""
        return Measured(
            rows=self.rows.take(index), axes=self.axes, block=self.block[index], loads=self.loads,
            recorded={name: column[index] for name, column in self.recorded.items()},
            **{name: self[name][index] for name in self.channels},
        )  # fmt: skip

    def turned(self, axes: Axes) -> Measured:
        """Return the same rows in other axes."""
        flip = signs(self.axes, axes)
        rows = replace(self.rows, SA=flip["SA"] * self.rows.SA)
        responses: dict[str, Any] = {name: flip.get(name, 1) * self[name] for name in self.channels}
        return replace(self, rows=rows, axes=axes, **responses)


def measured(
    columns: dict[str, Array],
    *,
    axes: Axes,
    rated_load_N: float | None = None,
    unloaded_radius_m: float = 0.3,
) -> Measured:
    """Return rows from columns in SI (FX FY MZ, SA FZ, optional IA P V KAPPA), blocks without load left out.

    FNOMIN is the rated load, else the mean load of the block nearest the middle of the range, the smaller of
    two that are equally near; NOMPRES and LONGVL are the medians of what was recorded.
    """
    FZ = columns["FZ"]
    blocks = loaded_blocks(FZ, columns["SA"])
    loaded = np.sort(np.concatenate(blocks)) if blocks else np.zeros(0, dtype=np.intp)
    number = np.zeros(len(FZ), dtype=np.intp)
    for index, block in enumerate(blocks):
        number[block] = index
    loads = np.array([FZ[block].mean() for block in blocks])
    middle = (loads.min() + loads.max()) / 2 if len(loads) else 1.0
    apart = np.abs(loads - middle)
    # Neither how a load is held nor the rounding of its unit must choose between two of them.
    nearest = apart <= apart.min(initial=np.inf) + _HELD * middle
    nominal = rated_load_N or (float(loads[np.argmax(nearest)]) if len(loads) else 1.0)
    pressure, speed = columns.get("P"), columns.get("V")
    rows = make_rows(
        columns["SA"][loaded],
        FZ[loaded],
        IA=columns["IA"][loaded] if "IA" in columns else 0.0,
        P=None if pressure is None else pressure[loaded],
        V=None if speed is None else np.abs(speed[loaded]),
        KAPPA=columns["KAPPA"][loaded] if "KAPPA" in columns else 0.0,
        FNOMIN=nominal,
        NOMPRES=200e3 if pressure is None else float(np.median(pressure)),
        LONGVL=16.7 if speed is None or not np.any(speed) else float(np.median(np.abs(speed))),
        UNLOADED_RADIUS=unloaded_radius_m,
    )
    return Measured(
        rows=rows, axes=axes, block=number[loaded], loads=loads,
        recorded={name: columns[name][loaded] for name in CONDITIONS if name in columns},
        **{name: columns[name][loaded] for name in CHANNELS if name in columns},
    )  # fmt: skip


def of_table(table: TireTable, *, rated_load_N: float | None = None, radius_m: float = 0.3) -> Measured:
    """Return the rows of a table, in its axes."""
    return measured(
        dict(table.columns), axes=table.axes, rated_load_N=rated_load_N, unloaded_radius_m=radius_m
    )


def what_varies(data: Measured) -> frozenset[str]:
    """Return which of a parameter's ``needs`` the rows meet (`toolkit.tires.global_model.Need`)."""
    r, varying = data.rows, set()
    if not len(r):
        return frozenset()
    loads = len(np.unique(data.block))
    sweeps = np.ptp(r.FZ) > _LOAD * r.FZ.max()
    if loads >= 2 or sweeps:
        varying.add("two_loads")
    if loads >= _FEW or (loads == 1 and sweeps):
        varying.add("three_loads")
    if _range(r.IA) > _CAMBER:
        varying.add("camber")
    pressure = r.P / np.median(r.P)
    if _range(pressure) > _PRESSURE:
        varying.add("pressure")
        if len(np.unique(np.rint(pressure / _PRESSURE))) >= _FEW:
            varying.add("three_pressures")
    if _range(r.V) > _SPEED * np.median(r.V):
        varying.add("speed")
    if r.SA.min() < -_ANGLE and r.SA.max() > _ANGLE:
        varying.add("both_signs")
    if np.ptp(r.KAPPA) > _SLIP:
        varying.add("kappa")
        if r.KAPPA.min() < -_SLIP and r.KAPPA.max() > _SLIP:
            varying.add("both_kappas")
        if np.ptp(r.SA[np.abs(r.KAPPA) > _SLIP]) > _ANGLE if np.any(np.abs(r.KAPPA) > _SLIP) else False:
            varying.add("alpha_and_kappa")
    return frozenset(varying)


def _range(column: Array) -> float:
    low, high = np.percentile(column, [_TAIL, 100.0 - _TAIL])
    return float(high - low)


def cell(data: Measured) -> NDArray[np.intp]:
    """Return a number a row (rows,) that is equal where load block, camber, pressure and slip are alike."""
    r = data.rows
    keys = np.stack([
        data.block, np.rint(r.IA / _CAMBER), np.rint(r.P / np.median(r.P) / (2 * _PRESSURE)),
        np.rint(r.KAPPA / _SLIP), np.rint(r.V / np.median(r.V) / (4 * _SPEED)),
    ])  # fmt: skip
    return np.unique(keys, axis=1, return_inverse=True)[1].reshape(-1)


def binned(data: Measured, *, robust: bool = False, most: int | None = None) -> tuple[Measured, Array, float]:
    """Return means of rows that share their cell and a bin of slip angle, their rows, the bin's width [rad].

    ``robust`` takes medians, which outliers do not move. Bins are 0.25 deg wide, or wider until there are no
    more than ``most``. Few rows are returned as they are, of width zero.
    """
    width = _BIN
    while True:
        keys = np.stack([cell(data), np.rint(data.rows.SA / width).astype(np.intp)])
        unique, place = np.unique(keys, axis=1, return_inverse=True)
        bins = unique.shape[1]
        if most is None or bins <= most or width >= _WIDEST:
            break
        width *= 2.0
    if bins > 0.7 * len(data):
        return data, np.ones(len(data)), 0.0
    place = place.reshape(-1)
    count = np.bincount(place, minlength=bins).astype(np.float64)
    order = np.argsort(place, kind="stable")
    cuts = np.cumsum(count[:-1]).astype(np.intp)

    def middle(column: Array) -> Array:
        if robust:
            return np.array([np.median(part) for part in np.split(column[order], cuts)])
        return np.bincount(place, column, bins) / count

    columns: dict[str, Any] = {
        name: middle(getattr(data.rows, name)) for name in ("SA", "FZ", "IA", "P", "V", "KAPPA")
    }
    first = order[np.concatenate([[0], cuts])]
    means = Measured(
        rows=replace(data.rows, **columns), axes=data.axes, block=data.block[first], loads=data.loads,
        recorded={name: middle(column) for name, column in data.recorded.items()},
        **{name: middle(data[name]) for name in data.channels},
    )  # fmt: skip
    return means, count, width
