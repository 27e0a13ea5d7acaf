"""From a session's rows to the runs of ISO 376: the same forces in every run, up and down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.standards.iso376_input import Iso376Run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.statements import ReferenceUncertainty
    from toolkit.calibration.standards.cell_rows import CellRun

# Reference loads that differ by less are one force; the deflection is carried to it in proportion.
_SAME = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Iso376Data:
    """Forces (n,), runs at them, expanded uncertainty of the force in % (n,) with k = 2, or None.

    ``reasons`` tell what of the session is not used, and what was not stated.
    """

    force: NDArray[np.float64]
    runs: tuple[Iso376Run, ...]
    force_uncertainty: NDArray[np.float64] | None
    reasons: tuple[str, ...]


def iso376_runs(runs: Sequence[CellRun], *, stated: ReferenceUncertainty | None) -> Iso376Data:
    """Return the runs that have every increasing force of the first; ``stated`` for rows without an own u."""
    levels = np.array(_levels(runs[0].force[runs[0].up]))
    made, reasons = [], []
    if runs[0].rotation_deg is None:
        reasons.append("the rotation of the runs is not stated")
    for run in runs:
        up = _at(levels, run.force[run.up], run.deflection[run.up])
        if any(value is None for value in up):
            lacking = [f"{f:g}" for f, value in zip(levels, up, strict=True) if value is None]
            reasons.append(f"run {run.number} is left out: no increasing force {', '.join(lacking)}")
            continue
        down: tuple[float | None, ...] | None = _at(levels, run.force[~run.up], run.deflection[~run.up])
        if down is not None and down[-1:] == (None,) and any(value is not None for value in down):
            # The largest force is where the run turns: its decreasing reading is the increasing one.
            down = (*down[:-1], up[-1])
        if down is None or any(value is None for value in down):
            if (~run.up).any():
                reasons.append(f"the decreasing forces of run {run.number} are not those of the first")
            down = None
        made.append(
            Iso376Run(
                rotation_deg=run.rotation_deg or 0.0,
                up=tuple(value for value in up if value is not None),
                down=None if down is None else tuple(value for value in down if value is not None),
                zero_before=run.zero_before,
                zero_after=run.zero_after,
            )
        )
    u = None if stated is None else stated.u_at(levels)
    if all(run.u is not None for run in runs) and len(levels):
        u = np.array([
            max(float(run.u[near].max(initial=0.0)) for run in runs if run.u is not None
                for near in [np.abs(run.force - level) <= _SAME * level])
            for level in levels
        ])  # fmt: skip
    return Iso376Data(
        force=levels,
        runs=tuple(made),
        force_uncertainty=None if u is None else 200 * u / levels,
        reasons=tuple(reasons),
    )


def _levels(force: NDArray[np.float64]) -> list[float]:
    levels: list[float] = []
    for value in sorted(force.tolist()):
        if not levels or value - levels[-1] > _SAME * value:
            levels.append(value)
    return levels


def _at(
    levels: NDArray[np.float64], force: NDArray[np.float64], deflection: NDArray[np.float64]
) -> tuple[float | None, ...]:
    found: list[float | None] = []
    for level in levels:
        near = np.abs(force - level) <= _SAME * level
        found.append(float(np.mean(deflection[near] * (level / force[near]))) if near.any() else None)
    return tuple(found)
