"""What the law of each effect from outside the catalogue is: where it acts, on what, with or without memory.

The judge reads an answer's laws against it; nothing here is used to draw a case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """A law as it truly is; None: whatever is said of it is right."""

    kind: str
    """``output``, ``state``, or ``input``: of what drives a tire; several where the truth is of several."""
    channels: frozenset[str] | None
    forms: frozenset[str]
    variables: frozenset[str] | None
    """The signals that it depends on."""
    memory: bool | None


def _law(kind: str, channels: str, forms: str, variables: str | None, *, memory: bool | None) -> Law:
    return Law(
        kind=kind, channels=frozenset(channels.split()) or None, forms=frozenset(forms.split()),
        variables=None if variables is None else frozenset(variables.split()), memory=memory,
    )  # fmt: skip


LAWS: dict[tuple[str, str], Law] = {
    **{
        (family, name): law
        for family in ("tire-machine", "tire-python", "tire-columns")
        for name, law in {
            "hidden_ambient": _law("output input", "FY MZ friction", "static", "T_AMBIENT", memory=False),
            "hidden_resonance": _law("output", "FY", "mode", None, memory=True),
            "hidden_line": _law("output", "FY", "tone", "t", memory=False),
            "hidden_pulse": _law("output", "FY", "event", "t", memory=False),
        }.items()
    },
    # The cells share the force: each shows it.
    ("tire-cells", "hidden_ambient"): _law("output input", "", "static", "T_AMBIENT", memory=False),
    ("tire-cells", "hidden_line"): _law("output", "", "tone", "t", memory=False),
    ("tire-cells", "hidden_pulse"): _law("output", "", "event", "t", memory=False),
    ("pendulum", "hidden_resonance"): _law("state", "om", "mode", None, memory=True),
    ("pendulum", "hidden_gust"): _law("state", "om", "event", "t", memory=False),
    ("drive", "hidden_resonance"): _law("state", "v", "mode", None, memory=True),
    ("drive", "hidden_gust"): _law("state", "v", "event", "t", memory=False),
    # The position is not recorded: no variable of it can be said.
    ("drive-force", "hidden_detent"): _law("output", "F", "static loop", None, memory=None),
    ("tank", "hidden_hatch"): _law("state", "h", "event", "t", memory=False),
    ("thermal", "hidden_radiation"): _law("state", "T1 T3", "static", "T1 T3", memory=False),
    ("thermal", "hidden_mass"): _law("state", "T2", "mode", None, memory=True),
    **{
        (family, name): law
        for family in ("beam-python", "beam-columns")
        for name, law in {
            "hidden_ambient": _law("output", "S", "static", "T", memory=False),
            "hidden_slip": _law("output", "S", "event", "t", memory=False),
        }.items()
    },
}
"""By family and effect. The zeros that a program takes anew in every file have no law."""


def judged_law(sealed: dict[str, Any], answer: dict[str, Any]) -> dict[str, bool] | None:
    """Return whether a law was learned, and whether its place, its variables and its memory are right.

    None where no law is asked for, or the answer was kept before laws were. Of several laws that one counts
    which is right in most.
    """
    if sealed["bucket"] != "outside" or "laws" not in answer:
        return None
    true = LAWS.get((sealed["family"], sealed["effects"][0]["name"]))
    if true is None:
        return None
    judged = [_held(true, law) for law in answer["laws"]]
    none = {"learned": False, "place": False, "variables": False, "memory": False}
    return max(judged, key=lambda row: sum(row.values()), default=none)


def _held(true: Law, law: dict[str, Any]) -> dict[str, bool]:
    place = law.get("place") or {}
    # The answer's word for the time is `time`, whatever its column is called.
    variables = frozenset("t" if name == "time" else name for name in law.get("variables") or ())
    channels = true.channels
    form = str(law.get("form"))
    # An event and a tone are of the time whether it is said or not.
    said = variables | ({"t"} if form in ("event", "tone") else frozenset())
    return {
        "learned": True,
        "place": place.get("kind") in true.kind.split()
        and (channels is None or place.get("channel") in channels),
        "variables": form in true.forms and (true.variables is None or said == true.variables),
        "memory": true.memory is None
        or true.memory == (law.get("memory_s") is not None or form in ("mode", "loop")),
    }
