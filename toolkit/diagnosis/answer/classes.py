"""Classes of effects that a recording cannot tell apart, and the measurement that would."""

from __future__ import annotations

from dataclasses import replace

from toolkit.diagnosis.answer.answer import FoundEffect
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.simulators.simulator import Active
from toolkit.effects.catalogue import effects as catalogue

_PULL = ("conicity", "camber_offset", "crosstalk")
_ANGLE = ("plysteer", "steer_offset")
# A load that is slow to come and a tire that is slow to settle: one may always be taken for the other.
_AKIN = {"load_lag": ("viscoelastic_settling",), "viscoelastic_settling": ("load_lag",)}


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
    others = found.equivalent_to or _AKIN.get(found.name, ())
    if not others:
        return ""
    return f"To tell {found.name} from {', '.join(others)}: {apart(replace(found, equivalent_to=others))}."


def _always(problem: Problem, active: Active) -> list[str]:
    """Return the classes that hold on this machine whatever the recording."""
    name = active.effect.name
    turned = any(run.conditions.get("mounting") == "turned" for run in problem.runs)
    if name in _ANGLE:
        return list(_ANGLE)
    is_load = name == "crosstalk" and active.channel == "FY" and active.source in ("FZ", "FZ_CMD")
    if (name in ("conicity", "camber_offset") or is_load) and not turned:
        return list(_PULL)
    if name == "channel_sign" and active.channel in problem.model.capability.cells:
        return ["channel_sign", "wrong_calibration"]
    if name == "wrong_calibration":
        return ["wrong_calibration", "channel_sign"]
    return []
