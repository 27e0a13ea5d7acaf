"""A continuous tire test to the rows of a table: split by condition and direction, averaged in bins of slip.

A belt test holds inclination, pressure and load at levels and sweeps the slip angle (or, driven and braked,
the slip ratio) up and down. Levels are where samples pile up: the peaks of a smoothed histogram. Samples on
the way from one level to the next belong to none. A sweep up and a sweep down lag to opposite sides; each has
its own means, so that both count alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import AXES, Axes
from toolkit.errors import FitError, refuse_unknown
from toolkit.tires.field_file import FieldFile, read_field_file
from toolkit.tires.plausibility import load_of
from toolkit.tires.table import TireTable

_WIDTHS = {"IA": np.radians(0.5), "P": 4e3, "SA": np.radians(0.5)}  # of a level, about its peak [rad, Pa]
_LOAD_WIDTH = 0.05  # of the largest load
_LEAST = 0.01  # of the samples: fewer make no level
_VALLEY = 0.3  # of the lower of two peaks: a deeper valley parts them
_BINS = {"SA": np.radians(0.25), "KAPPA": 0.01}
_RATES = {"SA": np.radians(0.3), "KAPPA": 0.02}  # per second: slower is held
_SMOOTH_S = 0.3  # over which the rate of a sweep is taken
_FEW = 3  # samples of a bin
_DRIVEN = 0.05  # a slip ratio beyond it, in a hundredth of the samples: driven and braked
_ROLLING = 0.5  # of the usual speed: slower is the way to it
_SPEED_WIDTH = 0.05  # of the usual speed: what varies by less is one speed
_TAIL = 0.02  # of the samples at either end


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One condition: inclination [rad], pressure [Pa], load [N], speed [m/s], and the direction.

    Inclination and pressure are None where unknown, the speed where the test has one alone.
    """

    inclination_rad: float | None
    pressure_Pa: float | None
    load_N: float
    speed_m_s: float | None
    direction: str
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweeps:
    """A test's sweeps and the ``table`` of their means; ``swept`` is SA or KAPPA, ``left_out`` samples."""

    table: TireTable
    sweeps: tuple[Sweep, ...]
    swept: str
    samples: int
    left_out: int


def levels(values: Array, width: float) -> tuple[NDArray[np.intp], Array]:
    """Return the level of every sample (rows,), -1 for those on the way, and the levels' medians, ascending.

    >>> at, medians = levels(np.repeat([0.0, 0.0, 2.0, 4.0], 100), 0.5)
    >>> medians.tolist(), np.bincount(at).tolist()
    ([0.0, 2.0, 4.0], [200, 100, 100])
    """
    step = width / 4
    low = float(values.min()) - 2 * width
    place = np.floor((values - low) / step).astype(np.intp)
    counts = np.bincount(place, minlength=int(place.max()) + 9).astype(float)
    kernel = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    density = np.convolve(counts, kernel / kernel.sum(), mode="same")
    padded = np.concatenate(([-1.0], density, [-1.0]))
    peaks = [
        int(at)
        for at in np.flatnonzero((padded[1:-1] > padded[:-2]) & (padded[1:-1] >= padded[2:]))
        if density[at] > 0
    ]
    summits: list[int] = []
    for peak in peaks:
        if summits and density[summits[-1] : peak + 1].min() > _VALLEY * min(
            density[summits[-1]], density[peak]
        ):
            summits[-1] = max(summits[-1], peak, key=lambda at: density[at])
        else:
            summits.append(peak)
    level = np.full(len(values), -1, dtype=np.intp)
    medians: list[float] = []
    for peak in summits:
        near = np.abs(values - (low + (peak + 0.5) * step)) <= width
        if near.mean() >= _LEAST:
            centre = float(np.median(values[near]))
            level[(np.abs(values - centre) <= width) & (level < 0)] = len(medians)
            medians.append(centre)
    return level, np.array(medians)


def split_file(path: Path, axes: str | None = None) -> Sweeps:
    """Return the sweeps of a file of the field; errors as `split` and `read_field_file`.

    Raises
    ------
    ConfigError
        ``unknown-axes``
    """
    if axes is not None:
        refuse_unknown("axis system", axes, AXES, where="--axes", rule="unknown-axes")
    return split(
        read_field_file(path), axes=next((system for system in get_args(Axes) if system == axes), None)
    )


def split(file: FieldFile, *, axes: Axes | None = None) -> Sweeps:
    """Return a test's sweeps and the table of their means.

    Parameters
    ----------
    file : the test
    axes : its axis system, in place of what the sign of its load says

    Raises
    ------
    FitError
        ``no-curve``: nothing of it is a sweep
    """
    columns = dict(file.columns)
    load = load_of(columns["FZ"], where=f"{file.path}, channel FZ", spikes=_LEAST)
    slip = columns.get("KAPPA")
    driven = slip is not None and float(np.quantile(np.abs(slip), 0.99)) > _DRIVEN
    swept = "KAPPA" if driven else "SA"
    varied = {name: columns[name] for name in ("IA", "P", *(("SA",) if driven else ())) if name in columns}
    marks = {name: levels(values, float(_WIDTHS[name])) for name, values in varied.items()}
    marks["FZ"] = levels(load, _LOAD_WIDTH * float(np.quantile(load, 0.99)))
    direction = _direction(columns[swept], columns["t"], float(_RATES[swept]))
    usable = np.all([at >= 0 for at, _ in marks.values()], axis=0)
    if "V" in columns:
        rolling = columns["V"] > _ROLLING * float(np.median(columns["V"]))
        usable &= rolling
        if _several_speeds(columns["V"][rolling]):
            marks["V"] = levels(columns["V"], _SPEED_WIDTH * float(np.median(columns["V"])))
            usable &= marks["V"][0] >= 0
    names = [name for name in columns if name not in ("t", "KAPPA") or (name == "KAPPA" and driven)]
    data = np.column_stack([load if name == "FZ" else columns[name] for name in names])
    key = np.column_stack([
        *(at for at, _ in marks.values()), direction, np.floor(columns[swept] / _BINS[swept]).astype(np.intp),
    ])[usable]  # fmt: skip
    cells, where, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    sums = np.column_stack([np.bincount(where.reshape(-1), weights=column) for column in data[usable].T])
    populated = count >= _FEW
    if not populated.any():
        raise FitError(
            "the test has no sweep", where=file.path, got=f"{file.rows} samples",
            expected="slip that is swept at levels of load", next_step="look at the channels of the file",
            rule="no-curve",
        )  # fmt: skip
    means = sums[populated] / count[populated, None]
    symbols = dict(zip(names, means.T, strict=True))
    table = TireTable(path=file.path, axes=axes or file.axes, columns=tuple(symbols.items()))
    return Sweeps(
        table=table,
        sweeps=_sweeps(
            cells[populated], count[populated], {name: medians for name, (_, medians) in marks.items()}
        ),
        swept=swept,
        samples=file.rows,
        left_out=file.rows - int(count[populated].sum()),
    )


def _several_speeds(rolling: Array) -> bool:
    low, high = np.quantile(rolling, [_TAIL, 1 - _TAIL])
    return bool(high - low > 2 * _SPEED_WIDTH * float(np.median(rolling)))


def _direction(values: Array, t: Array, rate: float) -> NDArray[np.intp]:
    """Return 1 where the slip is swept up, -1 down, 0 where it is held (rows,)."""
    interval = max(float(np.median(np.diff(t))), 1e-6) if len(t) > 1 else 1.0
    half = max(1, round(_SMOOTH_S / interval / 2))
    at = np.arange(len(values))
    first, last = np.maximum(at - half, 0), np.minimum(at + half, len(values) - 1)
    speed = (values[last] - values[first]) / (np.maximum(last - first, 1) * interval)
    return np.where(np.abs(speed) < rate, 0, np.sign(speed)).astype(np.intp)


def _sweeps(cells: NDArray[np.intp], count: NDArray[np.intp], medians: dict[str, Array]) -> tuple[Sweep, ...]:
    names = list(medians)
    conditions, where = np.unique(cells[:, :-1], axis=0, return_inverse=True)
    samples = np.bincount(where.reshape(-1), weights=count)

    def value(name: str, condition: NDArray[np.intp]) -> float | None:
        return float(medians[name][condition[names.index(name)]]) if name in names else None

    words = {1: "up", -1: "down", 0: "held"}
    return tuple(
        Sweep(
            inclination_rad=value("IA", condition), pressure_Pa=value("P", condition),
            load_N=value("FZ", condition) or 0.0, speed_m_s=value("V", condition),
            direction=words[int(condition[-1])], samples=int(number),
        )
        for condition, number in zip(conditions, samples, strict=True)
    )  # fmt: skip
