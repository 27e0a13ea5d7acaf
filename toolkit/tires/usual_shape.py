"""Would rows like these determine the parameters of a curve of the usual shape? Asked apart from the error.

Whether a parameter is shown must not depend on its own error: of curves whose noise happens to sharpen the
estimate alone, three quarters of the intervals would hold the truth and not nineteen of twenty. Holding C at
the value that is usual for such a curve and fitting all else again leaves, to first order, what is
independent of the error of C; what the rows would determine there hangs on their places, on the size of the
noise and on the curve, and hardly on the error. The usual values are those of Bakker, Nyborg and Pacejka (SAE
870421, 1987): 1.30 for a lateral force, 2.40 for an aligning moment; the nearer by ratio is taken.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires.models.magic_formula import jacobian, value

if TYPE_CHECKING:
    from toolkit.tires.kernel import Array, Problems

C_USUAL = (1.30, 1.85, 2.40)
_E_STARTS = ((-0.5, 0.0, -4.0), (-0.5, 0.0, -4.0), (-2.0, 0.0, -4.0))  # of the shapes
_STEPS = 8
_C = 1  # its place among the parameters


def at_usual_shape(theta: Array, problems: Problems, low: Array, high: Array) -> Array:
    """Return the parameters (curves, 6) nearest each curve with C held at its usual value.

    Parameters
    ----------
    theta : (curves, 6) normalised parameters of the curves, which stand for their data
    problems : places and weights of the rows
    low, high : (curves, 6) bounds
    """
    shape = np.abs(np.log(theta[:, _C, None] / np.array(C_USUAL))).argmin(axis=1)
    aim = value(theta.T[..., None], problems.u)
    start = theta.copy()
    start[:, _C] = np.array(C_USUAL)[shape]
    # The slope at zero is known best: B C is kept.
    start[:, 0] *= theta[:, _C] / start[:, _C]
    start = np.clip(start, low, high)
    residual = _residual(start, aim, problems)
    cost = np.vecdot(residual, residual)
    for E in np.array(_E_STARTS)[shape].T:
        other = start.copy()
        other[:, 3] = E
        new = _residual(other, aim, problems)
        new_cost = np.vecdot(new, new)
        better = new_cost < cost
        start[better], residual[better], cost[better] = other[better], new[better], new_cost[better]
    return _descend(start, residual, cost, aim, problems, (low, high))


def _descend(
    at: Array, residual: Array, cost: Array, aim: Array, problems: Problems, box: tuple[Array, Array]
) -> Array:
    damping = np.full(len(at), 1e-3)
    for _ in range(_STEPS):
        columns: Array = np.moveaxis(jacobian(at.T[..., None], problems.u), 0, 1) * problems.sw[:, None, :]
        normal = columns @ columns.transpose(0, 2, 1)
        right = np.matvec(columns, residual)
        diagonal = np.einsum("pii->pi", normal)
        diagonal *= (1 + damping)[:, None]
        diagonal += 1e-9 * diagonal.max(axis=1)[:, None] + 1e-300
        normal[:, _C, :] = normal[:, :, _C] = 0.0
        normal[:, _C, _C], right[:, _C] = 1.0, 0.0
        scale = 1.0 / np.sqrt(np.einsum("pii->pi", normal))
        step = np.linalg.solve(normal * (scale[:, :, None] * scale[:, None, :]), (right * scale)[..., None])
        trial = np.clip(at + step[..., 0] * scale, *box)
        new = _residual(trial, aim, problems)
        new_cost = np.vecdot(new, new)
        better = new_cost < cost
        at[better], residual[better], cost[better] = trial[better], new[better], new_cost[better]
        damping = np.where(better, 0.2 * damping, 5.0 * damping)
    return at


def _residual(theta: Array, aim: Array, problems: Problems) -> Array:
    residual: Array = (aim - value(theta.T[..., None], problems.u)) * problems.sw
    return residual
