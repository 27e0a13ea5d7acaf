"""What a model over all loads makes of loads that were not measured, and how a fit is kept physical there.

A fit sees its rows alone, and two freedoms pass between them unseen. A factor of the equations may leave what
physics allows at some load (`GlobalModel.bounded`), as a slope that crosses zero between two loads at which
the curve is even in it. And forces may swing: over load they are smooth, so that between two measured loads
they lie near the parabola through the model's own curves at the three nearest ones (near a line where there
are two); a model that departs from it by more than `LIMIT` of the largest value there follows no row.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.global_data import Measured
from toolkit.tires.global_model import Departure, GlobalModel, Rows

LIMIT = {2: 0.125, 3: 0.10}
"""Of the largest value at a load, by how many loads tell what to expect.

Of drawn tires whose truth is known (tests/tires/test_between_loads.py) a departure of a tenth from a parabola
is an error of a tenth; a line is itself off by up to 9 %.
"""
_KEPT = 0.5  # of the limit: within it a fit that left it is brought back
_SLACK = 1e-2  # of a factor's size: a parameter at its bound is no factor beyond it
_INNER = (0.25, 0.5, 0.75)  # places between two loads
_SLIPS = 21
_LOADS = 9  # of a factor: between so many a square of the load hides nothing


class Between:
    """The loads between the rows of a fit: ``data`` in the model's axes, ``channels`` that are fitted."""

    def __init__(self, model: GlobalModel, data: Measured, channels: Sequence[str]) -> None:
        self.model, self.channels = model, tuple(channels)
        self.bounded = [factor for factor in model.bounded if factor.stage in self.channels]
        self.domain = _domain(data)
        self.loads = data.loads[np.unique(data.block)]
        pairs = list(zip(self.loads[:-1].tolist(), self.loads[1:].tolist(), strict=True))
        self._sides = [pair for pair in pairs for _ in _INNER]
        self._inner = np.array([low + place * (high - low) for low, high in pairs for place in _INNER])
        self._from_loads = np.array([_lagrange(self.loads, load) for load in self._inner])
        self._rows = {channel: self._slips(data, channel) for channel in self.channels}
        self.limit = LIMIT[min(len(self.loads), 3)] if len(self.loads) > 1 else np.inf

    def left(self, values: Sequence[Any]) -> tuple[str, ...]:
        """Return what is not physical between the rows: factors by their names, channels that swing."""
        beyond = self._beyond([float(value) for value in values])
        factors = [name for name, by in beyond.items() if float(by.max()) > _SLACK]
        departures = [self.departure(values, channel) for channel in self.channels]
        swings = [at.channel for at in departures if at is not None and at.too_large]
        return (*factors, *swings)

    def excess(self, values: Sequence[Any], copies: int) -> Array:
        """Return by how much parameter sets leave it (copies, checks), 0 within.

        Factors by their sizes, departures as shares beyond half of the limit.
        """
        parts = [np.broadcast_to(by, (copies, len(self.domain))) for by in self._beyond(values).values()]
        if len(self.loads) > 1:
            for channel in self.channels:
                share = np.abs(self._departures(values, channel)[0])
                beyond = np.maximum(share - _KEPT * self.limit, 0.0).reshape(-1, self._inner.size * _SLIPS)
                parts.append(np.broadcast_to(beyond, (copies, beyond.shape[1])))
        every = np.concatenate(parts, axis=1) if parts else np.zeros((copies, 0))
        return np.nan_to_num(every, nan=1e3, posinf=1e3)

    def departure(self, values: Sequence[Any], channel: str) -> Departure | None:
        """Return the largest departure of a channel; None where there is one load."""
        if len(self.loads) < 2:
            return None
        share = np.abs(self._departures(values, channel)[0]).reshape(self._inner.size, _SLIPS).max(axis=1)
        worst = int(np.argmax(np.nan_to_num(share, nan=np.inf)))
        low, high = self._sides[worst]
        return Departure(
            channel=channel, load_N=float(self._inner[worst]), low_N=low, high_N=high,
            share=float(share[worst]), limit=float(self.limit),
        )  # fmt: skip

    def _beyond(self, values: Sequence[Any]) -> dict[str, Array]:
        if self.model.factors is None:
            return {}
        with np.errstate(all="ignore"):
            at = self.model.factors(values, self.domain)
        sizes = {
            factor.name: (
                np.maximum(factor.low - at[factor.name], 0.0) + np.maximum(at[factor.name] - factor.high, 0.0)
            )
            / factor.size
            for factor in self.bounded
        }
        return {name: np.nan_to_num(by, nan=1e3, posinf=1e3) for name, by in sizes.items()}

    def _departures(self, values: Sequence[Any], channel: str) -> tuple[Array, Array]:
        """Return departures (copies, inner loads, slips) over the largest value expected there, and that."""
        rows = self._rows[channel]
        with np.errstate(all="ignore"):
            response = np.asarray(self.model.forces(list(values), rows)[channel])
        response = np.broadcast_to(response, (*response.shape[:-1], len(rows)))
        curves = response.reshape(-1, len(rows) // _SLIPS, _SLIPS)
        measured, inner = curves[:, : len(self.loads)], curves[:, len(self.loads) :]
        # Over the load: a force that is in proportion to it, or to its square, is then no departure.
        expected = np.einsum("il,cls->cis", self._from_loads, measured / self.loads[:, None])
        expected = expected * self._inner[:, None]
        size = np.maximum(np.abs(expected).max(axis=2, keepdims=True), 1e-300)
        return (inner - expected) / size, size

    def _slips(self, data: Measured, channel: str) -> Rows:
        """Return every load, measured and between, over a channel's slip; all else as near zero as rows."""
        r = data.rows
        swept, still = (r.KAPPA, r.SA) if channel == "FX" else (r.SA, r.KAPPA)
        slips = np.linspace(swept.min(), swept.max(), _SLIPS)
        load, slip = (a.ravel() for a in np.meshgrid([*self.loads, *self._inner], slips, indexing="ij"))
        SA, KAPPA = (_least(still), slip) if channel == "FX" else (slip, _least(still))
        P, V = float(np.median(r.P)), float(np.median(r.V))
        return r.other(SA, load, KAPPA=KAPPA, IA=_least(r.IA), P=P, V=V)


def _domain(data: Measured) -> Rows:
    """Return where factors keep their bounds: from the smallest load to the largest, at ends of all else."""
    r = data.rows
    camber, pressure = (np.unique([column.min(), column.max()]) for column in (r.IA, r.P))
    if camber[0] < 0 < camber[-1]:
        camber = np.array([camber[0], 0.0, camber[-1]])
    load = np.linspace(r.FZ.min(), r.FZ.max(), _LOADS)
    FZ, IA, P = (column.ravel() for column in np.meshgrid(load, camber, pressure))
    return r.other(0.0, FZ, IA=IA, P=P)


def _least(column: Array) -> float:
    return float(column[np.argmin(np.abs(column))])


def _lagrange(loads: Array, load: float) -> Array:
    """Return the weights (loads,) of the polynomial through the three nearest of all loads, at a load."""
    weights = np.zeros(len(loads))
    nearest = np.argsort(np.abs(loads - load), kind="stable")[:3]
    for mine in nearest:
        others = loads[nearest[nearest != mine]]
        weights[mine] = np.prod((load - others) / (loads[mine] - others))
    return weights
