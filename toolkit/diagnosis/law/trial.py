"""One law at one place from one start: what a search for laws tries.

Tried are the laws that an output may show: every shape over every signal, events and tones.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.fit.structure import filled
from toolkit.diagnosis.law.shapes import (
    MODE,
    ONE,
    TONE,
    TWO,
    UNLOCKED,
    UNLOCKED_TURN,
    Form,
    Shape,
    curve,
    remembering,
    rung,
)
from toolkit.diagnosis.policy import LAWS, STRUCTURE
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.unexplained import (
    Line,
    answered_input,
    beyond_its_past,
    narrowest_line,
    own_swing,
    strongest_events,
    strongest_line,
)
from toolkit.diagnosis.simulators.parameter_units import channel_unit, reduced
from toolkit.diagnosis.simulators.setting import is_speed
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.formula import formula, way
from toolkit.effects.law import ITSELF, SCALED, TIME, Acts, conversion, law_effect, law_name
from toolkit.errors import FitError
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem

    Stacked = dict[str, Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """What a law may depend on: how a formula writes it, its channel, its unit, and its recorded values.

    ``steady`` signals are recorded or simulated values themselves, no rates: of these two make a product.
    One with an ``origin`` is on a scale whose zero is one of convention: laws about zero count it from there.
    Of one that is ``remembered`` laws may have a memory; it is not one whose rate is the output itself.
    """

    written: str
    name: str
    unit: str
    values: Array = field(compare=False)
    steady: bool = True
    origin: float | None = None
    remembered: bool = True

    def written_in(self, shape: Shape) -> str:
        """Return how a law of a shape writes it."""
        if self.origin is None or not shape.about_zero:
            return self.written
        return f"({self.written} - {self.origin:.9g})"

    def values_in(self, shape: Shape) -> Array:
        """Return its values as a law of a shape counts them."""
        if self.origin is None or not shape.about_zero:
            return self.values
        return self.values - self.origin


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One law at one place from one start, with its linearised gain of twice the log-likelihood.

    ``unit`` is that of what it adds, or of its factor. ``swayed`` is, of a law that scales what drives a
    tire, how every output answers to its factor, (rows,). ``looked`` counts the laws that were looked at to
    find it: its p-value is among as many. ``sds`` are standard deviations of parameters that no fit has.
    ``partner`` is the same law in another equation, which may have one: what one body loses the other has. It
    has a size of its own, or that of the first.
    """

    shape: Shape
    signals: tuple[Signal, ...]
    applied: AppliedEffect
    acts: Acts
    unit: str
    gain: float = 0.0
    looked: int = 1
    sds: Mapping[str, float] = field(default_factory=dict)
    swayed: Mapping[str, Array] = field(default_factory=dict)
    partner: Trial | None = None

    @property
    def parts(self) -> tuple[Trial, ...]:
        """The law, and those of its partners."""
        return (self, *(() if self.partner is None else self.partner.parts))

    @property
    def together(self) -> tuple[AppliedEffect, ...]:
        """What is fitted at once."""
        return tuple(part.applied for part in self.parts)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs that it acts on; none of one in an equation, which moves whatever answers."""
        channel = () if self.acts == "enters" else (str(self.applied.channel),)
        return tuple(self.swayed) or channel

    @property
    def form(self) -> Form:
        """Its family."""
        return self.shape.form

    @property
    def place(self) -> tuple[object, ...]:
        """What tells laws apart that differ by more than where they start."""
        return self.applied.key

    @property
    def cost(self) -> int:
        """Number of its parameters."""
        return sum(len(applied.searched) for applied in self.together)


def amplitudes(applied: AppliedEffect) -> tuple[str, ...]:
    """Return the parameters in proportion to which a law is."""
    return tuple(parameter.name for parameter in applied.effect.parameters if parameter.off is not None)


def started(
    problem: Problem,
    shape: Shape,
    signals: tuple[Signal, ...],
    acts: Acts,
    channel: str | None,
    *,
    force: str = "",
) -> Iterator[Trial]:
    """Give a law at every start of what shapes it; ``force`` is the unit of what enters an equation."""
    t = np.concatenate([run.t for run in problem.runs]) if problem.case.has_time else np.arange(2.0)
    for start in shape.starts(signals[0].values_in(shape), t):
        yield trial_at(problem, shape, signals, acts, channel, start, force=force)


def trial_at(
    problem: Problem, shape: Shape, signals: tuple[Signal, ...], acts: Acts, channel: str | None,
    start: Mapping[str, float], *, force: str = "",
) -> Trial:  # fmt: skip
    """Return a law at one start, the amplitudes zero; ``force`` is the unit of what enters an equation."""
    case = problem.case
    tokens = dict(zip(("x", "z"), (signal.written_in(shape) for signal in signals), strict=False))
    text = shape.text.format(**tokens) if "{x}" in shape.text else shape.text
    effect = law_effect(law_name(acts, text))
    itself = None if channel is None else channel_unit(case, problem.model, channel)
    y = {"adds": itself or "1", "enters": force}.get(acts, "1")
    plain = {"y": y} | {key: signal.unit for key, signal in zip(("x", "z"), signals, strict=False)}
    values: dict[str, float] = {name: start.get(name, 0.0) for name in effect.names}
    if acts != "enters" and itself is not None:
        values |= conversion(ITSELF, unit(itself).factor, 0.0)
    drivers = {driver.name for driver in case.drivers}
    for signal in signals if acts != "enters" else ():
        for name in drivers.intersection(formula(signal.written).signals):
            stated = unit(case.unit(name))
            values |= conversion(name, stated.factor, stated.offset)
    return Trial(
        unit=y,
        shape=shape, signals=signals, acts=acts,
        applied=AppliedEffect(
            effect=effect, channel=channel, values=values,
            units={name: _filled(shape.units[name], plain) for name in effect.names},
        ),
    )  # fmt: skip


def _filled(template: str, units: Mapping[str, str]) -> str:
    """Return a unit with its places filled in, in brackets where something stands around them."""
    alone = template.strip("{}")
    if alone in units:
        return units[alone]
    return reduced(template.format_map({place: bracketed(text) for place, text in units.items()}))


def bracketed(text: str) -> str:
    """Return a unit in brackets where it is put together of several."""
    return f"({text})" if any(mark in text for mark in "*/^") and not text.startswith("(") else text


def signals_of(problem: Problem, base: Fit, output: str) -> tuple[Signal, ...]:
    """Return what a law on an output may depend on: inputs, their rates and ways, itself, time."""
    case, timed = problem.case, problem.case.has_time
    view = CaseView(problem, output)
    listed = []

    def with_rate(name: str, of: str, values: Array, text: str) -> None:
        if np.ptp(values) <= 1e-9 * np.abs(values).max(initial=0.0):
            return
        listed.append(Signal(written=f"[{name}]", name=of, unit=text, values=values, origin=view.origin(of)))
        if timed and not _went_straight(problem, values):
            rates = [
                np.gradient(values[rows], run.t) if run.rows > 1 else np.zeros(run.rows)
                for run, rows in zip(problem.runs, problem.slices, strict=True)
            ]
            written, per_second = f"rate([{name}])", f"{bracketed(text)}/s"
            rate = np.concatenate(rates)
            listed.append(
                Signal(written=written, name=f"d{of}/dt", unit=per_second, values=rate, steady=False)
            )

    driven = []
    for channel in case.drivers:
        if all(channel.name in run.columns for run in problem.runs):
            values = np.concatenate([run.columns[channel.name] for run in problem.runs])
            # A copy of the output, value by value, foretells it and says nothing of it.
            if np.isfinite(values).all() and not np.array_equal(values, problem.observed[output]):
                with_rate(channel.name, channel.name, values, channel.unit)
                driven += [values] if np.ptp(values) > 0 else []
                if timed and is_speed(channel.unit):
                    listed.append(_way(problem, channel.name, channel.unit, values))
    with_rate(ITSELF, output, filled(base.simulated[output]), channel_unit(case, problem.model, output))
    motion = problem.model.capability.motion
    solved = motion is not None and motion.integrates
    if timed and driven and not solved and all(_went_straight(problem, each) for each in driven):
        # What all went at one rate has no past of its own: a memory is a curve of where it is.
        listed = [replace(each, remembered=False) for each in listed if each.steady]
    if timed:
        times = np.concatenate([run.t for run in problem.runs])
        listed.append(Signal(written="[time]", name="time", unit="s", values=times, steady=False))
    records = [each for each in listed if not each.steady and _is_record_of(problem, output, each)]
    of_records = {name for each in records for name in formula(each.written).signals}
    return tuple(
        replace(
            each, remembered=each.remembered and not of_records.intersection(formula(each.written).signals)
        )
        for each in listed
        if each not in records
    )


def _went_straight(problem: Problem, values: Array) -> bool:
    """Tell whether a signal went at one rate in all runs, but for its noise: that rate is one number."""
    t, x = (
        np.concatenate([column[rows] - column[rows].mean() for rows in problem.slices])
        for column in (np.concatenate([run.t for run in problem.runs]), values)
    )
    line = t * float(t @ x) / max(float(t @ t), 1e-300)
    return float(np.sum((x - line) ** 2)) <= LAWS.steady**2 * float(line @ line)


def _is_record_of(problem: Problem, output: str, signal: Signal) -> bool:
    """Tell whether a signal is an output that was recorded in another way: it foretells nothing of it.

    The rate of a recorded position is the velocity that a simulation is to give, whatever that leaves out. A
    load that is recorded as it is put on is what its reading is held against.
    """
    recorded, own = unit(signal.unit), unit(channel_unit(problem.case, problem.model, output))
    if recorded.dimension != own.dimension:
        return False
    kept = problem.kept[output]
    y = (problem.observed[output] * own.factor + own.offset)[kept]
    off = y - (signal.values * recorded.factor + recorded.offset)[kept]
    return float(np.mean(off**2)) < LAWS.itself * float(np.var(y))


def _way(problem: Problem, name: str, text: str, speed: Array) -> Signal:
    """Return the way of a recorded speed from the first row of each run on."""
    return Signal(
        written=f"way([{name}])",
        name=f"way of {name}",
        unit=reduced(f"{bracketed(text)}*s"),
        values=np.concatenate(
            [way(run.t, speed[rows]) for run, rows in zip(problem.runs, problem.slices, strict=True)]
        ),
        steady=False,
    )


def trials_of(problem: Problem, base: Fit, outputs: Sequence[str]) -> Iterator[Trial]:
    """Give every law that some outputs may show, at every start, without gains."""
    for output in outputs:
        signals = signals_of(problem, base, output)
        # Of a value that is counted from an arbitrary zero a multiple is nothing.
        multiplies = CaseView(problem, output).origin(output) is None
        for signal in signals:
            for shape in ONE:
                yield from started(problem, shape, (signal,), "adds", output)
                if ITSELF not in signal.written and multiplies:
                    yield from started(problem, shape, (signal,), "multiplies", output)
            if signal.name != "time" and signal.remembered:
                for shape in remembering(timed=problem.case.has_time, ordered=problem.case.has_order):
                    yield from started(problem, shape, (signal,), "adds", output)
        steady = [signal for signal in signals if signal.steady]
        for pair in itertools.combinations(steady, 2):
            for shape in TWO:
                yield from started(problem, shape, pair, "adds", output)
        line = strongest_line(problem, output, base.residual[output])
        # What answers to an input's own swing is bent or changes with time: no tone foretells another swing.
        # Nor one where the simulation swings by itself: that is off by a little, and no tone is beside it.
        if line is not None and not _is_of_a_swing(problem, base, line):
            yield trial_at(problem, TONE, signals[-1:], "adds", output, {"frequency": line.frequency})
            yield from _locked(problem, base, output, line, signals[-1])
        if line is not None:
            followed = [signal for signal in signals[:-1] if signal.remembered]
            for signal, start in itertools.product(followed, rung(line.frequency)):
                yield trial_at(problem, MODE, (signal,), "adds", output, start)
        yield from _events(problem, base, output)


def _is_of_a_swing(problem: Problem, base: Fit, line: Line) -> bool:
    return answered_input(problem, line) is not None or own_swing(problem, line, base.simulated) is not None


def _locked(problem: Problem, base: Fit, output: str, line: Line, time: Signal) -> Iterator[Trial]:
    """Give the tone near a line whose phase goes on through all runs, where their times are near enough.

    Over a whole session a tone is narrower than in one run, by as much as the session is longer: between the
    hills on which its phase fits two neighbouring runs and no third one, no descent finds the highest.
    """
    good = [problem.kept[output][rows] for rows in problem.slices]
    t = np.concatenate([run.t[kept] for run, kept in zip(problem.runs, good, strict=True)])
    count = math.ceil(2 * line.width * LAWS.locked * max(float(np.ptp(t)), 1 / line.width))
    if len(problem.runs) < 2 or count > LAWS.locked_most:
        return
    values = base.residual[output][problem.kept[output]]
    near = line.frequency + line.width * np.linspace(-1, 1, count)
    turns = 2 * math.pi * (t - t.mean())
    waves = [abs(complex(np.exp(-1j * frequency * turns) @ values)) for frequency in near.tolist()]
    frequency = float(near[int(np.argmax(waves))])
    yield replace(trial_at(problem, TONE, (time,), "adds", output, {"frequency": frequency}), looked=count)


def unlocked_tone(problem: Problem, base: Fit, output: str) -> Trial | None:
    """Return a tone whose phase differs from run to run, with its mean amplitude; None without a clear one.

    It is one of a recorded angle, unless that of time is narrower. It explains and does not predict: of
    another run nobody knows the phase. Its frequency and amplitude are as certain as the noise at the
    frequencies beside it lets them be.

    Source: Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974) 591, the bounds of a tone's variances.
    """
    line = narrowest_line(problem, output, base.residual[output])
    if line is None or line.p_value >= STRUCTURE.line or line.share <= STRUCTURE.line_share:
        return None
    if not line.angle and _is_of_a_swing(problem, base, line):
        return None
    if beyond_its_past(problem, output, base.residual[output], line) >= STRUCTURE.line:
        return None
    good = [problem.kept[output][rows] for rows in problem.slices]
    runs = [
        (course[kept], base.residual[output][rows][kept])
        for course, rows, kept in zip(line.courses(problem), problem.slices, good, strict=True)
        if kept.any()
    ]
    longest = max(float(np.ptp(t)) for t, _ in runs)

    # A line is as wide as a run is short: between the frequencies of a spectrum stands the true one.
    near = line.frequency + np.linspace(-1, 1, LAWS.tones) / longest
    frequency = _strongest(runs, near)
    frequency = _strongest(runs, frequency + np.linspace(-1, 1, LAWS.tones) * (near[1] - near[0]))
    amplitudes_of, left = _waves(runs, frequency)
    lines = [k for k in range(-STRUCTURE.line_around, STRUCTURE.line_around + 1) if abs(k) > 1]
    beside = [
        _waves(left, frequency + k / longest)[0] for k in lines if frequency + k / longest > 1 / longest
    ]
    rows_of = np.array([len(t) for t, _ in runs])
    noise = float(np.mean(np.stack(beside) ** 2 * rows_of / 4))
    lengths = np.array([np.ptp(t) for t, _ in runs])
    told = float(np.sum(amplitudes_of**2 * rows_of * lengths**2)) * (2 * math.pi) ** 2 / (24 * noise)
    sds = {
        "a": math.sqrt(float(np.sum(2 * noise / rows_of))) / len(runs), "frequency": 1 / math.sqrt(told)
    }  # fmt: skip
    start = {"a": float(np.mean(amplitudes_of)), "frequency": frequency, "phase": math.nan}
    shape, signals = UNLOCKED, signals_of(problem, base, output)
    of = next((signal for signal in signals if signal.name == line.angle), signals[-1])
    if of.name == line.angle:
        shape, period = UNLOCKED_TURN, 2 * math.pi / unit(problem.case.unit(of.name)).factor / frequency
        start["period"], sds["period"] = period, period * sds["frequency"] / frequency
    return replace(trial_at(problem, shape, (of,), "adds", output, start), gain=line.share, sds=sds)


def _strongest(runs: Sequence[tuple[Array, Array]], frequencies: Array) -> float:
    """Return at which of some frequencies waves with a phase of their own in each run take most."""
    return float(max(frequencies, key=lambda each: float(np.sum(_waves(runs, each)[0] ** 2))))


def _waves(
    runs: Sequence[tuple[Array, Array]], frequency: float
) -> tuple[Array, tuple[tuple[Array, Array], ...]]:
    """Return a frequency's amplitude in each run of (times, values), (runs,), and the runs without it."""
    amplitudes_of, left = [], []
    for t, values in runs:
        turn = 2 * math.pi * frequency * t
        columns = np.stack([np.sin(turn), np.cos(turn)], axis=1)
        solution = np.linalg.lstsq(columns, values, rcond=None)[0]
        amplitudes_of.append(float(np.hypot(*solution)))
        left.append((t, values - columns @ solution))
    return np.array(amplitudes_of), tuple(left)


def curve_trial(problem: Problem, trial: Trial) -> Trial | None:
    """Return the law of one signal as a curve without a formula; None of two signals, or with a memory."""
    if len(trial.signals) != 1 or trial.form != "static":
        return None
    shape = curve(trial.signals[0].values)
    if len(shape.units) < 3:
        return None
    force = trial.unit if trial.acts == "enters" else ""
    drawn = trial_at(problem, shape, trial.signals, trial.acts, trial.applied.channel, {}, force=force)
    return replace(drawn, swayed=trial.swayed)


def scales_of(problem: Problem, base: Fit) -> Iterator[Trial]:
    """Give every law of what drives a tire, its friction or its stiffness, at every start, without gains.

    Such a law is one of all forces and moments at once: a road that grips less has another force and another
    trail, as the similarity of tires has it, and no factor of one output is both. Over the slip angle itself
    it would be another curve, not another grip.
    """
    signals = [
        signal
        for signal in signals_of(problem, base, problem.names[0])
        if ((signal.steady and ITSELF not in signal.written) or signal.name == TIME)
        and signal.name not in ("SA", "SA_CMD")
    ]
    for acts in SCALED if signals else ():
        uniform = law_effect(law_name(cast("Acts", acts), "a"))
        if not problem.model.places(uniform):
            continue
        step = AppliedEffect(effect=uniform, values={"a": LAWS.step})
        try:
            stepped = problem.simulate(base.p, (*base.active, step))
        except FitError:
            continue
        swayed = {name: (stepped[name] - base.simulated[name]) / LAWS.step for name in problem.names}
        for signal, shape in itertools.product(signals, ONE):
            for trial in started(problem, shape, (signal,), cast("Acts", acts), None):
                yield replace(trial, swayed=swayed)


def _events(problem: Problem, base: Fit, output: str) -> Iterator[Trial]:
    """Give for every run the stretch of its time that stands off the rest most clearly."""
    for event in strongest_events(problem, output, base.residual[output]):
        text = f"a*between([time], {event.start:.9g}, {event.end:.9g})"
        shape = Shape(form="event", text=text, units={"a": "{y}"})
        times = np.array([event.start, event.end])
        signal = Signal(written="[time]", name="time", unit="s", values=times, steady=False)
        trial = trial_at(problem, shape, (signal,), "adds", output, {})
        yield replace(trial, looked=event.looked, applied=replace(trial.applied, runs=frozenset({event.run})))
