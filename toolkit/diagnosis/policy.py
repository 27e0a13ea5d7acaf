"""The policy of the verdict: every number that decides what is searched, named, withdrawn, held out or told.

A number stands in the section of what it decides, with its unit and the reason for it, and nowhere else in
the search and the answer. Tolerances of one algorithm (an integrator's, a descent's) stand beside it,
and what holds of one effect alone stands in that effect's own file.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any


def _set(value: Any, unit: str, why: str) -> Any:
    return dataclasses.field(default=value, metadata={"unit": unit, "why": why})


@dataclass(frozen=True, slots=True, kw_only=True)
class _Budget:
    """What a budget of time allows beside the search."""

    quick_s: float = _set(2.0, "s of one simulation", "a slower one is not run twice to see that it repeats")
    alarm_s: float = _set(0.5, "s after its end", "a worker that is late is told by itself before the alarm")
    laws: float = _set(1 / 3, "of the budget", "kept for laws, which come after pairs and are seldom dearer")
    grace: float = _set(0.25, "of the budget", "left for predictions after a search that has spent all of it")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Worker:
    """What a case's own code may use, in a process of its own."""

    memory_GB: float = _set(
        4.0, "GB of address space", "a simulator of 100 000 rows takes 0.5; a desk computer has 8 or more"
    )
    processes: int = _set(64, "processes", "a pool on every core of a large computer, and no fork bomb")
    scratch_MB: int = _set(1024, "MB of temporary files", "when isolated they lie in the memory")
    deaths: int = _set(12, "deaths", "of single sets of parameters: one that dies more often bounds no fit")
    simulate_s: float = _set(600.0, "s", "a model file's code without a --budget: that of a diagnosis")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Which rows count, and which are held out."""

    isolated: float = _set(8.0, "robust sd from the neighbours' median", "no physics does that in one row")
    outliers: float = _set(0.03, "of a run's rows", "more than that is no outlier but a pattern")
    sharp: float = _set(0.5, "of a run's outliers", "beside sharp moves of an input: they may answer it")
    coincidence: float = _set(0.001, "chance of as many", "beside turns of the input: a dozen do not by it")
    smooth: float = _set(2.0, "times a mismatch's noise", "a rougher recording does not lead from row to row")
    fewest_for_outliers: int = _set(12, "rows of a run", "fewer have no scatter that a row could be far off")
    folds: int = _set(5, "parts", "each fit sees four fifths of the rows, at the price of five fits")
    fewest: int = _set(3, "rows of an output", "with as many nothing can be told apart from anything")
    groups: int = _set(3, "groups of a part", "where rows have no order: none is an end of the range alone")
    group: int = _set(2, "different inputs", "of a group at least: less is a point between two known ones")
    step: float = _set(0.01, "of an input's range", "less between two rows is the noise of one that dwells")
    fewer_turns: float = _set(2.33, "standard deviations", "of an input: one shuffled table in 100 has them")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drift:
    """Which outputs only drift, and over how many rows their rates are taken."""

    grows: float = _set(
        1.8, "times the way of the first half", "a steady force moves it: two where nothing leads back"
    )
    wanders: float = _set(
        0.5, "of twice the error's variance", "an error moves by in an eighth of a run: of a random walk 3/8"
    )
    fewest: int = _set(16, "rows of a run", "in fewer there are no halves to be compared")
    clear: float = _set(4.0, "times the sensor's noise", "an error moves by, where its rate says something")
    parts: int = _set(8, "parts of a run", "over more rows than one has a rate is a mean of many motions")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Priors:
    """How far a parameter of the simulation may move."""

    within: float = _set(4.0, "prior sd", "further off it is not uncertain but imitates an effect: a bound")
    far: float = _set(3.0, "prior sd", "one in 370 by chance: beyond, the fit has absorbed what was left out")
    end: float = _set(3.98, "prior sd", "a parameter that far is at its bound, to the fit's own tolerance")
    moved: float = _set(1.0, "prior sd", "a refit beyond may have left what an effect needs: both begin fits")
    wider: float = _set(10.0, "prior sd", "so wide, a prior decides nothing, and its parameter keeps a scale")
    masked: int = _set(
        4, "candidates", "of those seen from the declared values, fitted jointly where a prior is far off"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Noise:
    """What of a residual is taken for noise."""

    gap: float = _set(3.0, "median steps of time", "beyond, a series begins anew: its past tells nothing")
    fewest: int = _set(24, "values of a segment", "below, nothing can be told of its colour")
    telling: float = _set(0.5, "of all values", "what fewer show is not the colour of the rest")
    paused: int = _set(3, "segments of a run", "that many short ones are one series with pauses")
    orders: int = _set(8, "orders of the autoregression", "the highest that BIC may choose")
    mismatch: float = _set(3.0, "times a stated noise", "a larger residual is mostly no noise")
    absorbed: float = _set(
        0.05,
        "of the plain fit's residual variance",
        "more in the coloured fit: its noise has absorbed physics",
    )
    absorbed_by_chance: float = _set(
        3.0, "independent rows for each parameter", "what the plain fit takes of the noise by its parameters"
    )
    apart: float = _set(2.0, "sd of the difference", "a larger one of the two solutions is none of chance")
    as_known: float = _set(
        1.1, "times the sensor's noise", "certificates and repeats are round: a residual is no more than it"
    )
    largest: float = _set(
        0.1,
        "of an output's spread",
        "what nobody stated and no repeat shows, and is larger, is not known as noise",
    )
    still: float = _set(1e-6, "of an output's spread", "of one that moves less the noise is the spread")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Even:
    """When a rest is not one noise: louder in some runs or times, or foretold by a law."""

    rows: int = _set(48, "rows", "of a stretch: twice as many as show the colour of a noise")
    parts: int = _set(8, "stretches of a run", "an event of an eighth of it stands alone in one")
    turns: int = _set(10, "estimates of a zero", "each with weights of the last: they settle")
    clipped: float = _set(4.0, "robust sd", "what single values count for: heavy tails are no louder run")
    runs: float = _set(4.0, "times the mean square", "of the quiet runs: sensors differ by less every day")
    stretches: float = _set(9.0, "times the mean square", "of the quiet ones: what wanders comes and goes")
    matters: float = _set(0.01, "of an output's spread", "simulations are off by less now and then")
    cautious: float = _set(2.0, "times the correlation", "of short series, which seem to forget sooner")
    worth: float = _set(10.0, "independent values", "on either side: fewer scatter by as much themselves")
    alpha: float = _set(1e-5, "of all divisions", "seen on AR(1) 0.99 of a hundred rows, once in 4 000 cases")
    foretold: float = _set(0.5, "of unseen runs' mean square", "by a law: it takes more than it leaves")
    clear: float = _set(
        0.5, "of what laws leave of noise", "at best, of 399 series: one null in 60 had as much"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Averages:
    """When rows are averaged, as their quick changes are noise of the inputs."""

    slope: float = _set(
        0.85,
        "of the slope that the best means leave",
        "more rows in a mean would only blur what is looked for",
    )
    beside_recorded: float = _set(
        0.25, "of the recorded power", "of the quickest octave kept: more noise is worth its own low-pass"
    )
    beside_shared: float = _set(
        0.5, "of the power in common", "or as little: what a lag has made weak is followed even so"
    )
    fewest: int = _set(32, "means of all runs", "as many must be left to judge by")
    window: int = _set(256, "rows", "of a window of the spectra: five octaves and more")
    windows: int = _set(4, "windows side by side", "fewer are alike by chance")
    shortest: int = _set(16, "rows of a window", "three octaves: a shorter one tells no quick changes")
    bent: float = _set(0.5, "of what is not followed", "stays where a bend is missing; noise stays by any")
    missed: float = _set(
        0.5, "of the mismatch", "smooth inputs that miss more drive another motion than the recorded one"
    )
    everywhere: float = _set(0.3, "of an input's differences", "their median: of noise 1, of steps nothing")
    of_inputs: float = _set(0.2, "of what is not followed", "goes with an input's noise, or it is physics")
    jitter: float = _set(0.1, "of the usual step", "rows further apart than that are no series")
    jittering: float = _set(0.01, "of all steps", "a clock stumbles now and then")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rates:
    """Over how many rows the rate of a recorded position is a velocity."""

    noise: float = _set(
        0.05, "of the usual speed", "noise of a rate: by more, a force that follows it is found too small"
    )
    windows: int = _set(10, "windows of a run", "fewer show no motion that turns, but its mean")
    within: float = _set(2.0, "standard deviations of its noise", "a rate within them has no sign")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Past:
    """What the state of an effect with a memory may have been before a run's first row."""

    spread: float = _set(
        1.0,
        "of the range of what it follows",
        "standard deviation of its departure from rest: what was not recorded was hardly another motion",
    )
    cost: float = _set(
        1.0,
        "of the log score of unseen rows",
        "of a state that they choose themselves: Akaike's, as of chance",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scatter:
    """How far runs of the same thing may differ."""

    fewest: int = _set(2, "runs held out", "one alone has no scatter that could be told from a mismatch")
    least: float = _set(0.3, "sd of what a run shows of its own zero", "a smaller scatter changes no score")
    intervals: int = _set(3, "runs", "whose zeros and gains enter values and intervals; two tell no scatter")
    nearly: float = _set(0.95, "above the sensor", "own values take; under AR(1) of 0.99 at most 0.91")
    halved: float = _set(0.5, "of a mean square", "own values take linearly, and leave of what was left")
    loudness: tuple[float, ...] = _set(tuple(2.0**k for k in range(12)), "degrees", "from twice to 2 % apart")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Screening:
    """Which candidates a look from one hypothesis at all others finds significant."""

    alpha: float = _set(
        0.003, "of the whole search, a step", "four steps stay below the bar of 2 % false names on nulls"
    )
    sharpened: int = _set(30, "starts", "whose gain is computed with a noise estimated anew: quick ones rank")
    starts: int = _set(6, "starts of one candidate", "among the sharpened: one cannot crowd out all others")
    turns: int = _set(2, "estimates of the noise", "the second is that of what the responses leave")
    short: float = _set(10.0, "independent rows", "a gain of so few is chance: found on clean AR(1) series")
    least_trust: float = _set(0.3, "of a gain", "that the shortest series keeps: found on clean AR(1) series")
    collinear: float = _set(1e-11, "of the largest eigenvalue", "below, nothing could be told apart")
    draws: int = _set(4_000, "draws of the null", "a p-value of 0.003 has twelve draws below it")
    fewest_draws: int = _set(20, "draws below a statistic", "with fewer the drawn share is mostly chance")
    tail: float = _set(0.01, "of the draws", "from there on Bonferroni, on the tests that the tail shows")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Starts:
    """Where the search for an effect starts."""

    subsets: int = _set(
        8, "groups of runs by one condition", "each is one test more; the first are likeliest"
    )
    beyond: float = _set(0.01, "of the rows, and of their range", "where an effect shows nothing: refuted")
    beyond_sd: float = _set(5.0, "sd of the noise", "beyond what an effect can show: no noise of some rows")
    late: tuple[int, ...] = _set((1, 4, 12), "rows", "delays of a plant whose rows are far apart")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Which candidate of those that are significant becomes a step."""

    most_effects: int = _set(4, "effects", "every further step has less evidence and more ways to be wrong")
    refined: int = _set(8, "candidates", "fitted jointly, of those that screening ranks first")
    judged: int = _set(3, "joint fits", "held out one after the other, the best first, until one stands")
    rival: float = _set(
        0.5, "of the best fit's gain", "what a rival has that may foretell better beside a rest"
    )
    far_behind: float = _set(0.25, "of the best gain", "a candidate below cannot win a joint fit")
    near: float = _set(
        40.0, "of twice the log-likelihood", "however large its share: so near to the best gain it may win"
    )
    least_behind: float = _set(
        0.5,
        "of the held-out mean square",
        "what one far behind must take away, where no first one can be fitted",
    )
    least_gain: float = _set(1.5, "of the held-out log score", "less is what chance gives on rows not seen")
    hinted: float = _set(
        0.05, "of the whole search", "what coloured noise of few rows hides so far may show on unseen runs"
    )
    runs: int = _set(3, "runs", "that are held out whole, for what was only hinted at: two agree by chance")
    shown: float = _set(
        0.75,
        "of the held-out mean square",
        "taken in runs that no fit has seen, although only hinted at: they all differ from it alike",
    )
    first: float = _set(
        0.02,
        "of the held-out mean square",
        "what a first effect takes: a hundredth of an error matters to nobody",
    )
    later: float = _set(
        0.05,
        "of the held-out mean square",
        "what an effect beside others takes: their own laws are off by some",
    )
    bound: float = _set(
        1e-3, "of a bound", "an estimate as near to it ends there: the effect only imitates another"
    )
    signal: float = _set(0.5, "of an output in its right unit", "what else it may have in it")
    undone: float = _set(0.5, "of the smaller one's change", "left of two laws of a sensor: less is one")
    undone_rows: float = _set(0.5, "of the rows", "in which they take each other back: most of the range")
    visible: float = _set(0.01, "of the noise", "an effect that never moves an output by more is not there")
    band_noise: float = _set(2.0, "of the log posterior", "noise before a dead band is taken for more likely")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Units:
    """When a channel may have been recorded in another unit than the stated one."""

    gross: float = _set(0.5, "of an output's spread", "as declared: units are off by more, no calibration is")
    left: float = _set(0.2, "of the mean square", "by the right unit, its parameters still to be refitted")
    most: int = _set(4, "units", "the best: a wrong input and a wrong output often do the same")
    farthest: float = _set(100.0, "times, or a share", "where factors are looked for, and ratios counted")
    steps: int = _set(13, "factors", "each twice the one before: the joint fit goes on from the best")
    least: float = _set(1.25, "times, or a share", "a factor nearer to one is a calibration's and no unit's")
    chance: float = _set(0.2, "ratios", "as near to a factor by chance: with more the unit is one of many")
    near: float = _set(2.0, "times the sensor's noise", "left beside an exact factor: else it is a guess")
    told: float = _set(0.02, "of a ratio", "by which a law's factor may miss it and be told as a unit")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pairs:
    """Which two effects are tried at once, where no single one passes."""

    starts: int = _set(2, "starts of a candidate", "the likeliest of its shapes")
    most: int = _set(60, "starts", "of some 1 800 pairs; others explain too little to be half of one")
    better: float = _set(1.5, "times the better one's gain", "less is one effect and what mends its form")
    apart: float = _set(1e-3, "of a response", "left beside the other's, or the two are one")
    fitted: int = _set(4, "pairs", "fitted jointly, of those that are ranked first")
    judged: int = _set(2, "pairs", "held out one after the other, the best first")
    least: float = _set(
        0.2, "of an output's held-out mean square", "false names on simulations a little wrong took 14 %"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Unseen:
    """What is named by its free simulation of unseen runs alone, where the rest is beyond all noise."""

    runs: int = _set(3, "runs", "held out whole: two agree by chance")
    runs_of_laws: int = _set(2, "runs", "held out whole for a law: it is a description, and names nothing")
    fitted: int = _set(4, "candidates", "fitted jointly, of those that screening ranks first")
    judged: int = _set(3, "candidates", "held out, of those that the joint fits leave the least of")
    usual: float = _set(
        0.9, "of the held-out mean square of the median run", "taken: what imitates another takes less"
    )
    every: float = _set(0.5, "of the held-out mean square of every run", "taken, or it is none of that run's")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Following:
    """What the prediction errors of an equation along its recording propose."""

    least: float = _set(0.1, "of the prediction errors' square", "less is left to the free simulations")
    later: float = _set(0.03, "of what the terms before leave", "a second term is fitted with a large one")
    together: int = _set(2, "terms", "are fitted at once; a third is looked for beside them")
    steadier: tuple[int, ...] = _set(
        (3, 10, 30, 100),
        "times less process noise",
        "where the likeliest shows nothing: it has in it what is missing, and what acts slowly hides there",
    )
    near: float = _set(0.5, "of the best gain", "what takes less than half of what another does is not it")
    alike: float = _set(0.5, "of its response squared", "what is fitted in the place of one of several terms")
    in_place: int = _set(5, "candidates", "are fitted in the place of one of several terms")
    hopeless: float = _set(
        0.05, "of the best gain", "what takes as little is not simulated beside one that takes all of it"
    )
    idle: float = _set(
        0.05, "of one test", "where no term takes a good part: what takes no more than chance gives it"
    )
    rival: float = _set(
        0.5,
        "of the gain reached",
        "a candidate that promises as much by its free simulation is fitted as well",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lattice:
    """Whether recorded values stand on coarse steps."""

    fewest: int = _set(20, "values", "fewer have a common step by chance")
    fewest_steps: int = _set(3, "different steps", "two numbers always have a common measure, near enough")
    coarse: float = _set(0.1, "of the residual's variance", "what rounding to the step must make to matter")
    exact: float = _set(1e-3, "of a step", "by which values may miss the lattice")
    finer: float = _set(1.5, "last places", "a step of one last place is only how the file was printed")
    coarser: float = _set(10.0, "last places", "a few values have a step of two or five places by chance")
    many: int = _set(8, "different steps", "from as many on a step of two or five places is none of chance")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Structure:
    """Which structure of a residual counts as unknown physics."""

    alpha: float = _set(
        0.0005, "of all groups", "stricter than an effect's: no held-out run has a say in what is left"
    )
    sharpened: int = _set(15, "groups", "whose gain is computed with a noise estimated anew: quick ones rank")
    knots: int = _set(7, "knots of a spline", "a smooth dependence, over the quantiles of the variable")
    rows_per_column: float = _set(4.0, "rows for each column", "fewer would fit the noise")
    stated: float = _set(1.1, "times a stated noise", "that a residual may have: certificates are round")
    stated_rows: int = _set(10, "values of an output", "fewer do not show that they scatter too much")
    stated_worth: float = _set(3.0, "degrees of freedom", "at least, however coloured the noise is")
    foretold: float = _set(
        0.2,
        "of a coloured residual's mean square",
        "foretold on unseen runs by what was recorded: it is no noise",
    )
    foretold_draws: int = _set(399, "series of the residual's colour", "none of which is foretold as well")
    line: float = _set(1e-8, "p-value of a spectral line", "the noise's own resonances are lines as well")
    swings: float = _set(
        0.5, "of a channel's variance", "in one line: it swings, and what is bent answers it"
    )
    line_share: float = _set(0.05, "of a residual's variance", "a line with less matters to nobody")
    line_around: int = _set(12, "frequencies on each side", "whose median is the level below a line")
    line_rows: int = _set(64, "rows of a run", "a shorter one has too few frequencies for a level")
    line_even: float = _set(0.05, "of the mean step", "by which the runs' clocks may differ to be added")
    line_cycles: int = _set(8, "cycles a run", "slower is a trend, not a line")
    line_jitter: float = _set(0.9, "of a step", "by which single steps may differ: an even clock is put in")
    order_cycles: float = _set(
        0.25, "cycles", "by which a line may part from an angle that it keeps step with"
    )
    line_kept: float = _set(0.9, "of a run's rows", "fewer recorded ones make lines of their own")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Laws:
    """Which law structure without a name is answered by."""

    alpha: float = _set(0.0005, "of all laws", "as strict as the structure that it explains")
    most: int = _set(3, "laws", "every further one has less evidence and more ways to be wrong")
    sharpened: int = _set(30, "laws", "whose gain is computed with a noise estimated anew: quick ones rank")
    refined: int = _set(10, "laws", "whose shape is moved to its best before their gain is computed")
    rounds: int = _set(12, "rounds", "in which each law moves to its best neighbour or halves its steps")
    fitted: int = _set(5, "laws", "fitted jointly, of those that are ranked first")
    along: int = _set(2, "laws", "of these, of those that take most of the errors from row to row")
    in_place: int = _set(3, "laws", "fitted in the best one's place: they are ranked where it has led")
    judged: int = _set(3, "laws", "held out one after the other, the best first, until one stands")
    share: float = _set(0.1, "of the held-out mean square", "what a law takes, or it matters to nobody")
    same: float = _set(
        0.95, "of what laws take of the held-out mean square", "by effects: the laws are their own formulas"
    )
    outdoes: float = _set(2.0, "times what effects take", "of unseen rows, by laws or left: they are minor")
    kept: float = _set(
        0.5, "of its size", "by which an effect may be smaller or larger beside laws and be the same effect"
    )
    itself: float = _set(0.05, "of an output's variance", "what a second record of it is off by")
    steady: float = _set(0.01, "of a rate", "by which it may vary and be one number")
    moved: float = _set(1.0, "prior sd", "a parameter that goes farther is what the law may be taken for")
    points: int = _set(41, "points of a curve", "that is drawn of a law over what was recorded")
    step: float = _set(1e-4, "of a parameter", "by which the band of a curve is differentiated")
    knots: int = _set(7, "knots of a curve", "as many as the structure was found with")
    times: int = _set(7, "time constants", "geometrically from two rows to a quarter of the recording")
    tones: int = _set(81, "frequencies", "within one line of a spectrum to either side: 40 to a line")
    locked: int = _set(8, "frequencies", "to a line of the whole session, for a tone whose phase goes on")
    locked_most: int = _set(4000, "frequencies", "runs farther apart share no phase of one tone")
    ends: int = _set(81, "times of a run", "between which an event in an equation may begin and end")
    apart: float = _set(1e-12, "of a response", "squared, of two steps in an equation: less is rounding")
    columns: int = _set(4_000_000, "numbers of a response", "of laws in an equation propagated together")
    cuts: int = _set(120, "stretches of a run", "on whose ends an event may begin and end")
    event_rows: int = _set(40, "values of a run", "fewer do not tell an event from a few outliers")
    stands_out: float = _set(
        3.0, "rms of other stretches as long", "an event's mean; less is what wanders, not what happened"
    )
    event_least: int = _set(5, "rows", "fewer are single values far off, not an event")
    event_most: float = _set(0.6, "of a run", "what lasts longer is no event but the run's own zero")
    alike: float = _set(0.5, "of a response", "left beside a known effect's, above which it is not like it")
    resembling: int = _set(3, "known effects", "that a law is told to be like, the nearest first")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Verdict:
    """What the answer says of what the search has found."""

    close: float = _set(3.0, "of the log-likelihood", "within which the data prefer neither of two effects")
    mostly: float = _set(0.5, "of the log-likelihood", "named effects explain it, beside what stays unknown")
    nearly: float = _set(0.9, "of the held-out mean square above the noise", "little is left beside it")
    taken: float = _set(
        2 / 3, "of the held-out mean square above the noise", "named effects take, in one output"
    )
    accuracy: float = _set(
        0.01,
        "of an output's spread",
        "a simulation that nobody calibrated is off by as much without any effect",
    )
    shown: float = _set(1.1, "times the noise's mean square", "an output with less shows no mismatch")
    telling: float = _set(20.0, "of the summed squares over the noise's", "one moved by less is not told")
    interval: float = _set(0.95, "probability", "of the confidence intervals that the contract promises")
    open_interval: float = _set(1e5, "times the value", "a wider interval is none: the data leave it open")
    power: float = _set(0.8, "probability", "with which the smallest detectable size would have been found")
    far: float = _set(1e3, "times the usual size", "no response is in proportion over so many sizes")
    moved: float = _set(0.25, "of an output's range", "a larger response that is not seen is no size to tell")
    of_a_run: float = _set(
        0.5, "of the longest run", "a later channel has fewer rows to show it than it loses"
    )
    own: float = _set(0.9, "of what an effect does", "a parameter of its unit does: it is not missing")
    observable: float = _set(1e-3, "of a response", "beside the nominal parameters, or nothing is seen of it")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Location:
    """Where a mismatch is said to be."""

    bins: int = _set(10, "quantiles of a variable", "the ends of a range fall on them")
    held: float = _set(0.8, "of the mismatch's energy", "a range must hold to be the place of it")
    narrow: float = _set(0.7, "of the rows", "a range that is wider says nothing")
    whole: float = _set(0.95, "of the rows", "a range as wide is all that was recorded")
    ranges: int = _set(3, "ranges", "told of one mismatch, the narrowest first")
    listed: int = _set(8, "values left out", "named one by one: a page of them says no more")
    run: float = _set(0.2, "of a run's mean energy", "a run with less is not named among those of a range")


BUDGET, WORKER, ROWS, PRIORS, NOISE = _Budget(), _Worker(), _Rows(), _Priors(), _Noise()
PAST, RATES, SCATTER, AVERAGES, EVEN = _Past(), _Rates(), _Scatter(), _Averages(), _Even()
SCREENING, STARTS, STEP, PAIRS, LATTICE = _Screening(), _Starts(), _Step(), _Pairs(), _Lattice()
DRIFT, UNSEEN, FOLLOWING, UNITS = _Drift(), _Unseen(), _Following(), _Units()
STRUCTURE, LAWS, VERDICT, LOCATION = _Structure(), _Laws(), _Verdict(), _Location()
SECTIONS = tuple(value for value in list(globals().values()) if type(value).__module__ == __name__)
