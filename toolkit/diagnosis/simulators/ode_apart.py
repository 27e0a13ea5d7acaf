"""Kind ``ode`` in a worker: whole integrations cross, never a single call of the equation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.channels import channel_places, input_places
from toolkit.diagnosis.simulators.following import Followed, following_shapes, padded
from toolkit.diagnosis.simulators.setting import known_names
from toolkit.diagnosis.simulators.simulator import (
    Capability,
    Following,
    Moving,
    Output,
    StateRange,
    TermPattern,
)
from toolkit.diagnosis.simulators.states import term_places
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect as named_effect
from toolkit.effects.catalogue import effects
from toolkit.effects.law import is_law
from toolkit.effects.surroundings import MotionSizes
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.case_code import CaseCode
    from toolkit.diagnosis.simulators.simulator import Model, Pattern
    from toolkit.effects.effect import Effect
    from toolkit.worker.serve import Handlers

    Crossing = tuple[tuple[Any, ...], ...]
    Place = tuple[str | None, str | None]

_ANSWERS = "\0answers"  # of the parameters
_MOST_ADDED = 2  # states that an effect brings along
_USABLE = "\0usable"  # one for each set that could be simulated; no channel has such a name
_SIZES = ("force", "speed", "place", "fastest", "farthest", "level")


class OdeApart:
    """The simulation of a case's equation, which is integrated in a worker."""

    def __init__(self, case: Case, code: CaseCode) -> None:
        self.case, self._code = case, code
        self.parameters = case.parameters
        self.outputs = tuple(
            Output(name=output.name, unit=output.unit, sd=output.sd) for output in case.outputs
        )
        # Asked once and at the start: what an answer needs is then there, whatever has become of the worker.
        self._places, self._motions, states = _facts_of(code.value("facts"))
        self._own = len(states)
        self._prepared: dict[Run, dict[Any, Arrays]] = {}
        self.capability = Capability(
            nominal_load_N=None,
            cells=(),
            unsure={},
            findings=(),
            averages=False,
            repeats=None,
            together=self._together,
            motion=Moving(
                integrates=True,
                sizes=lambda channel, _: self._motions[str(channel)].sizes,
                units=lambda channel: self._motions[str(channel)].units,
                way=lambda channel: self._motions[str(channel)].way,
                position=lambda channel: self._motions[str(channel)].position,
                states=states,
                pushed=self._pushed,
                followed=self._followed,
            ),
        )

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output."""
        return {
            output.name: run.columns[output.name] for output in self.outputs if output.name in run.columns
        }

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> Arrays:
        """Return every output of a free simulation over the whole run."""
        prepared = self._prepared.get(run)
        if prepared and (outputs := prepared.get(_key(p, active))) is not None:
            return outputs
        shapes = {output.name: (run.rows,) for output in self.outputs}
        return self._code.arrays("simulate", run, p, shapes, _crossing(active))

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return the states and outputs on which an effect could act."""
        if effect.term is None:
            outputs = [(output.name, output.unit) for output in self.outputs]
            drivers = [(driver.name, driver.unit) for driver in self.case.drivers]
            inputs = [(driver.name, driver.unit) for driver in self.case.drivers if driver.role == "input"]
            found = channel_places(effect, outputs, drivers, set(known_names(self.case)))
            return found + input_places(effect, inputs)
        if is_law(effect.name):
            return [(state, None) for state in term_places(self.places)]
        return self._places[effect.name]

    def _together(
        self,
        runs: Sequence[Run],
        points: Sequence[tuple[Mapping[str, float], Sequence[AppliedEffect]]],
    ) -> None:
        if all(_key(*point) in self._prepared.get(run, {}) for run in runs for point in points):
            return
        self._prepared = {run: {} for run in runs}
        sets = [(dict(p), _crossing(active)) for p, active in points]
        rows = sum(run.rows for run in runs)
        shapes: dict[str, tuple[int, ...]] = {output.name: (len(sets), rows) for output in self.outputs}
        others = [self._code.number(run) for run in runs]
        try:
            answers = self._code.arrays(
                "together", runs[0], {}, shapes | {_USABLE: (len(sets), len(runs))}, sets, others
            )
        except FitError:  # whatever it is, the same set alone raises it by name
            return
        ends = np.cumsum([run.rows for run in runs]).tolist()
        for i, (run, end) in enumerate(zip(runs, ends, strict=True)):
            for k in map(int, answers[_USABLE][:, i].nonzero()[0]):
                outputs = {
                    output.name: answers[output.name][k, end - run.rows : end] for output in self.outputs
                }
                self._prepared[run][_key(*points[k])] = outputs

    def _pushed(
        self,
        run: Run,
        p: Mapping[str, float],
        active: Sequence[AppliedEffect],
        channel: str | None,
        pattern: Pattern,
    ) -> Arrays:
        if run.rows < 2:
            return {}
        assert isinstance(pattern, TermPattern)  # noqa: S101  no other crosses
        forces = pattern(defaultdict(lambda: np.zeros(1))).shape[1]
        shapes = {output.name: (run.rows, forces) for output in self.outputs}
        terms = [(effect.name, tuple(map(dict, starts))) for effect, starts in pattern.terms]
        return self._code.arrays("pushed", run, p, shapes, _crossing(active), channel, terms)

    def _followed(
        self,
        runs: Sequence[Run],
        p: Mapping[str, float],
        active: Sequence[AppliedEffect],
        asked: Following,
    ) -> tuple[Followed, Array]:
        rows, outputs = sum(run.rows for run in runs), len(self.outputs)
        shapes = following_shapes(rows, self._own, self._own + _MOST_ADDED * len(active), outputs, len(runs))
        shapes[_ANSWERS] = (rows, outputs, len(asked.steps))
        made = self._code.arrays(
            "followed", runs[0], p, shapes, _crossing(active), [self._code.number(run) for run in runs],
            [
                dict(asked.steps), dict(asked.sensor),
                {name: list(at) for name, at in asked.unread.items()}, asked.steadier,
            ],
        )  # fmt: skip
        return Followed(**{name: made[name] for name in shapes if name != _ANSWERS}), made[_ANSWERS]


def handlers_of(case: Case, model: Model) -> Handlers:
    """Return what a worker answers of an equation."""
    from toolkit.worker.serve import Numbers

    runs = (*case.runs, *case.predict)
    together, moving = model.capability.together, model.capability.motion
    assert together is not None  # noqa: S101  of every equation
    assert moving is not None  # noqa: S101

    def facts() -> list[Any]:
        places = {
            effect.name: [list(place) for place in model.places(effect)]
            for effect in effects().values()
            if effect.term is not None
        }
        motions = {}
        for channel in {str(channel) for pairs in places.values() for channel, _ in pairs}:
            motion = moving.sizes(channel, lambda _: 1.0)
            motions[channel] = [
                [*(float(getattr(motion, name)) for name in _SIZES), float(motion.has_position)],
                list(moving.units(channel)),
                [float(length) for length in moving.way(channel)],
                moving.position(channel),
                motion.feeds,
            ]
        ranges = [
            [state.name, state.unit, list(state.quantiles), state.begins_read] for state in moving.states
        ]
        return [places, motions, ranges]

    def prepared(
        _: int,
        __: Mapping[str, float],
        sets: Sequence[tuple[dict[str, float], Crossing]],
        numbers: Sequence[int],
    ) -> Any:
        points, chosen = [(p, _crossed(active)) for p, active in sets], [runs[number] for number in numbers]
        together(chosen, points)
        ends = np.cumsum([run.rows for run in chosen]).tolist()
        answers = Numbers({output.name: np.zeros((len(sets), ends[-1])) for output in model.outputs})
        answers[_USABLE] = np.zeros((len(sets), len(chosen)))
        for k, (p, active) in enumerate(points):
            for i, (run, end) in enumerate(zip(chosen, ends, strict=True)):
                try:
                    outputs = model.simulate(run, p, active)
                except FitError:
                    continue
                for output in model.outputs:
                    answers[output.name][k, end - run.rows : end] = outputs[output.name]
                answers[_USABLE][k, i] = 1.0
        return answers

    def pushed(
        run: int, p: Mapping[str, float], active: Crossing, channel: str | None, terms: list[tuple[str, Any]]
    ) -> Any:
        pattern = TermPattern(tuple((named_effect(name), starts) for name, starts in terms))
        return Numbers(moving.pushed(runs[run], p, _crossed(active), channel, pattern))

    def followed(
        _: int, p: Mapping[str, float], active: Crossing, numbers: Sequence[int], question: Sequence[Any]
    ) -> Any:
        steps, sensor, unread, steadier = question
        rows = {name: tuple(at) for name, at in unread.items()}
        asked = Following(steps=steps, sensor=sensor, unread=rows, steadier=steadier)
        chosen = [runs[number] for number in numbers]
        assert moving.followed is not None  # noqa: S101  of every equation
        made, answers = moving.followed(chosen, p, _crossed(active), asked)
        shapes = following_shapes(
            len(made.errors),
            made.entry.shape[2],
            made.entry.shape[2] + _MOST_ADDED * len(active),
            made.errors.shape[1],
            len(chosen),
        )
        arrays = Numbers({name: padded(getattr(made, name), shape) for name, shape in shapes.items()})
        arrays[_ANSWERS] = answers
        return arrays

    return {
        "followed": followed,
        "simulate": lambda run, p, active: Numbers(model.simulate(runs[run], p, _crossed(active))),
        "together": prepared,
        "pushed": pushed,
        "facts": facts,
    }


@dataclass(frozen=True, slots=True)
class _Motion:
    """What moves at one state: sizes of its motion, units of force, velocity and position, and its ways.

    ``position`` is the state of which it is the rate.
    """

    sizes: MotionSizes
    units: tuple[str, str, str]
    way: tuple[float, float]
    position: str | None


def _facts_of(facts: Any) -> tuple[dict[str, list[Place]], dict[str, _Motion], tuple[StateRange, ...]]:
    """Return the places of every effect in an equation, the motion at each of them, and the states.

    Raises
    ------
    FitError
        the worker did not answer them: what its code left of it tells nothing
    """
    try:
        listed, moving, ranges = facts
        places: dict[str, list[Place]] = {}
        for name in (name for name, effect in effects().items() if effect.term is not None):
            places[name] = [(_text(channel), _text(source)) for channel, source in listed[name]]
        motions = {str(channel): _motion(*parts) for channel, parts in moving.items()}
        states = tuple(
            StateRange(
                name=str(name),
                unit=str(text),
                quantiles=tuple(map(float, quantiles)),
                begins_read=bool(read),
            )
            for name, text, quantiles, read in ranges
        )
        missing = {str(channel) for pairs in places.values() for channel, _ in pairs} - set(motions)
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise _unfit("places and motion of the effects") from error
    if missing:
        raise _unfit(f"motion of {', '.join(sorted(missing))}")
    return places, motions, states


def _motion(
    sizes: Sequence[float], units: Sequence[str], way: Sequence[float], rate_of: object, feeds: object
) -> _Motion:
    *numbers, has_position = map(float, sizes)
    force, velocity, position = map(str, units)
    longest, usual = map(float, way)
    return _Motion(
        sizes=MotionSizes(
            **dict(zip(_SIZES, numbers, strict=True)), has_position=bool(has_position), feeds=_text(feeds)
        ),
        units=(force, velocity, position),
        way=(longest, usual),
        position=_text(rate_of),
    )


def _text(value: object) -> str | None:
    return None if value is None else str(value)


def _crossing(active: Sequence[AppliedEffect]) -> Crossing:
    """Return effects as plain values: their functions stay where they are, and have the same names there."""
    return tuple(
        (
            applied.effect.name, applied.channel, applied.source, applied.runs, dict(applied.values),
            dict(applied.units), applied.condition,
        )
        for applied in active
    )  # fmt: skip


def _crossed(active: Crossing) -> list[AppliedEffect]:
    return [
        AppliedEffect(
            effect=named_effect(name), channel=channel, source=source, runs=runs, values=values, units=units,
            condition=condition,
        )
        for name, channel, source, runs, values, units, condition in active
    ]  # fmt: skip


def _key(p: Mapping[str, float], active: Sequence[AppliedEffect]) -> tuple[Any, ...]:
    effects = ((applied.key, tuple(applied.values.items()), applied.condition) for applied in active)
    return tuple(p.items()), tuple(effects)


def _unfit(content: str) -> FitError:
    return FitError(
        "the simulation gives no usable output", where="the worker of the equation", got=f"no {content}",
        expected="what the equation's functions give", rule="simulator",
        next_step="look at what the equation's file does beside giving rhs, outputs and initial",
    )  # fmt: skip
