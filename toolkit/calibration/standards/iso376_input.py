"""What ISO 376 is evaluated from: runs at rotated mountings, and the refusal of what cannot be evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from toolkit.calibration.session.statements import ReferenceUncertainty
    from toolkit.calibration.standards.cell_rows import CellRun

HIGHEST_DEGREE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Iso376Run:
    """One series of forces at one mounting, in the indication's unit.

    ``up`` deflections at the increasing forces (n,), ``down`` at the same forces when decreasing, in the
    order of ``up``, or None. ``zero_before`` and ``zero_after`` are the indications without force (i_0, i_f,
    the latter some 30 s after the force was taken off); None: not read.
    """

    rotation_deg: float
    up: tuple[float, ...]
    down: tuple[float, ...] | None = None
    zero_before: float | None = 0.0
    zero_after: float | None = 0.0


def rotated(runs: Sequence[Iso376Run]) -> tuple[Iso376Run, ...]:
    """Return the first run of each mounting, in the order of the runs (X1, X3, X5 of the standard)."""
    first: dict[float, Iso376Run] = {}
    for run in runs:
        first.setdefault(run.rotation_deg % 360, run)
    return tuple(first.values())


def repeated(runs: Sequence[Iso376Run]) -> bool:
    """Tell whether the first two runs share their mounting (X1 and X2 of the standard)."""
    return len(runs) > 1 and runs[0].rotation_deg % 360 == runs[1].rotation_deg % 360


def check(
    force: Array,
    runs: Sequence[Iso376Run],
    force_uncertainty: float | Array | None,
    resolution: float | None,
    creep: tuple[float, float] | None,
    degree: int,
) -> None:
    """Refuse what cannot be evaluated.

    Raises
    ------
    SessionError
        rule ``iso376``
    """
    forces = np.asarray(force, dtype=np.float64)
    n = forces.size
    if not 1 <= degree <= HIGHEST_DEGREE:
        raise _refused("no such degree", degree, f"1 to {HIGHEST_DEGREE}", "choose one of them")
    if forces.ndim != 1 or n < degree + 2:
        raise _refused(
            "too few forces for the interpolation", f"{n} forces", f"at least {degree + 2}",
            "apply more forces or lower the degree",
        )  # fmt: skip
    if not (np.isfinite(forces).all() and forces[0] > 0 and (np.diff(forces) > 0).all()):
        raise _refused("the forces do not increase", forces.tolist(), "from above zero", "sort the rows")
    if not runs:
        raise _refused("there is no run", "no runs", "runs of increasing forces", "give the runs")
    for number, run in enumerate(runs, start=1):
        for values in (run.up, run.down):
            if values is not None and (len(values) != n or not np.isfinite(values).all()):
                raise _refused(
                    f"run {number} does not match the forces", f"{len(values)} values",
                    f"{n} finite values", "check the run",
                )  # fmt: skip
        if not (
            np.isfinite([zero for zero in (run.zero_before, run.zero_after) if zero is not None]).all()
            and np.all(np.multiply(run.up, run.up[-1]) > 0)
        ):
            raise _refused(
                f"run {number} has a deflection or zero that is none", run.up,
                "deflections of one sign, finite zeros", "take the zero off and check the run",
            )  # fmt: skip
    uncertainty = np.asarray(0.0 if force_uncertainty is None else force_uncertainty, dtype=np.float64)
    if uncertainty.shape not in ((), (n,)) or not (np.isfinite(uncertainty) & (uncertainty >= 0)).all():
        raise _refused(
            "the applied force's uncertainty cannot be used", uncertainty.tolist(),
            "a percentage, one or one a force", "take it from the standard machine's certificate",
        )  # fmt: skip
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0):
        raise _refused("no such resolution", resolution, "a positive number", "state it as read")
    if creep is not None and not np.isfinite(creep).all():
        raise _refused("the creep is no number", creep, "two indications", "leave it out")


def _refused(problem: str, actual: object, expected: object, next_step: str) -> SessionError:
    return SessionError(
        problem, where="ISO 376", got=actual, expected=expected, next_step=next_step, rule="iso376"
    )


# From a session's rows to the runs of ISO 376: the same forces in every run, up and down.


# Reference loads that differ by less are one force; the deflection is carried to it in proportion.
_SAME = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Iso376Data:
    """Forces (n,), runs at them, expanded uncertainty of the force in % (n,) with k = 2, or None.

    ``reasons`` tell what of the session is not used, and what was not stated.
    """

    force: Array
    runs: tuple[Iso376Run, ...]
    force_uncertainty: Array | None
    reasons: tuple[str, ...]


def iso376_runs(runs: Sequence[CellRun], *, stated: ReferenceUncertainty | None) -> Iso376Data:
    """Return the runs that have every increasing force of the first; ``stated`` for rows without an own u."""
    levels = np.array(_levels(runs[0].force[runs[0].up]))
    inputs, reasons = [], []
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
        inputs.append(
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
        runs=tuple(inputs),
        force_uncertainty=None if u is None else 200 * u / levels,
        reasons=tuple(reasons),
    )


def _levels(force: Array) -> list[float]:
    levels: list[float] = []
    for value in sorted(force.tolist()):
        if not levels or value - levels[-1] > _SAME * value:
            levels.append(value)
    return levels


def _at(levels: Array, force: Array, deflection: Array) -> tuple[float | None, ...]:
    zeros: list[float | None] = []
    for level in levels:
        near = np.abs(force - level) <= _SAME * level
        zeros.append(float(np.mean(deflection[near] * (level / force[near]))) if near.any() else None)
    return tuple(zeros)
