"""What computed a file that no record explains: its coefficients, what its digits prove, the nearest record.

The rows that no candidate fits give a linear equation by least squares, and the linear programme of
`intervals` bounds every coefficient. A recording's channels are nearly collinear (one tire, five loads), so
such coefficients name a version; they never calibrate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.audit.intervals import coefficient_intervals
from toolkit.units import si_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.audit.columns import Columns
    from toolkit.audit.model import Segment
    from toolkit.audit.screen import Screen

_MARGIN = 2  # rows beyond the unknowns


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """One estimated coefficient, in the file's units; ``low`` and ``high`` None where nothing bounds it."""

    name: str
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """One load as the file has it. ``linear`` tells whether any linear equation gives every row.

    ``rms`` and ``max_abs`` of the residuals of the least squares, in ``unit``.
    """

    load: str
    unit: str
    coefficients: tuple[Coefficient, ...]
    linear: bool
    rms: float
    max_abs: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearest:
    """The record, as it is, whose values come nearest, and how far its worst row lies off [N, N·m]."""

    record: str
    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """``first_row`` to ``last_row`` (from 1): the longest stretch of rows that no candidate explains."""

    first_row: int
    last_row: int
    equations: tuple[Equation, ...]
    nearest: Nearest | None


def estimate(columns: Columns, segments: Sequence[Segment], screen: Screen) -> Estimate | None:
    """Return the equation of a file's unknown rows; None where there are too few of them."""
    unknown = [segment for segment in segments if segment.grade == "unknown"]
    if not unknown or not columns.loads or not columns.names:
        return None
    longest = max(unknown, key=lambda segment: segment.last_row - segment.first_row)
    rows = slice(longest.first_row - 1, longest.last_row)
    part = columns.part(rows)
    if part.rows < len(columns.names) + 1 + _MARGIN:
        return None
    return Estimate(
        first_row=longest.first_row,
        last_row=longest.last_row,
        equations=tuple(_equation(part, load) for load in part.loads),
        nearest=_nearest(part, screen),
    )


def _equation(part: Columns, load: str) -> Equation:
    # In parts of a power of two: what a broken channel holds may have no square in double precision.
    largest = math.ldexp(1.0, math.frexp(float(np.abs(part.y[load]).max()))[1] - 1)
    design = np.column_stack([part.x, np.ones(part.rows)])
    scale = np.maximum(np.abs(design).max(axis=0), np.finfo(float).tiny)
    solved = np.linalg.lstsq(design / scale, part.y[load], rcond=1e-12)[0] / scale
    residual = part.y[load] - design @ solved
    bounds = {interval.name: interval for interval in coefficient_intervals(part, load)}
    names = (*part.names, "constant")
    return Equation(
        load=load,
        unit=part.y_units[load],
        coefficients=tuple(
            Coefficient(
                name=name,
                value=float(value),
                low=_finite(bounds[name].low) if name in bounds else None,
                high=_finite(bounds[name].high) if name in bounds else None,
            )
            for name, value in zip(names, solved, strict=True)
        ),
        linear=bool(bounds),
        rms=largest * float(np.sqrt(np.mean((residual / largest) ** 2))),
        max_abs=float(np.abs(residual).max()),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _nearest(part: Columns, screen: Screen) -> Nearest | None:
    from toolkit.audit.identify import recompute

    best: tuple[float, Nearest] | None = None
    for record in screen.records:
        new = recompute(part, record)
        off = {load: _off(part, load, new[load]) for load in part.loads}
        # Newtons and newton metres are added in parts of what the file's own values span.
        total = sum(
            size / max(float(np.ptp(part.y[load])) * si_scale(part.y_units[load]), 1e-12)
            for load, size in off.items()
        )
        if best is None or total < best[0]:
            best = (
                total,
                Nearest(record=record.id, FY_max_abs_N=off.get("FY"), MZ_max_abs_Nm=off.get("MZ")),
            )
    return None if best is None else best[1]


def _off(part: Columns, load: str, new: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(new - part.y[load] * si_scale(part.y_units[load]))))
