"""Effect: what one piece of physics is, says and does; results of one file in this folder.

An effect acts in one of three ways, and belongs to one stage:

* ``drive``: it changes what the tire is driven by, or how the tire answers (carriage, road, tire);
* ``channel``: it changes one channel after the physics (load cells, acquisition);
* ``force``: it is a force-like term in an equation of motion (dynamics).

All three are pure functions of signals and of the effect's parameters in their own units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Drive, Setting, Tire

Stage = Literal["acquisition", "load_cells", "carriage", "tire", "road", "dynamics"]
STAGES: tuple[Stage, ...] = ("road", "carriage", "tire", "load_cells", "acquisition", "dynamics")
Values = Mapping[str, float]

DriveHook = Callable[["Drive", Values, "Setting", "Tire"], "Drive"]
ChannelHook = Callable[["NDArray[np.float64]", Values, "Setting"], "NDArray[np.float64]"]
# (position, velocity, parameters) -> force-like term, of the arrays' shape or scalars
ForceHook = Callable[[float, float, Values], float]
# (time, velocity, parameters) -> the same term along a recorded motion, of a force that has a memory
RecordedHook = Callable[["NDArray[np.float64]", "NDArray[np.float64]", Values], "NDArray[np.float64]"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """One parameter: name, unit, what it means, where it is usually found.

    ``unit`` may name the affected channel: ``{channel}`` and ``{from}`` are put in by the user of the
    effect, ``{force}``, ``{velocity}`` and ``{position}`` for a dynamic term. ``off`` is the value at which
    the effect is not there (None: it has no such value, another parameter switches it off); ``typical`` the
    range in ``unit``, in which a search starts; where ``relative`` it is in units of the channel's spread.
    ``absent`` is what a file means that does not have the parameter, None where every file must have it.
    ``ends_count`` says that the bounds are values like any other; elsewhere an estimate at a bound shows
    that the effect only imitates another. ``phase_of`` names the amplitude whose phase this is [deg]: the
    effect is then f(phase) = cos(phase) f(0) + sin(phase) f(90 deg).
    """

    name: str
    unit: str
    text: str
    typical: tuple[float, float]
    off: float | None = 0.0
    bounds: tuple[float, float] = (-float("inf"), float("inf"))
    relative: bool = False
    starts: tuple[float, ...] = ()
    absent: float | None = None
    ends_count: bool = False
    phase_of: str | None = None


ANY_OTHER = "*"
_CONDITIONS = ("rotation", "mounting", "phase", "surface", "pressure", "date", "order", "repeat_of")


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One effect of the catalogue.

    ``needs`` are channels without which the effect cannot be told at all, ``any_of`` channels of which one
    is needed; ``confined_by`` the conditions of a run by which the effect may be confined to some runs,
    `ANY_OTHER` among them for every condition to which the contract gives no meaning of its own.
    """

    name: str
    stage: Stage
    statement: str
    equation: str
    reference: str
    signature: str
    separates: str
    parameters: tuple[EffectParameter, ...]
    drive: DriveHook | None = None
    channel: ChannelHook | None = None
    force: ForceHook | None = None
    recorded: RecordedHook | None = None
    needs: tuple[str, ...] = ()
    any_of: tuple[str, ...] = ()
    confined_by: tuple[str, ...] = ()

    def confining(self, conditions: Iterable[str]) -> tuple[str, ...]:
        """Return those of some conditions' names by which the effect may be confined to some runs."""
        given = dict.fromkeys(conditions)
        others = (one for one in given if one not in _CONDITIONS) if ANY_OTHER in self.confined_by else ()
        return (*(one for one in self.confined_by if one in given), *others)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in their order."""
        return tuple(one.name for one in self.parameters)
