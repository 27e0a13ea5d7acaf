"""Which terms the loads tell, and which only the noise of the cells (regression dilution).

An equation is solved for the load from indications that carry noise. At two or three load levels a cube is
a straight line but for the noise of the indications; the fit then answers the noise, flattens the equation at
the levels that were applied, and reads up to a fifth of full scale wrong between them while the residuals
shrink.

The indications are therefore set against clean ones, what they would be by the reference loads alone:

    x_i = b_0 + sum over loads of (b_1 load + b_2 load^2 + b_3 load^3)

so that cells with curves of their own are not taken for noisy ones. The part of a term that the other terms
do not explain is one combination of all terms, T g; the same combination of the terms formed on the clean
indications, T_clean g, is what the loads make of it, and (|T g - T_clean g| / |T g|)^2 is the share of its
squares by which the coefficient is attenuated: Fuller, Measurement Error Models (1987), 1.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.terms import INTERCEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Of the size of a term's own part. Terms that the loads do not tell lie at 1. Straight cells at enough levels
# stay below 0.01, cells of which one has a curve of 5 % below 0.1, and balances that bend by 3 % with
# products of loads, which the clean indications have not, below 0.35.
NOISE_SHARE = 0.5
_CURVE = 3
# Columns that agree to this, of unit size, are one: levels that differ by less are the same level.
_SAME = 1e-6


def noise_shares(
    terms: Sequence[str], columns: Mapping[str, NDArray[np.float64]], loads: NDArray[np.float64]
) -> dict[str, float]:
    """Return how much of the part that tells each nonlinear term is noise, as a share of its size.

    Parameters
    ----------
    terms : terms that are not dependent on these indications
    columns : indications (rows,), by name
    loads : reference loads (rows, loads)

    Notes
    -----
    Fewer loads than indications leave loads unnamed that move the cells too: nothing is judged then.
    """
    higher = [i for i, term in enumerate(terms) if term not in (*columns, INTERCEPT)]
    if not higher or loads.shape[1] < len(columns):
        return {}
    basis = build_basis(terms, columns)
    triangle = np.linalg.qr(basis.design, mode="r")
    back = np.linalg.inv(triangle)
    inverse = back @ back.T
    # Column j: the combination of terms, 1 of term j, that is at right angles to all other terms.
    apart = (inverse / np.diag(inverse))[:, higher]
    noise = (basis.design - basis.at(_clean(columns, loads))) @ apart
    size = np.linalg.norm(basis.design @ apart, axis=0)
    shares = np.linalg.norm(noise, axis=0) / size
    return {terms[i]: share for i, share in zip(higher, shares.tolist(), strict=True)}


def noise_terms(
    terms: Sequence[str], columns: Mapping[str, NDArray[np.float64]], loads: NDArray[np.float64]
) -> dict[str, float]:
    """Return terms without which the loads tell all others, the last first, each with its `noise_shares`."""
    rest, found = list(terms), {}
    while noisy := {t: s for t, s in noise_shares(rest, columns, loads).items() if s > NOISE_SHARE}:
        # The highest goes first: where it is gone the lower ones are often told.
        term, share = list(noisy.items())[-1]
        found[term] = share
        rest.remove(term)
    return found


def _clean(
    columns: Mapping[str, NDArray[np.float64]], loads: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return the indications by the reference loads alone: each cell's curve over each load."""
    rows, axes = loads.shape
    size = np.abs(loads).max(axis=0)
    scaled = loads / np.where(size > 0, size, 1.0)
    # Few rows would be followed by a curve, noise and all: they get a plane.
    highest = _CURVE if rows >= 2 * (_CURVE * axes + 1) else 1
    design = np.column_stack([np.ones(rows), *(scaled**power for power in range(1, highest + 1))])
    cells = np.array(list(columns.values())).T
    fitted = design @ np.linalg.lstsq(design, cells, rcond=_SAME)[0]
    return dict(zip(columns, fitted.T, strict=True))
