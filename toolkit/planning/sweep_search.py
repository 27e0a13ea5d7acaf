"""The least sweeps in time that reach a stated uncertainty of the relaxation length.

A sweep steers the slip angle up and down at a rate, at one speed of the road. What it will say of a length
is what the fit of measured sweeps says (`characteristics.sweep_fit`) of one that is steered on the earlier
test's curve: the uncertainty by the form of the answer, and the derivative that noise is divided by. In
terms of the distance rolled both hang on the steering alone, as rate over speed; noise comes in by its
density in time. Every choice of amplitude, distance, speeds and number of cycles is looked at, and the
shortest that serves is taken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.characteristics.sweep_fit import Lag, SweepFit, forms_of
from toolkit.characteristics.sweep_length import relaxation_length
from toolkit.effects.filters import lag
from toolkit.errors import ConfigError
from toolkit.planning.demands import Demand, Reach
from toolkit.reduction.sweep import Sweep

if TYPE_CHECKING:
    from toolkit.channels import Rotation
    from toolkit.machine import Machine, Sweeping
    from toolkit.planning.expectation import EarlierTest

RELAXATION = "relaxation_length"
PRIOR_M = (0.2, 0.7)
"""Relaxation lengths of passenger tires, where the earlier test measured none."""
ROTATION: Rotation = "forward"
AMPLITUDES_RAD = (math.radians(1.0), math.radians(1.4))  # what is fitted ends at 1.5 deg
_HALVES_M = (4.0, 6.0, 9.0, 13.0)  # rolled from one end of the sweep to the other
_CYCLES = (3, 4, 6, 8, 12, 16, 24, 32, 48)
_SPEEDS = 3  # between the least and the largest that the machine and the steering rate allow
_ROW_M = 0.05
_BASIS = 2  # cycles of a predicted sweep
_CONTACT_M = 0.12  # length of a contact patch, over which a stretched string's answer is spread besides
_DOF = 40.0  # of the noise that a sweep of many rows tells, less than its ordinates


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """A sweep to either side of zero [rad], at a rate over the distance rolled [rad/m]."""

    amplitude_rad: float
    rate_rad_m: float

    @property
    def cycle_m(self) -> float:
        """The distance of a whole cycle."""
        return 4 * self.amplitude_rad / self.rate_rad_m


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepDesign:
    """One recording a speed, through all loads: so many cycles at each, one number a speed."""

    steering: Steering
    speeds_m_s: tuple[float, ...]
    cycles: tuple[int, ...]
    loads_N: tuple[float, ...]

    def seconds(self, *, between_files_s: float, to_load_s: float) -> float:
        """Return the time on the machine, from the recording before to the end."""
        return sum(
            between_files_s + len(self.loads_N) * (to_load_s + self.load_s(place))
            for place in range(len(self.speeds_m_s))
        )

    def load_s(self, place: int) -> float:
        """Return the time at each load of the recording at a speed."""
        return self.cycles[place] * self.steering.cycle_m / self.speeds_m_s[place]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepChoice:
    """A design with what it reaches of the demand, at each load on each tire, and its time [s]."""

    design: SweepDesign
    reaches: tuple[Reach, ...]
    seconds: float

    @property
    def worst(self) -> float:
        """The largest of U over what was demanded."""
        return max(reach.ratio for reach in self.reaches)

    @property
    def feasible(self) -> bool:
        """Whether the demand is met everywhere."""
        return self.worst <= 1


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    # A tire at a load, with the length that is taken for true.
    earlier: EarlierTest
    load_N: float
    length_m: float


def least_sweeps(
    tires: Sequence[EarlierTest],
    demand: Demand,
    loads_N: Sequence[float],
    *,
    machine: Machine,
    between_files_s: float,
    to_load_s: float,
    tell: Callable[[str], None] = lambda _text: None,
) -> SweepChoice:
    """Return the shortest sweeps that meet a demand, or those nearest to it where none does.

    Raises
    ------
    ConfigError
        ``plan-demand``: a demand without a size; the machine states nothing of sweeps
    """
    sweeping = sweeping_for(demand, machine)
    cases = [
        _Case(earlier=earlier, load_N=load, length_m=length)
        for earlier, load in itertools.product(tires, loads_N)
        for length in ((earlier.lengths_m[load],) if load in earlier.lengths_m else PRIOR_M)
    ]

    def seconds(design: SweepDesign) -> float:
        return design.seconds(between_files_s=between_files_s, to_load_s=to_load_s)

    steered = [
        _Steered(
            place=place, steering=steering, speed_sets=sets, cases=cases, sweeping=sweeping, demand=demand,
            seconds=seconds,
        )
        for place, steering in enumerate(_steerings())
        if (sets := tuple(_speed_sets(tuple(_speeds(steering, sweeping)), sweeping)))
    ]  # fmt: skip
    best: _Kept | None = None
    hardest = 0
    # What a sweep says of a tire takes long to foretell, and no case is served sooner with others beside it:
    # the most hopeful steering first, and of the next ones that case first which was hardest.
    for candidate in sorted(steered, key=lambda candidate: candidate.shortest((0,))[0]):
        tell(f"sweeps over {candidate.steering.cycle_m / 2:.0f} m")
        order = sorted(range(len(cases)), key=lambda at: at != hardest)
        if best is not None and any(candidate.shortest((at,))[0] > best[0] for at in order):
            continue
        nearest = candidate.shortest(range(len(cases)))
        if best is None or nearest[0] < best[0]:
            best = nearest
            hardest = int(np.argmax([reach.ratio for reach in nearest[1].reaches]))
    if best is None:
        raise ConfigError(
            "no sweep stays within what the machine can steer", where=f"machine {machine.name}, [sweeping]",
            got=f"speeds {_range(sweeping.speeds_m_s, 3.6)} km/h, steering "
            f"{_range(sweeping.steer_rates_rad_s, 180 / math.pi)} deg/s",
            expected=f"between two speeds a rate that turns {math.degrees(2 * AMPLITUDES_RAD[-1]):g} deg "
            f"within {_HALVES_M[0]:g} to {_HALVES_M[-1]:g} m",
            next_step="state the limits of the machine, or leave the relaxation length out",
            rule="plan-infeasible",
        )  # fmt: skip
    return best[1]


_Kept = tuple[tuple[float, float, int], SweepChoice]
"""A choice by what is best: that the demand is met, or how nearly, then the time, then the first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Steered:
    # A steering with the speeds at which the machine makes it, and what it says of each case once asked.
    place: int
    steering: Steering
    speed_sets: tuple[tuple[float, ...], ...]
    cases: Sequence[_Case]
    sweeping: Sweeping
    demand: Demand
    seconds: Callable[[SweepDesign], float]
    known: dict[int, tuple[SweepFit, float]] = field(default_factory=dict)

    def shortest(self, cases: Sequence[int]) -> _Kept:
        """Return the shortest design that meets the demand in some cases, or that nearest to it."""
        loads = tuple(sorted({case.load_N for case in self.cases}))
        best: _Kept | None = None
        for speeds in self.speed_sets:
            *fewer, most = itertools.product(_CYCLES, repeat=len(speeds))
            # The most cycles first. Noise falls with them: where they do not serve, no fewer do.
            for cycles in (most, *fewer):
                design = SweepDesign(steering=self.steering, speeds_m_s=speeds, cycles=cycles, loads_N=loads)
                seconds = self.seconds(design)
                if (
                    best is not None
                    and best[1].feasible
                    and seconds >= best[1].seconds
                    and cycles is not most
                ):
                    continue
                reaches = tuple(
                    _reach(self.cases[at], self._foretold(at), design, self.demand) for at in cases
                )
                judged = SweepChoice(design=design, reaches=reaches, seconds=seconds)
                key = (max(judged.worst, 1.0), seconds, self.place)
                if best is None or key < best[0]:
                    best = key, judged
                if cycles is most and not judged.feasible:
                    break
        if best is None:
            raise ValueError("a steering without speeds")  # `least_sweeps` asks none
        return best

    def _foretold(self, at: int) -> tuple[SweepFit, float]:
        if at not in self.known:
            self.known[at] = _predicted(self.cases[at], self.steering, self.sweeping)
        return self.known[at]


def sweeping_for(demand: Demand, machine: Machine) -> Sweeping:
    """Return what a machine states of sweeps, for a demand of a relaxation length.

    Raises
    ------
    ConfigError
        ``plan-demand``: the machine states nothing, the demand no size
    """
    if machine.sweeping is None:
        raise ConfigError(
            "a relaxation length cannot be planned", where=f"machine {machine.name}",
            got="no statement of the speeds and steering rates of a recording in time",
            expected="[sweeping] with speeds and steer_rates in its definition",
            next_step="state them, or leave relaxation_length out: settled steps at one speed do not show it",
            rule="plan-demand",
        )  # fmt: skip
    if demand.open:
        raise ConfigError(
            "a demand has no size, and the machine's protocol reaches none", where="--u", got=demand.label,
            expected=f"{demand.label}=NUMBER UNIT, such as '{demand.label}=40 mm' or '{demand.label}=10 %'",
            next_step="state the largest expanded uncertainty of the relaxation length", rule="plan-demand",
        )  # fmt: skip
    return machine.sweeping


def _steerings() -> Iterator[Steering]:
    for amplitude, half in itertools.product(AMPLITUDES_RAD, _HALVES_M):
        yield Steering(amplitude_rad=amplitude, rate_rad_m=2 * amplitude / half)


def _speeds(steering: Steering, sweeping: Sweeping) -> Iterator[float]:
    """Yield speeds [m/s] at which the steering's rate is within the machine's, the slowest first."""
    slow, quick = (rate / steering.rate_rad_m for rate in sweeping.steer_rates_rad_s)
    low, high = max(sweeping.speeds_m_s[0], slow), min(sweeping.speeds_m_s[1], quick)
    if low <= high:
        yield from sorted(set(np.linspace(low, high, _SPEEDS).tolist()))


def _speed_sets(speeds: tuple[float, ...], sweeping: Sweeping) -> Iterator[tuple[float, ...]]:
    """Yield the speeds of a design: each alone where a delay is stated, and the outer ones."""
    if sweeping.delay is not None:
        yield from ((speed,) for speed in speeds)
    if len(speeds) > 1:
        yield speeds[0], speeds[-1]


def _predicted(case: _Case, steering: Steering, sweeping: Sweeping) -> tuple[SweepFit, float]:
    """Return what a sweep of a metre a second will say without noise, and its mean squared derivative."""
    s = np.arange(0.0, _BASIS * steering.cycle_m, _ROW_M)
    amplitude = steering.amplitude_rad
    SA = 2 / np.pi * amplitude * np.arcsin(np.sin(np.pi / 2 * steering.rate_rad_m / amplitude * s))
    # A tire answers by a lag, or by one that its contact patch spreads: the form that says more counts.
    spread_out = np.mean([
        np.interp(s - behind, s, lag(s, SA, case.length_m - _CONTACT_M / 2))
        for behind in np.linspace(0.0, _CONTACT_M, 7)
    ], axis=0)  # fmt: skip
    facts = []
    for angle in (lag(s, SA, case.length_m), spread_out):
        FY = case.earlier.force(angle, case.load_N, ROTATION)
        fits = forms_of(sweep_of(s, SA, FY, load_N=case.load_N), (case.length_m,))
        facts.append((0.0, math.inf, 0.0) if fits is None else _facts(*fits))
    moved, form, slope = min(part[0] for part in facts), max(part[1] for part in facts), facts[0][2]
    delay = sweeping.delay
    spread = 1 + case.earlier.load_spread
    fit = SweepFit(
        file="", file_sha256="", rotation=ROTATION, first_row=1, last_row=len(s),
        load_N=case.load_N * spread, speed_m_s=1.0, steer_rate_rad_s=steering.rate_rad_m, rows=len(s),
        length_m=case.length_m * math.sqrt(spread), u_m=0.0, dof=_DOF, form_m=form, stiffness_N_rad=slope,
        offset_N=0.0, speed_u=sweeping.speed_u, delay_s=None if delay is None else 0.0,
        delay_u_s=None if delay is None else delay.u_s,
    )  # fmt: skip
    return fit, moved


def _facts(fit: Lag, form: float) -> tuple[float, float, float]:
    return float(fit.moved @ fit.moved) / len(fit.moved), form, -fit.slope


def sweep_of(s: Array, SA: Array, FY: Array, *, load_N: float) -> Sweep:
    """Return signals over the distance as a sweep of a metre a second."""
    return Sweep(
        file="", file_sha256="", rotation=ROTATION, first_row=1, last_row=len(s), t=s, SA=SA, FY=FY,
        FZ=np.full_like(s, load_N), V=np.ones_like(s), stretches=(slice(0, len(s)),),
        explained=np.zeros((len(s), 0)), speed_u=0.0,
    )  # fmt: skip


def _reach(case: _Case, basis: tuple[SweepFit, float], design: SweepDesign, demand: Demand) -> Reach:
    """Return what a design reaches on one tire at one load, if the tire has that length."""
    fit, moved = basis
    earlier, shared = case.earlier, case.earlier.shared
    density = earlier.rows_density(case.load_N, ROTATION)
    sweeps = [
        replace(
            fit, file=str(place), speed_m_s=speed, steer_rate_rad_s=fit.steer_rate_rad_s * speed,
            u_m=math.sqrt(density / (design.load_s(place) * moved)) if moved > 0 else math.inf,
        )
        for place, speed in enumerate(design.speeds_m_s)
    ]  # fmt: skip
    number = relaxation_length(sweeps, load_N=case.load_N, owner=shared.machine, test="planned")
    if number is None:
        raise ValueError("a design of one speed without a stated delay")  # `_speed_sets` makes none
    parts = [shared.load_part(-number.value / case.load_N, case.load_N)]
    if (pressure := shared.pressure_part(number.value)) is not None:
        parts.append(pressure)
    number = number.with_parts(*parts)
    estimate = number.estimate()
    return Reach(
        demand=demand, load_N=case.load_N, rotation=ROTATION, SA_rad=None, value=estimate.value, u=estimate.u,
        U=estimate.expanded()[0], dof=estimate.dof, unit="m", limit=demand.limit(estimate.value),
        sources=number.by_source(), tire=earlier.tire,
    )  # fmt: skip


def energy_J(design: SweepDesign, tires: Sequence[EarlierTest]) -> float:
    """Return the energy that slides away in the sweeps, on the tire of the largest force."""
    SA = np.linspace(-design.steering.amplitude_rad, design.steering.amplitude_rad, 29)
    total = 0.0
    for load in design.loads_N:
        forces = np.max([np.abs(earlier.force(SA, load, ROTATION)) for earlier in tires], axis=0)
        per_metre = float(np.mean(forces * np.abs(np.sin(SA))))
        total += per_metre * design.steering.cycle_m * sum(design.cycles)
    return total


def _range(limits: Sequence[float], factor: float) -> str:
    return " to ".join(f"{limit * factor:.3g}" for limit in limits)
