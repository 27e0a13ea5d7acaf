"""Curve, CurveFit, and the interface that every tire model has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, get_args

from toolkit.channels import Axes
from toolkit.estimate import Estimate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from toolkit.arrays import Array

Loss = Literal["linear", "robust"]
LOSSES: tuple[str, ...] = get_args(Loss)
CHANNEL_UNIT = {"FY": "N", "MZ": "N*m"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One channel against slip angle at one load, rows in the order in which they were recorded.

    ``SA`` [rad] and ``y`` [N or N·m] have one length; ``sigma`` are known standard uncertainties of y
    [its unit], None where nothing is known (every row then has the same weight). ``load_sd_N`` is by how much
    the load scatters about ``load_N`` from row to row.
    """

    SA: Array
    y: Array
    channel: Literal["FY", "MZ"]
    load_N: float | None
    axes: Axes = "SAE"
    sigma: Array | None = None
    load_sd_N: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSpec:
    """A model's parameter: ``unit`` ``y`` is the channel's own; ``bounds`` and ``text`` in words."""

    name: str
    unit: str
    bounds: str
    text: str

    def unit_of(self, channel: str) -> str:
        """Return the unit for a channel, in SI."""
        return self.unit.replace("y", CHANNEL_UNIT[channel])


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A fitted parameter. ``standard_error`` is None where the data do not determine it.

    ``dof`` are the degrees of freedom of the error, infinite where the noise was known: an interval of 95 %
    is Student's t for them times the error. None where there is no error. ``interval95`` is the interval of
    95 % itself, with or without an error, not always symmetric; an end is None where only the parameter's
    bound ends it, and the whole is None where both are or the fit gives no such interval.
    """

    name: str
    value: float
    unit: str
    standard_error: float | None
    dof: float | None = None
    interval95: tuple[float | None, float | None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveFit:
    """One model fitted to one channel (FY [N] or MZ [N·m]) of one load block or of all.

    ``load_N`` is the mean load of the block, None for a model over all loads. ``covariance`` is the
    parameters' covariance in their order, row by row, for propagation: a parameter that is not
    determined enters it with the spread that its bounds leave (it moves together with others, and a
    stiffness may be known where it is not). ``error_percent`` and
    ``scatter_floor_percent`` as in the files contract; the floor is None where bins are too thin.
    """

    model: str
    channel: str
    load_N: float | None
    axes: str
    n: int
    dof: int
    parameters: tuple[Parameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    not_determined: tuple[str, ...]
    at_bound: tuple[str, ...]
    error_percent: float
    scatter_floor_percent: float | None
    slope_at_zero: Estimate | None
    value_at_zero: Estimate | None
    loss: str
    converged: bool
    message: str

    @property
    def values(self) -> tuple[float, ...]:
        """Parameter values in their order."""
        return tuple(parameter.value for parameter in self.parameters)


class TireModel(Protocol):
    """What a model file offers. Derivatives are stacked in front: (parameters, points).

    ``fitter`` names the module whose ``fit_curves`` fits it: an equation does not know its fit. ``reads``
    names what it reads beside the slip angle, of one load.
    """

    name: str
    title: str
    reference: str
    fitter: str
    reads: tuple[str, ...]
    channels: tuple[str, ...]
    parameters: tuple[ParameterSpec, ...]

    def value(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return y at slip angles [rad]."""
        ...

    def slope(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return dy/dSA."""
        ...

    def jacobian(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return dy/dparameter."""
        ...

    def slope_jacobian(self, values: ArrayLike, SA: ArrayLike) -> Array:
        """Return d(dy/dSA)/dparameter."""
        ...
