"""ASTM E74: lower limit factor and loading ranges of a force-measuring instrument.

The standard fits the indication on the force (degree at most 5) and converts the standard deviation of that
fit to force by the mean ratio of force to indication:

    s_m = sqrt(sum d^2 / (n - m - 1)),  LLF = 2.4 s_m in force, never below the resolution

A loading range of class A begins at 400 LLF, of class AA at 2000 LLF, and nowhere below the smallest force
that was applied, which itself is at least 400 or 2000 resolutions. With fewer than 30 points or 3 runs the
figures stand without a class.

Reference: ASTM E74, sections on calibration equation and lower limit factor; annex on the degree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.errors import SessionError

# ASTM E74, annex: the degree of the polynomial that fits best.


HIGHEST = 5
_PROBABILITY = 0.025


@dataclass(frozen=True, slots=True, kw_only=True)
class DegreeStep:
    """One comparison: ``ratio`` = s_(degree - 1) / s_degree against ``factor`` = C(n, degree)."""

    degree: int
    ratio: float
    factor: float

    @property
    def better(self) -> bool:
        """Whether the degree fits better than the next lower one."""
        return self.ratio > self.factor


def degree_factor(n: int, m: int) -> float:
    """Return C(n, m) of the annex.

    >>> round(degree_factor(10, 2), 3)
    1.373
    """
    from scipy.special import fdtri

    quantile = float(fdtri(1, n - m - 1, 1 - _PROBABILITY))
    return math.sqrt(1 + (quantile - 1) / (n - m))


def best_degree(*, force: Array, indication: Array) -> tuple[int, tuple[DegreeStep, ...]]:
    """Return the degree of best fit of averaged indications (n,) at n forces, and each comparison made."""
    n = len(force)
    top = min(HIGHEST, n - 2)
    # Below this the scatter is rounding, and a ratio of two roundings means nothing.
    floor = 64 * np.finfo(float).eps * float(np.abs(indication).max())
    spread = [max(_spread(force, indication, m), floor) for m in range(1, top + 1)]
    steps: list[DegreeStep] = []
    for m in range(top, 1, -1):
        step = DegreeStep(degree=m, ratio=spread[m - 2] / spread[m - 1], factor=degree_factor(n, m))
        steps.append(step)
        if step.better:
            return m, tuple(steps)
    return 1, tuple(steps)


def _spread(force: Array, indication: Array, m: int) -> float:
    terms = ("F", *(f"F^{power}" for power in range(2, m + 1)), "intercept")
    return fit_terms(terms=terms, columns={"F": force}, load=indication).residual_sd


LLF_FACTOR = 2.4
CLASSES = (("AA", 2000.0), ("A", 400.0))
MAX_DEGREE = 5
MIN_POINTS = 30
MIN_RUNS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class LackOfFit:
    """F of the scatter about the curve against the scatter of the replicates; ``p`` its probability."""

    F: float
    dof_lack: int
    dof_pure: int
    p: float


@dataclass(frozen=True, slots=True, kw_only=True)
class E74Curve:
    """Indication = sum of ``coefficients[i]`` force^i, in the units of the data.

    ``s_m`` in the indication's unit; ``llf`` in the force's unit, of the scatter alone (see
    `E74Result.llf` for the bound by the resolution).
    """

    degree: int
    coefficients: tuple[float, ...]
    s_m: float
    dof: int
    llf: float
    lack_of_fit: LackOfFit | None


@dataclass(frozen=True, slots=True, kw_only=True)
class E74Class:
    """A loading range from ``lower_limit`` to ``upper_limit`` (force); ``reasons`` why it is not granted."""

    name: str
    lower_limit: float
    upper_limit: float
    reasons: tuple[str, ...]

    @property
    def granted(self) -> bool:
        """Whether nothing speaks against the class."""
        return not self.reasons


@dataclass(frozen=True, slots=True, kw_only=True)
class E74Result:
    """The evaluation of one calibration.

    ``curve`` is the one of ``degree``; ``curves`` those of every degree that the data allow; ``steps`` the
    comparisons of the annex (empty where the degree was requested). ``ratio`` force per indication;
    ``llf`` and ``resolution`` in force (None: not stated); ``classes`` AA and A; ``class_name`` the best one
    granted, or None. ``zeros`` counts rows at zero force, which the fit leaves out.
    """

    degree: int
    requested: bool
    points: int
    zeros: int
    runs: int | None
    levels: int
    ratio: float
    resolution: float | None
    llf: float
    curve: E74Curve
    curves: tuple[E74Curve, ...]
    steps: tuple[DegreeStep, ...]
    classes: tuple[E74Class, ...]

    @property
    def class_name(self) -> str | None:
        """Best class granted, None where there is none."""
        return next((class_.name for class_ in self.classes if class_.granted), None)


def evaluate_e74(
    *,
    force: Array,
    indication: Array,
    run: NDArray[np.int64] | None = None,
    resolution: float | None = None,
    degree: int | None = None,
) -> E74Result:
    """Evaluate a calibration by ASTM E74.

    Parameters
    ----------
    force : applied force (n,), of one sign; rows at zero are left out
    indication : the instrument's deflection at each force (n,), zero already taken off
    run : number of the run of each row (n,); None: not stated, hence no class
    resolution : of the indication, in its unit; None: not stated, hence no class
    degree : 1 to 5; None: chosen by the test of the annex

    Raises
    ------
    SessionError
        rule ``e74``: not finite, of both signs, a degree that is none, or fewer forces than it needs
    """
    loaded = _checked(force, indication, run, resolution, degree)
    f, d = np.asarray(force, np.float64)[loaded], np.asarray(indication, np.float64)[loaded]
    if not (d != 0).all() or len(set(np.sign(f / d).tolist())) != 1:
        raise _refused(
            "the indication does not follow the force", "indications of both signs, or zero under force",
            "an indication of one sign, zero taken off", "take the zero off and evaluate each sense apart",
        )  # fmt: skip
    levels, at = np.unique(f, return_inverse=True)
    highest = min(MAX_DEGREE, len(levels) - 1, len(f) - 2)
    if highest < max(degree or 1, 1):
        raise _refused(
            "too few forces for the degree", f"{len(f)} points at {len(levels)} forces",
            f"more forces than a degree of {degree or 1}", "apply more forces",
        )  # fmt: skip
    ratio = float(np.mean(f / d))
    curves = tuple(_curve(f, d, m, abs(ratio), at, len(levels)) for m in range(1, highest + 1))
    steps: tuple[DegreeStep, ...] = ()
    chosen = degree
    if chosen is None:
        means = np.bincount(at, weights=d) / np.bincount(at)
        chosen, steps = best_degree(force=levels, indication=means)
    curve = curves[chosen - 1]
    in_force = None if resolution is None else resolution * abs(ratio)
    llf = max(curve.llf, in_force or 0.0)
    runs = None if run is None else len(np.unique(np.asarray(run)[loaded]))
    return E74Result(
        degree=chosen,
        requested=degree is not None,
        points=len(f),
        zeros=int(len(loaded) - loaded.sum()),
        runs=runs,
        levels=len(levels),
        ratio=ratio,
        resolution=in_force,
        llf=llf,
        curve=curve,
        curves=curves,
        steps=steps,
        classes=tuple(_class(name, k, llf, in_force, np.abs(f), runs) for name, k in CLASSES),
    )


def fit_curve(*, force: Array, indication: Array, degree: int) -> TermFit:
    """Fit the indication on the force by a polynomial; coefficients from the first power, constant last."""
    terms = ("F", *(f"F^{power}" for power in range(2, degree + 1)), "intercept")
    return fit_terms(terms=terms, columns={"F": force}, load=indication)


def _curve(f: Array, d: Array, m: int, ratio: float, at: NDArray[np.int64], levels: int) -> E74Curve:
    fit = fit_curve(force=f, indication=d, degree=m)
    return E74Curve(
        degree=m,
        coefficients=(fit.coefficients[-1], *fit.coefficients[:-1]),
        s_m=fit.residual_sd,
        dof=fit.dof,
        llf=LLF_FACTOR * fit.residual_sd * ratio,
        lack_of_fit=_lack_of_fit(fit, d, at, levels),
    )


def _lack_of_fit(fit: TermFit, d: Array, at: NDArray[np.int64], levels: int) -> LackOfFit | None:
    from scipy.special import fdtrc

    counts = np.bincount(at, minlength=levels)
    dof_pure, dof_lack = len(d) - levels, levels - len(fit.terms)
    if dof_pure < 1 or dof_lack < 1:
        return None
    # Residuals differ from the indications by the same amount within a level: their scatter is that of the
    # replicates, and it does not cancel against large indications.
    means = np.bincount(at, weights=fit.residuals) / counts
    pure = float(np.sum((fit.residuals - means[at]) ** 2))
    lack = float(np.sum(counts * means**2))
    if pure <= 0:
        return None
    value = (lack / dof_lack) / (pure / dof_pure)
    return LackOfFit(F=value, dof_lack=dof_lack, dof_pure=dof_pure, p=float(fdtrc(dof_lack, dof_pure, value)))


def _class(
    name: str, k: float, llf: float, resolution: float | None, forces: Array, runs: int | None
) -> E74Class:
    smallest, largest = float(forces.min()), float(forces.max())
    lower = max(k * llf, smallest)
    reasons = []
    if len(forces) < MIN_POINTS:
        reasons.append(f"{len(forces)} points, at least {MIN_POINTS} are needed")
    if runs is None or runs < MIN_RUNS:
        stated = "the runs are not stated" if runs is None else f"{runs} runs"
        reasons.append(f"{stated}, at least {MIN_RUNS} are needed")
    if resolution is None:
        reasons.append("the resolution is not stated")
    elif smallest < k * resolution:
        reasons.append(f"the smallest force {smallest:.6g} is below {k:g} resolutions ({k * resolution:.6g})")
    if lower > largest:
        reasons.append(f"the lower limit {lower:.6g} is above the largest force {largest:.6g}")
    return E74Class(name=name, lower_limit=lower, upper_limit=largest, reasons=tuple(reasons))


def _checked(
    force: Array,
    indication: Array,
    run: NDArray[np.int64] | None,
    resolution: float | None,
    degree: int | None,
) -> NDArray[np.bool_]:
    f, d = np.asarray(force, dtype=np.float64), np.asarray(indication, dtype=np.float64)
    if f.ndim != 1 or f.shape != d.shape or (run is not None and run.shape != f.shape):
        raise _refused(
            "forces, indications and runs differ in number", [x.size for x in (f, d, run) if x is not None],
            "one of each a row", "check the columns",
        )  # fmt: skip
    if not (np.isfinite(f).all() and np.isfinite(d).all()):
        raise _refused("a value is not finite", "NaN or infinity", "numbers", "remove the row")
    if degree is not None and not 1 <= degree <= MAX_DEGREE:
        raise _refused("no such degree", degree, f"1 to {MAX_DEGREE}", "leave the degree to the annex test")
    if resolution is not None and not (np.isfinite(resolution) and resolution > 0):
        raise _refused("no such resolution", resolution, "a positive number", "state it as read")
    loaded: NDArray[np.bool_] = f != 0
    if (f > 0).any() and (f < 0).any():
        raise _refused(
            "forces of both senses", f"{f.min():g} to {f.max():g}", "tension or compression",
            "evaluate each sense apart",
        )  # fmt: skip
    if not loaded.any():
        raise _refused("there is no force", f"{len(f)} rows at zero", "forces", "apply forces")
    return loaded


def _refused(problem: str, actual: object, expected: object, next_step: str) -> SessionError:
    return SessionError(
        problem, where="ASTM E74", got=actual, expected=expected, next_step=next_step, rule="e74"
    )
