"""Hold a test against its protocol: which condition each block is, and what departs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.channels import Rotation
from toolkit.findings import Finding
from toolkit.units import from_si, in_both

if TYPE_CHECKING:
    from toolkit.machine import Protocol

# A block belongs to a nominal load when it is nearer to it than this part of the load; beyond, it is a
# load that the protocol does not know.
_LOAD_REACH = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """Where one block stands in the protocol; ``file_order`` is its file's place in the sorted names."""

    file: str
    file_order: int
    rotation: Rotation
    SA: float
    FZ: float
    step_SA: float | None
    step_FZ: float | None


def nearest_step(SA: float, protocol: Protocol) -> float | None:
    """Return the slip angle step [rad] nearest to a measured angle, None where every one is too far.

    The reach is half the distance to the neighbouring step, at least the tolerance: a file that is out
    of tolerance still is that step, with a finding.
    """
    steps = sorted(set(protocol.slip_angles_rad))
    best = min(steps, key=lambda step: abs(step - SA))
    distances = [abs(step - best) for step in steps if step != best]
    reach = max(protocol.slip_angle_tolerance_rad, min(distances) / 2) if distances else math.inf
    return best if abs(best - SA) <= reach else None


def nearest_load(FZ: float, protocol: Protocol) -> float | None:
    """Return the nominal load [N] nearest to a measured one, None where the protocol has none there."""
    best = min(protocol.loads_N, key=lambda load: abs(load - FZ))
    return best if abs(FZ - best) <= _LOAD_REACH * best else None


def doubled(placed: Sequence[Placed], protocol: Protocol) -> tuple[int, ...]:
    """Return the indices of blocks beyond the repeats that the protocol declares: they stay unused.

    Of more blocks than it asks for, the earlier files count.
    """
    counts: Counter[tuple[Rotation, float, float]] = Counter()
    later: list[int] = []
    for index in sorted(range(len(placed)), key=lambda i: placed[i].file_order):
        recording = placed[index]
        if recording.step_SA is None or recording.step_FZ is None:
            continue
        key = (recording.rotation, recording.step_SA, recording.step_FZ)
        if counts[key] >= protocol.times(recording.step_SA):
            later.append(index)
        counts[key] += 1
    return tuple(sorted(later))


def check(
    placed: Sequence[Placed], later: Sequence[int], protocol: Protocol, rotations: Sequence[Rotation]
) -> list[Finding]:
    """Return the departures from the protocol as findings."""
    return [
        *_missing(placed, protocol, rotations),
        *_doubled(placed, later),
        *_angles(placed, protocol),
        *_loads(placed, protocol),
    ]


def _missing(placed: Sequence[Placed], protocol: Protocol, rotations: Sequence[Rotation]) -> list[Finding]:
    findings: list[Finding] = []
    for rotation in rotations:
        recorded = Counter((p.step_SA, p.step_FZ) for p in placed if p.rotation == rotation)
        if not recorded:
            findings.append(
                Finding(
                    rule="missing",
                    where=f"drum {rotation}",
                    message=f"no recording of this direction: {_feeds_of_direction(rotation)} are null",
                )
            )
            continue
        steps = list(dict.fromkeys(protocol.slip_angles_rad))
        absent = [step for step in steps if not any(step == s for s, _ in recorded)]
        if absent:
            findings.append(
                Finding(
                    rule="missing",
                    where=f"drum {rotation}",
                    message=f"no file at slip angle {_angles_told(absent)}: the curves"
                    + (", the +-1 deg secant" if _has_one_degree(absent) else "")
                    + " and what they feed lack it",
                )
            )
        for step in steps:
            where = f"drum {rotation}, slip angle {_angles_told([step])}"
            loads = [load for load in protocol.loads_N if (step, load) not in recorded]
            if step not in absent and loads:
                message = f"no block at load {_loads_told(loads)}"
                findings.append(Finding(rule="missing", where=where, message=message))
            few = [load for load in protocol.loads_N if 0 < recorded[step, load] < protocol.times(step)]
            if few:
                message = (
                    f"{min(recorded[step, load] for load in few)} of {protocol.times(step)} declared repeats "
                    f"at load {_loads_told(few)}"
                )
                findings.append(Finding(rule="missing-repeat", where=where, message=message))
    return findings


def _doubled(placed: Sequence[Placed], later: Sequence[int]) -> list[Finding]:
    files: dict[str, list[Placed]] = {}
    for index in later:
        files.setdefault(placed[index].file, []).append(placed[index])

    def angles(placeds: Sequence[Placed]) -> str:
        return _angles_told(list(dict.fromkeys(placed.step_SA or 0.0 for placed in placeds)))

    return [
        Finding(
            rule="doubled",
            where=file,
            message=f"slip angle {angles(doubles)}, drum {doubles[0].rotation}: "
            f"{len(doubles)} block(s) of a condition that earlier files hold as often as "
            "the protocol declares; unused",
        )
        for file, doubles in files.items()
    ]


def _angles(placed: Sequence[Placed], protocol: Protocol) -> list[Finding]:
    findings: list[Finding] = []
    for file, step in dict.fromkeys((p.file, p.step_SA) for p in placed):
        SA = float(np.mean([p.SA for p in placed if (p.file, p.step_SA) == (file, step)]))
        if step is None:
            message = (
                f"slip angle {_angles_told([SA])} is no step of the protocol; its blocks feed the curves only"
            )
        elif abs(SA - step) > protocol.slip_angle_tolerance_rad:
            message = (
                f"slip angle {_angles_told([SA])} is out of tolerance of the step {_angles_told([step])} "
                f"(+-{_angles_told([protocol.slip_angle_tolerance_rad])})"
            )
        else:
            continue
        findings.append(Finding(rule="slip-angle-tolerance", where=file, message=message))
    return findings


def _loads(placed: Sequence[Placed], protocol: Protocol) -> list[Finding]:
    findings: list[Finding] = []
    for file in dict.fromkeys(p.file for p in placed):
        mine = [p for p in placed if p.file == file]
        unknown = [p.FZ for p in mine if p.step_FZ is None]
        off = [
            p
            for p in mine
            if p.step_FZ is not None and abs(p.FZ - p.step_FZ) > protocol.load_tolerance * p.step_FZ
        ]
        if unknown:
            findings.append(
                Finding(
                    rule="unplanned-load",
                    where=file,
                    message=f"load {_loads_told(unknown)} is none of the protocol's",
                )
            )
        if off:
            findings.append(
                Finding(
                    rule="load-tolerance",
                    where=file,
                    message=f"load {_loads_told([p.FZ for p in off])} is more than "
                    f"{protocol.load_tolerance:.0%} off the protocol's "
                    f"{_loads_told([p.step_FZ for p in off if p.step_FZ is not None])}",
                )
            )
    return findings


def _feeds_of_direction(rotation: Rotation) -> str:
    return "conicity, plysteer, CRAT and PRAT" + (" and every curve" if rotation == "forward" else "")


def _has_one_degree(steps: Sequence[float]) -> bool:
    return any(abs(abs(float(from_si(step, "deg"))) - 1) < 1e-9 for step in steps)


def _loads_told(loads: Sequence[float]) -> str:
    return in_both(loads, "lbf", ".0f")


def _angles_told(angles: Sequence[float]) -> str:
    texts = [f"{value:.2f}".rstrip("0").rstrip(".") for value in from_si(list(angles), "deg")]
    return f"{', '.join(texts)} deg"
