"""Least squares of a model over all loads: many starts in one batch, Levenberg-Marquardt with bounds.

Every start and every perturbed copy that its Jacobian needs is one row of a single call of the model, so that
the cost of numpy's calls is shared. Steps are scaled by the parameters' sizes; a parameter at a bound
whose gradient points outward is frozen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array

Residual = Callable[["Array"], "Array"]

_STEP = 1e-6  # of a size: forward differences are then exact to six digits, more than a step needs
_FINE = 1e-4  # of a size: central differences, for a covariance
_CHUNK = 4_000_000  # numbers in one call of a model


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Box:
    """Bounds and sizes of the free parameters (p,), the number of rows and inner points a row."""

    low: Array
    high: Array
    size: Array
    cost_per_copy: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Where the starts ended: parameters ``x`` (starts, p) and ``cost`` (starts,), lowest first."""

    x: Array
    cost: Array

    def agreeing(self, tolerance: float, floor: float) -> int:
        """Return how many starts ended at the lowest cost."""
        return int(np.sum(self.cost <= self.cost[0] * (1 + tolerance) + floor))


def descend(residual: Residual, x: Array, box: Box, *, steps: int, tolerance: float = 1e-9) -> Descent:
    """Return where Levenberg-Marquardt ends from ``x`` (starts, p).

    Parameters
    ----------
    residual : parameter sets (copies, p) to residuals (copies, n), finite
    steps : at most so many; a start leaves when its steps lower the cost by less than ``tolerance`` of it
    """
    descent = descend_each(residual, x, box, steps=steps, tolerance=tolerance)
    order = np.argsort(descent.cost, kind="stable")
    return Descent(x=descent.x[order], cost=descent.cost[order])


def descend_each(
    residual: Residual,
    x: Array,
    box: Box,
    *,
    steps: int,
    tolerance: float = 1e-9,
    held: NDArray[np.bool_] | None = None,
) -> Descent:
    """Return where each start ends, in their order; ``held`` (starts, p) parameters of each stay."""
    x = np.clip(x, box.low, box.high)
    starts, count = x.shape
    if not count:
        r = _call(residual, x, box)
        return Descent(x=x, cost=np.vecdot(r, r))
    stay_put = np.zeros(x.shape, dtype=np.bool_) if held is None else held
    alive = np.arange(starts)
    damping, radius = np.full(starts, 1e-2), np.full(starts, 8.0)
    final_cost = np.full(starts, np.inf)
    settled = np.zeros(starts, dtype=np.intp)
    r, J = linearise(residual, x, box)
    cost = np.vecdot(r, r)
    for _ in range(steps):
        place = x[alive]
        gradient = np.matvec(J, r)
        frozen = ((place <= box.low) & (gradient > 0)) | ((place >= box.high) & (gradient < 0))
        frozen |= stay_put[alive]
        delta, predicted = _step(J, gradient, frozen, damping, radius)
        trial = np.clip(place + delta * box.size, box.low, box.high)
        new_r = _call(residual, trial, box)
        new = np.vecdot(new_r, new_r)
        decrease = cost - new
        better = decrease > 0
        small = (predicted <= tolerance * cost + 1e-300) | (better & (decrease <= tolerance * cost))
        settled = np.where(small, settled + 1, 0)
        gain = decrease / np.maximum(predicted, 1e-300)
        length = np.abs(delta).max(axis=1)
        radius = np.where(
            gain > 0.7, np.maximum(radius, 2.5 * length), np.where(gain < 0.2, 0.4 * length, radius)
        )
        radius = np.clip(radius, 1e-7, 30.0)
        damping = np.clip(np.where(better, 0.2 * damping, 5.0 * damping), 1e-12, 1e8)
        x[alive[better]] = trial[better]
        final_cost[alive] = np.where(better, new, cost)
        stay = (settled < 2) & (radius > 1e-7)
        if not stay.any():
            break
        moved = better & stay
        cost = np.where(better, new, cost)
        if moved.any():
            r[moved], J[moved] = linearise(residual, x[alive[moved]], box)
        alive, cost, r, J = alive[stay], cost[stay], r[stay], J[stay]
        damping, radius, settled = damping[stay], radius[stay], settled[stay]
    return Descent(x=x, cost=final_cost)


def _step(
    J: Array, gradient: Array, frozen: NDArray[np.bool_], damping: Array, radius: Array
) -> tuple[Array, Array]:
    # J (starts, p, n) is by sizes; the step too.
    free = (~frozen).astype(np.float64)
    A = (J @ J.transpose(0, 2, 1)) * (free[:, :, None] * free[:, None, :])
    g = gradient * free
    diagonal = np.einsum("spp->sp", A).copy()
    scale = diagonal + 1e-8 * diagonal.max(axis=1)[:, None] + 1e-300
    M = A.copy()
    np.einsum("spp->sp", M)[...] += damping[:, None] * scale + 1e-13 * scale + frozen * scale
    unit = 1.0 / np.sqrt(np.einsum("spp->sp", M))
    M *= unit[:, :, None] * unit[:, None, :]
    delta = -np.linalg.solve(M, (g * unit)[..., None])[..., 0] * unit * free
    length = np.abs(delta).max(axis=1)
    delta *= np.minimum(1.0, radius / np.maximum(length, 1e-300))[:, None]
    predicted = -2.0 * np.vecdot(g, delta) - np.vecdot(delta, np.matvec(A, delta))
    return delta, np.maximum(predicted, 0.0)


def linearise(residual: Residual, x: Array, box: Box, *, fine: bool = False) -> tuple[Array, Array]:
    """Return residuals (starts, n) and derivatives by the parameters over their sizes (starts, p, n)."""
    starts, p = x.shape
    h = box.size * (_FINE if fine else _STEP)
    toward = np.where(x + h > box.high, -h, h)
    eye = np.eye(p)
    ahead = x[:, None, :] + eye * toward[:, None, :]
    if fine:
        back = np.clip(x[:, None, :] - eye * toward[:, None, :], box.low, box.high)
        all_r = _call(residual, np.concatenate([x[:, None], ahead, back], axis=1).reshape(-1, p), box)
        all_r = all_r.reshape(starts, 2 * p + 1, -1)
        step = np.einsum("spp->sp", ahead - back) / box.size
        return all_r[:, 0], (all_r[:, 1 : p + 1] - all_r[:, p + 1 :]) / step[..., None]
    all_r = _call(residual, np.concatenate([x[:, None], ahead], axis=1).reshape(-1, p), box)
    all_r = all_r.reshape(starts, p + 1, -1)
    return all_r[:, 0].copy(), (all_r[:, 1:] - all_r[:, :1]) / (toward / box.size)[..., None]


def _call(residual: Residual, x: Array, box: Box) -> Array:
    at_once = max(1, _CHUNK // max(box.cost_per_copy, 1))
    if len(x) <= at_once:
        return residual(x)
    return np.concatenate([residual(x[i : i + at_once]) for i in range(0, len(x), at_once)])


def spread_starts(base: Array, box: Box, count: int, *, reach: float) -> Array:
    """Return ``count`` deterministic variations (count, p) of the starts ``base`` (k, p), within bounds.

    A Halton sequence moves every parameter by up to ``reach`` sizes about the starts in turn.
    """
    p = base.shape[1]
    moves = (
        np.stack([_van_der_corput(count, prime) for prime in _primes(p)], axis=1)
        if p
        else np.zeros((count, 0))
    )
    centre = base[np.arange(count) % len(base)]
    return np.clip(centre + (2.0 * moves - 1.0) * reach * box.size, box.low, box.high)


def _van_der_corput(count: int, base: int) -> Array:
    damping_used = np.zeros(count)
    for index in range(count):
        n, share = index + 17, 1.0  # the first terms of large bases are all small
        while n:
            share /= base
            damping_used[index] += share * (n % base)
            n //= base
    return damping_used


def _primes(count: int) -> list[int]:
    primes: list[int] = []
    n = 2
    while len(primes) < count:
        if all(n % prime for prime in primes):
            primes.append(n)
        n += 1
    return primes
