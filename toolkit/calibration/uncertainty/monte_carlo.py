"""Monte Carlo check of a budget: propagation of distributions (JCGM 101:2008).

Every trial refits the calibration: the rows of the session get new errors, within their runs and between
them, the coefficients follow, X^+ (y + e), and the load is computed from them at indications that have errors
of their own.
Nothing is linearised. What the budget knows only as an amount of load is drawn as such, from its own
distribution: normal (6.4.7), scaled and shifted t (6.4.9), rectangular (6.4.2).

The interval is the probabilistically symmetric one (7.7). The budget's is *validated* (8.1) where both ends
agree within delta, half a unit of the last significant digit of u (7.9.2). Trials are a fixed number, or
adaptive: batches until twice the standard deviation of the mean of y, u(y) and both ends is below delta / 5
(7.9.4, with the sharper tolerance that 8.2 asks for where a budget is to be validated).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import term_matrix
from toolkit.calibration.uncertainty.common_errors import IndicationError, indication_errors
from toolkit.calibration.uncertainty.model import Budget, Component
from toolkit.calibration.uncertainty.scatter import scatter_of
from toolkit.declared import Entry, derived
from toolkit.errors import SessionError
from toolkit.estimate import last_place

Draw = Callable[[np.random.Generator, int], Array]
Refit = Callable[[np.random.Generator, int, Array], Array]

BATCH = 20_000
MOST_BATCHES = 500
MOST_TRIALS = 100_000_000
# Components that are drawn where they arise; the others are amounts of load.
_AT_SOURCE = ("fit", "resolution", "indication")


@dataclass(frozen=True, slots=True, kw_only=True)
class MonteCarloCheck:
    """The budget, held against a Monte Carlo computation by JCGM 101.

    In the load's unit; ``value`` and ``u`` are mean and standard deviation of the trials, ``low`` and
    ``high`` their symmetric coverage interval.
    """

    trials: int
    seed: int
    value: float
    u: float
    low: float
    high: float
    budget_low: float
    budget_high: float
    digits: Annotated[int, Entry("of u that count")]
    delta: Annotated[float, Entry("numerical tolerance")]
    stable: Annotated[bool, Entry("whether adaptive trials settled; always so for a fixed number")]

    @property
    @derived(after="budget_high")
    def low_difference(self) -> float:
        """Distance of the lower ends (JCGM 101 eq. 19)."""
        return abs(self.budget_low - self.low)

    @property
    @derived(after="low_difference")
    def high_difference(self) -> float:
        """Distance of the upper ends (JCGM 101 eq. 20)."""
        return abs(self.budget_high - self.high)

    @property
    @derived("whether the budget's interval is that of the trials, within the tolerance")
    def validated(self) -> bool:
        """Whether the budget's interval is that of the trials, within the tolerance."""
        return self.stable and max(self.low_difference, self.high_difference) <= self.delta


def monte_carlo(
    record: CalibrationRecord,
    loads: Table,
    budget: Budget,
    *,
    trials: int | None = 1_000_000,
    seed: int = 0,
    digits: int = 2,
) -> MonteCarloCheck:
    """Check a budget of a record by trials.

    Parameters
    ----------
    record, loads : as the budget was made from
    trials : their number; None: as many as the result needs to settle
    seed : of the generator; the same seed gives the same result
    digits : significant digits of u that are held to be meaningful, 1 or 2

    Raises
    ------
    SessionError
        ``budget``: under 10 000 or too many trials; nothing in the budget is uncertain
    """
    if trials is not None and not 10_000 <= trials <= MOST_TRIALS:
        raise _refused("the number of trials cannot be used", trials, f"10000 to {MOST_TRIALS}")
    if not (math.isfinite(budget.U) and budget.u > 0):
        raise _refused("the budget has no interval to check", f"u = {budget.u:g}, k = {budget.k:g}", "u > 0")
    fitted = record.load(budget.load)
    point = dict(zip(record.indications, np.asarray(budget.indications)[:, None], strict=True))
    value = fitted.at(point).item()
    draw = _model(record, loads, budget)
    delta = 0.5 * 10.0 ** last_place(budget.u, digits=digits)
    generator = np.random.default_rng(seed)
    if trials is None:
        drawn, stable = _until_settled(draw, generator, delta / 5, budget.probability)
    else:
        sizes = [min(BATCH, trials - start) for start in range(0, trials, BATCH)]
        drawn, stable = np.concatenate([draw(generator, size) for size in sizes]), True
    low, high = coverage_interval(drawn, budget.probability)
    return MonteCarloCheck(
        trials=len(drawn), seed=seed, value=float(drawn.mean()), u=float(drawn.std(ddof=1)),
        low=low, high=high, budget_low=value - budget.U, budget_high=value + budget.U,
        digits=digits, delta=delta, stable=stable,
    )  # fmt: skip


def coverage_interval(values: Array, probability: float) -> tuple[float, float]:
    """Return the probabilistically symmetric coverage interval of trials (JCGM 101, 7.7.2).

    >>> coverage_interval(np.arange(1.0, 101.0), 0.9)
    (5.0, 95.0)
    """
    M = len(values)
    q = math.floor(probability * M + 0.5)
    r = (M - q) // 2 if (M - q) % 2 == 0 else (M - q + 1) // 2
    r = max(r, 1)
    ends = np.partition(values, [r - 1, r + q - 1])
    return float(ends[r - 1]), float(ends[r + q - 1])


def _model(record: CalibrationRecord, loads: Table, budget: Budget) -> Draw:
    """Return the measurement model: a number of trials -> loads (trials,)."""
    fitted = record.load(budget.load)
    refit = _refits(record, loads, budget)
    errors = indication_errors(record, statements_of(record))
    exact = not any(e.u or e.half_width for e in errors)
    joint = [part.u for part in budget.components if part.joint and part.name not in _AT_SOURCE]
    scatter = math.sqrt(math.fsum(u * u for u in joint))
    point = np.asarray(budget.indications)
    row = term_matrix(fitted.terms, dict(zip(record.indications, point[:, None], strict=True)))[0]
    apart = [part for part in budget.components if not part.joint and part.name not in _AT_SOURCE]
    amounts = [part for part in apart if part.u > 0]

    def draw(generator: np.random.Generator, size: int) -> Array:
        # What one estimate from the rows gives is drawn by one scale (6.4.9.4).
        scale = _scale(generator, size, budget.scatter_dof)
        c = refit(generator, size, scale)
        if exact:
            total: Array = c @ row
        else:
            cells = {
                name: x + _misread(generator, size, e)
                for name, x, e in zip(record.indications, point.tolist(), errors, strict=True)
            }
            total = np.einsum("ij,ij->i", term_matrix(fitted.terms, cells), c)
        total = total + scale * generator.normal(0.0, scatter, size)
        for part in amounts:
            total = total + _amount(generator, size, part)
        return total

    return draw


def _refits(record: CalibrationRecord, loads: Table, budget: Budget) -> Refit:
    """Return what refits a number of trials at once: coefficients (trials, terms).

    A linear fit of rows whose errors are normal moves its coefficients by normal amounts, exactly: they are
    drawn from their covariance in place of the rows, whose number then costs nothing.
    """
    fitted = record.load(budget.load)
    coefficients = np.asarray(fitted.coefficients)
    part = budget.component("fit")
    scatter = scatter_of(record, loads, fitted)
    estimated = fitted.scatter is not None or fitted.method != "ols"
    root = _root(
        scatter.rows.estimated(scatter.runs) if part.joint and estimated else np.asarray(fitted.covariance)
    )

    def refit(generator: np.random.Generator, size: int, scale: Array) -> Array:
        moved = generator.standard_normal((size, len(coefficients))) @ root.T
        coefficients_drawn: Array = coefficients + (moved * scale[:, None] if part.joint else moved)
        return coefficients_drawn

    return refit


def _root(covariance: Array) -> Array:
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    root: Array = sd[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _scale(generator: np.random.Generator, size: int, dof: float) -> Array:
    """Return what makes normal draws those of Student's t with ``dof`` degrees of freedom (6.4.9.4)."""
    return np.ones(size) if math.isinf(dof) else np.sqrt(dof / generator.chisquare(dof, size))


def _amount(generator: np.random.Generator, size: int, part: Component) -> Array:
    if part.distribution == "rectangular":
        half = part.u * math.sqrt(3.0)
        return generator.uniform(-half, half, size)
    drawn = generator.normal(0.0, part.u, size)
    return drawn * _scale(generator, size, part.dof) if part.distribution == "student" else drawn


def _misread(generator: np.random.Generator, size: int, error: IndicationError) -> Array:
    total = generator.normal(0.0, error.u, size) if error.u else np.zeros(size)
    for _ in range(error.readings if error.half_width else 0):
        total = total + generator.uniform(-error.half_width, error.half_width, size)
    return total


def _until_settled(
    draw: Draw, generator: np.random.Generator, tolerance: float, probability: float
) -> tuple[Array, bool]:
    """Draw batches until the four results have settled (JCGM 101, 7.9.4); False where they never did."""
    batches: list[Array] = []
    results: list[tuple[float, float, float, float]] = []
    while len(batches) < MOST_BATCHES:
        values = draw(generator, BATCH)
        batches.append(values)
        results.append(
            (float(values.mean()), float(values.std(ddof=1)), *coverage_interval(values, probability))
        )
        if len(results) > 2:
            spread = np.std(results, axis=0, ddof=1) / math.sqrt(len(results))
            if (2 * spread <= tolerance).all():
                return np.concatenate(batches), True
    return np.concatenate(batches), False


def _refused(problem: str, actual: object, expected: object) -> SessionError:
    return SessionError(
        problem, where="Monte Carlo", got=actual, expected=expected,
        next_step="choose another number of trials",
        rule="budget",
    )  # fmt: skip
