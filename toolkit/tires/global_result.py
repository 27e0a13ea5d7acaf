"""GlobalFit: one channel of a model fitted over all loads, with what the data could and could not say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.estimate import Estimate
from toolkit.tires.model import Parameter

if TYPE_CHECKING:
    from toolkit.tires.global_model import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadShare:
    """How a model over all loads does at one load block.

    ``stiffness`` is the slope at SA = 0 in the table's axes [N/rad or N·m/rad], None for FX;
    ``prediction_error_percent`` is that of a fit that never saw this load, None where there is none.
    """

    load_N: float
    n: int
    error_percent: float
    stiffness: Estimate | None
    prediction_error_percent: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalFit:
    """One channel of a model over all loads; ``load_N`` is None as the files contract wants it.

    ``axes`` are the table's, in which stiffness and errors are; ``parameter_axes`` those of the model, in
    which its parameters are defined. ``fixed`` names parameters that stand at a value which the data did not
    choose, with the reason in words; they count among ``not_determined``, and ``covariance`` holds the
    others, in their order. ``nominal_load_N`` is FNOMIN, at which ``slope_at_zero`` is given.
    ``starts_agreeing`` ended at the lowest cost.
    """

    model: str
    channel: str
    axes: str
    parameter_axes: str
    n: int
    dof: int
    parameters: tuple[Parameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    not_determined: tuple[str, ...]
    fixed: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    error_percent: float
    prediction_error_percent: float | None
    scatter_floor_percent: float | None
    slope_at_zero: Estimate | None
    nominal_load_N: float
    loads: tuple[LoadShare, ...]
    loss: str
    weights: str
    starts: int
    starts_agreeing: int
    converged: bool
    message: str

    @property
    def load_N(self) -> None:
        """None: the fit is over all loads."""

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the channel's parameters in their order."""
        return tuple(one.value for one in self.parameters)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelFit:
    """A model fitted to a table: ``values`` of all its parameters, and one `GlobalFit` a channel.

    ``curves`` (channel, model at every row of the data, in the table's axes).
    """

    model: str
    values: Array
    fits: tuple[GlobalFit, ...]
    curves: tuple[tuple[str, Array], ...]

    def at_rows(self, channel: str) -> Array:
        """Return the model at every row of the data [N or N·m], in the table's axes."""
        return dict(self.curves)[channel]

    def fit(self, channel: str) -> GlobalFit | None:
        """Return the fit of a channel, None where there is none."""
        return next((one for one in self.fits if one.channel == channel), None)


def pooled_percent(residual: Array, y: Array) -> float:
    """Return 100 sqrt(sum residual^2 / sum y^2); NaN where every y is zero."""
    size = float(np.sum(y**2))
    return float(100 * np.sqrt(np.sum(residual**2) / size)) if size else float("nan")
