"""What the method of a fit takes a session's rows for, and how their scatter reaches its coefficients.

Every method makes its coefficients by a linear map A of the reference loads, so that one model of scatter
(`records.scatter`) serves them all: only A and what is stated of the rows differ.

    ols         A = (X'X)^-1 X'          nothing stated: rows alike, or as residuals show (`profile`)
    wls, odr    A = (X'WX)^-1 X'W        W = 1 / u^2; of odr u^2 = u_load^2 + sum of (slope_j u_j)^2 and X at
                                         the adjusted indications
    gls         A = (X'V^-1 X)^-1 X'V^-1 V with the error that a group of rows shares (`known_errors`)

A shared error whose groups are the runs is what differences of runs show: there the larger of the two counts,
anywhere else it is added. So is what rounding leaves (`rounding`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.profile import Profile, relative_profile
from toolkit.calibration.records.scatter import WEIGHTED, Rows, RunScatter, chi2_limit, rows_of
from toolkit.calibration.session.known_errors import KnownErrors, known_errors, row_uncertainty
from toolkit.calibration.terms import term_matrix, term_slopes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from toolkit.calibration.fit.rounding import Rounding
    from toolkit.calibration.session.statements import Statements
    from toolkit.calibration.session.table import Table

_STEPS = 100
_SETTLED = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowNoise:
    """The covariance u_i^2 (i = j) + v_i v_j (one group) of rows; the design that it weighs (rows, terms).

    ``stated`` is False where nothing is stated of single rows and ``u`` is what the residuals tell.
    ``proportional`` tells how a group's error acts, ``u_shared`` its size in the load's unit.
    """

    u: Array
    stated: bool
    v: Array
    group: NDArray[np.intp]
    u_shared: float
    proportional: bool
    design: Array

    @property
    def size(self) -> float:
        """Root mean square of u, in the load's unit."""
        return math.sqrt(float(self.u @ self.u) / len(self.u))

    @property
    def profile(self) -> Array:
        """Each row's u by their root mean square (rows,)."""
        return self.u / self.size

    def white(self, values: Array) -> Array:
        """Return rows (rows,) or (rows, columns) brought to independence and unit spread."""
        return self._freed((values.T / self.u).T)

    def chi2(self, residuals: Array) -> float:
        """Return the weighted sum of squares of residuals (rows,)."""
        white = self.white(residuals)
        return float(white @ white)

    def shown(self, residuals: Array, dof: int) -> float:
        """Return the scatter that residuals show, as `size` is stated, in the load's unit."""
        return self.size * math.sqrt(self.chi2(residuals) / dof)

    def scaled(self, residuals: Array) -> Array:
        """Return residuals (rows,) as `diagnostics` judges them: V^-1 r by the root of its diagonal."""
        total = self._sums(self._a * self._a)
        pull = residuals / self.u
        pull = (pull - self._a * self._sums(self._a * pull) / (1 + total)) / self.u
        return pull / np.sqrt((1 - self._a**2 / (1 + total)) / self.u**2)

    def operator(self) -> Array:
        """Return what makes coefficients of loads (terms, rows)."""
        length = np.sqrt(np.einsum("ij,ij->j", self.design, self.design))
        length = np.where(length > 0, length, 1.0)
        q, r = np.linalg.qr(self.white(self.design / length))
        # The whitening is symmetric but for the division by u, which comes first.
        return np.asarray(np.linalg.solve(r, (self._freed(q).T / self.u)) / length[:, None])

    @property
    def _a(self) -> Array:
        return self.v / self.u

    def _sums(self, values: Array) -> Array:
        return np.asarray(np.bincount(self.group, weights=values)[self.group], dtype=np.float64)

    def _freed(self, values: Array) -> Array:
        """Return (I + a a')^-1/2 of values in each group."""
        if not self.v.any():
            return values
        root = np.sqrt(1 + self._sums(self._a * self._a))
        # The limit of the factor for a'a -> 0 is 1/2; written so that nothing cancels.
        by = self._a / (root * (1 + root))
        columns = values.reshape(len(values), -1)
        taken = np.column_stack([by * self._sums(self._a * column) for column in columns.T])
        return np.asarray((columns - taken).reshape(values.shape), dtype=np.float64)


def noise_of(
    method: str,
    statements: Statements,
    table: Table,
    load: str,
    *,
    terms: Sequence[str],
    coefficients: Sequence[float],
    indications: Sequence[str],
    where: object,
) -> RowNoise | None:
    """Return what a method takes the rows of a load for; None of plain least squares: alike, nothing stated.

    Raises
    ------
    ConfigError
        ``session``: an uncertainty that the method needs is not stated
    """
    if method == "ols":
        return None
    columns, y = table.columns(indications), table.column(load)
    design = term_matrix(terms, columns)
    none, alone = np.zeros(len(y)), np.arange(len(y), dtype=np.intp)
    if method == "wls":
        u = row_uncertainty(table, load)
        if u is None:
            return None
        return RowNoise(
            u=u, stated=True, v=none, group=alone, u_shared=0.0, proportional=False, design=design
        )
    errors = known_errors(method, statements, table, load, where)
    if method == "odr":
        u, design = _adjusted(errors, terms, coefficients, columns, y)
        return RowNoise(
            u=u, stated=True, v=none, group=alone, u_shared=0.0, proportional=False, design=design
        )
    length = np.sqrt(np.einsum("ij,ij->j", design, design))
    q = np.linalg.qr(design / np.where(length > 0, length, 1.0))[0]
    ordinary = q @ (q.T @ y)
    residuals = y - ordinary
    residual_sd = math.sqrt(float(residuals @ residuals) / (len(y) - design.shape[1]))
    v = ordinary / float(np.abs(y).max()) if errors.proportional else np.ones(len(y))
    return RowNoise(
        u=np.full(len(y), residual_sd) if errors.u is None else errors.u, stated=errors.u is not None,
        v=errors.u_shared * v, group=errors.group, u_shared=errors.u_shared,
        proportional=errors.proportional, design=design,
    )  # fmt: skip


def _adjusted(
    errors: KnownErrors,
    terms: Sequence[str],
    coefficients: Sequence[float],
    columns: dict[str, Array],
    load: Array,
) -> tuple[Array, Array]:
    """Return the effective uncertainties (rows,) and the terms at the adjusted indications (rows, terms)."""
    u = np.ones(len(load)) if errors.u is None else errors.u
    x, u_x, c = np.array(list(columns.values())), errors.u_cells[:, None], np.asarray(coefficients)
    delta, largest = np.zeros_like(x), float(np.abs(load).max())
    for _ in range(_STEPS):
        at = dict(zip(columns, x + delta, strict=True))
        slopes, design = term_slopes(terms, coefficients, at), term_matrix(terms, at)
        slope = np.array([np.broadcast_to(slopes[name], load.shape) for name in columns])
        spread = np.sqrt(u**2 + np.square(slope * u_x).sum(axis=0))
        residual = load + (slope * delta).sum(axis=0) - design @ c
        adjusted = slope * u_x**2 * residual / spread**2
        moved = float(np.abs((slope * (adjusted - delta)).sum(axis=0)).max())
        delta = adjusted
        if moved <= _SETTLED * largest:
            break
    return spread, term_matrix(terms, dict(zip(columns, x + delta, strict=True)))


def weighed_rows(
    design: Array,
    load: Array,
    group: NDArray[np.int64],
    noise: RowNoise | None,
    operator: Array | None = None,
    rounding: Rounding | None = None,
) -> Rows:
    """Return how scatter reaches the coefficients of a load (rows,) on a design (rows, terms).

    ``operator`` (terms, rows) is what makes the coefficients, where it is known.
    """
    if noise is None:
        rows = rows_of(design, load, group, operator)
        return rows if rounding is None else replace(rows, rounded=rounding.covariance(rows.operator))
    operator = noise.operator() if operator is None else operator
    relative = rows_of(design, load, group, operator).relative
    stated = [noise.size**2 if noise.stated else 0.0, 0.0, 0.0]
    shared = None
    if noise.u_shared and group.any() and _same_partition(group, noise.group):
        stated[2 if noise.proportional else 1] = noise.u_shared**2
        relative = noise.v / noise.u_shared if noise.proportional else relative
    elif noise.u_shared:
        sums = np.stack([np.bincount(noise.group, weights=row * noise.v) for row in operator])
        shared = np.asarray(sums @ sums.T, dtype=np.float64)
    return Rows(
        operator=operator, relative=relative, group=group, noise=noise.profile,
        stated=(stated[0], stated[1], stated[2]), shared=shared,
        rounded=None if rounding is None else rounding.covariance(operator),
    )  # fmt: skip


def shown_rows(
    rows: Rows, design: Array, columns: Mapping[str, Array], residuals: Array
) -> tuple[Rows, Profile | None]:
    """Return the rows of a plain fit with the noise that residuals within runs show, and its profile.

    Where they show that all rows scatter alike, the rows are the same and the profile is None.
    """
    profile = relative_profile(columns, residuals, np.einsum("ij,ji->i", design, rows.operator))
    return (rows if profile is None else replace(rows, noise=np.sqrt(profile.at(columns)))), profile


def scatter_of_one(noise: RowNoise, residuals: Array, factor: str, dof: int) -> RunScatter | None:
    """Return the scatter of rows whose runs tell nothing; None where what is stated of them holds it."""
    within = noise.shown(residuals, dof)
    if (within / noise.size) ** 2 <= chi2_limit(dof) / dof:
        return None
    return RunScatter(
        factor=factor, groups=1, within=within, zero=0.0, gain=0.0, correlation=0.0, dof=dof,
        model=WEIGHTED,
    )  # fmt: skip


def _same_partition(runs: NDArray[np.int64], groups: NDArray[np.intp]) -> bool:
    """Tell whether two numberings of rows part them alike."""
    pairs = len(np.unique(np.column_stack([runs, groups]), axis=0))
    return pairs == len(np.unique(runs)) == len(np.unique(groups))
