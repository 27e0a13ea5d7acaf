"""Facts that an effect declares of itself by the way it acts: on a channel, in an equation, in a class."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.law import Formula
    from toolkit.effects.signals import Setting
    from toolkit.effects.surroundings import Surroundings

Values = Mapping[str, float]
Channels = Mapping[str, "Array"]
# (position, velocity, parameters) -> force-like term against the motion, of the arrays' shape or scalars
ForceHook = Callable[[Any, Any, Values], Any]
# (time, velocity, parameters) -> the same term along a recorded motion, of a force that has a memory
RecordedHook = Callable[["Array", "Array", Values], "Array"]
# (state, its spread, parameters) -> share of a rising rate that is left, of the arrays' shape or scalars
LimitHook = Callable[[Any, float, Values], Any]
# parameters -> size of the sliding force, and the distance over which it builds up (0: no bristle)
BristleHook = Callable[[Values], tuple[Any, Any]]
# (positions (n,), parameters of every start) -> forces (n, directions x starts), the directions in blocks
PatternHook = Callable[["Array", Sequence[Values]], "Array"]
# (shown (n,), parameters, setting) -> what the channel would show without the effect
InverseHook = Callable[["Array", Values, "Setting"], "Array"]

Where = Literal["output", "input", "cell", "program_cell", "program_load"]
"""Kinds of channels: an output; an input of a simulation; a load cell from which outputs are computed; cells
and loads of an acquisition program of which only the arithmetic is judged."""
Second = Literal["with", "from", "record"]
"""What an effect takes beside its channel: the channel it is exchanged ``with``, the one that shows in it
(``from``), or the calibration ``record`` that replaces the named one."""
Tare = Literal["alike", "own", "after"]
"""How a tare reading has the effect: by the same equation (``alike``), by its own state at that time
(``own``), or not at all because the effect came ``after`` the tare."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelFacts:
    """What is declared of an effect on a channel.

    ``where`` are the kinds of channels that a search puts it on; ``usual`` is the one that a plan means where
    it names none (None: every load cell). ``by_value`` says that it follows the channel's own value: put
    into a channel that was recorded disturbed, it must not follow that channel's noise. ``about_zero`` says
    that it depends on where the channel has its zero, which is then the recording's first value where the
    scale has a zero by convention alone. ``directed`` says that it concerns a direction, which a
    channel with such a zero does not have.
    ``between_rows`` says that it shows what happened between two rows. ``proportion`` says that it is one
    factor of the channel, and what has to be added to its parameter to give it. ``image`` are the ends of
    what the channel can show whatever is simulated: a recording beyond them refutes the effect. ``inverse``
    takes it away exactly; without it, a fixed point does.
    """

    where: tuple[Where, ...]
    tare: Tare
    by_value: bool
    second: Second | None = None
    about_zero: bool = False
    directed: bool = False
    usual: str | None = None
    between_rows: bool = False
    proportion: float | None = None
    image: tuple[float, float] | None = None
    inverse: InverseHook | None = None

    @property
    def paired(self) -> bool:
        """It joins two channels."""
        return self.second in ("with", "from")


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A term of an equation of motion, and what is declared of it.

    ``of`` is what it depends on. ``law`` is a term of any states, inputs and the time.
    ``on_place`` says of a term of the position that it may also enter the
    equation of a state that is a place itself. ``drives`` says that it is told as it stands in the equation
    of its own output, and not as a resistance. ``spill`` names the parameter that says which share of what a
    limit holds back arrives in the one other state that this state feeds. ``shares`` are those of its usual
    size at which the response of an integrated motion is taken: a motion answers a small force in proportion;
    one that is as large as it may ever be has another phase, or comes to rest.
    """

    of: Literal["nothing", "velocity", "position", "state"]
    force: ForceHook | None = None
    law: Formula | None = None
    recorded: RecordedHook | None = None
    limit: LimitHook | None = None
    bristle: BristleHook | None = None
    pattern: PatternHook | None = None
    on_place: bool = False
    drives: bool = False
    spill: str | None = None
    shares: tuple[float, ...] = (1.0, 0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """What may have been before the first row: values that shape the effect, and the words for them."""

    values: Mapping[str, float]
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike:
    """Membership of a class whose effects do the same on this machine whatever is recorded.

    ``holds`` says whether that is so at a place. ``size`` turns a value of the first parameter into that of
    the member that a machine can be corrected for (value, nominal load [N] or None; None where it cannot),
    which is then in ``size_unit`` (None: the parameter's own) at ``place`` (channel, source).
    """

    group: str
    holds: Callable[[Surroundings], bool]
    size: Callable[[float, float | None], float | None] | None = None
    size_unit: str | None = None
    place: tuple[str | None, str | None] = (None, None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Correctable:
    """How a machine is corrected for the effect, by its first parameter alone.

    ``unit`` is that of the value with which ``undo`` computes, ``{channel}`` and ``{from}`` put in; ``undo``
    takes the effect out of rows in machine axes and SI: (channels as corrected so far, channels as recorded,
    value, channel, source) to the channel that changes and its new values. ``u_slip`` is the standard
    uncertainty [rad] of the slip angle that one of the value leaves at the largest moment [N·m] of a test;
    None where none is left. ``channels`` and ``sources`` are those between which it is corrected, none for an
    effect of the whole machine.
    """

    unit: str
    undo: Callable[[Channels, Channels, float, str | None, str | None], tuple[str, Array]]
    u_slip: Callable[[float, float], float] | None = None
    channels: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()


def everywhere(_: Surroundings) -> bool:
    """Hold at every place."""
    return True


def mounted_one_way(case: Surroundings) -> bool:
    """Hold where no run has the tire turned round on the hub."""
    return "turned" not in case.conditions("mounting")
