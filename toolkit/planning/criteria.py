"""D, I and G: what a design is judged by, of a covariance and of one row more by an update formula.

D is the log-determinant of the covariance of the coefficients, I the mean and G the largest variance of what
they predict at the targets. A row z adds to the information M, and by Sherman and Morrison

    (M + z z')^-1 = C - (C z)(C z)' / (1 + z' C z),   C = M^-1

so that each criterion of every candidate row costs products with C, and no matrix is inverted for it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from toolkit.arrays import Array

Criterion = Literal["D", "I", "G"]
CRITERIA: tuple[Criterion, ...] = ("D", "I", "G")


def criterion(covariance: Array, targets: Array, by: Criterion) -> float:
    """Return what a criterion asks to be small, of the covariance (wanted, wanted) of one response.

    ``targets`` (points, wanted) are rows at which the response is to be predicted.
    """
    if by == "D":
        sign, size = np.linalg.slogdet(covariance)
        return float(size) if sign > 0 else float("inf")
    variances = np.einsum("ij,jk,ik->i", targets, covariance, targets)
    return float(variances.mean() if by == "I" else variances.max())


def with_each_row(covariance: Array, rows: Array, targets: Array, by: Criterion) -> Array:
    """Return the criterion (rows,) of a design with each of some rows added.

    ``covariance`` (columns, columns) is that of all coefficients, of which the first are wanted, as many as
    ``targets`` (points, wanted) has columns; ``rows`` (rows, columns) are in the same columns.
    """
    wanted = targets.shape[1]
    moved = rows @ covariance
    scale = 1.0 + np.einsum("ij,ij->i", moved, rows)
    inner, gained = covariance[:wanted, :wanted], moved[:, :wanted]
    if by == "D":
        share = np.einsum("ij,ij->i", gained, np.linalg.solve(inner, gained.T).T) / scale
        return np.asarray(np.linalg.slogdet(inner)[1] + np.log(np.maximum(1.0 - share, 1e-300)))
    before = np.einsum("ij,jk,ik->i", targets, inner, targets)
    after = before - (gained @ targets.T) ** 2 / scale[:, None]
    return np.asarray(after.mean(axis=1) if by == "I" else after.max(axis=1))


def together(values: list[Array], by: Criterion) -> Array:
    """Return the criterion of several responses: their sum, for G the largest."""
    return np.asarray(np.max(values, axis=0) if by == "G" else np.sum(values, axis=0))
