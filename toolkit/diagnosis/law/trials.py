"""The laws that structure may be: every shape over every signal of a place, ranked by linearised fits."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from toolkit.diagnosis.law.shapes import MODE, ONE, REMEMBERING, TONE, TWO, UNLOCKED, Form, Shape, curve, rung
from toolkit.diagnosis.policy import LAWS, STRUCTURE
from toolkit.diagnosis.search.unexplained import strongest_events, strongest_line
from toolkit.diagnosis.simulators.parameter_units import channel_unit, reduced
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.diagnosis.simulators.states import term_places
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import ITSELF, POSITION, Acts, conversion, law_effect, law_name, parts_of
from toolkit.errors import FitError
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.screen import LinearisedFit
    from toolkit.effects.formula import Formula

    Array = NDArray[np.float64]
    Stacked = dict[str, Array]


_LARGEST = 1e100  # of a response: the squares of larger ones are no numbers any more


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """What a law may depend on: how a formula writes it, its channel, its unit, and its recorded values.

    ``steady`` signals are recorded or simulated values themselves, no rates: of these two make a product.
    """

    written: str
    name: str
    unit: str
    values: Array = field(compare=False)
    steady: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One law at one place from one start, with its linearised gain of twice the log-likelihood.

    ``unit`` is that of what it adds, or of its factor. ``looked`` counts the laws that were looked at to find
    it: its p-value is among as many.
    """

    shape: Shape
    signals: tuple[Signal, ...]
    applied: AppliedEffect
    acts: Acts
    unit: str
    gain: float = 0.0
    looked: int = 1

    @property
    def form(self) -> Form:
        """Its family."""
        return self.shape.form

    @property
    def place(self) -> tuple[object, ...]:
        """What tells laws apart that differ by more than where they start."""
        return self.applied.effect.name, self.applied.channel

    @property
    def cost(self) -> int:
        """Number of its parameters."""
        return len(self.applied.effect.parameters)


def amplitudes(applied: AppliedEffect) -> tuple[str, ...]:
    """Return the parameters in proportion to which a law is."""
    return tuple(parameter.name for parameter in applied.effect.parameters if parameter.off is not None)


def signals_of(problem: Problem, base: Fit, output: str) -> tuple[Signal, ...]:
    """Return what a law on an output may depend on: every input and its rate, the output itself, time."""
    case, timed = problem.case, problem.case.has_time
    listed = []

    def with_rate(name: str, of: str, values: Array, text: str) -> None:
        if np.ptp(values) <= 1e-9 * np.abs(values).max(initial=0.0):
            return
        listed.append(Signal(written=f"[{name}]", name=of, unit=text, values=values))
        if timed:
            rates = [
                np.gradient(values[rows], run.t) if run.rows > 1 else np.zeros(run.rows)
                for run, rows in zip(problem.runs, problem.slices, strict=True)
            ]
            rate, per_second = np.concatenate(rates), f"{_bracketed(text)}/s"
            listed.append(
                Signal(
                    written=f"rate([{name}])", name=f"d{of}/dt", unit=per_second, values=rate, steady=False
                )
            )

    for channel in case.drivers:
        if all(channel.name in run.columns for run in problem.runs):
            values = np.concatenate([run.columns[channel.name] for run in problem.runs])
            if np.isfinite(values).all():
                with_rate(channel.name, channel.name, values, channel.unit)
    with_rate(ITSELF, output, base.simulated[output], channel_unit(case, problem.model, output))
    if timed:
        times = np.concatenate([run.t for run in problem.runs])
        listed.append(Signal(written="[time]", name="time", unit="s", values=times, steady=False))
    return tuple(listed)


def trials_of(problem: Problem, base: Fit, outputs: Sequence[str]) -> Iterator[Trial]:
    """Give every law that some outputs may show, at every start, without gains."""
    for output in outputs:
        signals = signals_of(problem, base, output)
        for signal in signals:
            for shape in ONE:
                yield from _started(problem, shape, (signal,), "adds", output)
                if ITSELF not in signal.written:
                    yield from _started(problem, shape, (signal,), "multiplies", output)
            for shape in REMEMBERING if problem.case.has_time and signal.name != "time" else ():
                yield from _started(problem, shape, (signal,), "adds", output)
        steady = [signal for signal in signals if signal.steady]
        for pair in itertools.combinations(steady, 2):
            for shape in TWO:
                yield from _started(problem, shape, pair, "adds", output)
        line = strongest_line(problem, output, base.residual[output])
        if line is not None:
            yield _trial(problem, TONE, signals[-1:], "adds", output, {"frequency": line.frequency})
            for signal, start in itertools.product(signals[:-1], rung(line.frequency)):
                yield _trial(problem, MODE, (signal,), "adds", output, start)
        yield from _events(problem, base, output)


def terms_of(problem: Problem) -> Iterator[Trial]:
    """Give every law that may be missing in the equation of a state, at every start, without gains."""
    motion = problem.model.capability.motion
    if motion is None or not motion.integrates:
        return
    for channel, of in term_places(problem.model.places).items():
        sizes = motion.sizes(channel, lambda _: 1.0)
        force, speed, position = map(reduced, motion.units(channel))
        grid = np.linspace(-sizes.fastest, sizes.fastest, 41) if of == "velocity" else None
        own = Signal(
            written=f"[{ITSELF}]", name=channel, unit=speed,
            values=np.linspace(0, sizes.level, 41) if grid is None else grid,
        )  # fmt: skip
        listed = [own]
        if sizes.has_position:
            way, name = np.linspace(-sizes.farthest, sizes.farthest, 41), motion.position(channel)
            listed.append(Signal(written=f"[{POSITION}]", name=name or POSITION, unit=position, values=way))
        made: list[tuple[Shape, tuple[Signal, ...]]] = [
            (shape, (signal,)) for signal in listed for shape in ONE
        ]
        made += [(shape, tuple(listed)) for shape in TWO if len(listed) > 1]
        for shape, signals in made:
            yield from _started(problem, shape, signals, "enters", channel, force=force)


def unlocked_tone(problem: Problem, base: Fit, output: str) -> Trial | None:
    """Return a tone whose phase differs from run to run, with its mean amplitude; None without a clear one.

    It explains and does not predict: of another run nobody knows the phase.
    """
    line = strongest_line(problem, output, base.residual[output])
    if line is None or line.p_value >= STRUCTURE.line or line.share <= STRUCTURE.line_share:
        return None
    longest = max(float(np.ptp(run.t)) for run in problem.runs if run.rows)

    def amplitudes_at(frequency: float) -> Array:
        listed = []
        for run, rows in zip(problem.runs, problem.slices, strict=True):
            good = problem.kept[output][rows]
            turn = 2 * math.pi * frequency * run.t[good]
            columns = np.stack([np.sin(turn), np.cos(turn)], axis=1)
            both = np.linalg.lstsq(columns, base.residual[output][rows][good], rcond=None)[0]
            listed.append(float(np.hypot(*both)))
        return np.array(listed)

    # A line is as wide as a run is short: between the frequencies of a spectrum stands the true one.
    near = line.frequency + np.linspace(-1, 1, LAWS.tones) / longest
    frequency = float(max(near, key=lambda each: float(np.sum(amplitudes_at(each) ** 2))))
    amplitudes_of = amplitudes_at(frequency)
    time = signals_of(problem, base, output)[-1:]
    start = {"a": float(np.mean(amplitudes_of)), "frequency": frequency, "phase": math.nan}
    return replace(_trial(problem, UNLOCKED, time, "adds", output, start), gain=line.share)


def curve_trial(problem: Problem, trial: Trial) -> Trial | None:
    """Return the law of one signal as a curve without a formula; None of two signals, or with a memory."""
    if len(trial.signals) != 1 or trial.form != "static":
        return None
    shape = curve(trial.signals[0].values)
    if len(shape.units) < 3:
        return None
    force = trial.unit if trial.acts == "enters" else ""
    channel = str(trial.applied.channel)
    return _trial(problem, shape, trial.signals, trial.acts, channel, {}, force=force)


def responses(problem: Problem, base: Fit, trial: Trial) -> Stacked | None:
    """Return the responses of all outputs to a law, one column for each amplitude; None where it has none."""
    return next(all_responses(problem, base, [trial]))


def all_responses(problem: Problem, base: Fit, trials: Sequence[Trial]) -> Iterator[Stacked | None]:
    """Give the responses to several laws, one after the other: of long recordings all are too much to hold.

    Those in the equation of one state are propagated together.
    """
    entering: dict[str, list[int]] = {}
    for i, trial in enumerate(trials):
        if trial.acts == "enters":
            entering.setdefault(str(trial.applied.channel), []).append(i)
    pushed: dict[int, Stacked] = {}
    for listed in entering.values():
        pushed |= zip(listed, _pushed(problem, base, [trials[i] for i in listed]), strict=True)
    for i, trial in enumerate(trials):
        if i in pushed:
            yield _usable(problem, pushed.pop(i))
            continue
        columns = _evaluated(problem, base, trial)
        none = np.zeros_like(columns)
        yield _usable(
            problem, {name: columns if name == trial.applied.channel else none for name in problem.names}
        )


def _usable(problem: Problem, directions: Stacked) -> Stacked | None:
    counted = np.concatenate([directions[name][problem.kept[name]] for name in problem.names])
    largest = float(np.abs(counted).max(initial=0.0))
    if not 0 < largest < _LARGEST:  # nor what is no number
        return None
    return {name: np.nan_to_num(columns) for name, columns in directions.items()}


def at_coefficients(trial: Trial, coefficients: Sequence[float]) -> Trial:
    """Return a law with its amplitudes as a linearised fit has them."""
    reached = dict(zip(amplitudes(trial.applied), coefficients, strict=True))
    return replace(trial, applied=replace(trial.applied, values={**trial.applied.values, **reached}))


def ranked(
    problem: Problem, base: Fit, screen: LinearisedFit, listed: Sequence[Trial], weight: float
) -> list[Trial]:
    """Return laws with their exact gains and amplitudes, the best first: of each the best start.

    Parameters
    ----------
    weight : what a parameter costs of the log-likelihood
    """
    quick: dict[object, Trial] = {}
    for trial, directions in zip(listed, all_responses(problem, base, listed), strict=True):
        if directions is None:
            continue
        gain = screen.quick(directions)[0] - 2 * weight * trial.cost
        if trial.place not in quick or gain > quick[trial.place].gain:
            quick[trial.place] = replace(trial, gain=gain)
    best = sorted(quick.values(), key=lambda trial: -trial.gain)[: LAWS.sharpened]
    best[: LAWS.refined] = _refined(problem, base, screen, best[: LAWS.refined])
    exact = []
    for trial, directions in zip(best, all_responses(problem, base, best), strict=True):
        if directions is not None:
            gain, coefficients, trust = screen.gain(directions)
            exact.append(replace(at_coefficients(trial, coefficients), gain=gain * trust))
    return sorted(exact, key=lambda trial: -(trial.gain - 2 * weight * trial.cost))


def _refined(problem: Problem, base: Fit, screen: LinearisedFit, trials: Sequence[Trial]) -> list[Trial]:
    """Return laws with what shapes them where their quick gain is largest nearby: a grid is coarse.

    All laws move together, each to the best of its neighbours; where none is better, its steps are halved.
    """
    best = list(trials)
    gains = [-math.inf] * len(best)
    steps = [_steps(trial) for trial in best]
    for turn in range(LAWS.rounds):
        neighbours = [
            (i, _moved(trial, offset))
            for i, trial in enumerate(best)
            for offset in _offsets(steps[i], centre=not turn)
        ]
        neighbours = [(i, trial) for i, trial in neighbours if _within(trial)]
        moved = set()
        for (i, trial), directions in zip(
            neighbours, all_responses(problem, base, [trial for _, trial in neighbours]), strict=True
        ):
            gain = -math.inf if directions is None else screen.quick(directions)[0]
            if gain > gains[i]:
                best[i], gains[i] = trial, gain
                moved.add(i)
        steps = [
            step if i in moved else {name: 0.5 * size for name, size in step.items()}
            for i, step in enumerate(steps)
        ]
    return best


def _steps(trial: Trial) -> dict[str, float]:
    """Return steps of what shapes a law: a share of a width or a time, of a place a share of the range."""
    values = trial.applied.values
    spread = float(np.ptp(trial.signals[0].values)) if trial.signals else 1.0
    return {
        parameter.name: 0.05 * spread if parameter.bounds[0] < 0 else 0.25 * abs(values[parameter.name])
        for parameter in trial.applied.effect.parameters
        if parameter.off is None
    }


def _offsets(steps: Mapping[str, float], *, centre: bool) -> Iterator[dict[str, float]]:
    for signs in itertools.product((0, 1, -1), repeat=len(steps)):
        if any(signs) or centre:
            yield {name: sign * step for sign, (name, step) in zip(signs, steps.items(), strict=True)}


def _moved(trial: Trial, offset: Mapping[str, float]) -> Trial:
    values = {**trial.applied.values}
    for name, by in offset.items():
        values[name] += by
    return replace(trial, applied=replace(trial.applied, values=values))


def _within(trial: Trial) -> bool:
    """Tell whether what shapes a law lies inside its bounds."""
    values = trial.applied.values
    return all(values[each.name] > each.bounds[0] for each in trial.applied.effect.parameters)


def p_value(trial: Trial, looked: int) -> float:
    """Return the chance of so large a gain among as many laws as were looked at."""
    from scipy.stats import chi2

    log_p = float(chi2.logsf(max(trial.gain, 0.0), trial.cost)) + math.log(max(looked, 1) * trial.looked)
    return min(1.0, max(math.exp(max(log_p, -690.0)), 1e-300))


def _started(
    problem: Problem, shape: Shape, signals: tuple[Signal, ...], acts: Acts, channel: str, *, force: str = ""
) -> Iterator[Trial]:
    t = np.concatenate([run.t for run in problem.runs]) if problem.case.has_time else np.arange(2.0)
    for start in shape.starts(signals[0].values, t):
        yield _trial(problem, shape, signals, acts, channel, start, force=force)


def _trial(
    problem: Problem, shape: Shape, signals: tuple[Signal, ...], acts: Acts, channel: str,
    start: Mapping[str, float], *, force: str = "",
) -> Trial:  # fmt: skip
    case = problem.case
    tokens = dict(zip(("x", "z"), (signal.written for signal in signals), strict=False))
    text = shape.text.format(**tokens) if "{x}" in shape.text else shape.text
    effect = law_effect(law_name(acts, text))
    y = {"adds": channel_unit(case, problem.model, channel), "multiplies": "1", "enters": force}[acts]
    plain = {"y": y} | {key: signal.unit for key, signal in zip(("x", "z"), signals, strict=False)}
    values: dict[str, float] = {name: start.get(name, 0.0) for name in effect.names}
    if acts != "enters":
        values |= conversion(ITSELF, unit(channel_unit(case, problem.model, channel)).factor, 0.0)
    for signal in signals if acts != "enters" else ():
        if any(driver.name in signal.written for driver in case.drivers):
            name = signal.written[signal.written.index("[") + 1 : signal.written.index("]")]
            if name != ITSELF:
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
    return reduced(template.format_map({place: _bracketed(text) for place, text in units.items()}))


def _bracketed(text: str) -> str:
    return f"({text})" if any(mark in text for mark in "*/^") and not text.startswith("(") else text


def _events(problem: Problem, base: Fit, output: str) -> Iterator[Trial]:
    """Give for every run the stretch of its time that stands off the rest most clearly."""
    for event in strongest_events(problem, output, base.residual[output]):
        text = f"a*between([time], {event.start:.9g}, {event.end:.9g})"
        shape = Shape(form="event", text=text, units={"a": "{y}"})
        times = np.array([event.start, event.end])
        signal = Signal(written="[time]", name="time", unit="s", values=times, steady=False)
        made = _trial(problem, shape, (signal,), "adds", output, {})
        yield replace(made, looked=event.looked, applied=replace(made.applied, runs=frozenset({event.run})))


def _formula(applied: AppliedEffect) -> Formula:
    return parts_of(applied.effect.name)[1]


def _pushed(problem: Problem, base: Fit, trials: Sequence[Trial]) -> list[Stacked]:
    """Return the linear responses to laws in the equation of one state, a column for each amplitude."""
    terms = [
        (
            trial.applied.effect,
            tuple(_unit(trial.applied, name).values for name in amplitudes(trial.applied)),
        )
        for trial in trials
    ]
    widths = [len(starts) for _, starts in terms]
    nothing = [{name: np.zeros((problem.rows, width)) for name in problem.names} for width in widths]
    try:
        pushes = problem.pushed(
            base.p, base.active, trials[0].applied, TermPattern(tuple(terms)), sum(widths)
        )
    except FitError:
        return nothing
    ends = np.cumsum(widths).tolist()
    # A law is taken from the rate, a push is added to it.
    return [
        {name: -columns[:, end - width : end] for name, columns in pushes.items()}
        for width, end in zip(widths, ends, strict=True)
    ]


def _unit(applied: AppliedEffect, name: str) -> AppliedEffect:
    """Return a law with one of its amplitudes alone, of one."""
    none = dict.fromkeys(amplitudes(applied), 0.0)
    return replace(applied, values={**applied.values, **none, name: 1.0})


def _evaluated(problem: Problem, base: Fit, trial: Trial) -> Array:
    applied, law = trial.applied, _formula(trial.applied)
    output, names = str(applied.channel), amplitudes(applied)
    columns = np.zeros((problem.rows, len(names)))
    for run, rows in zip(problem.runs, problem.slices, strict=True):
        if not applied.acts_in(run):
            continue
        own = base.simulated[output][rows]
        signals = {ITSELF: own, "time": run.t}
        signals |= {name: run.columns[name] for name in law.signals if name in run.columns}
        for k, name in enumerate(names):
            values = _unit(applied, name).values
            with np.errstate(all="ignore"):
                change = np.broadcast_to(cast("Array", law(signals, values, run.t)), run.rows)
            columns[rows, k] = own * change if trial.acts == "multiplies" else change
    return columns
