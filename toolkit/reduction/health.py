"""What the rows of one recording show of its channels: dead, stuck, saturated and copied ones, stray rows, a
clock that does not run, and a tare that was recorded under load.

Nothing here asks for a calibration. A channel that the result reads makes its numbers unreliable, an error;
of any other it is a warning, and the audit of an archive lists all as notes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import RecordingError
from toolkit.findings import Finding, Level
from toolkit.reduction.averaging import clock_of, shaft_turns
from toolkit.reduction.blocks import find_blocks, is_tare
from toolkit.units import in_both

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.machine import Machine
    from toolkit.recording.model import Recording, Series


_FEW_ROWS = 8  # fewer prove nothing
_STUCK = 6  # rows in a row at one value, of a channel whose neighbouring rows otherwise differ
_SMOOTH = 3  # times the rows for which a channel stands still elsewhere
_BY_CHANCE = 1e-4  # how often a sound file of coarse digits may show such rows
_JUMP = 10.0  # in median steps of the clock
_STRAY = 15.0  # standard deviations of the other rows
_CORE = 0.8  # of the rows, the nearest to their median: what a few stray ones cannot widen
_CORE_SD = 0.662  # standard deviation of that part of a normal distribution
_LISTED_FILES = 6  # files with one trouble that are named each by itself
_LEVELS: tuple[Level, ...] = ("error", "warning", "note")
_MEASURED = ("load", "indication", "slip_angle")


def quality(recording: Recording, where: str) -> tuple[Finding, ...]:
    """Return what the channels of a recording show, as notes; nothing of its blocks is known.

    ``constant-channel``: a measured channel that never changes. ``saturated-channel``: rows that stand
    exactly at a channel's largest or smallest value, more in a row than its digits explain.
    ``copied-channel``: two measured channels that move alike in every row. ``clock-jump``: a
    time channel that runs backwards, stands still, or leaps by over ten of its steps.
    """
    if recording.rows < _FEW_ROWS:
        return ()
    findings: list[Finding] = []
    for channel in recording.series:
        text = None
        if channel.role == "time":
            text, rule = _clock(channel), "clock-jump"
        elif channel.role in _MEASURED:
            if _constant(channel.values):
                text, rule = _constant_text(channel), "constant-channel"
            else:
                rule, text = _stuck(channel, only_ends=True) or ("", None)
        if text is not None:
            findings.append(Finding(rule=rule, where=where, message=text, level="note"))
    for text, _ in _copied(recording, [slice(0, recording.rows)]):
        findings.append(Finding(rule="copied-channel", where=where, message=text, level="note"))
    return tuple(findings)


def health_findings(
    recording: Recording,
    where: str,
    *,
    stretches: Sequence[slice],
    read: Collection[str] | None = None,
    settled: bool = True,
    counted: bool = False,
) -> list[Finding]:
    """Return what the channels show in the rows that make a result: its load blocks, or a tare.

    Parameters
    ----------
    stretches : the rows of each block; between two of them a channel may do what it likes
    read : the indications that the calibration reads, all where None
    settled : False for a sweep, whose rows follow no mean
    counted : whether clock and shafts count from the file's first row on, not from each block's

    Notes
    -----
    Load and slip angle are set and may stand still; an indication answers to them and may not, unless every
    channel stands still with it, as in a recording without noise.
    """
    findings: list[Finding] = []

    def add(rule: str, text: str, level: Level) -> None:
        findings.append(Finding(rule=rule, where=where, message=text, level=level))

    for channel in recording.series:
        level: Level = "warning" if read is not None and channel.symbol not in read else "error"
        rows = np.concatenate([channel.values[stretch] for stretch in stretches]) if stretches else ()
        if channel.role == "indication" and len(rows) >= _FEW_ROWS:
            if _constant(channel.values):
                if _others_scatter(recording, channel, stretches):
                    add("constant-channel", _constant_text(channel), level)
            elif (stuck := _stuck(channel)) is not None:
                add(*stuck, level)
        if settled and channel.role in _MEASURED and (text := _stray(channel, stretches)) is not None:
            add("stray-row", text, "error" if channel.role != "indication" else level)
    for text, pair in _copied(recording, stretches):
        counts = read is None or any(
            channel.role != "indication" or channel.symbol in read for channel in pair
        )
        add("copied-channel", text, "error" if counts else "warning")
    if settled and (text := _repeated(recording, stretches)) is not None:
        add("constant-channel", text, "warning")
    counted_rows = [slice(0, recording.rows)] if counted else stretches
    for channel in recording.series:
        if channel.role == "time" or channel.symbol in ("TIRE_ANGLE", "DRUM_ANGLE"):
            troubles = [t for stretch in counted_rows if (t := _counter(channel, stretch)) is not None]
            if troubles:
                text, worst = min(troubles, key=lambda trouble: _LEVELS.index(trouble[1]))
                add("clock-jump", text, worst)
    return findings


def first_of_many(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings of the files of a test; what more than a few files show alike is said once."""
    alike: dict[tuple[str, str, Level], list[Finding]] = {}
    for finding in findings:
        channel = finding.message.split(" ", 1)[0]
        alike.setdefault((finding.rule, channel, finding.level), []).append(finding)
    return [
        finding
        for group in alike.values()
        for finding in (
            group
            if len(group) <= _LISTED_FILES
            else [dataclasses.replace(group[0], where=f"{len(group)} files ({group[0].where}, ...)")]
        )
    ]


def tare_under_load(recording: Recording, machine: Machine) -> RecordingError | None:
    """Return why a recording is no tare: a part of it is under load; None where it is one.

    Without a column of the load nothing is known of it.
    """
    if not recording.has("FZ"):
        return None
    smallest = min(machine.protocol.loads_N)
    loaded = [b for b in find_blocks(recording["FZ"].si) if not is_tare(b, smallest_load=smallest)]
    if not loaded:
        return None
    worst = max(loaded, key=lambda block: abs(block.mean_FZ))
    return RecordingError(
        "the tare was recorded under load",
        where=recording.path,
        got=f"FZ is {in_both(worst.mean_FZ, 'N', '.0f')} in rows {worst.start + 1} to {worst.stop}",
        expected=f"under 5 % of the smallest load of the protocol, {in_both(0.05 * smallest, 'N', '.0f')}",
        next_step="name a recording with the tire off the road in '[tare] file', or correct the zero of the "
        "load channel",
        rule="tare-under-load",
    )


def tare_finding(error: RecordingError, where: str, *, level: Level) -> Finding:
    """Return a tare under load as a finding, where its file is looked at by itself."""
    message = f"the tare was recorded under load: {error.got}"
    return Finding(rule="tare-under-load", where=where, message=message, level=level)


def _constant(values: Array) -> bool:
    return bool(np.all(values == values[0]))


def _constant_text(channel: Series) -> str:
    return f"{channel.header} is {channel.values[0]:g} {channel.unit} in all {len(channel.values)} rows"


def _others_scatter(recording: Recording, channel: Series, stretches: Sequence[slice]) -> bool:
    # Whether another measured channel moves from row to row while this one stands still.
    channels = (c for c in recording.series if c.role in ("load", "indication") and c is not channel)
    return any(np.ptp(other.values[stretch]) > 0 for other in channels for stretch in stretches)


def _copied(recording: Recording, stretches: Sequence[slice]) -> list[tuple[str, tuple[Series, Series]]]:
    """Return which measured channels move alike in every row, in words and as a pair.

    Each channel has an amplifier and a noise of its own: two whose steps agree to the last digit, or have the
    other sign, in more rows than their digits explain are one signal. A simulation may have no noise.
    """
    if recording.simulated:
        return []
    steps = [
        (channel, np.concatenate([np.diff(channel.values[stretch]) for stretch in stretches]))
        for channel in recording.series
        if channel.role in _MEASURED
        if stretches
    ]
    found = []
    for place, (one, of_one) in enumerate(steps):
        for other, of_other in steps[place + 1 :]:
            for sign, word in ((1, ""), (-1, " with the other sign")):
                # Beside the digit of a channel its steps differ by the rounding of binary numbers alone.
                room = 1e-9 * (np.max(np.abs(one.values)) + np.max(np.abs(other.values)))
                if not len(of_one) or np.any(np.abs(of_one - sign * of_other) > room):
                    continue
                _, counts = np.unique(np.round(of_one / room) if room else of_one, return_counts=True)
                alike = float(np.sum((counts / len(of_one)) ** 2))  # of two rows of independent channels
                if alike ** len(of_one) <= _BY_CHANCE:
                    text = (
                        f"{one.header} and {other.header} move alike to the last digit in {len(of_one)} rows"
                    )
                    found.append((text + word, (one, other)))
                    break
    return found


def _repeated(recording: Recording, stretches: Sequence[slice]) -> str | None:
    """Return in words that every row of each block repeats one reading of every channel, None where not.

    A recording of a simulation may have no noise.
    """
    if recording.simulated:
        return None
    channels = [c for c in recording.series if c.role in ("load", "indication")]
    long = [stretch for stretch in stretches if stretch.stop - stretch.start >= _FEW_ROWS]
    if not long or any(np.ptp(c.values[stretch]) > 0 for c in channels for stretch in long):
        return None
    return (
        f"all rows of a block repeat its first reading in every channel, in {len(long)} block(s): the mean "
        "is that of one sample, and its uncertainty is not known"
    )


def _stuck(series: Series, *, only_ends: bool = False) -> tuple[str, str] | None:
    """Return rule and words where a channel stands at one value for longer than its digits explain."""
    values = series.values
    repeated = values[1:] == values[:-1]
    if int(repeated.sum()) < _STUCK - 1:
        return None  # the usual case, and the cheap one
    start, length = _longest(repeated)
    length += 1
    ends = (float(values.min()), float(values.max()))
    value = float(values[start])
    if only_ends and value not in ends:
        return None
    # A channel printed so coarsely that it often repeats stands still by chance, not at an end of its range;
    # one that a filter smoothed does so for several rows on end, here and elsewhere.
    outside = len(repeated) - (length - 1)
    chance = (int(repeated.sum()) - (length - 1)) / outside if outside else 1.0
    elsewhere = repeated & (values[1:] != value)
    usual = _longest(elsewhere)[1] + 1 if elsewhere.any() else 1
    if length < max(_STUCK, _SMOOTH * usual) or len(values) * chance ** (length - 1) > _BY_CHANCE:
        return None
    rows = f"rows {start + 1} to {start + length}"
    if value in ends:
        text = f"{series.header} stands at {value:g} {series.unit}, an end of its range, in {rows}"
        return "saturated-channel", text
    return "constant-channel", f"{series.header} stands at {value:g} {series.unit} in {rows}"


def _longest(true: NDArray[np.bool_]) -> tuple[int, int]:
    # Start and length of the longest run of True.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    starts, lengths = edges[::2], edges[1::2] - edges[::2]
    best = int(np.argmax(lengths))
    return int(starts[best]), int(lengths[best])


def _stray(series: Series, stretches: Sequence[slice]) -> str | None:
    """Return in words which row lies far off all others of its block, the farthest of a channel."""
    digit = _last_digit(series.values)
    worst: tuple[float, int, float, float] | None = None
    for stretch in stretches:
        values = series.values[stretch]
        if len(values) < _FEW_ROWS:
            continue
        middle = float(np.median(values))
        off = np.abs(values - middle)
        core = np.sort(off)[: math.ceil(_CORE * len(off))]
        scatter = max(float(np.sqrt(np.mean(core**2))) / _CORE_SD, digit)
        place = int(np.argmax(off))
        if off[place] > _STRAY * scatter > 0 and (worst is None or off[place] / scatter > worst[0]):
            worst = (off[place] / scatter, stretch.start + place, float(values[place]), middle)
    if worst is None:
        return None
    times, row, value, middle = worst
    return (
        f"{series.header} is {value:.4g} {series.unit} in row {row + 1}, {times:.0f} standard deviations of "
        f"the block's other rows off their {middle:.4g} {series.unit}"
    )


def _last_digit(values: Array) -> float:
    steps = np.diff(np.unique(values))
    return float(steps.min()) if len(steps) else 0.0


def _clock(series: Series) -> str | None:
    steps = np.diff(series.values)
    usual = float(np.median(steps))
    bad = np.flatnonzero((steps <= 0) | (steps > _JUMP * usual))
    if not len(bad):
        return None
    row = int(bad[0])
    return (
        f"{series.header} goes from {series.values[row]:g} to {series.values[row + 1]:g} {series.unit} after "
        f"row {row + 1}; the usual step is {usual:g}" + (f" ({len(bad)} such places)" if len(bad) > 1 else "")
    )


def _counter(series: Series, stretch: slice) -> tuple[str, Level] | None:
    """Return in words what is wrong with a clock or a shaft in some rows, and its level; None: nothing.

    A clock whose steps are coarser than the rows counts none the less.
    """
    rows = f"rows {stretch.start + 1} to {stretch.stop}"
    values = series.values[stretch]
    if len(values) < 2:
        return None
    if series.role != "time":
        if len(values) < _FEW_ROWS or shaft_turns(series.si_of(stretch)) is not None:
            return None
        return f"{series.header} does not turn in one direction in {rows}: it counts no revolutions", "error"
    if _constant(values):
        return f"{series.header} stands at {values[0]:g} {series.unit} in {rows}", "error"
    if clock_of(values) is None:
        row = int(np.flatnonzero(np.diff(values) < 0)[0])
        text = (
            f"{series.header} runs backwards from {values[row]:g} to {values[row + 1]:g} {series.unit} after "
        )
        return text + f"row {stretch.start + row + 1}", "error"
    ticks = np.flatnonzero(np.diff(values) > 0)
    steps = np.diff(values)[ticks]
    far = np.flatnonzero(steps > _JUMP * float(np.median(steps)))
    if len(values) >= _FEW_ROWS and len(far):
        row = int(ticks[far[0]])
        text = f"{series.header} leaps from {values[row]:g} to {values[row + 1]:g} {series.unit} after "
        return text + f"row {stretch.start + row + 1}", "warning"
    if len(values) >= _FEW_ROWS and len(ticks) < len(values) - 1:
        return f"{series.header} repeats its value in {rows}: its steps are coarser than the rows", "note"
    return None
