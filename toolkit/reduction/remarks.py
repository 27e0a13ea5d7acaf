"""What a user should know about the files of a test as a whole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.uncertainty.common_errors import reference_findings
from toolkit.channels import CHANNELS
from toolkit.findings import Finding
from toolkit.reduction.limits import CONDITIONS, condition_finding, condition_of, farthest
from toolkit.units import from_si, in_both, unit

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.machine import Machine, Protocol
    from toolkit.recording.model import TestInfo
    from toolkit.reduction.model import Condition
    from toolkit.reduction.prepare_rows import OpenedFile
    from toolkit.reduction.selection import Selection

# A cell may leave the range of the reference loads by this part of it before it is said aloud.
_BEYOND = 0.05
_PARTS = 5  # of a block, whose means show a move
_SIZES = ("FZ", "V")  # axes give them a sign


def machine_findings(info: TestInfo, machine: Machine) -> list[Finding]:
    """Return what the test declares against what tires are tested at, and against protocol or machine."""
    stated = {"P": info.pressure_Pa, "V": info.speed_m_s, "rated_load": info.rated_load_N}
    unusual = [
        condition_finding(name, value, where="test.toml")
        for name, value in stated.items()
        if value is not None
    ]
    asked = [] if info.speed_m_s is None else _speed([info.speed_m_s], "test.toml", machine)
    return [*filter(None, unusual), *asked]


def condition_findings(files: Sequence[OpenedFile]) -> list[Finding]:
    """Return the measured conditions that no tire is tested at, by the means of the load blocks."""
    outside: dict[str, dict[str, float]] = {}
    units: dict[str, str] = {}
    judged: dict[str, str] = {}
    for file in files:
        for series in file.recording.series:
            name = condition_of(series.symbol, series.unit)
            if name is None:
                continue
            means = [float(np.mean(series.si_of(window.rows))) for window in file.windows]
            means = [abs(mean) for mean in means] if name in _SIZES else means
            if (worst := farthest(name, means)) is not None:
                outside.setdefault(series.symbol, {})[file.name] = worst
                units.setdefault(series.symbol, series.unit)
                judged[series.symbol] = name
    findings = (
        condition_finding(
            judged[symbol],
            max(by_file.values(), key=abs),
            where=_first_names(list(by_file)),
            stated_in=units[symbol],
            called=None if symbol in CONDITIONS else symbol,
        )
        for symbol, by_file in outside.items()
    )
    return [*filter(None, findings)]


def pressure_findings(info: TestInfo, machine: Machine) -> list[Finding]:
    """Tell that the pressure is not known, where the machine states what an error of it does."""
    if info.pressure_Pa is not None or not machine.stated_uncertainty("P").effect:
        return []
    message = "the test does not say its inflation pressure: the uncertainties hold no part for it"
    return [Finding(rule="no-pressure", where="test.toml", message=message, level="note")]


def speed_findings(files: Sequence[OpenedFile], machine: Machine) -> list[Finding]:
    """Return the files whose own speed channel, averaged over a block, leaves the tolerance.

    A speed counts by its size, but a negative one contradicts a run that is declared to be forward. A sensor
    without a sign says nothing of a reversed run.
    """
    speeds: dict[str, list[float]] = {}
    backwards: dict[str, float] = {}
    for file in files:
        if not file.recording.has("V"):
            continue
        V = file.recording["V"].si
        for window in file.windows:
            mean = float(np.mean(V[window.rows]))
            if _speed([abs(mean)], file.name, machine):
                speeds.setdefault(file.name, []).append(abs(mean))
            if mean < 0 and file.rotation == "forward":
                backwards[file.name] = min(mean, backwards.get(file.name, 0.0))
    findings = []
    if speeds:
        every = [v for values in speeds.values() for v in values]
        findings += _speed(every, _first_names(list(speeds)), machine)
    if backwards:
        worst = float(from_si(min(backwards.values()), "km/h"))
        message = (
            f"the speed is {worst:.2f} km/h in a run that is declared forward: the drum turned the other "
            "way, or the column has the other sign"
        )
        findings.append(Finding(rule="speed", where=_first_names(list(backwards)), message=message))
    return findings


def swept_findings(files: Sequence[OpenedFile], machine: Machine) -> list[Finding]:
    """Return the files whose slip angle moves within a block, of which one condition is made."""
    tolerance = machine.protocol.slip_angle_tolerance_rad
    swept: dict[str, tuple[float, int, int]] = {}
    for file in files:
        for block, window in zip(file.blocks, file.windows, strict=True):
            # Means of parts, so that noise is no move.
            parts = np.array_split(file.channels[0, block.rows], min(_PARTS, block.n))
            moved = float(np.ptp([part.mean() for part in parts]))
            if moved > tolerance and moved > swept.get(file.name, (0.0, 0, 0))[0]:
                swept[file.name] = moved, window.rows.stop - window.rows.start, block.n
    if not swept:
        return []
    moved, averaged, rows = max(swept.values())
    message = (
        f"the slip angle moves by {math.degrees(moved):.2f} deg within a load block: {averaged} of its "
        f"{rows} rows are averaged to one condition"
    )
    return [Finding(rule="swept-block", where=_first_names(list(swept)), message=message)]


def selection_findings(files: Sequence[OpenedFile], selection: Selection) -> list[Finding]:
    """Tell the load blocks that are of another condition than the test's, which are not used."""
    names = [file.name for file in files for _ in file.windows]
    findings = []
    if selection.left_out:
        away = list(
            dict.fromkeys(name for name, selected in zip(names, selection.rows, strict=True) if not selected)
        )
        message = (
            f"{selection.left_out} of {len(names)} load blocks are at other conditions and not used: "
            f"{'; '.join(selection.apart)}"
        )
        findings.append(Finding(rule="other-conditions", where=_first_names(away), message=message))
    if selection.stands:
        message = f"{'; '.join(selection.stands)} in every block that is used: the curves are of that"
        findings.append(
            Finding(
                rule="one-condition",
                where=_first_names(list(dict.fromkeys(names))),
                message=message,
                level="note",
            )
        )
    return findings


def _speed(speeds_m_s: Sequence[float], where: str, machine: Machine) -> list[Finding]:
    protocol, drum = machine.protocol, machine.drum
    expected = drum.speed_m_s if protocol.speed_m_s is None else protocol.speed_m_s
    tolerance = (
        drum.speed_tolerance_m_s if protocol.speed_tolerance_m_s is None else protocol.speed_tolerance_m_s
    )
    worst = max(speeds_m_s, key=lambda speed: abs(speed - expected))
    # A speed on the edge of the tolerance is inside it, however its unit rounds.
    if abs(worst - expected) <= tolerance * (1 + 1e-9):
        return []
    measured, nominal, room = from_si([worst, expected, tolerance], "km/h")
    message = f"speed {measured:.2f} km/h is outside {nominal:.2f} +- {room:g} km/h"
    return [Finding(rule="speed", where=where, message=message)]


def tare_findings(files: Sequence[OpenedFile], record: CalibrationRecord) -> list[Finding]:
    """Tell that there is no tare, or that the tare of some files served all."""
    source = files[0].tare.source
    if source == "none":
        message = (
            "no tare was recorded or declared: the zero of the cells stays in FY and MZ, "
            + (
                "and in their uncertainty"
                if any(u for _, u in files[0].tare.u)
                else "and no uncertainty holds it: the machine definition states none ([type_b] zero)"
            )
            + ("" if record.zero == "included" else "; the record was fitted on tared indications")
        )
        return [Finding(rule="no-tare", where=_first_names([file.name for file in files]), message=message)]
    if source.startswith("mean of"):
        message = f"the {source} was subtracted from every file"
        return [
            Finding(rule="tare-shared", where=_first_names([file.name for file in files]), message=message)
        ]
    return []


def angle_findings(files: Sequence[OpenedFile]) -> list[Finding]:
    """Name columns that look like a shaft angle and are none that the toolkit knows."""
    columns = dict.fromkeys(
        channel.header
        for file in files
        if not (file.recording.has("TIRE_ANGLE") or file.recording.has("DRUM_ANGLE"))
        for channel in file.recording.series
        if channel.role == "covariate"
        and unit(channel.unit).dimension == "angle"
        and channel.symbol not in CHANNELS
    )
    if not columns:
        return []
    message = (
        f"column {', '.join(columns)} is an angle but not known as TIRE_ANGLE or DRUM_ANGLE: no row was "
        "discarded by it"
    )
    return [Finding(rule="unknown-angle", where=_first_names([file.name for file in files]), message=message)]


def window_findings(files: Sequence[OpenedFile]) -> list[Finding]:
    """Name the files whose blocks end too early."""
    short = [file.name for file in files if any(w.short for w in file.windows)]
    if not short:
        return []
    message = "a block ends before settling and averaging are complete; its last revolution was averaged"
    return [Finding(rule="short-block", where=_first_names(short), message=message)]


def acquired_findings(files: Sequence[OpenedFile], record: CalibrationRecord) -> list[Finding]:
    """Tell that another calibration wrote the FY and MZ of the files."""
    wrong = [d for file in files for d in file.differences if not d.explained]
    if not wrong:
        return []
    largest = {c: max((d.largest for d in wrong if d.channel == c), default=0.0) for c in ("FY", "MZ")}
    return [
        Finding(
            rule="acquired-differs",
            where=_first_names(list(dict.fromkeys(d.file for d in wrong))),
            message=f"FY and MZ in the file are not what {record.id} gives of its cells: they differ by "
            f"up to {in_both(largest['FY'], 'N', '.1f')} and {in_both(largest['MZ'], 'N*m', '.2f')}; the "
            "values here are recomputed from the cells, and wrong where a cell was changed (inspect tells "
            "which side is wrong)",
        )
    ]


def record_findings(record: CalibrationRecord) -> list[Finding]:
    """Tell that the record is only a legacy import, or that no uncertainty holds its reference standard."""
    if record.verified:
        return [*reference_findings(record)]
    message = "the record is a legacy import without its reference data: nothing verifies its coefficients"
    return [Finding(rule="unverified", where=record.id, message=message)]


def range_findings(conditions: Sequence[Condition], record: CalibrationRecord) -> list[Finding]:
    """Name the cells that left the range of the record's reference loads: the record extrapolates there."""
    findings = []
    for place, cell in enumerate(record.cells):
        if cell.minimum is None or cell.maximum is None:
            continue
        room = _BEYOND * (cell.maximum - cell.minimum)
        outside = [
            c for c in conditions if not cell.minimum - room <= c.indications[place] <= cell.maximum + room
        ]
        if outside:
            values = [c.indications[place] for c in outside]
            message = (
                f"{cell.name} reads {min(values):.4g} to {max(values):.4g} {cell.unit} in {len(outside)} "
                f"blocks; the reference loads of {record.id} reached {cell.minimum:.4g} to {cell.maximum:.4g}"
            )
            findings.append(
                Finding(rule="beyond-range", where=_first_names(_files(outside)), message=message)
            )
    return findings


def _files(conditions: Sequence[Condition]) -> list[str]:
    return list(dict.fromkeys(c.file for c in conditions))


def averaging_text(files: Sequence[OpenedFile], machine: Machine) -> str:
    """Return in words what was averaged and over how many revolutions."""
    turns = [w.revolutions for file in files for w in file.windows if w.revolutions is not None]
    settle, length = machine.protocol.settle_revolutions, machine.protocol.average_revolutions
    shaft = machine.protocol.revolutions_of
    if not turns:
        return (
            f"whole blocks averaged, nothing discarded: the machine starts acquisition after {settle:g} "
            f"{shaft} revolutions and records {length:g}; the files have no time or angle channel to count "
            "them"
        )
    settled = [w for file in files for w in file.windows if not w.short]
    if not settled:
        return (
            f"every block ends before {settle:g} {shaft} revolutions of settling and {length:g} of averaging"
            f": its last {min(turns):.2f} to {max(turns):.2f} revolutions averaged"
        )
    return (
        f"the first {settle:g} {shaft} revolutions of each block discarded, then averaged over "
        f"{min(turns):.2f} to {max(turns):.2f} revolutions"
    )


def _first_names(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{len(names)} files ({names[0]}, ...)"


# Drift between the repeats that a protocol declares: the same condition, measured again later.

_LEVEL = 2.0  # a drift inside its own expanded uncertainty is none


def drift_findings(conditions: Sequence[Condition], protocol: Protocol) -> list[Finding]:
    """Return one finding for each direction and channel whose repeats drift beyond the protocol's tolerance.

    The tolerance is a part of the largest value of the channel at that load and direction. First repeat
    against last, in the order of the files' names.
    """
    findings = []
    for rotation in dict.fromkeys(c.rotation for c in conditions):
        for channel, channel_unit in (("FY", "N"), ("MZ", "N*m")):
            worst: tuple[float, float, Condition] | None = None
            count = 0
            for condition, difference, limit in _drifts(conditions, rotation, channel, protocol):
                if abs(difference) > limit:
                    count += 1
                    if worst is None or abs(difference) / limit > abs(worst[0]) / worst[1]:
                        worst = (difference, limit, condition)
            if worst is None:
                continue
            difference, limit, condition = worst
            angle = float(from_si(condition.step_SA or 0.0, "deg"))
            message = (
                f"{channel} drifts between repeats in {count} condition(s), at {angle:g} deg and "
                f"{in_both(condition.step_FZ or 0.0, 'lbf', '.0f')} by "
                f"{in_both(difference, channel_unit, '.3g')}; "
                f"{in_both(limit, channel_unit, '.3g')} are tolerated"
            )
            findings.append(Finding(rule="repeat-drift", where=f"drum {rotation}", message=message))
    return findings


def _drifts(
    conditions: Sequence[Condition], rotation: str, channel: str, protocol: Protocol
) -> list[tuple[Condition, float, float]]:
    """Return (last repeat, drift, tolerated drift) of every repeated condition of one direction."""

    def value(condition: Condition) -> float:
        return condition.FY_common if channel == "FY" else condition.MZ_common

    def u(condition: Condition) -> float:
        return condition.u_FY_common if channel == "FY" else condition.u_MZ_common

    drifts = []
    compared = [c for c in conditions if c.used and c.rotation == rotation and c.step_SA is not None]
    for load in dict.fromkeys(c.step_FZ for c in compared):
        repeated = sorted((c for c in compared if c.step_FZ == load), key=lambda c: (c.file, c.first_row))
        largest = max(abs(value(c)) for c in repeated)
        steps = sorted({c.step_SA for c in repeated if c.step_SA is not None})
        angles = np.array([np.mean([c.SA for c in repeated if c.step_SA == s]) for s in steps])
        means = np.array([np.mean([value(c) for c in repeated if c.step_SA == s]) for s in steps])
        slopes = np.gradient(means, angles) if len(steps) > 1 else np.zeros(1)
        for step, slope in zip(steps, slopes.tolist(), strict=True):
            repeats = [c for c in repeated if c.step_SA == step]
            if len(repeats) < 2:
                continue
            first, last = repeats[0], repeats[-1]
            drift = value(last) - value(first) - slope * (last.SA - first.SA)
            limit = max(protocol.repeat_tolerance * largest, _LEVEL * math.hypot(u(first), u(last)))
            drifts.append((last, drift, limit))
    return drifts
