"""Follow the bristles of a tread from the leading edge to the trailing one: adhere, or slide at the limit.

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.3 (TreadSim); in SAE axes. Forces are divided by
load and lengths by half the patch, so that a tire without load is no special case: the patch runs from u = 1
to -1, a bristle has the force w (over load, per du), and the sums are FX/FZ, FY/FZ and MZ/(FZ a).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_TOLERANCE = 1e-11  # of the carcass's slopes, rad
_ROUNDS = 25  # of Broyden's method; most states need five to ten
_PATIENCE = 75  # further damped rounds
_DAMPED = 0.15
_FEWER = 0.8  # of the cases are left: only then are they copied apart
_END = -1 / 12  # weight of the first and last middle beyond 1, by the slopes at the edges (Euler-Maclaurin)
_TINY = 1e-300
_AT_ONCE = 3000  # cases, so that a step's arrays stay in the cache


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tread:
    """The tread and carcass of (cases,) states; ``limit`` is (bristles, cases).

    ``limit`` friction times pressure at the middle of each bristle without sliding speed, over FZ/a;
    ``half_C`` half the cornering stiffness of the tread over FZ; ``fade`` divides the limit by 1 + fade slip;
    ``yaw`` [rad] and ``bend`` [rad] slopes of the contact line for MZ = FZ a and, at its ends, for FY = FZ.
    ``curve`` [rad] slope of the contact line at u = 1 by camber, ``cone`` [1] slip along at the right edge of
    the tread by camber, ``edge`` half the tread's width over a.
    """

    limit: Array
    half_C: Array
    fade: Array
    yaw: Array
    bend: Array
    curve: Array
    cone: Array
    edge: Array

    def take(self, index: NDArray[np.intp]) -> Tread:
        """Return some of the cases."""
        return Tread(
            limit=self.limit[:, index],
            half_C=self.half_C[index],
            fade=self.fade[index],
            yaw=self.yaw[index],
            bend=self.bend[index],
            curve=self.curve[index],
            cone=self.cone[index],
            edge=self.edge[index],
        )


def summed(of_middles: Array) -> Array:
    """Return the integral over u of what is 0 at both edges, from its values at the middles (first axis).

    >>> round(float(summed(1 - middles(20) ** 2)), 3)
    1.333
    """
    ends = _END * (of_middles[0] + of_middles[-1])
    return np.asarray((of_middles.sum(axis=0) + ends) * (2.0 / len(of_middles)))


def middles(bristles: int) -> Array:
    """Return the middle of each bristle, from the leading edge on.

    >>> middles(2).tolist()
    [0.5, -0.5]
    """
    return np.asarray(1.0 - (np.arange(bristles) + 0.5) * (2.0 / bristles))


def balance(tread: Tread, sx: Array, sy: Array, *, lines: int = 1) -> Array:
    """Return FX/FZ, FY/FZ, MZ/(FZ a) (3, cases) in balance with the carcass that they turn and bend.

    The two slopes of the contact line are found by Broyden's method from the tire that adheres everywhere,
    and by damped steps where that wanders: a carcass so soft that it has several balances comes to a stable
    one.

    Parameters
    ----------
    sx, sy : (cases,) theoretical slips
    lines : lines of bristles over the width; more than one only matters with camber
    """
    parts = [np.arange(at, min(at + _AT_ONCE, len(sy))) for at in range(0, len(sy), _AT_ONCE)]
    return np.concatenate(
        [np.zeros((3, 0)), *(_balance(tread.take(one), sx[one], sy[one], lines) for one in parts)], axis=1
    )


def _balance(tread: Tread, sx: Array, sy: Array, lines: int) -> Array:
    done = np.zeros((3, len(sy)))
    todo = np.arange(len(sy))
    slopes = np.zeros((2, len(sy)))
    inverse = _adhering(tread)
    last: tuple[Array, Array] | None = None
    plain = not (np.any(sx) or np.any(tread.cone))
    part = tread
    for round_ in range(_ROUNDS + _PATIENCE):
        made = across(part, sy, slopes) if plain else both(part, sx, sy, slopes, lines)
        done[:, todo] = made
        residual = np.stack([part.yaw * made[2], -part.bend * made[1]]) - slopes
        if last is not None:
            inverse = _broyden(inverse, slopes - last[0], residual - last[1])
        far = np.flatnonzero(np.abs(residual).max(axis=0) > _TOLERANCE)
        if not len(far):
            break
        if len(far) < _FEWER * len(todo):
            part, todo, sx, sy = part.take(far), todo[far], sx[far], sy[far]
            slopes, residual, inverse = slopes[:, far], residual[:, far], inverse[..., far]
        last = slopes, residual
        searching = round_ < _ROUNDS
        slopes = slopes + (np.einsum("ijn,jn->in", inverse, residual) if searching else _DAMPED * residual)
    return done


def across(tread: Tread, sy: Array, slopes: Array) -> Array:
    """Return the sums (3, cases) of bristles that move across only: no longitudinal slip, no camber."""
    u = middles(len(tread.limit))
    step = 2.0 / len(u)
    level, tilt = sy - slopes[0], slopes[1] + tread.curve
    gain, lean = tread.half_C * step * level, tread.half_C * step * tilt
    w, total, moment, spare = (np.zeros_like(sy) for _ in range(4))
    path, part = u[0] + 0.5 * step, 0.5  # the first middle lies half a step behind the edge
    for here, limit in zip(u, tread.limit, strict=True):
        between = 0.5 * (path + here)
        w = w - part * gain + (part * between) * lean
        most = limit / (1.0 + tread.fade * np.abs(level - tilt * here))
        size = np.abs(w)
        edge = _turn(spare, size - most) * np.sign(w)
        np.clip(w, -most, most, out=w)
        if part < 1.0:
            edge = edge + _END * w
        total += w + edge
        moment += w * here + edge * between
        spare, path, part = np.maximum(most - size, 0.0), here, 1.0
    edge = _end(spare, np.abs(w), np.abs(gain - path * lean)) * np.sign(w)
    total += edge
    moment -= edge
    return np.stack([np.zeros_like(sy), total, moment]) * step


def both(tread: Tread, sx: Array, sy: Array, slopes: Array, lines: int) -> Array:
    """Return the sums (3, cases) of bristles that move along and across, in ``lines`` over the width."""
    u = middles(len(tread.limit))
    step = 2.0 / len(u)
    side = -middles(lines)[:, None]  # from the left of the tread to the right
    level, tilt = sy - slopes[0], slopes[1] + tread.curve
    along = sx + tread.cone * side
    reach, path, part = tread.half_C * step, u[0] + 0.5 * step, 0.5
    wx, wy, fx, fy, moment, spare = (np.zeros_like(along) for _ in range(6))
    for here, limit in zip(u, tread.limit, strict=True):
        between = 0.5 * (path + here)
        wx = wx + part * reach * along
        wy = wy - part * reach * (level - tilt * between)
        most = limit / (1.0 + tread.fade * np.hypot(along, level - tilt * here))
        size = np.hypot(wx, wy)
        safe = np.where(size > 0, size, 1.0)
        x, y = wx / safe, wy / safe
        # What is beyond the limit slides back along its own deflection.
        held = np.minimum(size, most)
        edge = _turn(spare, size - most)
        if part < 1.0:
            edge = edge + _END * held
        wx, wy = x * held, y * held
        fx += wx + x * edge
        fy += wy + y * edge
        moment += wy * here + y * edge * between
        spare, path, part = np.maximum(most - size, 0.0), here, 1.0
    edge = _end(spare, held, reach * np.hypot(along, level - tilt * path))
    fx += x * edge
    fy += y * edge
    moment -= y * edge
    moment -= fx * side * tread.edge
    return np.stack([fx.mean(axis=0), fy.mean(axis=0), moment.mean(axis=0)]) * step


def _turn(spare: Array, excess: Array) -> Array:
    # What a kink between two middles, where the bristle reaches its limit, adds to their sum: the triangle
    # over the chord, less the share of the change of slope that a sum of middles makes too large
    # (Euler-Maclaurin with a kink).
    beyond = np.maximum(excess, 0.0)
    product, change = spare * beyond, spare + beyond
    return np.asarray((product > 0) * (0.5 * product / (change + _TINY) - change / 12))


def _end(spare: Array, w: Array, rise: Array) -> Array:
    # What the trailing edge, where the limit is 0, adds to the sum: all slides by then, or the kink comes
    # in the last half step. ``rise`` is what a bristle that adheres gains in a step.
    beyond = w + 0.5 * rise
    kink = 0.25 * spare * beyond / np.where(spare > 0, spare + beyond, 1.0) - 0.25 * w - rise / 12
    return np.where(spare > 0, kink, _END * w)


def _adhering(tread: Tread) -> Array:
    # (I - J)^-1 (2, 2, cases) of slopes -> slopes where all adheres: FY/FZ = -C (sy - yaw) + C bend/3 and
    # MZ/(FZ a) = C (sy - yaw)/3.
    C = 2 * tread.half_C
    yaw, bend = 1 + tread.yaw * C / 3, 1 + tread.bend * C / 3
    zero = np.zeros_like(C)
    return np.array([[1 / yaw, zero], [-tread.bend * C / (yaw * bend), 1 / bend]])


def _broyden(inverse: Array, moved: Array, changed: Array) -> Array:
    # The rank-one update that maps the change of the residual onto minus the move.
    image = np.einsum("ijn,jn->in", inverse, changed)
    row = np.einsum("in,ijn->jn", moved, inverse)
    below = np.einsum("jn,jn->n", row, changed)
    small = np.abs(below) <= 1e-3 * np.einsum("jn,jn->n", moved, moved)
    update = np.einsum("in,jn->ijn", -(moved + image), row) / np.where(small, 1.0, below)
    return np.asarray(np.where(small, inverse, inverse + update))
