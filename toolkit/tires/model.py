"""CurveFit: the result of fitting one curve of one channel."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A fitted parameter. ``standard_error`` is None where the data do not determine it."""

    name: str
    value: float
    unit: str
    standard_error: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveFit:
    """One model fitted to one channel (FY [N] or MZ [N·m]) of one load block or of all.

    ``load_N`` is the mean load of the block, None for a model over all loads. ``covariance`` is the
    parameters' covariance in their order, row by row, zero where not determined. ``error_percent`` and
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
