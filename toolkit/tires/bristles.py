"""Follow the bristles of a tread from the leading edge to the trailing one: adhere, or slide at the limit.

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.3 (TreadSim); in SAE axes. Forces are divided by
load and lengths by half the patch, so that a tire without load is no special case: the patch runs from u = 1
to -1, a bristle has the force w (over load, per du), and the sums are FX/FZ, FY/FZ and MZ/(FZ a).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array, taken

_TOLERANCE = 1e-11  # of the carcass's slopes, rad
_ROUNDS = 25  # of Broyden's method; most states need five to ten
_PATIENCE = 75  # further damped rounds
_DAMPED = 0.15
_FEWER = 0.8  # of the cases are left: only then are they copied apart
_END = -1 / 12  # weight of the first and last middle beyond 1, by the slopes at the edges (Euler-Maclaurin)
_TINY = 1e-300
_AT_ONCE = 1500  # cases x lines, so that the bristles' arrays stay in the cache
_NUDGE = 1e-7  # rad, of the slopes to see how the forces answer


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
        return taken(self, index, last=True)


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Balance:
    """Forces in balance with the carcass: ``sums`` FX/FZ, FY/FZ, MZ/(FZ a) (3, cases).

    ``slopes`` [rad] (2, cases) of the contact line by yaw and bending, ``inverse`` (2, 2, cases) how they
    answer to what is out of balance: from both a state nearby starts. ``settled`` (cases,) is False where
    the slopes ended beside a jump of the sums, at which no balance is exact.
    """

    sums: Array
    slopes: Array
    inverse: Array
    settled: NDArray[np.bool_]

    def take(self, index: NDArray[np.intp]) -> Balance:
        """Return some of the cases."""
        return taken(self, index, last=True)


def balance(tread: Tread, sx: Array, sy: Array, *, lines: int = 1, near: Balance | None = None) -> Balance:
    """Return the forces in balance with the carcass that they turn and bend.

    The two slopes of the contact line are found by Broyden's method from the tire that adheres everywhere,
    and by damped steps where that wanders: a carcass so soft that it has several balances comes to a stable
    one.

    Parameters
    ----------
    sx, sy : (cases,) theoretical slips
    lines : lines of bristles over the width; more than one only matters with camber
    near : the balance of a state near each case, to start from; where that did not settle its slopes stand,
        for what is searched again there is another side of the same jump
    """
    parts = [
        _balance(tread.take(part), sx[part], sy[part], lines, None if near is None else near.take(part))
        for part in _parts(tread, sx, lines)
    ]
    none = Balance(
        sums=np.zeros((3, 0)), slopes=np.zeros((2, 0)), inverse=np.zeros((2, 2, 0)), settled=np.zeros(0, bool)
    )
    return Balance(
        sums=np.concatenate([none.sums, *(part.sums for part in parts)], axis=1),
        slopes=np.concatenate([none.slopes, *(part.slopes for part in parts)], axis=1),
        inverse=np.concatenate([none.inverse, *(part.inverse for part in parts)], axis=2),
        settled=np.concatenate([none.settled, *(one.settled for one in parts)]),
    )


def sharpened(tread: Tread, sx: Array, sy: Array, balance: Balance, *, lines: int = 1) -> Balance:
    """Return a balance with the ``inverse`` of differences: worth it where many states start from one."""
    inverse = balance.inverse.copy()
    for part_rows in _parts(tread, sx, lines):
        part, state = tread.take(part_rows), balance.take(part_rows)
        parts_sums = [state.sums]
        for nudge in np.eye(2) * _NUDGE:
            moved = state.slopes + nudge[:, None]
            parts_sums.append(_forces(part, sx[part_rows], sy[part_rows], moved, lines))
        back = np.stack([_slopes(part, sums) for sums in parts_sums])
        (a, c), (b, d) = np.eye(2)[:, :, None] - (back[1:] - back[0]) / _NUDGE
        det = a * d - b * c
        good = np.abs(det) > 1e-3
        sharp = np.array([[d, -b], [-c, a]]) / np.where(good, det, 1.0)
        inverse[..., part_rows] = np.where(good, sharp, state.inverse)
    return Balance(sums=balance.sums, slopes=balance.slopes, inverse=inverse, settled=balance.settled)


def _parts(tread: Tread, sx: Array, lines: int) -> list[NDArray[np.intp]]:
    most = _AT_ONCE // (1 if _plain(tread, sx) else lines)
    return [np.arange(at, min(at + most, len(sx))) for at in range(0, len(sx), most)]


def _plain(tread: Tread, sx: Array) -> bool:
    return not (np.any(sx) or np.any(tread.cone))


def _forces(tread: Tread, sx: Array, sy: Array, slopes: Array, lines: int) -> Array:
    return across(tread, sy, slopes) if _plain(tread, sx) else oblique(tread, sx, sy, slopes, lines)


def _slopes(tread: Tread, sums: Array) -> Array:
    # (2, cases) of the contact line under these forces.
    return np.stack([tread.yaw * sums[2], -tread.bend * sums[1]])


def _balance(tread: Tread, sx: Array, sy: Array, lines: int, near: Balance | None) -> Balance:
    sums, at = np.zeros((3, len(sy))), np.zeros((2, len(sy)))
    todo = np.arange(len(sy))
    slopes, inverse = (at.copy(), _adhering(tread)) if near is None else (near.slopes, near.inverse)
    answers, settled = inverse.copy(), np.ones(len(sy), dtype=np.bool_)
    searched = np.ones_like(settled) if near is None else near.settled
    last: tuple[Array, Array] | None = None
    part = tread
    for round_ in range(_ROUNDS + _PATIENCE):
        forces = _forces(part, sx, sy, slopes, lines)
        residual = _slopes(part, forces) - slopes
        if last is not None:
            inverse = _broyden(inverse, slopes - last[0], residual - last[1])
        sums[:, todo], at[:, todo], answers[..., todo] = forces, slopes, inverse
        open_ = np.abs(residual).max(axis=0) > _TOLERANCE
        settled[todo] = ~open_
        far = np.flatnonzero(open_ & searched)
        if not len(far):
            break
        if len(far) < _FEWER * len(todo):
            part, todo, sx, sy, searched = part.take(far), todo[far], sx[far], sy[far], searched[far]
            slopes, residual, inverse = slopes[:, far], residual[:, far], inverse[..., far]
        last = slopes, residual
        step = np.einsum("ijn,jn->in", inverse, residual) if round_ < _ROUNDS else _DAMPED * residual
        slopes = slopes + np.where(searched, step, 0.0)
    return Balance(sums=sums, slopes=at, inverse=answers, settled=settled)


def across(tread: Tread, sy: Array, slopes: Array) -> Array:
    """Return the sums (3, cases) of bristles that move across only: no longitudinal slip, no camber."""
    u = middles(len(tread.limit))
    step, between, weight, lever = _quadrature(u)
    level, tilt = sy - slopes[0], slopes[1] + tread.curve
    gain, lean = tread.half_C * step * level, tread.half_C * step * tilt
    limit = tread.limit / (1.0 + tread.fade * np.abs(level - tilt * u[:, None]))
    rise = gain - lean * between[:, None]
    rise[0] *= 0.5  # the first middle lies half a step behind the edge
    trial, w, least = np.empty_like(limit), np.empty_like(limit), -limit
    shear = np.zeros_like(sy)
    for wanted, kept, grows, low, high in zip(trial, w, rise, least, limit, strict=True):
        np.subtract(shear, grows, out=wanted)
        np.maximum(wanted, low, out=kept)
        np.minimum(kept, high, out=kept)
        shear = kept
    turns, edge, spare = _turns(limit - np.abs(trial))
    edge *= np.sign(trial[turns])
    total = weight @ w + _added(edge, turns, sy.shape)
    moment = lever @ w + _added(edge * between[turns[0]], turns, sy.shape)
    # The last path ends at the last middle.
    edge = _end(spare, np.abs(shear), np.abs(gain - u[-1] * lean)) * np.sign(shear)
    return np.stack([np.zeros_like(sy), total + edge, moment - edge]) * step


def oblique(tread: Tread, sx: Array, sy: Array, slopes: Array, lines: int) -> Array:
    """Return the sums (3, cases) of bristles that move along and across, in ``lines`` over the width."""
    u = middles(len(tread.limit))
    step, between, weight, lever = _quadrature(u)
    side = -middles(lines)[:, None]  # from the left of the tread to the right
    mirrored = not np.any(sx)
    if mirrored:
        # Without slip along, a line left of the middle is the image of the one right of it.
        side = side[lines // 2 :]
    level, tilt = sy - slopes[0], slopes[1] + tread.curve
    along = sx + tread.cone * side
    reach = tread.half_C * step
    gain, lean, ahead = reach * level, reach * tilt, reach * along
    rise = gain - lean * between[:, None]
    rise[0] *= 0.5
    limit = np.broadcast_to(tread.limit[:, None], (len(u), *along.shape))
    if np.any(tread.fade):
        speed = along**2 + ((level - tilt * u[:, None]) ** 2)[:, None]
        np.sqrt(speed, out=speed)
        speed *= tread.fade
        speed += 1.0
        limit = np.divide(limit, speed, out=speed)
    wx, wy, size = (np.empty(limit.shape) for _ in range(3))
    share, last_x, last_y = np.empty_like(along), np.zeros_like(along), np.zeros_like(along)
    grows_x = 0.5 * ahead
    with np.errstate(divide="ignore", invalid="ignore"):
        for x, y, long, grows, high in zip(wx, wy, size, rise, limit, strict=True):
            np.add(last_x, grows_x, out=x)
            np.subtract(last_y, grows, out=y)
            np.multiply(x, x, out=long)
            np.multiply(y, y, out=share)
            long += share
            np.sqrt(long, out=long)
            # What is beyond the limit slides back along its own deflection; none has no direction.
            np.divide(high, long, out=share)
            np.fmin(share, 1.0, out=share)
            x *= share
            y *= share
            last_x, last_y, grows_x = x, y, ahead
    turns, edge, spare = _turns(limit - size)
    edge /= np.maximum(limit[turns], _TINY)
    edge_y = edge * wy[turns]
    flat_x, flat_y = wx.reshape(len(u), -1), wy.reshape(len(u), -1)
    fx = (weight @ flat_x).reshape(along.shape) + _added(edge * wx[turns], turns, along.shape)
    fy = (weight @ flat_y).reshape(along.shape) + _added(edge_y, turns, along.shape)
    moment = (lever @ flat_y).reshape(along.shape)
    moment += _added(edge_y * between[turns[0]], turns, along.shape)
    shear = np.sqrt(last_x**2 + last_y**2)
    end = _end(spare, shear, reach * np.hypot(along, level - tilt * u[-1])) / np.maximum(shear, _TINY)
    fx += last_x * end
    fy += last_y * end
    moment -= last_y * end
    moment -= fx * side * tread.edge
    if mirrored:
        shares = np.where(side > 0, 2.0, 1.0) / lines
        return np.stack([np.zeros_like(sy), (shares * fy).sum(axis=0), (shares * moment).sum(axis=0)]) * step
    return np.stack([fx.mean(axis=0), fy.mean(axis=0), moment.mean(axis=0)]) * step


def _quadrature(u: Array) -> tuple[float, Array, Array, Array]:
    # Step, the middle of each bristle's path, and the weights of force and moment at the bristles.
    step = 2.0 / len(u)
    between = 0.5 * (np.concatenate([[u[0] + 0.5 * step], u[:-1]]) + u)
    weight, lever = np.ones(len(u)), u.copy()
    weight[0] += _END
    lever[0] += _END * between[0]
    return step, between, weight, lever


def _turns(free: Array) -> tuple[tuple[NDArray[np.intp], ...], Array, Array]:
    # Where a bristle reaches its limit between two middles, what this kink adds to their sum, and what the
    # last one has to spare. ``free`` is limit less deflection: the kink adds the triangle over the chord,
    # less the share of the change of slope that a sum of middles makes too large (Euler-Maclaurin).
    turns = np.nonzero((free[1:] < 0) & (free[:-1] > 0))
    spare, beyond = free[:-1][turns], -free[1:][turns]
    change = spare + beyond
    edge = 0.5 * spare * beyond / change - change / 12
    return (turns[0] + 1, *turns[1:]), edge, np.maximum(free[-1], 0.0)


def _added(values: Array, turns: tuple[NDArray[np.intp], ...], shape: tuple[int, ...]) -> Array:
    # Values at (bristle, ...) summed over the bristles.
    size = int(np.prod(shape))
    place = np.ravel_multi_index(turns[1:], shape)
    return np.asarray(np.bincount(place, values, size), dtype=np.float64).reshape(shape)


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
