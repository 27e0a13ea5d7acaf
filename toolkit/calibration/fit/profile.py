"""How the scatter of rows grows with the indications: a variance for every point, not for the rows alone.

What a cell scatters by grows with its own indication, so the variance of a load is taken as

    s^2 = a + sum over j of (b_j |x_j| + d_j x_j^2),   a, b_j, d_j >= 0

fitted to the squares of stated uncertainties, or of residuals, by least squares without negative parts
(Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array

_RISK = 0.01
_LEAST = 0.01  # of the root mean square: what few small residuals may make of a point
_FEWEST_ROWS = 20
_STEPS = 8
_SMALLEST = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """The variance of a row by its indications; ``least`` is the smallest that it may be."""

    names: tuple[str, ...]
    constant: float
    linear: tuple[float, ...]
    square: tuple[float, ...]
    least: float

    @classmethod
    def of(cls, columns: Mapping[str, Array], squares: Array, least: float) -> Profile:
        """Return the profile of squares (rows,) over indications (rows,)."""
        from scipy.optimize import nnls

        x = np.abs(np.column_stack(list(columns.values())))
        size = np.where(x.max(axis=0) > 0, x.max(axis=0), 1.0)
        unit = float(squares.mean()) or 1.0
        shares = x / size
        columns_of = np.column_stack([np.ones(len(x)), shares, shares**2])
        # The square of a row scatters as its variance does: rows of little scatter tell as much as others.
        parts, floor = np.zeros(0), max(least / unit, _SMALLEST)
        expected = np.ones(len(x))
        for _ in range(_STEPS):
            parts = nnls(columns_of / expected[:, None], squares / unit / expected)[0]
            expected = np.maximum(columns_of @ parts, floor)
        parts = parts * unit
        count = x.shape[1]
        return cls(
            names=tuple(columns), constant=float(parts[0]),
            linear=tuple((parts[1 : count + 1] / size).tolist()),
            square=tuple((parts[count + 1 :] / size**2).tolist()), least=least,
        )  # fmt: skip

    def at(self, columns: Mapping[str, Array]) -> Array:
        """Return the variance at indications (points,)."""
        x = np.abs(np.column_stack([columns[name] for name in self.names]))
        total = self.constant + x @ np.array(self.linear) + x**2 @ np.array(self.square)
        return np.asarray(np.maximum(total, self.least), dtype=np.float64)


def shown_profile(columns: Mapping[str, Array], residuals: Array) -> Array | None:
    """Return each row's standard deviation (rows,) where residuals show that it grows; else None."""
    profile = profile_of_residuals(columns, residuals)
    return None if profile is None else np.asarray(np.sqrt(profile.at(columns)))


def relative_profile(columns: Mapping[str, Array], residuals: Array, leverage: Array) -> Profile | None:
    """Return how the scatter of a plain fit grows, by its residual variance; None where it shows none.

    A residual has 1 - h of its row's variance (``leverage`` h, (rows,)): rows of large loads draw the
    equation to themselves, and are the ones that scatter most (MacKinnon and White, J. Econometrics 29 (1985)
    305, HC2).
    """
    remaining = np.maximum(1 - leverage, _SMALLEST)
    size = float(np.sqrt(residuals @ residuals / remaining.sum()))
    return profile_of_residuals(columns, residuals / np.sqrt(remaining) / size) if size > 0 else None


def profile_of_residuals(columns: Mapping[str, Array], residuals: Array) -> Profile | None:
    """Return how the scatter grows where residuals (rows,) show that it does; else None.

    They show it where their squares follow the indications beyond chance: n R^2 of that regression by
    chi-square (Koenker, J. Econometrics 17 (1981) 107).
    """
    from scipy.special import chdtrc

    n, count = len(residuals), len(columns)
    squares = residuals**2
    if n < _FEWEST_ROWS or not squares.any():
        return None
    x = np.column_stack(list(columns.values()))
    size = np.where(np.abs(x).max(axis=0) > 0, np.abs(x).max(axis=0), 1.0)
    q = np.linalg.qr(np.column_stack([np.ones(n), np.abs(x / size)]))[0]
    about = squares - squares.mean()
    explained = float(np.sum((q.T @ about) ** 2) / (about @ about))
    if chdtrc(count, n * explained) >= _RISK:
        return None
    return Profile.of(columns, squares, _LEAST**2 * float(squares.mean()))
