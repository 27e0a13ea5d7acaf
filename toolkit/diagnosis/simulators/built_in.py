"""Effects that a simulation has from the start: those of a model file, and of a corrected machine.

Their parameters are parameters of the simulation like any other: free within their standard errors, refitted
with the rest, and told before and after. What a search finds comes on top of them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.parameter_units import channel_unit, unit_of
from toolkit.diagnosis.simulators.simulator import Capability, Following, Model
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import ITSELF, is_law
from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.simulation.plan_file import CaseParameter
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.following import Followed
    from toolkit.diagnosis.simulators.simulator import LedAlong, Parameters
    from toolkit.effects.effect import Effect
    from toolkit.simulation.model_file import FittedEffect


@dataclass(frozen=True, slots=True, kw_only=True)
class _Told:
    """One parameter of an effect: the simulation's name for it, and the factor to the hook's own value."""

    name: str
    parameter: str
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _BuiltIn:
    """One effect with the names under which its parameters stand among those of the simulation."""

    active: AppliedEffect
    told: tuple[_Told, ...]

    def at(self, p: Mapping[str, float]) -> AppliedEffect:
        """Return the effect with its values of these parameters."""
        values = {parameter.parameter: p[parameter.name] * parameter.factor for parameter in self.told}
        return dataclasses.replace(self.active, values={**self.active.values, **values})


class WithEffects:
    """A simulation with the effects of its own case in it, in every question that is asked of it.

    Raises
    ------
    ConfigError
        ``model-place``: an effect acts on what this case does not have, or in another dimension
    """

    def __init__(self, case: Case, plain: Model) -> None:
        self._plain = plain
        self._own = {parameter.name for parameter in plain.parameters}
        pairs = [
            _built(case, plain, effect, names)
            for effect, names in zip(case.effects, parameter_names(case.effects), strict=True)
        ]
        self._effects = [effect for effect, _ in pairs]
        self.outputs = plain.outputs
        self.parameters = (*plain.parameters, *(parameter for _, free in pairs for parameter in free))
        self.capability = self._wrapped(plain.capability)

    def _wrapped(self, plain: Capability) -> Capability:
        repeats, together, motion = plain.repeats, plain.together, plain.motion
        if repeats is not None:
            plain = dataclasses.replace(plain, repeats=lambda run, p: repeats(run, self._parameters(p)))
        if together is not None:
            plain = dataclasses.replace(
                plain,
                together=lambda runs, sets: together(
                    runs, [(self._parameters(p), self._all(p, active)) for p, active in sets]
                ),
            )
        if motion is not None:
            pushed = motion.pushed
            motion = dataclasses.replace(
                motion,
                pushed=lambda run, p, active, channel, pattern: pushed(
                    run, self._parameters(p), self._all(p, active), channel, pattern
                ),
                followed=None if motion.followed is None else self._following(motion.followed),
            )
        return dataclasses.replace(plain, motion=motion)

    def _following(self, plain: LedAlong) -> LedAlong:
        """Return how the equation is led along its recording with the effects in it.

        Their own parameters are as they stand: prediction errors answer to those of the simulation alone.
        """

        def followed(
            runs: Sequence[Run], p: Parameters, active: Sequence[AppliedEffect], asked: Following
        ) -> tuple[Followed, Array]:
            own = [name in self._own for name in asked.steps]
            steps = {name: step for name, step in asked.steps.items() if name in self._own}
            made, of_own = plain(
                runs, self._parameters(p), self._all(p, active), dataclasses.replace(asked, steps=steps)
            )
            answers = np.zeros((*of_own.shape[:2], len(own)))
            answers[:, :, own] = of_own
            return made, answers

        return followed

    def _parameters(self, p: Mapping[str, float]) -> dict[str, float]:
        return {name: value for name, value in p.items() if name in self._own}

    def _all(self, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> tuple[AppliedEffect, ...]:
        return (*(effect.at(p) for effect in self._effects), *active)

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output."""
        return self._plain.observed(run)

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> Arrays:
        """Return every output of a run, the simulation's own effects before those that are added."""
        return self._plain.simulate(run, self._parameters(p), self._all(p, active))

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return where a further effect could act."""
        # Steps on steps of the same size are no second effect, and the recording would name them again.
        stepped = {
            one.active.channel
            for one in self._effects
            if effect.from_digits and one.active.effect.name == effect.name
        }
        return [place for place in self._plain.places(effect) if place[0] not in stepped]


def parameter_names(effects: Sequence[FittedEffect]) -> tuple[tuple[str, ...], ...]:
    """Return the names of each effect's parameters among those of the simulation, all different.

    Those of a second effect at one place are counted: ``NAME.CHANNEL#2.PARAMETER``.
    """
    counts: dict[str, int] = {}
    names = []
    for effect in effects:
        label = effect.applied.key.dotted
        counts[label] = counts.get(label, 0) + 1
        label += f"#{counts[label]}" if counts[label] > 1 else ""
        names.append(tuple(f"{label}.{name}" for name in effect.applied.effect.names))
    return tuple(names)


def _built(
    case: Case, model: Model, one: FittedEffect, names: Sequence[str]
) -> tuple[_BuiltIn, list[CaseParameter]]:
    applied, effect = one.applied, one.applied.effect
    if (applied.channel, applied.source) not in [tuple(place) for place in model.places(effect)]:
        raise ConfigError(
            "the simulation has no place for an effect of its model", where=case.path, got=one.label,
            expected="a case with the channels on which the model's effects act",
            next_step="use the model with recordings of the same channels and roles", rule="model-place",
        )  # fmt: skip
    runs = {run.name for run in (*case.runs, *case.predict)}
    acting = frozenset(run.name for run in (*case.runs, *case.predict) if applied.acts_in(run))
    active = dataclasses.replace(
        applied,
        runs=None if acting == runs else acting,
        condition=None,
        values=applied.numerics,
        units=applied.units if is_law(effect.name) else {},
    )
    _check_unit(case, model, applied)
    stated, free = [], []
    for name, parameter in zip(names, effect.parameters, strict=True):
        sense = parameter.sign_in(one.axes or case.axes)
        low, high = (sense * bound for bound in parameter.bounds)
        text = applied.units[parameter.name]
        scale = _scale(case, model, active, parameter.name, text)
        sd = one.standard_errors.get(parameter.name) if active.searched else None
        free.append(
            CaseParameter(
                name=name,
                value=applied.values[parameter.name],
                unit=text,
                sd=sd,
                bounds=(min(low, high) / scale, max(low, high) / scale),
            )
        )
        stated.append(_Told(name=name, parameter=parameter.name, factor=sense * scale))
    return _BuiltIn(active=active, told=tuple(stated)), free


def _check_unit(case: Case, model: Model, applied: AppliedEffect) -> None:
    """Refuse a law on a channel that is in another unit than the one that it was learned of."""
    learned = applied.values.get(f"factor {ITSELF}")
    if learned is None:
        return
    text = channel_unit(case, model, applied.channel)
    if abs(unit(text).factor - learned) > 1e-12 * abs(learned):
        raise ConfigError(
            "a law of the model was learned of a channel in another unit",
            where=f"{case.path}: {applied.channel}", got=text,
            expected=f"a unit of {learned:g} in SI, as in the model's own case",
            next_step="give the channel in the unit that it had there", rule="model-place",
        )  # fmt: skip


def _scale(case: Case, model: Model, active: AppliedEffect, name: str, text: str) -> float:
    """Return the factor from a parameter's unit to that of the same parameter in this case."""
    case_unit = unit_of(case, model, active, name)
    if case_unit == text:
        return 1.0
    file_unit, expected = unit(text), unit(case_unit)
    if file_unit.dimension != expected.dimension:
        raise ConfigError(
            "a parameter of the model does not fit the case's units",
            where=f"{case.path}: {active.effect.name}.{name}", got=text, expected=case_unit,
            next_step="give the channel the dimension that it had when the model was fitted",
            rule="model-place",
        )  # fmt: skip
    return file_unit.factor / expected.factor


def built_in_findings(case: Case) -> tuple[Finding, ...]:
    """Return notes on the effects that the simulation has from the start."""
    findings = []
    for effect in case.effects:
        runs = [run.name for run in case.runs if effect.applied.acts_in(run)]
        where = "all runs" if len(runs) == len(case.runs) else ", ".join(runs) or "none of the case's runs"
        findings.append(
            Finding(
                rule="case-model",
                where=effect.origin or case.path.name,
                level="note",
                message="the simulation has an effect of an earlier answer in it: "
                f"{effect.label}, in {where}",
            )
        )
    return tuple(findings)
