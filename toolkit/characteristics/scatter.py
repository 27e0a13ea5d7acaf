"""How conditions scatter about the curves of a test: ten variances, by restricted likelihood.

The rows of a block say how sure their own mean is, and no more: a drum's run-out that the filter delays, a
load that creeps, a steering that comes to rest elsewhere are the same in every row of the block. They differ
from block to block, and that is seen about the curves. The error of a condition i beyond that of its rows is

    channel:  a          load of the block:  dy/dFZ_i b          slip angle of the block:  dy/dSA_i c

with a for FY and for MZ, and b and c that move both channels of a block together. What goes with the rest of
the steering, a zero of the channels that moves from file to file and where the angle comes to rest, is the
same at all loads of the rest: a further a for FY and for MZ, and a further c. What the form of the curves
misses at a slip angle is the same at all loads and in both directions, but for its size, which goes with what
is left about the curves of the load, and but for its sign at the slip angle's other side: a tire answers both
sides alike, its pull apart. That is a last a for FY and for MZ, and a last c: a brush bends elsewhere than a
Magic Formula, in both. Without them a moment that no Magic Formula follows passes for rests at slip angles
that are wrong in just those ways that the curve of FY takes up, and conicity for ten times as unsure as it
is; they cancel in what is read at zero slip, and add up in a slope. The variances are those of the largest
restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545) of the residuals of all curves at
once, by scoring with non-negative variances; a single curve has seven degrees of freedom and its own variance
says little. At zero slip FY hardly follows the load, and an error of the load is not taken for one of
conicity. Degrees of freedom are Satterthwaite's, from the information on the variances: of what all loads of
a rest share, the residuals of further loads say little that is new.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import ROTATIONS
from toolkit.characteristics.groups import CHANNELS, Channel, Direction
from toolkit.reduction.common_load import at_one_angle, slopes
from toolkit.tires.evaluate import slope_at, value_at
from toolkit.tires.models import model

_SOURCES = 10
# Sources that are errors of a channel; the others are of load and slip angle.
_CHANNEL = (0, 1, 4, 5, 7, 8)
# Those that all loads of a rest share, and that all loads and both directions share at a slip angle; the
# others are of single blocks.
_OF_REST = (4, 5, 6)
_OF_FORM = (7, 8, 9)
_ENOUGH = 24  # residual freedoms from which on the variances of load and slip angle are told apart
_STEPS, _SETTLED = 60, 1e-6
_ON_CURVE = 1e-9  # of max|y|
_FLOOR = 1e-24  # of max|y|^2: rounding of conditions without noise
# Singular values of the scaled derivatives below this part of the largest are directions without data.
_NO_DATA = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """What one direction's conditions are moved by: (sources, conditions) for each channel.

    Sources: FY, MZ [1], the load of a block [N/N, N·m/N], its slip angle [N/rad, N·m/rad]; then FY, MZ and
    the slip angle of a rest; then what the form of FY and MZ misses at a slip angle, 1 or -1 by its side at
    the load where most is left. ``rests`` and ``places`` (conditions,) number the rest and the size of the
    slip angle of each condition within the test.
    """

    by_channel: Mapping[Channel, Array]
    rests: NDArray[np.intp]
    places: NDArray[np.intp]

    def errors(self, source: int) -> NDArray[np.intp]:
        """Return which of a source's errors moves each condition: its block's, its rest's or its angle's."""
        if source in _OF_FORM:
            return self.places
        return self.rests if source in _OF_REST else np.arange(len(self.rests))


@dataclass(frozen=True, slots=True, kw_only=True)
class FormError:
    """Signed share in a value [its unit] of what the form of the curves misses at a slip angle."""

    source: int
    place: int
    share: float
    dof: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """Variances (10,) of the sources of `Sensitivity` and their covariance (10, 10).

    Units are N², N²m², N², rad², then N², N²m², rad² twice. ``directions`` has the sensitivities of
    each direction by its load and rotation.
    """

    variances: Array
    covariance: Array
    directions: Mapping[tuple[float, str], Sensitivity]

    @property
    def variances_u(self) -> Array:
        """Standard uncertainties of the variances (10,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    def of(self, direction: Direction, weights: Mapping[Channel, Array]) -> tuple[float, float]:
        """Return u and degrees of freedom of a weighted sum of a direction's conditions, without `form`."""
        squares = self._squares(direction, weights)
        squares[list(_OF_FORM)] = 0.0
        variance = float(squares @ self.variances)
        if variance <= 0:
            return 0.0, np.inf
        spread = float(squares @ self.covariance @ squares)  # the variance of the variance
        return float(np.sqrt(variance)), max(2 * variance**2 / spread, 1.0) if spread > 0 else np.inf

    def form(
        self, direction: Direction, weights: Mapping[Channel, Array], at: tuple[Channel, float] | None = None
    ) -> Iterator[FormError]:
        """Yield what the form of the curves misses at each slip angle: shares of a weighted sum of
        conditions.

        ``at`` is a channel and the slip angle [rad] at which its curve is read: what the form misses there is
        in the tire, and its want in the curve. It is that of the nearest step, and within the innermost steps
        as much less as it is nearer to zero, where an error that changes its sign is none.
        """
        sensitivity = self.directions[direction.group.load_N, direction.group.rotation]
        for source in _OF_FORM:
            variance = float(self.variances[source])
            if variance <= 0:
                continue
            spread = float(self.covariance[source, source])
            dof = max(2 * variance**2 / spread, 1.0) if spread > 0 else np.inf
            moved = np.sum([w * sensitivity.by_channel[c][source] for c, w in weights.items()], axis=0)
            if at is not None:
                nearest = int(np.argmin(np.abs(direction.group.SA - at[1])))
                step = direction.group.conditions[nearest].step_SA
                share = min(at[1] / step, 1.0) if step else 1.0
                moved[nearest] -= share * sensitivity.by_channel[at[0]][source, nearest]
            shares = np.bincount(sensitivity.places, moved) * np.sqrt(variance)
            for place in np.unique(sensitivity.places).tolist():
                yield FormError(source=source, place=place, share=float(shares[place]), dof=dof)

    def each(self, direction: Direction, channel: Channel) -> Array:
        """Return the variance of each condition of a direction as it was measured (conditions,)."""
        sensitivity = self.directions[direction.group.load_N, direction.group.rotation]
        first = _OF_FORM[0]  # what the form of a curve misses is no error of what was measured
        return np.asarray(self.variances[:first] @ sensitivity.by_channel[channel][:first] ** 2)

    def forms(self, direction: Direction, channel: Channel) -> Array:
        """Return what `form` moves each condition by, in standard deviations (sources, conditions)."""
        sensitivity = self.directions[direction.group.load_N, direction.group.rotation]
        sizes = np.sqrt(self.variances[list(_OF_FORM)])
        return np.asarray(sizes[:, None] * sensitivity.by_channel[channel][list(_OF_FORM)])

    def _squares(self, direction: Direction, weights: Mapping[Channel, Array]) -> Array:
        # What one error moves, in both channels, adds before it is squared.
        sensitivity = self.directions[direction.group.load_N, direction.group.rotation]
        moved = np.sum([sensitivity.by_channel[channel] * w for channel, w in weights.items()], axis=0)
        return np.array([
            np.sum(np.bincount(sensitivity.errors(source), row) ** 2) for source, row in enumerate(moved)
        ])  # fmt: skip


def of_one_block(variances: Array) -> Array:
    """Return the variances of FY [N²], MZ [N²m²], load [N²] and slip angle [rad²] of one block (4,)."""
    of_rest = np.array(
        [variances[4] + variances[7], variances[5] + variances[8], 0.0, variances[6] + variances[9]]
    )
    return np.asarray(variances[:4] + of_rest)


def weights_of(direction: Direction, channel: Channel) -> Array:
    """Return d parameter / d condition (6, conditions) of a direction's curve: J^+ of its free parameters."""
    fit = direction.curve(channel)
    if fit is None:
        raise ValueError(f"there is no curve of {channel} to weigh conditions by")
    jacobian = model(fit.model).jacobian(fit.values, direction.group.SA)
    free = np.array([p.name not in fit.at_bound for p in fit.parameters])
    size = np.linalg.norm(jacobian, axis=1) * free
    scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    pseudo = np.linalg.pinv((jacobian * scale[:, None]).T, rcond=_NO_DATA)
    return np.asarray(scale[:, None] * pseudo)


def scatter_of(
    directions: Sequence[Direction],
    *,
    beside: Sequence[Sequence[Direction]] = (),
    expected: Array | None = None,
) -> Scatter:
    """Return the scatter of the conditions of a test about all its curves.

    Parameters
    ----------
    beside : directions of further tests of the same tire, which tell of the same variances
    expected : variances of the sources (10,) of a test that is yet to be made: what it will say of them, on
        average, in place of what the residuals say
    """
    sensitivities = _sensitivities(directions)
    scale = _scale(directions, sensitivities)
    curves = [
        _Residuals.of(mine, of_test, scale)
        for test, of_test in (
            (directions, sensitivities),
            *((other, _sensitivities(other)) for other in beside),
        )
        for rotation in ROTATIONS
        if (mine := [d for d in test if d.group.rotation == rotation and (d.fit.FY or d.fit.MZ)])
    ]
    if expected is not None:
        curves = [curve.expecting(expected / scale**2) for curve in curves]
    freedoms = sum(len(curve.rows) for curve in curves)
    conditions = [c for d in directions for c in sensitivities[d.group.load_N, d.group.rotation].rests]
    shared = len(set(conditions)) < len(conditions)
    free = np.array([
        (shared or source not in (*_OF_REST, *_OF_FORM)) and (source in _CHANNEL or freedoms >= _ENOUGH)
        and any(float(np.trace(curve.parts[source])) > _SETTLED * len(curve.rows) for curve in curves)
        for source in range(_SOURCES)
    ])  # fmt: skip
    variances, covariance = _restricted(curves, free)
    # What the form misses is the same in both directions and all tests of a tire: none tells it anew.
    again = np.where(np.isin(np.arange(_SOURCES), _OF_FORM), np.sqrt(len(curves)), 1.0)
    covariance = covariance * np.outer(again, again)
    return Scatter(
        variances=variances * scale**2,
        covariance=covariance * np.outer(scale**2, scale**2),
        directions=sensitivities,
    )


def _sensitivities(directions: Sequence[Direction]) -> dict[tuple[float, str], Sensitivity]:
    every = [
        (direction, place) for direction in directions for place in range(len(direction.group.conditions))
    ]
    groups = at_one_angle([direction.group.conditions[place] for direction, place in every])
    by_load: dict[Channel, dict[tuple[int, int], float]] = {channel: {} for channel in CHANNELS}
    rest: dict[tuple[int, int], int] = {}
    for number, members in enumerate(groups):
        pairs = [every[index] for index in members]
        rest |= {(id(direction), place): number for direction, place in pairs}
        FZ = np.array([direction.group.conditions[place].FZ for direction, place in pairs])
        for channel in CHANNELS:
            y = np.array([direction.group.values(channel)[place] for direction, place in pairs])
            for (direction, place), load, value, slope in zip(pairs, FZ, y, slopes(FZ, y), strict=True):
                steep = value / load if slope is None else slope.value
                by_load[channel][id(direction), place] = float(steep)
    missed = _missed(directions)
    steps: dict[Hashable, int] = {}
    sensitivities: dict[tuple[float, str], Sensitivity] = {}
    for direction in directions:
        SA = direction.group.SA
        stated = [condition.step_SA for condition in direction.group.conditions]
        sides = np.array([1.0 if step is None else np.sign(step) for step in stated])
        rows: dict[Channel, Array] = {}
        for index, channel in enumerate(CHANNELS):
            fit = direction.curve(channel)
            moved = np.zeros((_SOURCES, len(SA)))
            moved[index] = moved[4 + index] = 1.0
            moved[7 + index] = missed[channel, direction.group.load_N] * sides
            moved[2] = [by_load[channel][id(direction), place] for place in range(len(SA))]
            moved[3] = moved[6] = 0.0 if fit is None else slope_at(fit, SA)
            moved[9] = moved[6] * sides
            rows[channel] = moved
        sensitivities[direction.group.load_N, direction.group.rotation] = Sensitivity(
            by_channel=rows,
            rests=np.array([rest[id(direction), place] for place in range(len(SA))]),
            places=np.array([
                steps.setdefault((id(direction), place) if step is None else round(abs(step), 9), len(steps))
                for place, step in enumerate(stated)
            ]),
        )  # fmt: skip
    return sensitivities


def _missed(directions: Sequence[Direction]) -> dict[tuple[Channel, float], float]:
    # What is left of the conditions about the curves of a load, of the load where most is left. Where all
    # lie on their curves, in a test that is yet to be made, it goes with their size.
    squares: dict[tuple[Channel, float], list[float]] = {}
    for direction in directions:
        for channel in CHANNELS:
            fit = direction.curve(channel)
            y = direction.group.values(channel)
            left = (_ON_CURVE * float(np.max(np.abs(y)))) ** 2
            if fit is not None:
                residual = y - value_at(fit, direction.group.SA)
                left += float(residual @ residual) / max(len(residual) - len(fit.parameters), 1)
            squares.setdefault((channel, direction.group.load_N), []).append(left)
    size = {key: float(np.sqrt(np.mean(values))) for key, values in squares.items()}
    most = {
        c: max((v for (channel, _), v in size.items() if channel == c), default=0.0) or 1.0 for c in CHANNELS
    }
    return {key: value / most[key[0]] for key, value in size.items()}


def _largest(directions: Sequence[Direction]) -> dict[Channel, float]:
    return {
        c: max((float(np.max(np.abs(direction.group.values(c)))) for direction in directions), default=1.0)
        or 1.0
        for c in CHANNELS
    }


def _scale(directions: Sequence[Direction], sensitivities: Mapping[tuple[float, str], Sensitivity]) -> Array:
    # What each source is measured in, so that all are of one size: max|y| of the channels, and what of load
    # and slip angle moves FY by as much.
    size = list(_largest(directions).values())
    steep = [
        max(
            (float(np.max(np.abs(source.by_channel["FY"][k]))) for source in sensitivities.values()),
            default=0.0,
        )
        for k in (2, 3)
    ]
    load, angle = (size[0] / slope if slope else 1.0 for slope in steep)
    return np.array([*size, load, angle, *size, angle, *size, angle])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Residuals:
    # Of one rotation, in the space that its curves leave: residuals (f,), what its rows and the way to the
    # common load explain (f, f), and what each source would (10, f, f); values in parts of max|y|. Of a test
    # that is yet to be made the columns of z are those of a root of the residuals' covariance.
    z: tuple[Array, ...]
    rows: Array
    parts: Array

    @classmethod
    def of(
        cls,
        directions: Sequence[Direction],
        sensitivities: Mapping[tuple[float, str], Sensitivity],
        scale: Array,
    ) -> _Residuals:
        """Project the residuals of both channels of all loads out of their curves' tangent planes."""
        from scipy.linalg import block_diag

        residuals, rows = [], []
        moved: list[list[Array]] = [[] for _ in range(_SOURCES)]  # of each curve (its freedoms, errors)
        mine = [sensitivities[d.group.load_N, d.group.rotation] for d in directions]
        errors = 1 + max(int(max(one.rests.max(), one.places.max())) for one in mine)
        blocks = sum(len(d.group.conditions) for d in directions)
        first = 0
        for direction in directions:
            SA = direction.group.SA
            sensitivity = sensitivities[direction.group.load_N, direction.group.rotation]
            for index, channel in enumerate(CHANNELS):
                fit = direction.curve(channel)
                if fit is None:
                    continue
                jacobian = model(fit.model).jacobian(fit.values, SA)
                hat = jacobian.T @ weights_of(direction, channel)
                values, vectors = np.linalg.eigh((hat + hat.T) / 2)
                space = vectors[:, values < 0.5].T
                y = direction.group.values(channel)
                residuals.append(space @ (y - value_at(fit, SA)) / scale[index])
                own = (direction.group.own_u(channel) / scale[index]) ** 2 + _FLOOR
                rows.append((space * own) @ space.T)
                for source in range(_SOURCES):
                    together = source in (*_OF_REST, *_OF_FORM)
                    number = sensitivity.errors(source) + (0 if together else first)
                    through = np.zeros((errors if together else blocks, len(space)))
                    part = sensitivity.by_channel[channel][source] * scale[source] / scale[index]
                    np.add.at(through, number, (space * part).T)
                    moved[source].append(through.T)
            first += len(SA)
        stacked = [np.vstack(curves) for curves in moved]
        parts = np.array([through @ through.T for through in stacked])
        return cls(z=(np.concatenate(residuals),), rows=block_diag(*rows), parts=parts)

    def expecting(self, variances: Array) -> _Residuals:
        """Return what the residuals are on average where the sources have these variances."""
        values, vectors = np.linalg.eigh(self.rows + np.einsum("k,kij->ij", variances, self.parts))
        return replace(self, z=tuple((vectors * np.sqrt(np.maximum(values, 0.0))).T))


def _restricted(curves: Sequence[_Residuals], free: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the variances of the largest restricted likelihood (10,) and their covariance (10, 10)."""
    from scipy.optimize import nnls

    variances, covariance = np.zeros(_SOURCES), np.zeros((_SOURCES, _SOURCES))
    places = np.flatnonzero(free)
    if not len(curves) or not len(places):
        return variances, covariance
    squares = sum(float(z @ z) for curve in curves for z in curve.z)
    total = squares / sum(len(curve.rows) for curve in curves)
    variances[places] = total / len(places)
    for _ in range(_STEPS):
        information, right = _score(curves, variances, places)
        size = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
        lower = np.linalg.cholesky(information * np.outer(size, size) + 1e-10 * np.eye(len(places)))
        update = nnls(lower.T, np.linalg.solve(lower, right * size))[0] * size
        change = np.abs(update - variances[places]).max()
        variances[places] = update
        if change <= _SETTLED * update.max():
            break
    active = np.flatnonzero(variances > 0)
    if len(active):
        information, _ = _score(curves, variances, active)
        size = 1 / np.sqrt(np.diag(information))
        unit = information * np.outer(size, size)
        covariance[np.ix_(active, active)] = np.linalg.pinv(unit, hermitian=True) * np.outer(size, size)
    return variances, covariance


def _score(curves: Sequence[_Residuals], variances: Array, places: NDArray[np.intp]) -> tuple[Array, Array]:
    # The information on the variances, and the right side whose solution is the next step of scoring.
    information, right = np.zeros((len(places), len(places))), np.zeros(len(places))
    for curve in curves:
        V = curve.rows + np.einsum("k,kij->ij", variances, curve.parts)
        inverse = np.linalg.inv(V)
        through = inverse @ curve.parts[places]
        information += 0.5 * np.einsum("kij,lji->kl", through, through)
        for z in curve.z:
            weighted = inverse @ z
            right += 0.5 * np.einsum("i,kij,j->k", weighted, curve.parts[places], weighted)
        right -= 0.5 * np.einsum("kij,ji->k", through, inverse @ curve.rows)
    return information, right
