"""What is to be known of recordings in time: those that say nothing, and what one speed cannot part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.characteristics.sweep_length import speeds_of
from toolkit.findings import Finding
from toolkit.units import in_both

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Direction
    from toolkit.characteristics.sweep_fit import SweepFit
    from toolkit.reduction.sweep import Sweep


def sweep_findings(
    sweeps: Sequence[Sweep], fits: Sequence[SweepFit | None], directions: Sequence[Direction]
) -> list[Finding]:
    """Return a finding for each sweep that determines nothing or stands alone, and for each single speed."""
    findings = []
    served = {id(fit) for direction in directions for fit in direction.sweeps}
    for sweep, fit in zip(sweeps, fits, strict=True):
        where = f"{sweep.file}, {in_both(float(np.mean(sweep.FZ)), 'lbf', '.0f')}"
        why = None
        if fit is None:
            why = "its steering does not determine by what distance FY lags"
        elif id(fit) not in served:
            why = f"the test has no conditions at this load with the drum {fit.rotation}"
        if why is not None:
            findings.append(
                Finding(rule="sweep-unused", where=where, message=f"the sweep says nothing: {why}")
            )
    alone = (direction for direction in directions if len(speeds_of(direction.sweeps)) == 1)
    return [*findings, *map(_one_speed, alone)]


def _one_speed(direction: Direction) -> Finding:
    first = direction.sweeps[0]
    where = f"drum {direction.group.rotation}, {in_both(direction.group.load_N, 'lbf', '.0f')}"
    apparent = float(np.mean([sweep.length_m for sweep in direction.sweeps]))
    text = (
        f"swept at {3.6 * first.speed_m_s:.3g} km/h alone: FY lags by {1e3 * apparent:.0f} mm, relaxation "
        "length and what is rolled within the delay of its channel together"
    )
    if first.delay_u_s is None or first.delay_s is None:
        message = f"{text}; nobody states that delay, and no relaxation length is given"
        return Finding(rule="sweep-one-speed", where=where, message=message)
    rolled = 1e3 * first.speed_m_s
    message = (
        f"{text}; the machine states a delay of {1e3 * first.delay_s:g} ms with a standard uncertainty of "
        f"{1e3 * first.delay_u_s:g} ms: {rolled * first.delay_s:.2g} mm, u {rolled * first.delay_u_s:.2g} mm"
    )
    return Finding(rule="sweep-one-speed", where=where, message=message, level="note")
