"""From apparent lengths at several speeds to the relaxation length: least squares with the stated delay.

A sweep at the speed V_i gives y_i = sigma + V_i tau. With the variances u_i^2 of the noise, and what the
machine states of tau as one more equation, sigma is a weighted sum of the y_i and of the stated delay. At one
speed the weights of the y_i add up to one, and the delay's is -V: nothing is told of tau. Where nobody states
a delay two speeds part them, and one cannot.

Findings name the recordings that say nothing, and what one speed cannot part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.characteristics.characteristic import DELAY, FORM, LOAD, NOISE, SPEED
from toolkit.characteristics.uncertain import Part, Uncertain, merged
from toolkit.findings import Finding
from toolkit.units import in_both

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Direction
    from toolkit.characteristics.sweep_fit import SweepFit
    from toolkit.reduction.sweep import Sweep


_SAME_SPEED = 0.05  # speeds within this part of each other do not part a delay
_BY_LOAD = (
    0.5  # power of the load with which the length goes: between one length (0) and the stiffness' law (1)
)
_BY_LOAD_U = 0.5 / math.sqrt(3.0)


def speeds_of(sweeps: Sequence[SweepFit]) -> tuple[float, ...]:
    """Return the speeds of sweeps that are apart [m/s], ascending."""
    speeds: list[float] = []
    for speed in sorted(sweep.speed_m_s for sweep in sweeps):
        if not speeds or speed > (1 + _SAME_SPEED) * speeds[-1]:
            speeds.append(speed)
    return tuple(speeds)


def parts_delay(sweeps: Sequence[SweepFit]) -> bool:
    """Tell whether sweeps determine the relaxation length: two speeds, or a delay that is stated."""
    return len(speeds_of(sweeps)) > 1 or any(sweep.delay_u_s is not None for sweep in sweeps)


def relaxation_length(
    sweeps: Sequence[SweepFit], *, load_N: float, owner: str, test: str
) -> Uncertain | None:
    """Return the relaxation length [m] at a load; None where nothing parts it from a delay.

    Parameters
    ----------
    load_N : to which each length is carried from its own load
    owner : the machine, whose errors of speed and delay all its tests share
    test : load and direction of the test, which owns the rest
    """
    if not sweeps or not parts_delay(sweeps):
        return None
    stated = [sweep for sweep in sweeps if sweep.delay_u_s is not None]
    to_load = np.array([(load_N / sweep.load_N) ** _BY_LOAD for sweep in sweeps])
    lengths = np.array([sweep.length_m for sweep in sweeps])
    weights, of_delay = weights_of(sweeps)
    delay = stated[0].delay_s or 0.0 if stated else 0.0
    u_delay = stated[0].delay_u_s or 0.0 if stated else 0.0
    # The delay's share does not go with the load, so that the length alone is carried.
    tau = _delay(sweeps, weights, of_delay, delay)
    speeds = np.array([sweep.speed_m_s for sweep in sweeps])
    carried = (to_load - 1) * (lengths - speeds * tau)
    value = float(weights @ (lengths + carried)) + of_delay * delay
    parts = [
        Part(source=NOISE, key=f"{NOISE}/{test}/{sweep.file}/{sweep.first_row}", u=float(weight) * sweep.u_m,
             dof=sweep.dof)
        for sweep, weight in zip(sweeps, weights, strict=True)
    ]  # fmt: skip
    by_load = [
        float(weight) * sweep.length_m * math.log(load_N / sweep.load_N) * _BY_LOAD_U
        for sweep, weight in zip(sweeps, weights, strict=True)
    ]
    forms = np.array([sweep.form_m for sweep in sweeps])
    scales = np.array([sweep.length_m * sweep.speed_u for sweep in sweeps])
    parts += [
        Part(source=FORM, key=f"{FORM}/{test}", u=float(weights @ forms)),
        Part(source=DELAY, key=f"{DELAY}/{owner}", u=of_delay * u_delay),
        Part(source=SPEED, key=f"{SPEED}/{owner}", u=float(weights @ scales)),
        Part(source=LOAD, key=f"{LOAD} of sweeps/{test}", u=sum(by_load)),
    ]
    return Uncertain(value=value, unit="m", parts=merged(parts))


def weights_of(sweeps: Sequence[SweepFit]) -> tuple[Array, float]:
    """Return d length / d apparent length of each sweep, and d length / d stated delay [m/s]."""
    stated = next((sweep.delay_u_s for sweep in sweeps if sweep.delay_u_s is not None), None)
    speeds = np.array([sweep.speed_m_s for sweep in sweeps])
    u = np.array([math.hypot(sweep.u_m, 1e-6) for sweep in sweeps])
    rows = np.column_stack([np.ones(len(u)), speeds]) / u[:, None]
    if stated is not None:
        rows = np.vstack([rows, [0.0, 1 / max(stated, 1e-9)]])
    inverse = np.linalg.pinv(rows)[0]
    of_delay = 0.0 if stated is None else float(inverse[-1] / max(stated, 1e-9))
    return inverse[: len(u)] / u, of_delay


def _delay(sweeps: Sequence[SweepFit], weights: Array, of_delay: float, stated: float) -> float:
    """Return the delay [s] that goes with the length: its mean over the sweeps."""
    lengths = np.array([sweep.length_m for sweep in sweeps])
    speeds = np.array([sweep.speed_m_s for sweep in sweeps])
    length = float(weights @ lengths) + of_delay * stated
    return float(np.mean((lengths - length) / speeds))


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
