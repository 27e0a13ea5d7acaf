"""Scatter of a load about its curve: within a run, and between runs; and the covariance that follows from it.

Reference loads y of a session against its terms X:

    y_i = X_i c + z_r + g_r l_i + e_i,   l_i = (X c)_i / largest load,   r the run (or mounting) of row i

with a zero z_r ~ N(0, zero^2) and a gain g_r ~ N(0, gain^2) of every run, both in the unit of the load (the
gain at the largest load), and e_i ~ N(0, (within s_i)^2), correlated with the row before it in its run by
``correlation``. s_i is 1 where all rows weigh alike, else the row's stated uncertainty by their root mean
square, or what the residuals of a plain fit show of it (White, Econometrica 48 (1980) 817, by a profile in
place of single squares). The coefficients are those of the session's fit, whatever its method, a linear map
A of the loads (of errors in both variables: to first order, at the solution): their covariance is A V A^T
with V that of the rows (JCGM 100:2008, 5.2; Searle, Casella and McCulloch, Variance Components, 1992).
`fit.run_scatter` estimates the components; what is computed from them stands here, in numpy alone, because
every command that loads a record computes it again.

What a session states of its rows stands in V in place of what they show, unless chi-square contradicts it
at 95 % (ISO/TS 28037:2010, 6.2.2): then what they show takes its place, as the scale factor of weighted means
does (Particle Data Group, Review of Particle Physics, section 5.2.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.estimate import coverage_factor

MODEL = "run-effects-1"
WEIGHTED = "weighted-run-effects-1"  # rows of unlike stated uncertainty, and what is stated as a floor
SHOWN = "shown-run-effects-1"  # rows of a plain fit whose residuals show that they scatter unlike
UNTOLD = "untold-runs-1"  # runs of so few rows that nothing tells their effects from noise
UNTOLD_DOF = 2.0  # as three runs tell, the fewest that ASTM E74 accepts
MODELS = (MODEL, WEIGHTED, SHOWN, UNTOLD)
_NEGLIGIBLE = 1e-18
_STEP = 1e-4
_NORMAL_95 = 1.6448536269514722


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """Standard deviations in the load's unit, as restricted likelihood estimates them.

    ``factor`` is what tells the groups of rows apart, run or mounting; ``groups`` their number; ``within``,
    ``zero``, ``gain`` and ``correlation`` as above; ``dof`` the degrees of freedom that are left for
    ``within`` by the mean and the runs. ``zero`` is 0 by definition where each run has its own zero. Of one
    group alone ``zero`` and ``gain`` are what the session stated; of the model `UNTOLD`, all that rows allow.
    """

    factor: str
    groups: int
    within: float
    zero: float
    gain: float
    correlation: float
    dof: int
    model: str = MODEL

    @property
    def variances(self) -> Array:
        """within^2, zero^2, gain^2 (3,)."""
        return np.array([self.within, self.zero, self.gain]) ** 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """What of a session's rows decides how scatter reaches its coefficients.

    ``operator`` (terms, rows) is A; ``relative`` (rows,) the loads l; ``group`` (rows,) the run of each row,
    whole numbers from 0; ``noise`` (rows,) is s, None where it is 1. ``stated`` (3,) are variances
    within runs, of zeros and of gains that the session states, and ``shared`` (terms, terms) the covariance
    by stated errors that no difference of runs can show; ``rounded`` (terms, terms) that by the stated
    resolution of indications, None where none is stated.
    """

    operator: Array
    relative: Array
    group: NDArray[np.int64]
    noise: Array | None = None
    stated: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shared: Array | None = None
    rounded: Array | None = None

    def parts(self, correlation: float) -> Array:
        """Return A V_k A^T of a unit of within^2, zero^2 and gain^2 (3, terms, terms)."""
        noisy, group, zero, gain = self._by_run()
        return np.stack([_within(noisy, group, correlation), zero @ zero.T, gain @ gain.T])

    def roots(self, correlation: float) -> tuple[Array, Array, Array]:
        """Return B_k (terms, at most terms) with B_k B_k^T = A V_k A^T, as `parts` has them.

        J B_k keeps the digits that J (A V_k A^T) J^T loses where terms nearly cancel in A.
        """
        noisy, group, zero, gain = self._by_run()
        within = _root_within(noisy, group, correlation)
        first, second, third = (np.linalg.qr(part.T)[1].T for part in (within, zero, gain))
        return first, second, third

    def _by_run(self) -> tuple[Array, NDArray[np.int64], Array, Array]:
        """Return A s and the run of each row, the rows of a run together; the sums of A and A l by run."""
        order = np.argsort(self.group, kind="stable")
        A, group, relative = self.operator[:, order], self.group[order], self.relative[order]
        runs = int(group[-1]) + 1
        zero = np.stack([np.bincount(group, weights=row, minlength=runs) for row in A])
        gain = np.stack([np.bincount(group, weights=row * relative, minlength=runs) for row in A])
        noisy = A if self.noise is None else A * self.noise[order]
        return noisy, group, np.asarray(zero, dtype=np.float64), np.asarray(gain, dtype=np.float64)

    def covariance(self, scatter: RunScatter) -> Array:
        """Return the covariance of the coefficients (terms, terms) that a normal interval may be built on.

        A component on nu degrees of freedom enters (t_nu / t_inf)^2 times as large, t at 95 %: who is handed
        a covariance takes k = 1.96, and with three runs the sizes of their zeros are known to two degrees of
        freedom only. The within part counts rows that correlation leaves independent,
        (1 - phi^2) / (1 + phi^2) of them (Bayley and Hammersley, J. R. Stat. Soc. Suppl. 8 (1946) 184).
        """
        if scatter.model == UNTOLD:
            widening = [1.0, _expansion(UNTOLD_DOF), _expansion(UNTOLD_DOF)]
            return self._total(scatter, self.parts(0.0), widening)
        if scatter.groups < 2:  # as for independent rows; what was stated is known
            return self._total(scatter, self.parts(0.0))
        phi2 = scatter.correlation**2
        within = max(scatter.dof * (1 - phi2) / (1 + phi2), 1.0)
        between = float(max(scatter.groups - 1, 1))
        widening = [_expansion(dof) for dof in (within, between, between)]
        return self._total(scatter, self.parts(scatter.correlation), widening)

    def estimated(self, scatter: RunScatter) -> Array:
        """Return the covariance of the coefficients (terms, terms) by the components as estimated."""
        return self._total(scatter, self.parts(scatter.correlation))

    def shows_more(self, scatter: RunScatter) -> NDArray[np.bool_]:
        """Tell which of within, zero and gain (3,) the rows show, since nothing stated holds them."""
        stated = np.array(self.stated)
        limits = stated * np.array([chi2_limit(scatter.dof) / scatter.dof, 1.0, 1.0])
        return np.asarray((stated == 0) | (scatter.variances > limits))

    def _total(self, scatter: RunScatter, parts: Array, widening: Sequence[float] = (1.0, 1.0, 1.0)) -> Array:
        shown = scatter.variances * np.array(widening)
        total = np.einsum("k,kij->ij", np.where(self.shows_more(scatter), shown, self.stated), parts)
        total = total + sum((part for part in (self.shared, self.rounded) if part is not None), start=0.0)
        return np.asarray((total + total.T) / 2)

    def of_runs(self, scatter: RunScatter, residuals: Array) -> Array:
        """Return what of the residuals (rows,) the zeros and gains of the runs make, as best predicted.

        Henderson's predictor G Z^T V^-1 e of rows taken for uncorrelated: a run that lies off does not make
        outliers of its rows.
        """
        root = np.array([scatter.zero, scatter.gain])
        if scatter.groups < 2 or not root.any() or not scatter.within:
            return np.zeros_like(residuals)
        scale = np.ones_like(residuals) if self.noise is None else 1 / self.noise
        constant, relative, residuals = scale, self.relative * scale, residuals * scale
        products = [
            constant * constant, constant * relative, relative * relative, constant * residuals,
            residuals * relative,
        ]  # fmt: skip
        counts, first, second, zero, gain = (np.bincount(self.group, weights=values) for values in products)
        inner = np.array([[counts, first], [first, second]]).transpose(2, 0, 1) * np.outer(root, root)
        inner = inner + scatter.within**2 * np.eye(2)
        solved = np.linalg.solve(inner, (np.stack([zero, gain], axis=1) * root)[:, :, None])[:, :, 0] * root
        effects = solved[self.group]
        return np.asarray(effects[:, 0] + effects[:, 1] * self.relative)

    def variance(self, scatter: RunScatter, J: Array) -> tuple[Array, Array]:
        """Return J C J^T, unexpanded, of vectors J (points, terms), and their gradients (points, 4).

        The gradient is by within^2, zero^2, gain^2 and the correlation.
        """
        phi = scatter.correlation
        share = np.column_stack([_squares(J @ root) for root in self.roots(phi)])
        near = [max(phi - _STEP, 0.0), phi + _STEP]
        moved = [_squares(J @ self.roots(value)[0]) for value in near]
        more = self.shows_more(scatter)
        variances = np.where(more, scatter.variances, self.stated)
        turned = variances[0] * (moved[1] - moved[0]) / (near[1] - near[0])
        shared = sum(quadratic(J, part) for part in (self.shared, self.rounded) if part is not None)
        # What is stated is known: it moves with no estimate.
        estimated = np.where(more, share, 0.0)
        return share @ variances + shared, np.column_stack([estimated, turned])


def rows_of(design: Array, load: Array, group: NDArray[np.int64], operator: Array | None = None) -> Rows:
    """Return the rows of a plain least-squares fit of a load (rows,) on a design (rows, terms).

    ``operator`` (terms, rows) is what makes the coefficients, where it is known.
    """
    if operator is None:
        # Columns of one length: the pseudo-inverse of raw terms loses digits to their units.
        length = np.sqrt(np.einsum("ij,ij->j", design, design))
        length = np.where(length > 0, length, 1.0)
        q, r = np.linalg.qr(design / length)
        operator = np.linalg.solve(r, q.T) / length[:, None]
    relative = design @ (operator @ load) / (float(np.abs(load).max()) or 1.0)
    return Rows(operator=operator, relative=relative, group=group)


def _within(A: Array, group: NDArray[np.int64], correlation: float) -> Array:
    """Return A R A^T with R_ij = correlation^|i - j| inside a run; rows of a run stand together."""
    product = A @ A.T
    if correlation <= 0:
        return np.asarray(product)
    # R = L + L^T - 1 with L the sum over all rows before.
    half = _filtered(A, group, correlation) @ A.T
    return np.asarray(half + half.T - product)


def _root_within(A: Array, group: NDArray[np.int64], correlation: float) -> Array:
    """Return B (terms, rows) with B B^T = A R A^T, R as in `_within`."""
    if correlation <= 0:
        return A
    # Cholesky's factor of R, from each run's last row on: the sums before, each by what is new in its row.
    last = np.append(group[1:] != group[:-1], True)
    new = math.sqrt(max(1 - correlation**2, 0.0))
    return np.asarray(_filtered(A, group, correlation) * np.where(last, 1.0, new))


def _filtered(A: Array, group: NDArray[np.int64], correlation: float) -> Array:
    """Return the sums over each row and those before it in its run, each weighed by correlation^distance."""
    # The geometric series doubles at every step.
    filtered, lag, weight = A.copy(), 1, correlation
    while lag < A.shape[1] and weight > _NEGLIGIBLE:
        neighbours = group[lag:] == group[:-lag]
        before = filtered[:, :-lag] * neighbours
        filtered = filtered.copy()
        filtered[:, lag:] += weight * before
        lag, weight = 2 * lag, weight * weight
    return filtered


def quadratic(J: Array, form: Array) -> Array:
    """Return J C J^T of every row of J (points, terms)."""
    return np.asarray(np.einsum("ij,ij->i", J @ form, J))


def _squares(rows: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", rows, rows))


def chi2_limit(dof: int) -> float:
    """Return the 95 % quantile of chi-square (Wilson and Hilferty, PNAS 17 (1931) 684).

    >>> round(chi2_limit(72), 1)  # 92.8 in the tables
    92.8
    """
    part = 2 / (9 * dof)
    return float(dof * (1 - part + _NORMAL_95 * part**0.5) ** 3)


def _expansion(dof: float) -> float:
    return float((coverage_factor(dof) / coverage_factor(float("inf"))) ** 2)
