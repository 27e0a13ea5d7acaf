"""A law without a name as an effect: what a diagnosis learned of structure that no effect explains.

Its name is its formula and how it acts, so that a model file, a worker and a fit mean the same by it:
``law adds: a*tanh([SA]/s)``. It acts on an output (``adds`` to it, ``multiplies`` it), ``scales`` what drives
a tire (its friction or its stiffness; a trail's law is one of MZ), or ``enters`` the equation of a state,
where it is taken from the state's rate. Signals are in the units of the recording: an applied law carries
the factor and zero by which its setting's SI values become those.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Literal, cast, get_args

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Term, Values
from toolkit.effects.formula import Formula, formula
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Drive, Setting, Tire


_LEAST = 0.05  # of a tire's friction or stiffness
Acts = Literal["adds", "multiplies", "enters", "scales friction", "scales stiffness"]
SCALED = {acts: acts.removeprefix("scales ") for acts in get_args(Acts) if acts.startswith("scales ")}
"""Of a law that scales a tire: the field of its `signals.Drive`."""
ITSELF = "itself"
"""The signal that is the channel or the state that a law acts on."""
POSITION = "position"
"""The signal, in an equation, of which the state that a law acts on is the rate."""
TIME = "time"
"""The signal that is the time of the run [s]."""
_NAME = re.compile(rf"law ({'|'.join(get_args(Acts))}): (.+)", re.DOTALL)
_POSITIVE = ("s", "w", "reach", "period", "tau", "frequency", "damping")


def law_name(acts: Acts, text: str) -> str:
    """Return the name of a law."""
    return f"law {acts}: {text}"


def is_law(name: str) -> bool:
    """Tell whether an effect's name is that of a law."""
    return name.startswith("law ")


def parts_of(name: str) -> tuple[Acts, Formula]:
    """Return how a law acts, and its formula.

    Raises
    ------
    ConfigError
        ``law-formula``: the name is none of a law, or its formula cannot be read
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise ConfigError(
            "a law does not say how it acts", where=name[:200], got=name[:40],
            expected=" or ".join(f"'law {acts}: ...'" for acts in get_args(Acts)),
            next_step="take the law as a diagnosis has written it", rule="law-formula",
        )  # fmt: skip
    return cast("Acts", match[1]), formula(match[2])


def conversion(name: str, factor: float, zero: float) -> dict[str, float]:
    """Return the numbers of an applied law by which a signal's SI values become the recording's."""
    return {f"factor {name}": factor, f"zero {name}": zero}


@cache
def law_effect(name: str) -> Effect:
    """Return a law as an effect; its parameters have the units that are stated where it is applied.

    Raises
    ------
    ConfigError
        ``law-formula``: its formula cannot be read, remembers where it enters an equation, or reads what it
        scales
    """
    acts, law = parts_of(name)
    refused = {"enters": not law.by_states} | dict.fromkeys(SCALED, ITSELF in law.signals)
    if refused.get(acts):
        raise ConfigError(
            f"a law cannot act so: it {acts}", where=name[:200], got=law.plain(),
            expected="a formula of states, inputs and the time, that remembers as a lag or a mode does"
            if acts == "enters"
            else "a formula of recorded channels and the time",
            next_step="take the law as a diagnosis has written it", rule="law-formula",
        )  # fmt: skip

    def added(y: Array, values: Values, setting: Setting) -> Array:
        with np.errstate(all="ignore"):  # what is no number is told by whoever simulates
            change = np.asarray(law(_signals(law, y, values, setting), values, setting.t), dtype=np.float64)
        return y * (1 + change) if acts == "multiplies" else y + change

    def scaled(drive: Drive, values: Values, setting: Setting, _: Tire) -> Drive:
        with np.errstate(all="ignore"):
            change = law(_signals(law, drive.SA, values, setting), values, setting.t)
        before = getattr(drive, SCALED[acts])
        return replace(drive, **{SCALED[acts]: before * np.maximum(1 + change, _LEAST)})

    return Effect(
        name=name,
        stage="dynamics" if acts == "enters" else "tire" if acts in SCALED else "acquisition",
        rank=99,
        in_time=law.in_time,
        statement=_STATEMENTS[acts],
        equation=_EQUATIONS[acts].format(law.plain("y_model" if acts != "enters" else "x")),
        reference="learned from the recordings of its case",
        signature="",
        separates="",
        parameters=tuple(_parameter(parameter) for parameter in law.parameters),
        drive=scaled if acts in SCALED else None,
        channel=added if acts in ("adds", "multiplies") else None,
        on_channel=ChannelFacts(where=("output",), tare="own", by_value=ITSELF in law.signals)
        if acts in ("adds", "multiplies")
        else None,
        term=Term(of="state", law=law) if acts == "enters" else None,
    )


_STATEMENTS: dict[Acts, str] = {
    "adds": "A law without a name adds to the channel.",
    "multiplies": "A law without a name multiplies the channel.",
    "enters": "A law without a name is missing in the state's equation.",
    **{acts: f"A law without a name scales the tire's {of}." for acts, of in SCALED.items()},
}
_EQUATIONS: dict[Acts, str] = {
    "adds": "y = y_model + {}", "multiplies": "y = y_model * (1 + {})", "enters": "x' = ... - ({})",
    **{acts: of + " = 1 + {}" for acts, of in SCALED.items()},
}  # fmt: skip


def _parameter(name: str) -> EffectParameter:
    """Return a parameter: an amplitude by its first letter, a, else what shapes the law."""
    amplitude = name.startswith("a")
    return EffectParameter(
        name=name, unit="", text="amplitude" if amplitude else "shape", typical=(1.0, 1.0),
        off=0.0 if amplitude else None,
        bounds=(0.0, float("inf")) if name in _POSITIVE else (-float("inf"), float("inf")),
    )  # fmt: skip


def _signals(law: Formula, y: Array, values: Values, setting: Setting) -> dict[str, Array]:
    signals = {ITSELF: y, TIME: setting.t}
    for name in law.signals:
        if name in signals:
            continue
        column = setting.channel(name)
        if column is None:
            raise ConfigError(
                "a law needs a channel that was not recorded", where=law.plain(), got="no such channel",
                expected=name, next_step="give inputs with that channel", rule="model-place",
            )  # fmt: skip
        signals[name] = (column - values.get(f"zero {name}", 0.0)) / values.get(f"factor {name}", 1.0)
    return signals
