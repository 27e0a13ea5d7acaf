"""What stays unexplained about a fit: smooth structure, lines, and more than the stated noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.noise import Autoregression, fit_noise, log_likelihood, whiten
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.fit.sensor_noise import noise_of_repeats
from toolkit.diagnosis.fit.structure import RUNS, SmoothDependence, groups
from toolkit.diagnosis.policy import LAWS, STEP, STRUCTURE
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.search.screen_step import search_p_values
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import CaseChannel
    from toolkit.diagnosis.fit.problem import Stacked

# Lines in the spectrum of a residual: a disturbance that repeats in time, of a period that nobody named.


TOO_LARGE = "more than its stated noise"
BEYOND_REPEATS = "more than repeats of a run differ by"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line: its frequency [1/s], its p-value among all of them, its share of the residual's variance.

    ``width`` is what the shortest run leaves open of its frequency [1/s]. One over the ``angle`` of that
    channel has both per turn.
    """

    frequency: float
    p_value: float
    share: float
    width: float
    angle: str = ""

    def courses(self, problem: Problem) -> list[Array]:
        """Return what it is a line over in every run, (n_run,): time [s], or turns."""
        over = (turns_of(problem, each) for each in problem.case.drivers if each.name == self.angle)
        return next(over, None) or [run.t for run in problem.runs]

    @property
    def told(self) -> str:
        """Return the frequency with its unit."""
        return f"{self.frequency:.4g} {'per turn' if self.angle else 'Hz'}"

    @property
    def reason(self) -> str:
        """Return which line of its variable it is, as the answer says it."""
        return f"a line at {self.told}"


def narrowest_line(problem: Problem, name: str, residual: Array) -> Line | None:
    """Return the strongest line of an output's residual, over a recorded angle unless time's is narrower.

    What is of a shaft keeps its number per turn while the speed changes, and smears over time. As much in
    the three frequencies of a line is as narrow; at one steady speed both are, and the angle comes first.
    """
    best = strongest_line(problem, name, residual)
    for channel in problem.case.drivers:
        turns = turns_of(problem, channel)
        over = None if turns is None else strongest_line(problem, name, residual, over=turns)
        if over is not None and (best is None or over.share > (1 - STRUCTURE.line_share) * best.share):
            best = replace(over, angle=channel.name)
    return best


def turns_of(problem: Problem, channel: CaseChannel) -> list[Array] | None:
    """Return the turns of a recorded angle in every run, (n_run,); None where it does not turn in one way."""
    if unit(channel.unit).dimension != "angle":
        return None
    turns = []
    for run in problem.runs:
        course = np.unwrap(run.columns[channel.name] * unit(channel.unit).factor) / (2 * np.pi)
        course = course if course[-1] > course[0] else -course
        if not (course[-1] - course[0] >= 1 and (np.diff(course) > 0).all()):
            return None
        turns.append(course)
    return turns


def answered_input(problem: Problem, line: Line) -> tuple[str, int] | None:
    """Return the recorded input whose own swing has a line [Hz] among its multiples, and which it is.

    What is bent answers to a swing by its multiples, and nothing else has to turn there.
    """
    return _swings_of(
        problem,
        line,
        {
            channel.name: [run.columns.get(channel.name) for run in problem.runs]
            for channel in problem.case.drivers
        },
    )


def own_swing(problem: Problem, line: Line, simulated: Stacked) -> tuple[str, int] | None:
    """Return the simulated output whose own swing has a line [Hz] among its multiples, and which it is.

    A swing that is a little too quick, too large or late leaves a line where the simulation itself swings.
    """
    return _swings_of(
        problem, line, {name: [column[rows] for rows in problem.slices] for name, column in simulated.items()}
    )


def _swings_of(
    problem: Problem, line: Line, columns: Mapping[str, Sequence[Array | None]]
) -> tuple[str, int] | None:
    """Return the first of some columns, one a run, of whose swing in all runs a line is the same multiple."""
    for name, of_runs in columns.items():
        pairs = zip(problem.runs, of_runs, strict=True)
        multiples = [_multiple(line, run.t, column) for run, column in pairs]
        if multiples and None not in multiples and len(set(multiples)) == 1:
            return name, int(multiples[0] or 0)
    return None


def _multiple(line: Line, t: Array, values: Array | None) -> int | None:
    """Return which multiple of a column's own swing a line is in one run; None where it has none so clear."""
    if values is None or len(t) < STRUCTURE.line_rows or not np.isfinite(values).all():
        return None
    even = np.interp(np.linspace(t[0], t[-1], len(t)), t, values)
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(len(t)))) ** 2
    k = int(np.argmax(power))
    if not STRUCTURE.line_cycles <= k < len(power) - 1:
        return None
    around = power[k - 1 : k + 2]
    if around.sum() < STRUCTURE.swings * power.sum():
        return None
    width = 1 / float(t[-1] - t[0])
    below, at, above = np.log(np.maximum(around, 1e-300))
    own = (
        k + 0.5 * (below - above) / min(below - 2 * at + above, -1e-12)
    ) * width  # where a parabola is highest
    multiple = round(line.frequency / own)
    unsure = (multiple * width + line.width) / 2
    near = abs(line.frequency - multiple * own) <= unsure
    # Among so wide multiples any line would be.
    return multiple if near and multiple and unsure < STRUCTURE.order_cycles * own else None


def strongest_line(
    problem: Problem,
    name: str,
    residual: Array,
    *,
    over: Sequence[Array] | None = None,
) -> Line | None:
    """Return the strongest line of an output's residual, None where no run is long and even enough.

    Parameters
    ----------
    over : what rises along every run, (n_run,) each; time by default
    """
    if not problem.case.has_time:
        return None
    runs = []
    courses = [run.t for run in problem.runs] if over is None else over
    # Runs of several speeds have angles of several steps, and the widest of them is common to all.
    common = None if over is None else max(float(np.ptp(course)) / (len(course) - 1) for course in over)
    for run, course, place in zip(problem.runs, courses, problem.slices, strict=True):
        steps = np.diff(course)
        if run.rows < STRUCTURE.line_rows or np.ptp(steps) > STRUCTURE.line_jitter * np.median(steps):
            continue
        good = problem.kept[name][place]
        if good.mean() < STRUCTURE.line_kept:
            continue
        values = residual[place]
        count = run.rows if common is None else int(np.ptp(course) / common * (1 + 1e-9)) + 1
        last = course[-1] if common is None else course[0] + (count - 1) * common
        even = np.linspace(course[0], last, count)
        runs.append((float(even[1] - even[0]), np.interp(even, course[good], values[good])))
    if not runs:
        return None
    n = min(len(values) for _, values in runs)
    step = runs[0][0]
    if n < STRUCTURE.line_rows or any(abs(each - step) > STRUCTURE.line_even * step for each, _ in runs):
        return None
    window = np.hanning(n + 2)[1:-1]
    power = np.zeros(n // 2 + 1)
    for _, values in runs:
        x = values[:n] - values[:n].mean()
        power += np.abs(np.fft.rfft(x * window)) ** 2
    level = np.array([_level(power, k) for k in range(len(power))])
    ratio = np.where(level > 0, power / np.maximum(level, 1e-300), 0.0)
    ratio[: STRUCTURE.line_cycles] = 0.0
    k = int(np.argmax(ratio))
    # A sum of R independent periodograms is chi-squared with 2R degrees, its median the level.
    p = min(1.0, len(power) * _tail(ratio[k], len(runs)))
    line_power = power[max(k - 1, 1) : k + 2].sum() - 3 * level[k]
    share = max(0.0, float(line_power / max(power[1:].sum(), 1e-300)))
    return Line(frequency=k / (n * step), p_value=p, share=share, width=1 / (n * step))


def _level(power: Array, k: int) -> float:
    low, high = max(1, k - STRUCTURE.line_around), min(len(power), k + STRUCTURE.line_around + 1)
    around = np.concatenate([power[low : max(low, k - 2)], power[min(high, k + 3) : high]])
    return float(np.median(around)) if len(around) else 0.0


def beyond_its_past(problem: Problem, name: str, residual: Array, line: Line) -> float:
    """Return the chance that coloured noise has waves as large, each run's of its own phase.

    Noise that came through a resonance of the plant has a peak in its spectrum as well, as narrow as the line
    of a short run. But its own past foretells it, and beside that past a wave explains nothing more.
    """
    from scipy.stats import chi2

    where = problem.layout(name)
    values = residual[where.index]
    noise = fit_noise(values, where, floor=problem.floor[name])
    courses, columns = line.courses(problem), 2 * len(problem.runs)

    def likelihood(frequency: float) -> float:
        """Return the log-likelihood beside waves by ordinary or by generalised least squares."""
        waves = np.zeros((problem.rows, columns))
        for k, (course, place) in enumerate(zip(courses, problem.slices, strict=True)):
            angle = 2 * np.pi * frequency * (course - course[0])
            waves[place, 2 * k], waves[place, 2 * k + 1] = np.cos(angle), np.sin(angle)
        reached = -math.inf
        for weights in (Autoregression(reflection=(), sd=1.0), noise):
            white = whiten(np.column_stack([waves[where.index], values]), where, weights)
            left = values - waves[where.index] @ np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)[0]
            there = fit_noise(left, where, floor=problem.floor[name], used=columns)
            reached = max(reached, log_likelihood(left, where, there))
        return reached

    best, frequency = -math.inf, line.frequency
    for reach in (line.width, line.width / 8):
        near = [(likelihood(at), at) for at in frequency + reach * np.linspace(-1, 1, 17)]
        best, frequency = max((best, frequency), *near)
    gain = 2 * (best - log_likelihood(values, where, noise))
    # As many frequencies were looked at as half the rows of a run.
    looked = 0.5 / (line.width * float(np.median(np.diff(courses[0]))))
    return min(1.0, looked * float(chi2.sf(max(gain, 0.0), columns + 1)))


def _tail(ratio: float, runs: int) -> float:
    from scipy.stats import chi2

    median = float(chi2.median(2 * runs))
    # The level is itself a median of some twenty values: its own scatter is allowed for.
    return float(chi2.sf(ratio * median / (1 + 2 / math.sqrt(2 * STRUCTURE.line_around)), 2 * runs))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A stretch of one run's time, from the first to the last of its rows [s]; one of ``looked``."""

    run: str
    start: float
    end: float
    looked: int

    def columns(self, problem: Problem) -> Array:
        """Return one in its rows and zero elsewhere, (rows, 1)."""
        inside = [
            (run.t >= self.start) & (run.t <= self.end) & (run.name == self.run) for run in problem.runs
        ]
        return np.concatenate(inside).astype(np.float64)[:, None]


def strongest_events(problem: Problem, name: str, residual: Array) -> tuple[Event, ...]:
    """Return for every run the stretch of its time that stands off the rest most clearly.

    None of a run in which other stretches as long are off as well: that is what wanders, not what happened.
    """
    events = []
    for run, place in zip(problem.runs, problem.slices, strict=True):
        good = problem.kept[name][place]
        if not problem.case.has_time or good.sum() < LAWS.event_rows:
            continue
        t, values = run.t[good], residual[place][good]
        edges = np.unique(np.linspace(0, len(values), LAWS.cuts + 1).astype(int))
        total = np.concatenate([[0.0], np.cumsum(values - np.median(values))])[edges]
        first, last = np.triu_indices(len(edges), 1)
        rows = (edges[last] - edges[first]).astype(float)
        usable = (rows >= LAWS.event_least) & (rows < LAWS.event_most * len(values))
        strength = np.where(usable, (total[last] - total[first]) ** 2 / rows, 0.0)
        at = int(np.argmax(strength))
        if not _stands_out(values - np.median(values), edges[first[at]], edges[last[at]]):
            continue
        events.append(
            Event(
                run=run.name, start=float(t[edges[first[at]]]), end=float(t[edges[last[at]] - 1]),
                looked=int(usable.sum()),
            )
        )  # fmt: skip
    return tuple(events)


def _stands_out(values: Array, first: int, last: int) -> bool:
    """Tell whether the mean of some rows is far beyond those of all other stretches of as many."""
    rows = last - first
    total = np.concatenate([[0.0], np.cumsum(values)])
    means = (total[rows:] - total[:-rows]) / rows
    begins = np.arange(len(means))
    others = means[(begins + rows <= first) | (begins >= last)]
    if not len(others):
        return True
    scatter = math.sqrt(float(np.mean(others**2)))
    return abs(float(means[first])) > LAWS.stands_out * scatter


def _event(problem: Problem, screen: LinearisedFit, base: Fit, name: str) -> StructureFound | None:
    """Return the clearest event of an output's residual, None where chance gives as much.

    It follows nothing that was recorded: no smooth dependence shows it, and coloured noise takes it up.
    """
    from scipy.stats import chi2

    listed = []
    events = strongest_events(problem, name, base.residual[name])
    none = np.zeros((problem.rows, 1))
    for event in events:
        column = event.columns(problem)
        group = SmoothDependence(output=name, variables=("time",), columns=column)
        if _share(problem, base, group) < LAWS.share:
            continue
        gain, _, trust = screen.gain({each: column if each == name else none for each in problem.names})
        log_p = float(chi2.logsf(max(gain * trust, 0.0), 1)) + math.log(event.looked * len(events))
        text = f"an event in {event.run} from {event.start:.4g} to {event.end:.4g} s"
        p = math.exp(min(max(log_p, -690.0), 0.0))
        listed.append(
            StructureFound(output=name, variables=("time",), reason=text, gain=gain, p_value=p, rest=True)
        )
    best = min(listed, key=lambda found: found.p_value, default=None)
    return best if best is not None and best.p_value < STRUCTURE.alpha else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructureFound:
    """Structure that stays: where it is, and its p-value in the search.

    A ``rest`` is only larger than noise may be, or differs from run to run: it follows nothing that an effect
    could imitate, and no effect beside it is withdrawn because of it. ``columns`` are the parameters of a
    smooth dependence; a line and a rest have none. ``noise_sd`` is what the output's noise is known to be
    where the structure shows that it is not the residual; None where it shows nothing of it. ``reason`` says
    which ``line`` or event of its variable it is, or why it counts where no variable foretells it.
    """

    output: str
    variables: tuple[str, ...]
    gain: float
    p_value: float
    rest: bool = False
    columns: int = 0
    noise_sd: float | None = None
    line: Line | None = None
    reason: str = ""

    @property
    def is_lawful(self) -> bool:
        """Tell whether a law may answer it: an event has one, what only differs from run to run has none."""
        return not self.rest or "time" in self.variables

    @property
    def is_too_large(self) -> bool:
        """Tell whether it is all that is known that the residual is larger than a noise that is known."""
        return self.reason in (TOO_LARGE, BEYOND_REPEATS)


def remainder(problem: Problem, screen: LinearisedFit, base: Fit, seed: int) -> tuple[StructureFound, ...]:
    """Return what stays unexplained about a fit, the largest first; nothing that matters to nobody."""
    listed: list[SmoothDependence] = groups(problem, base)
    directions = [dependence.directions(problem) for dependence in listed]
    quick = [screen.quick(dependence) for dependence in directions]
    order = sorted(range(len(listed)), key=lambda i: -quick[i][0])
    gains = [gain for gain, _ in quick]
    trusts = [screen.trust(base.noise)] * len(listed)
    for place, i in enumerate(order):
        if place < STRUCTURE.sharpened:
            gains[i], _, trusts[i] = screen.gain(directions[i])
    least = min((gains[i] for i in order[: STRUCTURE.sharpened]), default=0.0)
    for i in order[STRUCTURE.sharpened :]:
        gains[i] = min(gains[i], least)
    weighed = [gain * trust for gain, trust in zip(gains, trusts, strict=True)]
    p_values = search_p_values(screen, [block for _, block in quick], weighed, seed)
    findings = [
        StructureFound(
            output=dependence.output,
            variables=dependence.variables,
            gain=gain,
            p_value=p,
            rest=dependence.variables == RUNS,
            columns=dependence.columns.shape[1],
        )
        for dependence, gain, p in zip(listed, gains, p_values, strict=True)
        if p < STRUCTURE.alpha and _share(problem, base, dependence) > STEP.first
    ]
    for name in problem.names:
        line = narrowest_line(problem, name, base.residual[name])
        if line is not None and line.p_value < STRUCTURE.line and line.share > STRUCTURE.line_share:
            gain = -2 * math.log(max(line.p_value, 1e-300))
            over = (line.angle or "time",)
            of_line = StructureFound(
                output=name, variables=over, line=line, reason=line.reason, gain=gain, p_value=line.p_value
            )
            findings.append(of_line)
        event = _event(problem, screen, base, name)
        findings += [] if event is None else [event]
        beyond = _beyond_noise(problem, base, name)
        if beyond is not None:
            findings.append(beyond)
    return tuple(sorted(findings, key=lambda dependence: -dependence.gain))


def _beyond_noise(problem: Problem, base: Fit, name: str) -> StructureFound | None:
    """Return the finding that a residual is larger than the noise that is stated, or that repeats show.

    Repeats show it and its colour, but for their zeros: beside them every run counts about its own.
    """
    from scipy.stats import chi2, f

    stated, repeated = problem.stated_sd(name), noise_of_repeats(problem, base, name)
    counted, residual, known = problem.kept[name], base.residual[name], math.inf
    if counted.sum() < STRUCTURE.stated_rows:
        return None
    if stated is not None:
        share = 1 / base.noise[name].correlation_rows
        # Coarse steps add their own to what the sensor is stated to have.
        ratio = float(np.mean(residual[counted] ** 2)) / (stated**2 + problem.floor[name] ** 2)
    elif repeated is not None:
        sd, share, rows = repeated
        known = max(rows * share, STRUCTURE.stated_worth)
        runs = [residual[run][counted[run]] for run in problem.slices if counted[run].any()]
        about = np.concatenate([values - values.mean() for values in runs])
        ratio = float(np.mean(about**2)) / max(sd, problem.floor[name]) ** 2
    else:
        return None
    worth = max(float(counted.sum()) * share, STRUCTURE.stated_worth)
    least = ratio / STRUCTURE.stated**2
    p = float(chi2.sf(least * worth, worth) if known == math.inf else f.sf(least, worth, known))
    if p >= STRUCTURE.alpha:
        return None
    gain = float(worth * (ratio - 1 - math.log(ratio)))
    reason = BEYOND_REPEATS if stated is None else TOO_LARGE
    return StructureFound(output=name, variables=(), reason=reason, gain=gain, p_value=p, rest=True)


def _share(problem: Problem, base: Fit, group: SmoothDependence) -> float:
    """Return the share of a residual's variance that a group's columns explain."""
    counted = problem.kept[group.output]
    residual, columns = base.residual[group.output][counted], group.columns[counted]
    coefficients = np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1 - float(np.sum((residual - columns @ coefficients) ** 2)) / max(
        float(np.sum(residual**2)), 1e-300
    )
