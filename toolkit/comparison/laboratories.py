"""Interlaboratory comparison: ISO 13528 scores of each laboratory, ISO 5725-2 precision of the method.

The assigned value x_pt is that of a reference laboratory, with its stated uncertainty, or the consensus of
all by algorithm A. With sigma_pt, stated or robust, U = k u:

    z' = (x - x_pt) / sqrt(sigma_pt^2 + u(x_pt)^2)          (9.5)
    zeta = (x - x_pt) / sqrt(u(x)^2 + u(x_pt)^2)            (9.6)
    E_n = (x - x_pt) / sqrt(U(x)^2 + U(x_pt)^2)             (9.7)

Precision is the one-way analysis of variance of `precision`, for laboratories with different numbers of
results too. Cochran's test looks for a laboratory that scatters more, Grubbs' for a mean that lies apart;
Mandel's h and k (`mandel`) say both of every laboratory.

Algorithm A (ISO 13528, annex C.3) gives a robust mean and standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from toolkit.arrays import Array
from toolkit.comparison.differences import ROUNDED, deviations, grubbs_p, printed_step
from toolkit.comparison.model import Spread
from toolkit.comparison.precision import Consistency, Departure, consistencies, factor_spread, spread
from toolkit.errors import ConfigError
from toolkit.findings import Finding

FACTOR = 1.134  # as the standard prints it; 1.1334 of a normal distribution cut at 1.5 standard deviations
_CUT = 1.5
_MAD = 1.483
_SAME = 1e-10
_VANISHED = 1e-6
_MOST_STEPS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Robust:
    """Robust mean and standard deviation of ``n`` results."""

    mean: float
    sd: float
    n: int

    @property
    def u(self) -> float:
        """Standard uncertainty of the mean, 1.25 s* / sqrt(p) (7.7.7)."""
        return float(1.25 * self.sd / np.sqrt(self.n))


def algorithm_a(values: Array, *, factor: float = FACTOR) -> Robust:
    """Return the robust mean and standard deviation of results (n,), by iteration until they stay.

    It begins with the median and the scaled median absolute deviation, and settles by its own s*: how far the
    wildest result lies decides nothing. Where more than half of the results are the same that deviation is 0,
    and the ordinary one is taken to begin with; it may then end in 0.

    >>> clean = algorithm_a(np.array([9.9, 10.0, 10.1, 10.0, 9.8, 10.2]))
    >>> spoilt = algorithm_a(np.array([9.9, 10.0, 10.1, 10.0, 9.8, 99.0]))
    >>> abs(clean.mean - spoilt.mean) < 0.1
    True
    """
    median = float(np.median(values))
    off = values - median  # from here on: results that lie near each other keep their digits
    off[np.abs(off) <= ROUNDED * abs(median)] = 0.0
    sizes = np.abs(off[off != 0])
    if not sizes.size:
        return Robust(mean=median, sd=0.0, n=len(values))
    mean, sd = 0.0, _MAD * float(np.median(np.abs(off))) or float(off.std(ddof=1))
    nothing = _VANISHED * float(sizes.min())  # of what the nearest of the others lies apart
    for _ in range(_MOST_STEPS):
        near = np.clip(off, mean - _CUT * sd, mean + _CUT * sd)
        after, spread = float(near.mean()), factor * float(near.std(ddof=1))
        settled = abs(after - mean) <= _SAME * sd and abs(spread - sd) <= _SAME * sd
        mean, sd = after, spread
        if sd <= nothing:
            mean = sd = 0.0
        if settled or not sd:
            break
    return Robust(mean=median + mean, sd=sd, n=len(values))


Signal = Literal["action", "warning"]
K = 2.0
FEW = 12
"""Laboratories below which a robust consensus of 13528 is weak (its annex D)."""
FEWEST = 3
OUTLIER = 0.01
LIMIT = 2.8  # 1.96 sqrt(2): between two results


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What a laboratory reports of a measurand: results, and U of their mean with k (None: not stated)."""

    laboratory: str
    values: tuple[float, ...]
    U: float | None = None
    k: float = K

    @property
    def mean(self) -> float:
        """Mean of its results."""
        first = self.values[0]  # the mean of equal results is that result
        return first + math.fsum(value - first for value in self.values) / len(self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """A laboratory's scores; z' is None without sigma_pt, zeta and E_n where it states no uncertainty.

    ``signal`` is that of z' (beyond 2 a warning, from 3 an action), ``En_signal`` tells an E_n from 1 on.
    ``h`` and ``k`` are Mandel's, None where there are too few laboratories or repeats to tell.
    """

    laboratory: str
    n: int
    mean: float
    U: float | None
    z_prime: float | None
    zeta: float | None
    En: float | None
    signal: Signal | None
    En_signal: bool
    h: float | None
    k: float | None
    h_departure: Departure | None
    k_departure: Departure | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodPrecision:
    """Repeatability and reproducibility (ISO 5725-2); without repeats there is no repeatability.

    ``s_r`` with its interval, ``s_L`` between laboratories, ``s_R``; limits r and R between two results;
    ``cochran_p`` of the laboratory that scatters most, ``grubbs_p`` of the mean farthest off.
    """

    laboratories: int
    n: int
    mean: float
    s_r: Spread | None
    s_L: float | None
    s_R: float
    r: float | None
    R: float
    cochran_p: float | None
    cochran_laboratory: str | None
    grubbs_p: float | None
    grubbs_laboratory: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurand:
    """The comparison of a measurand: assigned value with its standard uncertainty, sigma_pt, scores.

    ``sigma_pt`` is None where it is not stated and too few laboratories tell it; ``precision`` of one alone.
    """

    name: str
    unit: str
    assigned: float
    u_assigned: float
    assigned_by: str
    sigma_pt: float | None
    sigma_by: str
    scores: tuple[Score, ...]
    precision: MethodPrecision | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LaboratoryComparison:
    """All measurands of a comparison."""

    measurands: tuple[Measurand, ...]
    findings: tuple[Finding, ...]


def compare_laboratories(
    reported: dict[str, Sequence[Results]], *, unit: str, reference: str | None, sigma: float | None
) -> LaboratoryComparison:
    """Compare laboratories in every measurand.

    Parameters
    ----------
    reported : the results of every laboratory by measurand
    unit : of all results
    reference : the laboratory whose values are the assigned ones; None: the consensus of all
    sigma : sigma_pt for all measurands; None: the robust standard deviation of the laboratories

    Raises
    ------
    ConfigError
        ``laboratories``: none beside the reference, fewer than three without, a reference without its
        result or U, results without spread
    """
    measurands = []
    findings: list[Finding] = []
    for name, results in reported.items():
        measurand = _measurand(name, results, unit, reference, sigma)
        measurands.append(measurand)
        findings += _findings(measurand, reference)
    return LaboratoryComparison(measurands=tuple(measurands), findings=tuple(findings))


def _measurand(
    name: str, results: Sequence[Results], unit: str, reference: str | None, sigma: float | None
) -> Measurand:
    taking_part = [entry for entry in results if entry.laboratory != reference]
    fewest = FEWEST if reference is None else 1
    if len(taking_part) < fewest:
        beside = "" if reference is None else f" beside {reference}"
        raise _refused(
            name, "too few laboratories to compare",
            ", ".join(entry.laboratory for entry in taking_part) or "none", f"{fewest} at least{beside}",
            "add a laboratory's results"
            + (f", name a reference, beside which one is enough, or leave {name} out" * (reference is None)),
        )  # fmt: skip
    robust = algorithm_a(np.array([entry.mean for entry in taking_part])) if len(taking_part) > 1 else None
    stated = next((entry for entry in results if entry.laboratory == reference), None)
    if stated is not None and stated.U is not None:
        assigned, u_assigned, by = stated.mean, stated.U / stated.k, stated.laboratory
    elif reference is None and robust is not None:
        assigned, u_assigned, by = robust.mean, robust.u, f"consensus of {robust.n} (algorithm A)"
    else:
        lacking = "no result" if stated is None else "a result without U"
        raise _refused(name, "the reference laboratory cannot assign a value", f"{reference}: {lacking}",
                       "its result with U")  # fmt: skip
    sigma_pt: float | None
    if sigma is None and robust is not None and robust.n >= FEWEST and robust.sd > 0:
        sigma_pt, sigma_by = robust.sd, "robust standard deviation (algorithm A)"
    else:
        few = robust is None or robust.n < FEWEST
        lacking = "too few to tell" if few else "most results are equal (s* = 0)"
        sigma_pt, sigma_by = sigma, "stated" if sigma is not None else f"not stated, {lacking}"
    if sigma_pt is None and reference is None:
        raise _refused(
            name,
            "the laboratories' results have no spread to score by",
            "s* = 0: more than half of the results are equal",
            "--sigma VALUE",
        )
    alike = consistencies([entry.values for entry in taking_part])
    return Measurand(
        name=name, unit=unit, assigned=assigned, u_assigned=u_assigned, assigned_by=by, sigma_pt=sigma_pt,
        sigma_by=sigma_by,
        scores=tuple(
            _score(entry, consistency, assigned, u_assigned, sigma_pt)
            for entry, consistency in zip(taking_part, alike, strict=True)
        ),
        precision=method_precision(taking_part) if robust is not None else None,
    )  # fmt: skip


def _score(
    entry: Results, consistency: Consistency, assigned: float, u_assigned: float, sigma_pt: float | None
) -> Score:
    off = entry.mean - assigned
    z_prime = None if sigma_pt is None else off / math.hypot(sigma_pt, u_assigned)
    size = 0.0 if z_prime is None else abs(z_prime)
    zeta = None if entry.U is None else _ratio(off, math.hypot(entry.U / entry.k, u_assigned))
    En = None if entry.U is None else _ratio(off, math.hypot(K * entry.U / entry.k, K * u_assigned))
    return Score(
        laboratory=entry.laboratory, n=len(entry.values), mean=entry.mean, U=entry.U, z_prime=z_prime,
        zeta=zeta, En=En,
        signal="action" if size >= 3 else "warning" if size > 2 else None,
        En_signal=En is not None and abs(En) >= 1,
        h=consistency.h, k=consistency.k,
        h_departure=consistency.h_departure, k_departure=consistency.k_departure,
    )  # fmt: skip


def _ratio(off: float, u: float) -> float:
    return off / u if u else math.copysign(math.inf, off) if off else 0.0


def method_precision(results: Sequence[Results]) -> MethodPrecision:
    """Return repeatability and reproducibility of laboratories' results, their numbers equal or not."""
    values = np.array([value for entry in results for value in entry.values])
    owners = [entry.laboratory for entry in results for _ in entry.values]
    between = factor_spread(values, owners, factor="laboratory")
    dof = len(values) - len(results)
    within = math.sqrt(
        sum(float(np.sum(deviations(entry.values) ** 2)) for entry in results) / dof
    ) if dof else None  # fmt: skip
    means = np.array([entry.mean for entry in results])
    cochran = cochran_p(results)
    return MethodPrecision(
        laboratories=len(results), n=len(values), mean=float(values.mean()),
        s_r=None if within is None else spread(within, dof),
        s_L=between.s_between, s_R=between.s,
        r=None if within is None else LIMIT * within, R=LIMIT * between.s,
        cochran_p=None if cochran is None else cochran[1],
        cochran_laboratory=None if cochran is None else cochran[0],
        grubbs_p=grubbs_p(means, printed_step(values)),
        grubbs_laboratory=results[int(np.argmax(np.abs(deviations(means))))].laboratory,
    )  # fmt: skip


def cochran_p(results: Sequence[Results]) -> tuple[str, float] | None:
    """Return the laboratory that scatters most and the p value of Cochran's test; None without repeats.

    C = SS_i / sum SS is a laboratory's share of the sum of squares within laboratories; of equal numbers of
    results it is the standard's s_i^2 / sum s^2 (ISO 5725-2, 7.3.3). P(C) is that of C (N - n) / (n (1 - C))
    in F with n and N - n degrees of freedom, n of the laboratory and N of all; p is the least P times the
    number of laboratories with repeats. For different numbers the standard takes the most common one for
    all: of two results beside many of five every tenth sound comparison would have an outlier at 1 %.
    """
    from scipy.special import fdtrc

    repeated = [entry for entry in results if len(entry.values) > 1]
    squares = [float(np.sum(deviations(entry.values) ** 2)) for entry in repeated]
    if len(repeated) < 2 or not any(squares):
        return None
    dofs = [len(entry.values) - 1 for entry in repeated]
    N, total = sum(dofs), math.fsum(squares)
    chances = [
        0.0 if square >= total else float(fdtrc(n, N - n, square * (N - n) / ((total - square) * n)))
        for n, square in zip(dofs, squares, strict=True)
    ]
    place = int(np.argmin(chances))
    return repeated[place].laboratory, min(1.0, len(repeated) * chances[place])


def _findings(measurand: Measurand, reference: str | None) -> list[Finding]:
    findings = []
    p = measurand.precision
    tests = () if p is None else (
        ("Cochran", p.cochran_p, p.cochran_laboratory),
        ("Grubbs", p.grubbs_p, p.grubbs_laboratory),
    )  # fmt: skip
    for test, chance, laboratory in tests:
        if chance is not None and chance < OUTLIER:
            deviation = " scatters more than" if test == "Cochran" else " lies apart from"
            message = (
                f"{laboratory}{deviation} the others ({test}, p = {chance:.2g}): s_r and s_R are with it"
            )
            findings.append(Finding(rule="laboratory-outlier", where=measurand.name, message=message))
    if reference is None and len(measurand.scores) < FEW:
        message = (
            f"a consensus of {len(measurand.scores)} laboratories is weak; ISO 13528 asks for about {FEW}"
        )
        findings.append(Finding(rule="few-laboratories", where=measurand.name, message=message, level="note"))
    if reference is None and any(score.En is not None for score in measurand.scores):
        message = "the assigned value is made of the scored results too: zeta and E_n come out a little small"
        findings.append(Finding(rule="consensus-scores", where=measurand.name, message=message, level="note"))
    return findings


def _refused(
    measurand: str, problem: str, actual: object, expected: str, next_step: str = "add what is expected"
) -> ConfigError:
    return ConfigError(
        problem, where=measurand, got=actual, expected=expected, next_step=next_step,
        rule="laboratories",
    )  # fmt: skip
