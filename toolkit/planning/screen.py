"""What of a budget hangs on the slip angles, for many designs at once: what an exchange goes by.

A reading moves with the parameters of its curves by a gradient g, and these with the conditions by J^+, so
that conditions of variances s² leave (g J^+)² s² of it (`characteristics.reading`). What the form of the
curves misses at a slip angle moves both sides and directions together: it adds up before it is squared. All
else in the budget stays as it is whatever the slip angles. The gradient is taken by moving a curve's
parameters and letting the catalogue read again: no formula of a characteristic stands here. A design that
comes out of the exchange is judged by the whole budget (`expectation`), not by this.

Derivatives hold near the curves of the earlier test. A design that leaves a curve open between its slip
angles is none: the curve of the test may go elsewhere there, and what is read off it has another U.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import ROTATIONS
from toolkit.characteristics.catalogue import by_name
from toolkit.characteristics.groups import CHANNELS, Channel, Direction, DirectionFit
from toolkit.characteristics.reading import Reader
from toolkit.planning.demands import Reach
from toolkit.planning.design import Design
from toolkit.planning.expectation import EarlierTest
from toolkit.tires.model import CurveFit
from toolkit.tires.models import model

_OWN = ("repeatability", "fit", "slip angle scatter")  # of the budget, what follows the design
_STEP = 1e-4  # of a parameter's size
_NO_DATA = 1e-8
_COVERAGE = 1.96
_POWER = 16
_OPEN = 2.0  # u of a curve at most, in that of a condition there, or of what every candidate together leaves


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Screen:
    """Demands on the curves of a list of candidate slip angles.

    ``tangents`` (curves, candidates, parameters), scaled, and ``variances`` (curves, candidates) of their
    conditions; ``forms`` (sources, curves, candidates) the standard deviations of what their form misses, one
    error at all candidates of one of ``places`` (candidates,); ``own`` (readings, curves, candidates) marks
    where a reading is the tire's value; ``closed`` (curves, candidates) the variances of a curve that nothing
    leaves open; ``gradients`` (readings, curves, parameters) in the scale of the tangents; ``fixed``
    (readings,) the variances that stay, ``limits`` (readings,) of the expanded uncertainty.
    """

    tangents: Array
    variances: Array
    forms: Array
    places: NDArray[np.intp]
    own: Array
    closed: Array
    gradients: Array
    fixed: Array
    limits: Array

    def ratios(self, designs: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return of designs (designs, points), candidates by their numbers, U of each reading over its limit
        (designs, readings), and how open each curve is between over what is allowed (designs, curves).
        """
        pseudo = np.asarray(np.linalg.pinv(self.tangents[:, designs], rcond=_NO_DATA), dtype=np.float64)
        weights = np.einsum("rcp,cdpn->drcn", self.gradients, pseudo)
        own = np.einsum("drcn,cdn->dr", weights**2, self.variances[:, designs])
        missed = weights - np.moveaxis(self.own[:, :, designs], 2, 0)
        missed = np.einsum("drcn,scdn->drsn", missed, self.forms[:, :, designs])
        places = self.places[designs]
        own += np.einsum("drsn,dnm,drsm->dr", missed, places[:, :, None] == places[:, None], missed)
        curves = _between(self.tangents, pseudo, self.variances[:, designs]) / self.closed
        return _COVERAGE * np.sqrt(self.fixed + own) / self.limits, np.sqrt(curves.max(axis=2)) / _OPEN


def _between(tangents: Array, pseudo: Array, variances: Array) -> Array:
    """Return the variances of curves at every candidate (designs, curves, candidates)."""
    between = tangents[:, None] @ pseudo  # (curves, designs, candidates, points)
    return np.asarray(np.einsum("cdkn,cdn->dck", between**2, variances))


def criterion(screens: Sequence[Screen], designs: NDArray[np.intp]) -> Array:
    """Return the largest ratio (designs,) of all screens, where many are alike a little more."""
    ratios = np.concatenate([part for screen in screens for part in screen.ratios(designs)], axis=1)
    # By a power of two, which is exact: the powers of a demand far below what can be had are too large.
    scale = np.frexp(ratios.max(axis=1))[1]
    scaled = np.ldexp(ratios, -scale[:, None])
    return np.asarray(np.ldexp(np.sum(scaled**_POWER, axis=1) ** (1 / _POWER), scale))


def openness(screens: Sequence[Screen], design: Sequence[int]) -> float:
    """Return how open the least known curve of a design is, over what is allowed: at most 1 serves."""
    at = np.array([list(design)])
    return float(max(screen.ratios(at)[1].max() for screen in screens))


def screen_of(earlier: EarlierTest, full: Design, reaches: Sequence[Reach]) -> Screen:
    """Return the screen of demands.

    Parameters
    ----------
    full : the design of every candidate slip angle, ascending, once
    reaches : what it reaches of each demand at each load, by the whole budget
    """
    directions, scatter = earlier.foreseen(full)
    places: dict[tuple[float, str, str], int] = {}
    tangents, variances, scales, forms = [], [], [], []
    for direction in directions:
        for channel in CHANNELS:
            fit = _fit(direction, channel)
            places[direction.group.load_N, direction.group.rotation, channel] = len(places)
            jacobian = model(fit.model).jacobian(fit.values, direction.group.SA).T
            free = np.array([parameter.name not in fit.at_bound for parameter in fit.parameters])
            size = np.linalg.norm(jacobian, axis=0) * free
            scale = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
            tangents.append(jacobian * scale)
            scales.append(scale)
            variances.append(direction.group.own_u(channel) ** 2 + scatter.each(direction, channel))
            forms.append(scatter.forms(direction, channel))
    gradients = np.zeros((len(reaches), len(tangents), len(scales[0])))
    read = np.zeros((len(reaches), len(tangents), len(full.slip_angles_rad)))
    for row, reach in enumerate(reaches):
        demand = reach.demand
        for curve, gradient in _gradients(
            earlier, full.slip_angles_rad, demand.characteristic, reach.load_N, reach.rotation, reach.SA_rad
        ):
            gradients[row, places[curve]] = gradient * scales[places[curve]]
        if reach.SA_rad is not None:
            at_load = earlier.curves[reach.load_N, "forward"].fit.load_N
            curve = at_load, reach.rotation, by_name()[demand.characteristic].channel
            read[row, places[curve]] = np.isclose(np.sort(full.slip_angles_rad), reach.SA_rad)
    fixed = [sum(u * u for source, u in reach.sources if source not in _OWN) for reach in reaches]
    every, own = np.array(tangents), np.array(variances)
    pseudo = np.asarray(np.linalg.pinv(every, rcond=_NO_DATA), dtype=np.float64)
    return Screen(
        tangents=every,
        variances=own,
        forms=np.stack(forms, axis=1),
        places=np.unique(np.abs(np.round(full.slip_angles_rad, 9)), return_inverse=True)[1].ravel(),
        own=read,
        closed=np.maximum(own, _between(every, pseudo[:, None], own[:, None])[0]),
        gradients=gradients,
        fixed=np.array(fixed),
        limits=np.array([reach.limit for reach in reaches]),
    )


def _fit(direction: Direction, channel: Channel) -> CurveFit:
    fit = direction.curve(channel)
    if fit is None:  # an earlier test has none without both
        raise ValueError(f"no curve of {channel} at {direction.group.load_N:g} N")
    return fit


@functools.lru_cache(maxsize=1024)
def _gradients(
    earlier: EarlierTest,
    slip_angles_rad: tuple[float, ...],
    characteristic: str,
    load_N: float,
    rotation: str,
    SA_rad: float | None,
) -> tuple[tuple[tuple[float, str, Channel], Array], ...]:
    """Return d value / d parameters of each curve that a reading is read off, by load, rotation and channel.

    Whatever other loads a design has: what they change is how sure the conditions are, and no value.
    """
    declared = by_name()[characteristic]
    runs = declared.runs if declared.scope == "load" else (rotation,)
    design = Design(slip_angles_rad=slip_angles_rad, loads_N=(load_N,), rotations=ROTATIONS)
    directions: dict[str, Direction] = {each.group.rotation: each for each in earlier.directions(design)}
    at = () if SA_rad is None else (SA_rad,)
    # Of the value alone: what the rows share is not asked for.
    shared = replace(earlier.shared, record=None)
    still = [Reader(directions[run], shared=shared, stepped=False) for run in runs]

    def value(place: int, fit: DirectionFit) -> float:
        readers = [*still[:place], still[place].on_curves(fit), *still[place + 1 :]]
        number = declared.read(declared, *readers, *at)
        return math.nan if number is None else number.value

    found = []
    for place, reader in enumerate(still):
        direction, curves = reader.direction, reader.direction.fit
        for channel in CHANNELS:
            fit, slopes = _fit(direction, channel), []
            for i, parameter in enumerate(fit.parameters):
                step = _STEP * max(abs(parameter.value), 1e-3)
                ends = []
                for sign in (1.0, -1.0):
                    values = list(fit.parameters)
                    values[i] = replace(parameter, value=parameter.value + sign * step)
                    changed = replace(fit, parameters=tuple(values))
                    moved = replace(curves, FY=changed) if channel == "FY" else replace(curves, MZ=changed)
                    ends.append(value(place, moved))
                slopes.append((ends[0] - ends[1]) / (2 * step))
            found.append(((direction.group.load_N, direction.group.rotation, channel), np.array(slopes)))
    return tuple(found)
