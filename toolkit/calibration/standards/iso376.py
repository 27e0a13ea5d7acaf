"""ISO 376: classification of a force-proving instrument.

Two runs X1, X2 with increasing forces at the first mounting, then one at each turned mounting (X3 at 120
degrees, X5 at 240), each with its decreasing forces (X4', X6'). Errors in % at each force:

    b  = (Xmax - Xmin) / Xr, of X1, X3, X5 with Xr their mean        reproducibility
    b' = |X2 - X1| / Xwr, Xwr the mean of the two                    repeatability, same mounting
    fc = (Xr - Xa) / Xa, Xa of the interpolation equation            interpolation
    v  = (|X4' - X3| / X3 + |X6' - X5| / X5) / 2                     reversibility

and of the instrument: f0 = (i_f - i_0) / X_N (zero, the largest of all runs), c = |i_300 - i_30| / X_N
(creep), X_N the mean deflection at the largest force. A class also asks for an applied force of small
uncertainty and for forces that are large against the resolution r: 4000, 2000, 1000 and 500 r for classes
00, 0.5, 1 and 2. No class holds below 2 % of the transducer's largest force, whatever the resolution: the
second condition on the minimum force, taken for every class (the standard's own text was not at hand).
The largest force of the calibration stands in for the transducer's, which a session does not state and which
is not smaller. What the procedure lacks costs the class, not the figures that can still be had.

Not judged: temperature and time between the readings, the regularity of the steps, the age of the
calibration.

Reference: ISO 376:2011, clauses on minimum force, on procedure and on classification with its table; EURAMET
cg-4 on force measurements names the same components. The limits are in % of the value that the error is
relative to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.standards import iso376_input
from toolkit.calibration.standards.e74 import fit_curve
from toolkit.calibration.standards.iso376_input import Iso376Run

__all__ = ["LIMITS", "Iso376Force", "Iso376Limits", "Iso376Result", "Iso376Run", "evaluate_iso376"]

# An error that equals its limit is within it, whatever the last bit of a quotient says.
_SLACK = 1 + 1e-9
MIN_FORCES = 8
MIN_PRELOADS = 3
LEAST_SHARE = 0.02
"""The least force over the largest one, for every class."""


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

    An error that was not measured is None: ``b`` without turned mountings, ``b_same`` without a repeated
    run, ``v`` without decreasing forces. ``class_name`` is of the errors that are there; None: not even
    class 2.
    """

    force: float
    deflection: float
    interpolated: float
    b: float | None
    b_same: float | None
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
    force, each None where it was not measured or stated; ``coefficients[i]`` belongs to force^i.
    """

    class_name: str | None
    reasons: tuple[str, ...]
    procedure: tuple[str, ...]
    forces: tuple[Iso376Force, ...]
    ranges: tuple[Iso376Range, ...]
    f0: float | None
    c: float | None
    resolution: float | None
    coefficients: tuple[float, ...]


def evaluate_iso376(
    *,
    force: Array,
    runs: Sequence[Iso376Run],
    force_uncertainty: float | Array | None,
    resolution: float | None,
    creep: tuple[float, float] | None = None,
    preloads: int | None = MIN_PRELOADS,
    degree: int = 3,
) -> Iso376Result:
    """Classify a force-proving instrument.

    Parameters
    ----------
    force : increasing forces (n,), without zero
    runs : two at the first mounting, then one a turned mounting; see `Iso376Run`
    force_uncertainty : expanded uncertainty of the applied force in %, one or one a force (n,); None: not
        stated, hence no class
    resolution : of the indication, in its unit; None: not stated, hence no class
    creep : indication 30 s and 300 s after the largest force was applied or taken off; None: not measured
    preloads : to the largest force, before the first run; None: not stated, hence no class
    degree : of the interpolation, deflection on force, 1 to 3; it ends with the constant

    Raises
    ------
    SessionError
        rule ``iso376``: lengths, order or values that cannot be evaluated
    """
    iso376_input.check(force, runs, force_uncertainty, resolution, creep, degree)
    forces = np.asarray(force, dtype=np.float64)
    rotated = iso376_input.rotated(runs)
    X = np.array([run.up for run in rotated])
    mean = X.mean(axis=0)
    fit = fit_curve(force=forces, indication=mean, degree=degree)
    curve = mean - fit.residuals
    full = float(abs(mean[-1]))
    zeros = [
        run.zero_after - run.zero_before
        for run in runs
        if run.zero_after is not None and run.zero_before is not None
    ]
    f0 = 100 * max(zeros, key=abs) / full if zeros else None
    c = None if creep is None else 100 * abs(creep[1] - creep[0]) / full
    b = 100 * np.ptp(X, axis=0) / np.abs(mean) if len(rotated) > 1 else None
    b_same, v = _repeatability(runs), _reversibility(rotated)
    fc = 100 * fit.residuals / curve
    uncertainty = (
        None
        if force_uncertainty is None
        else np.broadcast_to(np.asarray(force_uncertainty, dtype=np.float64), forces.shape)
    )
    in_force = None if resolution is None else resolution * float(forces[-1]) / full
    rows = []
    for i, value in enumerate(forces.tolist()):
        errors = {
            "b": _at(b, i), "b'": _at(b_same, i), "fc": float(fc[i]), "f0": f0, "v": _at(v, i), "c": c,
            "U": _at(uncertainty, i),
        }  # fmt: skip
        resolutions = None if in_force is None else value / in_force
        name, reasons = _classify(errors, resolutions, value / float(forces[-1]))
        rows.append(
            Iso376Force(
                force=value,
                deflection=float(mean[i]),
                interpolated=float(curve[i]),
                b=errors["b"],
                b_same=errors["b'"],
                fc=float(fc[i]),
                v=errors["v"],
                class_name=name,
                reasons=reasons,
            )
        )
    unstated = (
        (b_same is None, "no repeated run at the first mounting"),
        (f0 is None, "the zero was not read before and after a run"),
        (uncertainty is None, "the applied force's uncertainty is not stated"),
        (in_force is None, "the resolution is not stated"),
    )
    procedure = (
        *_procedure(forces, runs, rotated, preloads, has_c=creep is not None),
        *(text for lacks, text in unstated if lacks),
    )
    worst = max(_rank(row.class_name) for row in rows)
    limiting = [row for row in rows if _rank(row.class_name) == worst and worst > 0]
    limits = [f"{row.force:g}: {reason}" for row in limiting for reason in row.reasons]
    return Iso376Result(
        class_name=LIMITS[worst].name if worst < len(LIMITS) and not procedure else None,
        reasons=(*procedure, *limits),
        procedure=procedure,
        forces=tuple(rows),
        ranges=() if procedure else _ranges(rows),
        f0=f0,
        c=c,
        resolution=in_force,
        coefficients=(fit.coefficients[-1], *fit.coefficients[:-1]),
    )


def _repeatability(runs: Sequence[Iso376Run]) -> Array | None:
    if not iso376_input.repeated(runs):
        return None
    first, second = (np.array(run.up) for run in runs[:2])
    return np.asarray(100 * np.abs(second - first) / np.abs((first + second) / 2))


def _reversibility(rotated: Sequence[Iso376Run]) -> Array | None:
    # The standard takes it at the turned mountings; the first one stands in where it is alone.
    pairs = [(np.array(run.up), np.array(run.down)) for run in rotated[1:] if run.down is not None]
    if not pairs and rotated[0].down is not None:
        pairs = [(np.array(rotated[0].up), np.array(rotated[0].down))]
    if not pairs:
        return None
    return np.asarray(100 * np.mean([np.abs(down - up) / np.abs(up) for up, down in pairs], axis=0))


def _at(values: Array | None, i: int) -> float | None:
    return None if values is None else float(values[i])


def _classify(
    errors: dict[str, float | None], resolutions: float | None, share: float
) -> tuple[str | None, tuple[str, ...]]:
    """Return the best class at one force, and what the next better class is refused for."""
    if share * _SLACK < LEAST_SHARE:
        return None, (
            f"the force is {100 * share:.3g} % of the largest, a class needs {100 * LEAST_SHARE:g} %",
        )
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
        if resolutions is not None and resolutions * _SLACK < limits.least_resolutions:
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
    ranges = []
    upper = rows[-1].force
    for rank, limits in enumerate(LIMITS):
        lower = None
        for row in reversed(rows):
            if _rank(row.class_name) > rank:
                break
            lower = row.force
        if lower is not None and lower <= upper / 2:
            ranges.append(Iso376Range(class_name=limits.name, lower=lower, upper=upper))
    return tuple(ranges)


def _procedure(
    forces: Array,
    runs: Sequence[Iso376Run],
    rotated: Sequence[Iso376Run],
    preloads: int | None,
    *,
    has_c: bool,
) -> tuple[str, ...]:
    classes = []
    if len(forces) < MIN_FORCES:
        classes.append(f"{len(forces)} forces, at least {MIN_FORCES} are needed")
    turned = sorted((run.rotation_deg - runs[0].rotation_deg) % 360 for run in rotated)
    if turned != [0, 120, 240]:
        angles = ", ".join(f"{angle:g}" for angle in turned)
        classes.append(f"mounted at {angles} deg, 0, 120 and 240 deg are needed")
    if preloads is None or preloads < MIN_PRELOADS:
        angles = "the preloads are not stated" if preloads is None else f"{preloads} preloads"
        classes.append(f"{angles}, {MIN_PRELOADS} are needed")
    if not has_c and not any(run.down is not None for run in rotated[1:]):
        classes.append(
            "neither decreasing forces at the turned mountings nor creep were measured, one of them is needed"
        )
    return tuple(classes)
