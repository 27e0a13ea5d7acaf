"""Every effect at every place where it could act in a case, with the values from which a search starts."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.sensor_noise import quick_sd
from toolkit.diagnosis.policy import STARTS
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.effects.applied import ORIGIN, SOURCE_ORIGIN, AppliedEffect, EffectKey
from toolkit.effects.catalogue import effects
from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import lag
from toolkit.effects.signals import Drive, Setting, Tire
from toolkit.files import reads_as_number

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.effects.surroundings import Surroundings

# What imitates physics without being any: noise in the recorded slip angle, which every lag smooths away.


def _smoothed(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    del setting, tire
    tau = max(values["time_constant"], 0.0)
    forward = lag(drive.t, drive.SA, tau)
    there_and_back = lag(-drive.t[::-1], forward[::-1], tau)[::-1]
    return dataclasses.replace(drive, SA=there_and_back)


INPUT_NOISE = Effect(
    name="input_noise",
    stage="carriage",
    rank=0,
    in_time=True,
    nuisance=True,
    statement="The recorded slip angle is noisy; the wheel's own is smoother.",
    equation="SA smoothed forward and backward by one time constant",
    reference="Rauch, Tung and Striebel, AIAA J. 3 (1965)",
    signature="a gain from smoothing alone, without delay",
    separates="",
    parameters=(
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the smoothing, each way",
            typical=(0.005, 0.2),
            bounds=(0.0, 10.0),
            starts=(0.01, 0.05, 0.2),
        ),
    ),
    drive=_smoothed,
)


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
        values = dict(self.values)
        for name in dict.fromkeys(self.amplitudes):
            if name not in off:
                continue
            weights = [
                weight
                for amplitude, weight in zip(self.amplitudes, coefficients, strict=True)
                if amplitude == name
            ]
            size = self.values[name] - off[name]
            if name in self.phases:
                values[name] = off[name] + math.hypot(*weights) * size
                values[self.phases[name]] = math.degrees(math.atan2(weights[1], weights[0]))
            else:
                values[name] = off[name] + weights[0] * size
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateEffect:
    """An effect at a place, and how a search may start.

    ``zero`` is a constant beside which it is seen and fitted, where its size depends on a free one: nobody
    recorded from which temperature a drift counts.
    """

    active: AppliedEffect
    starts: tuple[Start, ...]
    zero: AppliedEffect | None = None

    def zero_beside(self, active: Sequence[AppliedEffect]) -> tuple[AppliedEffect, ...]:
        """Return its constant where none of some effects is one at its channel, else nothing."""
        there = any(each.effect.is_zero and each.channel == self.active.channel for each in active)
        return () if self.zero is None or there else (self.zero,)

    @property
    def discrete(self) -> bool:
        """It is there or not."""
        return self.active.effect.discrete

    @property
    def has_pattern(self) -> bool:
        """Its starts differ by their pattern over the position, and have linear responses."""
        return self.active.effect.term is not None and self.active.effect.term.pattern is not None

    @property
    def key(self) -> EffectKey:
        """What tells candidates apart."""
        return self.active.key

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.active.effect.name


def candidates(
    problem: Problem, *, view: Callable[[Problem, str | None, str | None], CaseView] = CaseView
) -> tuple[CandidateEffect, ...]:
    """Return every candidate of a case, scaled by how the case is seen at each place."""
    listed = []
    inputs = {driver.name for driver in problem.case.drivers}
    for effect in (*effects().values(), INPUT_NOISE):
        if effect.in_time and not problem.case.has_time:
            continue
        if effect.remembers and not problem.case.has_order:  # its way was not recorded
            continue
        subsets = (None, *_subsets(problem, effect))
        for channel, source in problem.model.places(effect):
            if is_refuted(problem, effect, channel):
                continue
            on_inputs = effect.on_channel is not None and "input" in effect.on_channel.where
            of_many = effect.discrete and effect.parameters and channel not in problem.model.capability.cells
            if on_inputs and channel in inputs and of_many:
                continue  # asked where the declared simulation is grossly wrong: `wrong_units`
            case = view(problem, channel, source)
            confined = effect.in_case(case)
            starts = _starts(case, confined)
            for runs in subsets if starts else ():
                active = AppliedEffect(effect=confined, channel=channel, source=source, runs=runs)
                listed.append(CandidateEffect(active=active, starts=starts))
    zeros = {
        candidate.active.channel: dataclasses.replace(
            candidate.active,
            values=candidate.starts[0].values | dict.fromkeys(candidate.active.effect.names, 0.0),
        )
        for candidate in listed
        if candidate.active.effect.is_zero and candidate.active.runs is None
    }
    return tuple(
        dataclasses.replace(candidate, zero=zeros.get(candidate.active.channel))
        if candidate.active.effect.frees_zero
        else candidate
        for candidate in listed
    )


def is_refuted(problem: Problem, effect: Effect, channel: str | None) -> bool:
    """Tell whether an output was recorded where an effect of it cannot show it, by more than its noise.

    However well such an effect imitates something else: by rates alone, of which an angle that begins below
    zero and was not folded has others than one that was, nothing of it would be seen.
    """
    image = None if effect.on_channel is None else effect.on_channel.image
    if image is None or channel is None or channel not in problem.observed:
        return False
    values = problem.observed[channel][problem.kept[channel]]
    noise = quick_sd(problem, problem.observed[channel], channel)
    margin = max(STARTS.beyond_sd * noise, STARTS.beyond * float(np.abs(values).max(initial=0.0)))
    beyond = (values < image[0] - margin) | (values > image[1] + margin)
    return bool(np.count_nonzero(beyond) > STARTS.beyond * len(values))


def _starts(case: Surroundings, effect: Effect) -> tuple[Start, ...]:
    of_zero = effect.term is not None and effect.term.limit is not None
    of_direction = effect.on_channel is not None and effect.on_channel.directed
    if (of_zero or of_direction) and case.origin(case.channel) is not None:
        return ()  # a level above a zero that means nothing, or a sign beside it
    if not effect.parameters:
        values = origins(case, effect)
        return (Start(values=values, directions=(values,), amplitudes=()),)
    scales = {
        parameter.name: 1.0 if parameter.scale is None else parameter.scale(case)
        for parameter in effect.parameters
    }
    extra = {
        f"_size_{parameter.name}": scales[parameter.name] * _middle(parameter)
        for parameter in effect.parameters
    }
    extra |= {} if effect.numerics is None else dict(effect.numerics(case))
    extra |= origins(case, effect)
    phases = {
        parameter.phase_of: parameter.name
        for parameter in effect.parameters
        if parameter.phase_of is not None
    }
    still = dict.fromkeys(phases.values(), 0.0)
    shapes = [
        parameter for parameter in effect.parameters if parameter.off is None and parameter.phase_of is None
    ]
    amplitudes = [parameter for parameter in effect.parameters if parameter.off is not None]
    off = {amplitude.name: float(amplitude.off or 0.0) for amplitude in amplitudes}
    starts = []
    grids = [_shape_values(case, shape, scales[shape.name]) for shape in shapes]
    pasts = ({}, *(dict(past.values) for past in effect.histories))
    for past, point in itertools.product(pasts, itertools.product(*grids)):
        fixed = dict(zip((shape.name for shape in shapes), point, strict=True)) | extra | past | still
        if len(amplitudes) == 1 and amplitudes[0].starts:
            (amplitude,) = amplitudes
            for size in _amplitudes(case, amplitude, scales[amplitude.name]):
                values = fixed | {amplitude.name: size}
                starts.append(Start(values=values, directions=(values,), amplitudes=(amplitude.name,)))
            continue
        shares = effect.term.shares if effect.term is not None and case.integrates else (1.0,)
        for share in shares:
            sizes = {
                parameter.name: share * _middle(parameter) * scales[parameter.name]
                for parameter in amplitudes
            }
            directions, names = [], []
            for amplitude in amplitudes:
                alone = fixed | off | {amplitude.name: sizes[amplitude.name]}
                for phase in (0.0, 90.0) if amplitude.name in phases else (None,):
                    directions.append(alone if phase is None else alone | {phases[amplitude.name]: phase})
                    names.append(amplitude.name)
            starts.append(
                Start(
                    values=fixed | sizes, directions=tuple(directions), amplitudes=tuple(names), phases=phases
                )
            )
    return tuple(starts)


def origins(case: Surroundings, effect: Effect) -> dict[str, float]:
    """Return from where the values of an effect's channels are counted, where not from their own zero."""
    if effect.on_channel is None or not effect.on_channel.about_zero:
        return {}
    counted = {ORIGIN: case.origin(case.channel), SOURCE_ORIGIN: case.origin(case.source)}
    return {key: origin for key, origin in counted.items() if origin is not None}


def _shape_values(case: Surroundings, shape: EffectParameter, scale: float) -> list[float]:
    """Return the values of a shape from which a search starts."""
    if shape.start_values is not None:
        return list(shape.start_values(case))
    return [value * scale for value in shape.starts or (_middle(shape),)]


def _amplitudes(case: Surroundings, amplitude: EffectParameter, scale: float) -> list[float]:
    """Return where the only amplitude of an effect starts."""
    if amplitude.start_values is not None:
        return list(amplitude.start_values(case))
    starts = amplitude.starts
    if amplitude.unit == "s":
        # Of a plant whose rows are far apart, some rows: so far off the response is no straight line.
        far = [rows * case.row_time for rows in STARTS.late]
        far = [time for time in far if time > max(map(abs, starts))]
        starts = (*starts, *far, *(-time for time in far if min(starts) < 0))
    return [value * scale for value in starts]


def _middle(parameter: EffectParameter) -> float:
    low, high = parameter.typical
    if low * high > 0:
        return math.copysign(math.sqrt(low * high), low)
    return high or low


def _subsets(problem: Problem, effect: Effect) -> list[frozenset[str]]:
    """Return the sets of runs to which the conditions may confine an effect.

    A condition that nobody here knows and that is another number in each of three or more runs (where each
    starts, its mean temperature) groups none: any one run would have a group of its own.
    """
    subsets: list[frozenset[str]] = []
    names = {run.name for run in problem.runs}
    for key in effect.confining(key for run in problem.runs for key in run.conditions):
        levels: dict[str, list[str]] = {}
        for run in problem.runs:
            if key in run.conditions:
                levels.setdefault(run.conditions[key], []).append(run.name)
        apart = key not in effect.confined_by and len(levels) == len(problem.runs) > 2
        if len(levels) < 2 or (apart and all(map(reads_as_number, levels))):
            continue
        ordered = _in_order(list(levels))
        groups: list[Sequence[str]] = [[level] for level in ordered]
        groups += [ordered[:k] for k in range(2, len(ordered))]
        for group in groups[: STARTS.subsets]:
            runs = frozenset(itertools.chain.from_iterable(levels[level] for level in group))
            if runs not in subsets and runs != names:
                subsets.append(runs)
    return subsets


def _in_order(levels: list[str]) -> list[str]:
    return sorted(levels, key=float) if all(map(reads_as_number, levels)) else sorted(levels)
