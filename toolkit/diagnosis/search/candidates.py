"""Every effect at every place where it could act in a case, with the values from which a search starts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.nuisance import INPUT_NOISE
from toolkit.diagnosis.policy import STARTS
from toolkit.diagnosis.search import ripple
from toolkit.diagnosis.simulators.forces import LEAST_REACH
from toolkit.diagnosis.simulators.parameter_units import channel_unit
from toolkit.diagnosis.simulators.simulator import DISCRETE, Active, MotionSizes
from toolkit.effects.catalogue import effects
from toolkit.effects.creep import FROM_REST
from toolkit.effects.drum_curvature import EXPONENT
from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.relaxation import WITH_LOAD
from toolkit.effects.thermal_friction import TEMPERATURES
from toolkit.effects.unit_error import factors_for
from toolkit.errors import UnitError
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.problem import Problem

# Effects in which time passes: nothing can be said of them where rows have no time.
_IN_TIME = frozenset(
    (
        "channel_delay filter_lag zero_drift creep relaxation thermal_friction wear viscoelastic_settling "
        "turn_slip load_lag input_noise"
    ).split()
)


# What tells candidates apart: name, channel, source, runs.
Key = tuple[str, str | None, str | None, frozenset[str] | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """One way to switch a candidate on: its full values, and one set of values for each direction.

    ``amplitudes`` names for each direction the parameter that is on in it; an amplitude with a phase has
    two, a quarter of a cycle apart, and ``phases`` names its phase.
    """

    values: dict[str, float]
    directions: tuple[dict[str, float], ...]
    amplitudes: tuple[str, ...]
    phases: dict[str, str] = field(default_factory=dict)

    def reached(self, coefficients: Sequence[float], off: dict[str, float]) -> dict[str, float]:
        """Return the values that a linear combination of the directions stands for.

        Parameters
        ----------
        coefficients : one for each direction
        off : of every amplitude the value at which the effect is not there, those without one left out
        """
        made = dict(self.values)
        for name in dict.fromkeys(self.amplitudes):
            if name not in off:
                continue
            own = [c for one, c in zip(self.amplitudes, coefficients, strict=True) if one == name]
            size = self.values[name] - off[name]
            if name in self.phases:
                made[name] = off[name] + math.hypot(*own) * size
                made[self.phases[name]] = math.degrees(math.atan2(own[1], own[0]))
            else:
                made[name] = off[name] + own[0] * size
        return made


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateEffect:
    """An effect at a place, and how a search may start; ``discrete`` ones are there or not."""

    active: Active
    starts: tuple[Start, ...]
    discrete: bool

    @property
    def key(self) -> Key:
        """What tells candidates apart."""
        return (self.active.effect.name, self.active.channel, self.active.source, self.active.runs)

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.active.effect.name


def candidates(problem: Problem) -> tuple[CandidateEffect, ...]:
    """Return every candidate of a case."""
    made = []
    for effect in (*effects().values(), INPUT_NOISE):
        if effect.name in _IN_TIME and not problem.case.has_time:
            continue
        for channel, source in problem.model.places(effect):
            whole = Active(effect=_as_known(problem, effect), channel=channel, source=source)
            whole = _within_reach(problem, whole)
            for runs in (None, *_subsets(problem, effect)):
                active = replace(whole, runs=runs)
                starts = _starts(problem, active)
                if starts:
                    made.append(
                        CandidateEffect(active=active, starts=starts, discrete=effect.name in DISCRETE)
                    )
    return tuple(made)


def _as_known(problem: Problem, effect: Effect) -> Effect:
    """Return an effect without the parameters that mean nothing in a case: nobody should search for them."""
    needless: set[str] = set()
    if effect.name == "load_friction" and problem.model.capability.nominal_load_N is not None:
        needless = {"reference"}  # the tire's own file states the load
        effect = replace(effect, equation="friction = 1 + sensitivity * (FZ - FZ0)/FZ0, FZ0 the nominal load")
    if effect.name == "drum_curvature" and all(one.name != "MZ" for one in problem.model.outputs):
        needless = {EXPONENT}
    if effect.name == "relaxation" and not _several_loads(problem):
        needless = {WITH_LOAD}
    if effect.name == "thermal_friction":
        recorded = {one.name for one in problem.case.drivers} & set(TEMPERATURES)
        needless = {"time_constant" if recorded else "reference"}
    return replace(effect, parameters=tuple(one for one in effect.parameters if one.name not in needless))


def _several_loads(problem: Problem) -> bool:
    loads = _values(problem, "FZ")
    return len(loads) > 0 and float(np.ptp(loads)) > STARTS.loads * float(np.abs(loads).max())


def _within_reach(problem: Problem, active: Active) -> Active:
    """Return an effect with the bounds that its motion sets.

    A bristle as long as the way itself is a spring: over a fall from rest it grows as drag does. A ripple of
    which the way sees less than two periods does not repeat: it is a stiffness, linear and cubic.
    """
    if active.effect.name == ripple.NAME:
        return _bounded(active, "period", ripple.longest(problem, active.channel))
    if active.effect.name != "coulomb_friction" or not _integrates(problem):
        return active
    sizes = _motion_sizes(problem, active)
    way = sizes.place
    if not sizes.has_position:
        longest = max((float(run.t[-1] - run.t[0]) for run in problem.runs if run.rows), default=0.0)
        way = sizes.speed * longest
    most = max(STARTS.bristle * way, sizes.speed * _row_time(problem))
    return _bounded(active, "presliding", most)


def _bounded(active: Active, name: str, most: float) -> Active:
    parameters = tuple(
        replace(one, bounds=(one.bounds[0], most)) if one.name == name else one
        for one in active.effect.parameters
    )
    return replace(active, effect=replace(active.effect, parameters=parameters))


def _starts(problem: Problem, active: Active) -> tuple[Start, ...]:
    effect = active.effect
    if not effect.parameters:
        return (Start(values={}, directions=({},), amplitudes=()),)
    scales = {one.name: _scale(problem, active, one) for one in effect.parameters}
    extra = {f"_size_{one.name}": scales[one.name] * _middle(one) for one in effect.parameters}
    extra |= _smoothing(problem, active) | _span(problem, active)
    phases = {one.phase_of: one.name for one in effect.parameters if one.phase_of is not None}
    still = dict.fromkeys(phases.values(), 0.0)
    shapes = [one for one in effect.parameters if one.off is None and one.phase_of is None]
    amplitudes = [one for one in effect.parameters if one.off is not None]
    made = []
    grids = [_tried(problem, active, one, scales[one.name]) for one in shapes]
    for before, shape in itertools.product(_histories(effect), itertools.product(*grids)):
        fixed = dict(zip((one.name for one in shapes), shape, strict=True)) | extra | before | still
        off = {one.name: float(one.off or 0.0) for one in amplitudes}
        if len(amplitudes) == 1 and amplitudes[0].starts:
            one = amplitudes[0]
            for value in _steps(problem, active, one):
                values = fixed | {one.name: value * scales[one.name]}
                made.append(Start(values=values, directions=(values,), amplitudes=(one.name,)))
            continue
        for share in _shares(problem, effect):
            sizes = {one.name: share * _middle(one) * scales[one.name] for one in amplitudes}
            directions, names = [], []
            for one in amplitudes:
                alone = fixed | off | {one.name: sizes[one.name]}
                for turned in (0.0, 90.0) if one.name in phases else (None,):
                    directions.append(alone if turned is None else alone | {phases[one.name]: turned})
                    names.append(one.name)
            made.append(
                Start(
                    values=fixed | sizes, directions=tuple(directions), amplitudes=tuple(names), phases=phases
                )
            )
    return tuple(made)


def _shares(problem: Problem, effect: Effect) -> tuple[float, ...]:
    """Return the shares of an effect's usual size at which its response is taken.

    A motion answers a small force in proportion; one that is as large as it may ever be has another phase, or
    comes to rest.
    """
    moves = _integrates(problem) and effect.stage == "dynamics"
    return (1.0, 0.1) if moves and effect.name not in (ripple.NAME, "overflow") else (1.0,)


def _tried(problem: Problem, active: Active, one: EffectParameter, scale: float) -> list[float]:
    """Return the values of a shape from which a search starts."""
    if active.effect.name == ripple.NAME and one.name == "period":
        return list(ripple.periods(problem, active.channel))
    return [value * scale for value in _grid(problem, one)]


def _grid(problem: Problem, one: EffectParameter) -> tuple[float, ...]:
    starts = one.starts or (_middle(one),)
    # The longest bristle of an equation that turns at every row is a spring.
    return starts[:2] if one.name == "presliding" and _integrates(problem) else starts


def _histories(effect: Effect) -> tuple[dict[str, float], ...]:
    """Return what may have been before the first row, where that shapes an effect."""
    return ({}, {FROM_REST: 1.0}) if effect.name == "creep" else ({},)


def _steps(problem: Problem, active: Active, one: EffectParameter) -> tuple[float, ...]:
    """Return where the only amplitude of an effect starts: a unit is taken for one of its own dimension."""
    if one.unit == "s":
        # Of a plant whose rows are far apart, some rows: so far off the response is no straight line.
        far = [rows * _row_time(problem) for rows in STARTS.late]
        far = [time for time in far if time > max(map(abs, one.starts))]
        return (*one.starts, *far, *(-time for time in far if min(one.starts) < 0))
    if active.effect.name != "unit_error":
        return one.starts
    try:
        return factors_for(unit(channel_unit(problem.case, problem.model, active.channel)).dimension)
    except UnitError:
        return factors_for(None)


def _middle(one: EffectParameter) -> float:
    low, high = one.typical
    if low * high > 0:
        return math.copysign(math.sqrt(low * high), low)
    return high or low


def _scale(problem: Problem, active: Active, one: EffectParameter) -> float:
    if not one.relative:
        return 1.0
    if active.effect.stage == "dynamics":
        return _dynamic_scale(problem, active, one)
    own = _spread(problem, active.channel)
    name = active.effect.name
    if name == "nonlinearity":
        return 1 / own if one.name == "quadratic" else 1 / own**2
    if name == "zero_drift":
        minutes = sum(float(run.t[-1] - run.t[0]) for run in problem.runs if run.rows > 1) / 60
        return 20 * own / max(minutes, 1e-9)
    if name == "thermal_drift":
        return 100 * own / max(_temperature_range(problem), 0.1)
    if name == "crosstalk":
        return own / _spread(problem, active.source)
    return own


def _dynamic_scale(problem: Problem, active: Active, one: EffectParameter) -> float:
    sizes = _motion_sizes(problem, active)
    return {
        "force": sizes.force,
        "coulomb": sizes.force,
        "amplitude": sizes.force,
        # Where it is largest, not at its spread: a cube of three of them would be another motion.
        "viscous": sizes.force / sizes.fastest,
        "drag": sizes.force / sizes.fastest**2,
        "k3": sizes.force / sizes.farthest**3,
        "period": sizes.place,
        "level": sizes.level,
        "presliding": sizes.speed * _row_time(problem),
    }[one.name]


def _row_time(problem: Problem) -> float:
    steps = np.concatenate([np.diff(run.t) for run in problem.runs if run.rows > 1] or [np.ones(1)])
    return float(np.median(steps))


def _integrates(problem: Problem) -> bool:
    """Tell whether a simulation integrates its own equation of motion."""
    moving = problem.model.capability.motion
    return moving is not None and moving.integrates


def _motion_sizes(problem: Problem, active: Active) -> MotionSizes:
    """Return the sizes of the equation that an effect enters; of nothing that moves, the channel's own."""
    moving = problem.model.capability.motion
    if moving is not None:
        return moving.sizes(active.channel, lambda name: _spread(problem, name))
    return MotionSizes(
        force=_spread(problem, active.channel), speed=1.0, place=1.0, fastest=1.0, farthest=1.0, level=1.0,
        has_position=False,
    )  # fmt: skip


def _smoothing(problem: Problem, active: Active) -> dict[str, float]:
    if active.effect.name != "coulomb_friction":
        return {}
    speed = _motion_sizes(problem, active).speed
    return {"smooth": 1e-3 * speed, LEAST_REACH: 1e-3 * speed * _row_time(problem)}


def _span(problem: Problem, active: Active) -> dict[str, float]:
    """Return half the range of a channel and its middle, over all runs: its loops have one shape."""
    if active.effect.name != "hysteresis":
        return {}
    values = _values(problem, active.channel)
    if not len(values):
        return {}
    low, high = float(values.min()), float(values.max())
    return {"_span": 0.5 * (high - low), "_middle": 0.5 * (high + low)}


def _spread(problem: Problem, name: str | None) -> float:
    if name is None:
        return 1.0
    values = np.abs(_values(problem, name))
    return float(values.max()) if len(values) and values.max() > 0 else 1.0


def _values(problem: Problem, name: str | None) -> NDArray[np.float64]:
    """Return what was recorded of a channel over all runs, nothing where it was not."""
    if name is not None and name in problem.observed:
        values = problem.observed[name]
    else:
        columns = [run.columns[str(name)] for run in problem.runs if name in run.columns]
        values = np.concatenate(columns) if columns else np.zeros(0)
    return values[np.isfinite(values)]


def _temperature_range(problem: Problem) -> float:
    for name in ("T_CELL", "T_AMBIENT", "T", "T_TREAD"):
        columns = [run.columns[name] for run in problem.runs if name in run.columns]
        if columns:
            return float(np.ptp(np.concatenate(columns)))
    return 1.0


def _subsets(problem: Problem, effect: Effect) -> list[frozenset[str]]:
    made: list[frozenset[str]] = []
    names = {run.name for run in problem.runs}
    for key in effect.confining(key for run in problem.runs for key in run.conditions):
        levels: dict[str, list[str]] = {}
        for run in problem.runs:
            if key in run.conditions:
                levels.setdefault(run.conditions[key], []).append(run.name)
        if len(levels) < 2:
            continue
        ordered = _in_order(list(levels))
        groups: list[Sequence[str]] = [[one] for one in ordered]
        groups += [ordered[:k] for k in range(2, len(ordered))]
        for group in groups[: STARTS.subsets]:
            chosen = frozenset(itertools.chain.from_iterable(levels[one] for one in group))
            if chosen not in made and chosen != names:
                made.append(chosen)
    return made


def _in_order(levels: list[str]) -> list[str]:
    try:
        return sorted(levels, key=float)
    except ValueError:
        return sorted(levels)
