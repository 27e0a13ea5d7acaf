"""Drift between the repeats that a protocol declares: the same condition, measured again later.

Two blocks of one step are compared at one load (`common_load`) and at one slip angle: the difference of their
measured angles is taken off with the slope between the neighbouring steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.findings import Finding
from toolkit.units import from_si, in_both

if TYPE_CHECKING:
    from toolkit.machine import Protocol
    from toolkit.reduction.model import Condition

_LEVEL = 2.0  # a drift inside its own expanded uncertainty is none


def drift_findings(conditions: Sequence[Condition], protocol: Protocol) -> list[Finding]:
    """Return one finding for each direction and channel whose repeats drift beyond the protocol's tolerance.

    The tolerance is a part of the largest value of the channel at that load and direction. First repeat
    against last, in the order of the files' names.
    """
    findings = []
    for rotation in dict.fromkeys(c.rotation for c in conditions):
        for channel, unit in (("FY", "N"), ("MZ", "N*m")):
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
                f"{in_both(condition.step_FZ or 0.0, 'lbf', '.0f')} by {in_both(difference, unit, '.3g')}; "
                f"{in_both(limit, unit, '.3g')} are tolerated"
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
