"""Classes of effects that a recording cannot tell apart, and the measurement that would."""

from __future__ import annotations

from dataclasses import replace

from toolkit.diagnosis.answer.answer import FoundEffect
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.forward_step import Step
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects as catalogue


def equivalent_to(problem: Problem, step: Step) -> tuple[str, ...]:
    """Return the other names that explain a step as well, without the step's own."""
    names = [one.active.effect.name for one in step.rivals if one.difference > -VERDICT.close]
    names += _always(problem, step.active)
    own = step.active.effect.name
    return tuple(dict.fromkeys(name for name in names if name != own))


def apart(found: FoundEffect) -> str:
    """Return the measurements that would tell an effect from its class, and of which names each speaks."""
    told: dict[str, list[str]] = {}
    for name in (found.name, *found.equivalent_to):
        told.setdefault(catalogue()[name].separates, []).append(name)
    return "; ".join(f"{text} ({', '.join(names)})" for text, names in told.items() if text)


def parted(found: FoundEffect) -> str:
    """Return the sentence that says what would tell an effect from its class, or from what is like it."""
    others = found.equivalent_to or _akin(found.name)
    if not others:
        return ""
    return f"To tell {found.name} from {', '.join(others)}: {apart(replace(found, equivalent_to=others))}."


def _akin(name: str) -> tuple[str, ...]:
    """Return the other effects for which one may always be taken, however the recording parts them."""
    akin = catalogue()[name].akin
    return tuple(
        effect.name for effect in catalogue().values() if akin and effect.akin == akin and effect.name != name
    )


def _always(problem: Problem, active: AppliedEffect) -> list[str]:
    """Return the class that holds on this machine whatever the recording, the tire's effects first."""
    alike = active.effect.alike
    if alike is None or not alike.holds(CaseView(problem, active.channel, active.source)):
        return []
    members = [
        effect.name
        for effect in catalogue().values()
        if effect.alike is not None and effect.alike.group == alike.group
    ]
    return members[::-1]
