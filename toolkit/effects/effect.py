"""Effect: what one piece of physics is, says and does, as one file of the catalogue declares it.

An effect acts in one of three ways, and belongs to one stage:

* ``drive``: it changes what the tire is driven by, or how the tire answers (carriage, road, tire);
* ``channel``: it changes one channel after the physics (load cells, acquisition);
* ``term``: it enters an equation of motion (dynamics).

Hooks are pure functions of signals and of the effect's parameters in their own units. What simulation,
diagnosis and correction have to know of an effect beside its hooks is declared with it, as a number, a word
or a small function of its `Surroundings`: none of them knows an effect by its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from toolkit.channels import Axes, signs
from toolkit.effects.facts import Alike, ChannelFacts, Correctable, History, Term, Values

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Drive, Setting, Tire
    from toolkit.effects.surroundings import Scale, Surroundings

Stage = Literal["acquisition", "load_cells", "carriage", "tire", "road", "dynamics"]
STAGES: tuple[Stage, ...] = ("road", "carriage", "tire", "load_cells", "acquisition", "dynamics")
"""In the order in which effects act."""

DriveHook = Callable[["Drive", Values, "Setting", "Tire"], "Drive"]
ChannelHook = Callable[["Array", Values, "Setting"], "Array"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """One parameter: name, unit, what it means, where it is usually found.

    ``unit`` may name the affected channel: ``{channel}`` and ``{from}`` are put in by the user of the
    effect, ``{force}``, ``{velocity}`` and ``{position}`` for a dynamic term. ``off`` is the value at which
    the effect is not there (None: it has no such value, another parameter switches it off); ``typical`` the
    range in ``unit`` in which a search starts, taken to hold 95 % of the sizes met; with a ``scale`` it is in
    units of what that returns. ``absent`` is what a file means that does not have the parameter, None where
    every file must have it.
    ``ends_count`` says that the bounds are values like any other; elsewhere an estimate at a bound shows
    that the effect only imitates another. ``phase_of`` names the amplitude whose phase this is [deg]: the
    effect is then f(phase) = cos(phase) f(0) + sin(phase) f(90 deg).

    Of a case ask ``start_values`` (in ``unit``, in the place of ``starts``), ``most`` (an upper bound that
    the motion sets, None for none) and ``needless`` (the parameter means nothing there; the equation is then
    ``equation_without``, where it is given). ``sense`` is the channel whose sign the parameter has, and the
    axes in which the equation computes. ``words`` are values that a plan may write as a name.
    """

    name: str
    unit: str
    text: str
    typical: tuple[float, float]
    off: float | None = 0.0
    bounds: tuple[float, float] = (-float("inf"), float("inf"))
    scale: Scale | None = None
    starts: tuple[float, ...] = ()
    absent: float | None = None
    ends_count: bool = False
    phase_of: str | None = None
    start_values: Callable[[Surroundings], tuple[float, ...]] | None = None
    most: Callable[[Surroundings], float | None] | None = None
    needless: Callable[[Surroundings], bool] | None = None
    equation_without: str = ""
    sense: tuple[str, Axes] | None = None
    words: Callable[[], Mapping[str, float]] | None = None

    @property
    def relative(self) -> bool:
        """Typical values and starts are in units of the scale."""
        return self.scale is not None

    def log_density(self, ratio: float) -> float:
        """Return the logarithm of the density with which sizes are met, over the logarithm of the size.

        Parameters
        ----------
        ratio : the value in units of the scale, as ``typical`` has it

        Of a range on one side of ``off`` the logarithm of the size is normal, and of one around it the
        departure from ``off``; the range is two standard deviations to either side. Over a logarithm, sizes
        of any unit can be held against each other.

        >>> gap = EffectParameter(name="gap", unit="deg", text="play", typical=(0.05, 0.5))
        >>> round(gap.log_density(0.5) - gap.log_density(0.05 * 10**0.5), 9)
        -2.0
        """
        low, high = self.typical
        around = self.off is not None and low < self.off < high
        size = abs(ratio - (self.off or 0.0)) if around else abs(ratio)
        if size == 0 or not math.isfinite(size):
            return -math.inf
        if around:
            sds = 4 * size / (high - low)
            return math.log(2 * sds) - 0.5 * (sds**2 + math.log(2 * math.pi))
        sd = abs(math.log(high / low)) / 4
        sds = math.log(size / math.sqrt(low * high)) / sd
        return -0.5 * (sds**2 + math.log(2 * math.pi)) - math.log(sd)

    def sign_in(self, axes: Axes) -> int:
        """Return the factor, +1 or -1, between the parameter in some axes and in those of its equation.

        An equation is read with the channels of whoever states it: ``alpha = SA - offset`` says in every axis
        system that an offset of +0.3 deg is a recorded slip angle 0.3 deg too large. Without a ``sense`` the
        parameter is the same in all axes.
        """
        return 1 if self.sense is None else signs(self.sense[1], axes)[self.sense[0]]

    def sign_between(self, source: Axes, target: Axes) -> int:
        """Return the factor, +1 or -1, that carries the parameter from one axis system to another."""
        return 1 if self.sense is None else signs(source, target)[self.sense[0]]


ANY_OTHER = "*"
_CONDITIONS = ("rotation", "mounting", "phase", "surface", "pressure", "date", "order", "repeat_of")


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One effect of the catalogue.

    ``rank`` is its place within its stage in lists. ``in_time`` says that time passes in it: rows without
    time tell nothing of it. ``any_of`` are channels of which one is needed; ``confined_by`` the conditions of
    a run by which the effect may be confined to some runs, `ANY_OTHER` among them for every condition to
    which the contract gives no meaning of its own.

    Of the search: a ``discrete`` effect is there or not, and nothing of it is fitted; ``form_error`` is the
    share of what it does by which its law may be off, ``size_error`` that of its sizes where it is known to
    be less; ``histories`` are the pasts that shape it beside an uneventful one; ``remembers`` says that it
    has a state, which at a run's first row nobody knows (`filters.PAST` moves it); ``numerics`` are numbers
    of its computation in a case, which no fit moves; ``from_digits`` says that it is read off the recorded
    digits and not searched; ``needs_signal`` that its output must have
    most of the simulated signal in it; ``nuisance`` that it is fitted beside the effects and never named;
    ``reshapes`` that it changes the shape of an answer, as every discrete effect does (`misleads`).

    Of zeros: ``is_zero`` says that it adds one constant; ``zero_beside`` how large a constant may be that is
    only the point from which this effect starts; ``frees_zero`` that its size depends on a free constant.
    ``noise_key`` is the value by which the hook is told the sd of noise that comes before the effect.

    Of the tire: ``needs_tire`` is what its model must depend on; ``follows_command`` the channel that the
    effect makes late against its command; ``by_temperature`` says that it changes with the tread's
    temperature and so with the heat that the forces make; ``by_slip_work`` that it sums the slip work of a
    tire without it.

    Of classes and corrections: ``alike`` is the class of effects that are the same on this machine, ``akin``
    the name of a likeness that a recording may part; ``correctable`` says how a machine is corrected for it,
    ``not_correctable`` what is done instead.
    """

    name: str
    stage: Stage
    rank: int
    in_time: bool
    statement: str
    equation: str
    reference: str
    signature: str
    separates: str
    parameters: tuple[EffectParameter, ...]
    drive: DriveHook | None = None
    channel: ChannelHook | None = None
    on_channel: ChannelFacts | None = None
    term: Term | None = None
    any_of: tuple[str, ...] = ()
    confined_by: tuple[str, ...] = ()
    discrete: bool = False
    form_error: float = 0.0
    size_error: float | None = None
    histories: tuple[History, ...] = ()
    remembers: bool = False
    numerics: Callable[[Surroundings], Mapping[str, float]] | None = None
    from_digits: bool = False
    needs_signal: bool = False
    nuisance: bool = False
    reshapes: bool = False
    is_zero: bool = False
    zero_beside: Callable[[Values], float] | None = None
    frees_zero: bool = False
    noise_key: str | None = None
    needs_tire: Literal["camber", "pressure"] | None = None
    follows_command: str | None = None
    by_temperature: bool = False
    by_slip_work: bool = False
    alike: Alike | None = None
    akin: str = ""
    correctable: Correctable | None = None
    not_correctable: str = ""

    def confining(self, conditions: Iterable[str]) -> tuple[str, ...]:
        """Return those of some conditions' names by which the effect may be confined to some runs."""
        present = dict.fromkeys(conditions)
        further = (key for key in present if key not in _CONDITIONS) if ANY_OTHER in self.confined_by else ()
        return (*(key for key in self.confined_by if key in present), *further)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in their order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def second(self) -> str | None:
        """What it takes beside its channel: ``with``, ``from`` or ``record``, None where nothing."""
        return None if self.on_channel is None else self.on_channel.second

    @property
    def exchanges(self) -> bool:
        """Two channels take each other's values."""
        return self.second == "with"

    @property
    def replaces_record(self) -> bool:
        """It computes with another calibration record than the named one."""
        return self.second == "record"

    @property
    def reads_between_rows(self) -> bool:
        """It shows what a channel did between two rows."""
        return self.on_channel is not None and self.on_channel.between_rows

    @property
    def misleads(self) -> bool:
        """Parameters refitted without it may have gone where it no longer helps."""
        return self.reshapes or self.discrete

    def parameter(self, name: str) -> EffectParameter:
        """Return a parameter by its name."""
        return next(parameter for parameter in self.parameters if parameter.name == name)

    def in_case(self, case: Surroundings) -> Effect:
        """Return the effect without parameters that mean nothing in a case, bounded by its motion."""
        equation, parameters = self.equation, []
        for parameter in self.parameters:
            if parameter.needless is not None and parameter.needless(case):
                equation = parameter.equation_without or equation
                continue
            limit = None if parameter.most is None else parameter.most(case)
            parameters.append(
                parameter if limit is None else replace(parameter, bounds=(parameter.bounds[0], limit))
            )
        return replace(self, equation=equation, parameters=tuple(parameters))
