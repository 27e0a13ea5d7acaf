"""The residuals of a stage of a global fit, and what moves them: its parameters and its noisy inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.between_loads import Between
from toolkit.tires.global_data import Measured
from toolkit.tires.global_model import GlobalModel, Rows
from toolkit.tires.global_solver import Box

_INPUT = 1e-4  # rad, of the load, of the slip ratio: over which a response is taken as straight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """A stage: channels, the free parameters' places, and all values (parameters,) with earlier stages' held.

    ``sigma`` (rows,) standard deviation of a row relative to the others, None where all are alike;
    ``between`` what keeps the model physical between the rows, None where nothing does.
    """

    model: GlobalModel
    data: Measured
    channels: tuple[str, ...]
    values: Array
    free: tuple[int, ...]
    starts: Array
    sigma: Array | None = None
    robust: bool = False
    between: Between | None = None


class Misfit:
    """Residuals of parameter sets, each channel over its own size; weights multiply them."""

    def __init__(
        self, task: Task, data: Measured, weight: Array, scale: dict[str, float], count: Array | None = None
    ) -> None:
        self.model, self.data, self.channels = task.model, data, task.channels
        self.base, self.free, self.scale = task.values.copy(), list(task.free), scale
        self.weight = np.tile(weight, len(self.channels))
        # A mean of many rows has the noise of one, in the weight that it has.
        self.unit = (
            self.weight if count is None else self.weight / np.tile(np.sqrt(count), len(self.channels))
        )
        self.y = np.concatenate([data[name] / scale[name] for name in self.channels])
        self.between = task.between
        # A tenth beyond what is physical costs as much as all rows would without a model.
        self.stiff = 10.0 * float(np.sqrt(np.sum(self.weight**2)))

    def _values(self, x: Array) -> list[float | Array]:
        values: list[float | Array] = list(self.base.tolist())
        for place, column in zip(self.free, x.T, strict=True):
            values[place] = column[:, None]
        return values

    def raw(self, x: Array) -> Array:
        """Return unweighted residuals (copies, rows x channels) of free parameters (copies, p)."""
        r: Array = self._curves(x, self.data.rows) - self.y
        return np.nan_to_num(r, nan=1e3, posinf=1e3, neginf=-1e3)

    def _curves(self, x: Array, rows: Rows) -> Array:
        with np.errstate(all="ignore"):
            responses = self.model.forces(self._values(x), rows)
        shape = (len(x), len(rows))
        parts = [np.broadcast_to(responses[name] / self.scale[name], shape) for name in self.channels]
        return np.asarray(np.concatenate(parts, axis=1))

    def parts(self, x: Array) -> Array:
        """Return what makes rows scatter (parts, rows x channels) at parameters (1, p): `unlike_rows`.

        The noise of each channel, then that of each input that was read and moves them.
        """
        rows = self.data.rows
        own = np.repeat(np.eye(len(self.channels)), len(rows), axis=1)
        steps = {"SA": np.full(len(rows), _INPUT), "FZ": _INPUT * rows.FZ}
        if np.ptp(rows.KAPPA) > 0:
            steps["KAPPA"] = np.full(len(rows), _INPUT)
        moved = []
        for name, step in steps.items():
            ends: Any = [replace(rows, **{name: getattr(rows, name) + side * step}) for side in (1, -1)]
            change = self._curves(x, ends[0])[0] - self._curves(x, ends[1])[0]
            moved.append(np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0) / (2 * _INPUT))
        return np.asarray((np.concatenate([own, moved]) * self.unit) ** 2)

    def __call__(self, x: Array) -> Array:
        """Return weighted residuals (copies, rows x channels), then what is not physical between the rows."""
        weighted = self.raw(x) * self.weight
        if self.between is None:
            return weighted
        excess = self.between.excess(self._values(x), len(x))
        return np.concatenate([weighted, self.stiff * excess], axis=1)

    def box(self) -> Box:
        """Return bounds and sizes of the free parameters."""
        parameters = [self.model.parameters[place] for place in self.free]
        return Box(
            low=np.array([parameter.low for parameter in parameters]),
            high=np.array([parameter.high for parameter in parameters]),
            size=np.array([parameter.size for parameter in parameters]),
            cost_per_copy=len(self.data) * self.model.grid,
        )

    def release(self, places: Sequence[int], x: Array) -> Array:
        """Free parameters that were held; return all free ones (1, p), those of ``x`` (1, free) first."""
        self.base[self.free] = x[0]
        self.free += list(places)
        return self.base[self.free][None]

    def hold(self, place: int, value: float) -> None:
        """Take a parameter out of the search."""
        self.base[place] = value
        self.free.remove(place)
