"""ISO 376: classification of a force-proving instrument.

Errors in % at each force, from the deflections X of rotated mountings (0, 120, 240 degrees):

    b  = (Xmax - Xmin) / mean over the rotated runs        reproducibility
    b' = |X2 - X1| / mean of the two                       repeatability, same mounting
    fc = (X - Xa) / Xa                                     interpolation; X the mean of the rotated runs
    v  = |X' - X| / X, mean over the runs with decreasing forces      reversibility

and of the instrument: f0 = (i_f - i_0) / X_N (zero), c = |i_300 - i_30| / X_N (creep), X_N the mean
deflection at the largest force. A class also asks for an applied force of small uncertainty and for forces
that are large against the resolution.

Reference: ISO 376, classification table; the limits are in % of the value that the error is relative to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.standards import iso376_input
from toolkit.calibration.standards.e74 import fit_curve
from toolkit.calibration.standards.iso376_input import Iso376Run

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LIMITS", "Iso376Force", "Iso376Limits", "Iso376Result", "Iso376Run", "evaluate_iso376"]

# An error that equals its limit is within it, whatever the last bit of a quotient says.
_SLACK = 1 + 1e-9
MIN_FORCES = 8
MIN_PRELOADS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Iso376Limits:
    """A class: limits of errors and of the applied force's uncertainty in %, least force in resolutions."""

    name: str
    b: float
    b_same: float
    fc: float
    f0: float
    v: float
    c: float
    force_uncertainty: float
    least_resolutions: float


def _limits(name: str, *values: float) -> Iso376Limits:
    b, b_same, fc, f0, v, c, uncertainty, least = values
    return Iso376Limits(
        name=name, b=b, b_same=b_same, fc=fc, f0=f0, v=v, c=c,
        force_uncertainty=uncertainty, least_resolutions=least,
    )  # fmt: skip


LIMITS = (
    _limits("00", 0.05, 0.025, 0.025, 0.012, 0.07, 0.025, 0.01, 4000),
    _limits("0.5", 0.10, 0.05, 0.05, 0.025, 0.15, 0.05, 0.02, 2000),
    _limits("1", 0.20, 0.10, 0.10, 0.05, 0.30, 0.10, 0.05, 1000),
    _limits("2", 0.40, 0.20, 0.20, 0.10, 0.50, 0.20, 0.10, 500),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Iso376Force:
    """One force: mean deflection, errors in %, class, and what the next better class would need.

    ``v`` is None without decreasing forces. ``class_name`` None: not even class 2.
    """

    force: float
    deflection: float
    interpolated: float
    b: float
    b_same: float
    fc: float
    v: float | None
    class_name: str | None
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Iso376Range:
    """The forces over which a class holds without a gap, up to the largest force."""

    class_name: str
    lower: float
    upper: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Iso376Result:
    """The evaluation of one calibration.

    ``class_name`` holds at every force; None where a force has none or the procedure was not the standard's
    (``procedure`` says what it lacks). ``reasons`` tell why it is not better. ``ranges`` only lists classes
    that reach from the largest force down to half of it at least. ``f0`` and ``c`` in %, ``resolution`` in
    force; ``coefficients[i]`` belongs to force^i.
    """

    class_name: str | None
    reasons: tuple[str, ...]
    procedure: tuple[str, ...]
    forces: tuple[Iso376Force, ...]
    ranges: tuple[Iso376Range, ...]
    f0: float
    c: float | None
    resolution: float
    coefficients: tuple[float, ...]


def evaluate_iso376(
    *,
    force: NDArray[np.float64],
    runs: Sequence[Iso376Run],
    force_uncertainty: float | NDArray[np.float64],
    resolution: float,
    creep: tuple[float, float] | None = None,
    preloads: int = MIN_PRELOADS,
    degree: int = 3,
) -> Iso376Result:
    """Classify a force-proving instrument.

    Parameters
    ----------
    force : increasing forces (n,), without zero
    runs : two at the first mounting, then one a rotated mounting; see `Iso376Run`
    force_uncertainty : expanded uncertainty of the applied force in %, one or one a force (n,)
    resolution : of the indication, in its unit
    creep : indication 30 s and 300 s after the largest force was applied or taken off; None: not measured
    preloads : to the largest force, before the first run
    degree : of the interpolation, deflection on force, 1 to 3; it ends with the constant

    Raises
    ------
    SessionError
        rule ``iso376``: lengths, order or values that cannot be evaluated
    """
    iso376_input.check(force, runs, force_uncertainty, resolution, creep, degree)
    forces = np.asarray(force, dtype=np.float64)
    rotated = iso376_input.rotated(runs)
    X = np.array([one.up for one in rotated])
    first, second = (np.array(one.up) for one in runs[:2])
    mean = X.mean(axis=0)
    fit = fit_curve(force=forces, indication=mean, degree=degree)
    curve = mean - fit.residuals
    b = 100 * np.ptp(X, axis=0) / np.abs(mean)
    b_same = 100 * np.abs(second - first) / np.abs((first + second) / 2)
    fc = 100 * fit.residuals / curve
    full = float(abs(mean[-1]))
    f0 = 100 * max((one.zero_after - one.zero_before for one in runs), key=abs) / full
    c = None if creep is None else 100 * abs(creep[1] - creep[0]) / full
    turned = [(np.array(one.up), np.array(one.down)) for one in rotated if one.down is not None]
    v = 100 * np.mean([np.abs(down - up) / np.abs(up) for up, down in turned], axis=0) if turned else None
    uncertainty = np.broadcast_to(np.asarray(force_uncertainty, dtype=np.float64), forces.shape)
    in_force = resolution * float(forces[-1]) / full
    rows = []
    for i, value in enumerate(forces.tolist()):
        name, reasons = _classify(
            {"b": float(b[i]), "b'": float(b_same[i]), "fc": float(fc[i]), "f0": f0,
             "v": None if v is None else float(v[i]), "c": c, "U": float(uncertainty[i])},
            value / in_force,
        )  # fmt: skip
        rows.append(
            Iso376Force(
                force=value,
                deflection=float(mean[i]),
                interpolated=float(curve[i]),
                b=float(b[i]),
                b_same=float(b_same[i]),
                fc=float(fc[i]),
                v=None if v is None else float(v[i]),
                class_name=name,
                reasons=reasons,
            )
        )
    procedure = _procedure(forces, runs, rotated, preloads, has_v=bool(turned), has_c=creep is not None)
    worst = max(_rank(row.class_name) for row in rows)
    limiting = [row for row in rows if _rank(row.class_name) == worst and worst > 0]
    told = [f"{row.force:g}: {reason}" for row in limiting for reason in row.reasons]
    return Iso376Result(
        class_name=LIMITS[worst].name if worst < len(LIMITS) and not procedure else None,
        reasons=(*procedure, *told),
        procedure=procedure,
        forces=tuple(rows),
        ranges=() if procedure else _ranges(rows),
        f0=f0,
        c=c,
        resolution=in_force,
        coefficients=(fit.coefficients[-1], *fit.coefficients[:-1]),
    )


def _classify(errors: dict[str, float | None], resolutions: float) -> tuple[str | None, tuple[str, ...]]:
    """Return the best class at one force, and what the next better class is refused for."""
    reasons: tuple[str, ...] = ()
    for limits in LIMITS:
        allowed = {
            "b": limits.b, "b'": limits.b_same, "fc": limits.fc, "f0": limits.f0, "v": limits.v,
            "c": limits.c, "U": limits.force_uncertainty,
        }  # fmt: skip
        missed = [
            f"{name} = {value:.4g} %, class {limits.name} allows {allowed[name]:g} %"
            for name, value in errors.items()
            if value is not None and not abs(value) <= allowed[name] * _SLACK
        ]
        if resolutions * _SLACK < limits.least_resolutions:
            missed.append(
                f"the force is {resolutions:.5g} resolutions, class {limits.name} needs "
                f"{limits.least_resolutions:g}"
            )
        if not missed:
            return limits.name, reasons
        reasons = tuple(missed)
    return None, reasons


def _rank(name: str | None) -> int:
    return next((i for i, limits in enumerate(LIMITS) if limits.name == name), len(LIMITS))


def _ranges(rows: Sequence[Iso376Force]) -> tuple[Iso376Range, ...]:
    found = []
    upper = rows[-1].force
    for rank, limits in enumerate(LIMITS):
        lower = None
        for row in reversed(rows):
            if _rank(row.class_name) > rank:
                break
            lower = row.force
        if lower is not None and lower <= upper / 2:
            found.append(Iso376Range(class_name=limits.name, lower=lower, upper=upper))
    return tuple(found)


def _procedure(
    forces: NDArray[np.float64],
    runs: Sequence[Iso376Run],
    rotated: Sequence[Iso376Run],
    preloads: int,
    *,
    has_v: bool,
    has_c: bool,
) -> tuple[str, ...]:
    found = []
    if len(forces) < MIN_FORCES:
        found.append(f"{len(forces)} forces, at least {MIN_FORCES} are needed")
    turned = sorted((one.rotation_deg - runs[0].rotation_deg) % 360 for one in rotated)
    if turned != [0, 120, 240]:
        told = ", ".join(f"{angle:g}" for angle in turned)
        found.append(f"mounted at {told} deg, 0, 120 and 240 deg are needed")
    if preloads < MIN_PRELOADS:
        found.append(f"{preloads} preloads, {MIN_PRELOADS} are needed")
    if not has_v and not has_c:
        found.append("neither decreasing forces nor creep were measured, one of them is needed")
    return tuple(found)
