"""How far a session may go: a plan states U inside of what was calibrated and of what can be put on.

A record says nothing of a load beyond the interval [low, high] of its rows, neither of a larger one nor of
one in the other sense; and a session gives no U beyond the loads that it puts on. So U is stated at the
largest load that both reach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.errors import ConfigError

AS_READ = 0.02
"""Of the largest load: what loads of one weight differ by as they are read, and not as they are meant."""
_SAME = 1e-6  # of a load: units converted and back


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """One load: from ``low`` to ``high`` of what was calibrated can be loaded, in the record's unit."""

    load: str
    unit: str
    calibrated: tuple[float, float]
    low: float
    high: float

    @property
    def largest(self) -> float:
        """Largest size of what was calibrated."""
        return max(map(abs, self.calibrated))

    @property
    def end(self) -> float:
        """The end that lies farther from zero: where U is stated, if nothing else is asked for."""
        return _farther(self.low, self.high)

    @property
    def short(self) -> tuple[float, ...]:
        """The ends of the calibrated interval that no load reaches."""
        reached = zip(self.calibrated, (self.low, self.high), strict=True)
        return tuple(end for end, at in reached if abs(end) - abs(at) > AS_READ * self.largest)

    @property
    def text(self) -> str:
        """The interval with its unit."""
        return f"{self.low:.5g} to {self.high:.5g} {self.unit.replace('*', '·')}"


def calibrated_interval(fit: LoadFit) -> tuple[float, float]:
    """Return the interval of a load that a record was calibrated for, zero within it."""
    return min(fit.minimum or 0.0, 0.0), max(fit.maximum or 0.0, 0.0)


def reach_of(record: CalibrationRecord, feasible: Array) -> tuple[Reach, ...]:
    """Return how far each load may go, by feasible loads (candidates, loads) in the record's order."""
    reached = []
    for fit, loads in zip(record.loads, feasible.T, strict=True):
        low, high = calibrated_interval(fit)
        reached.append(
            Reach(
                load=fit.load, unit=fit.unit, calibrated=(low, high),
                low=max(low, min(float(loads.min()), 0.0)), high=min(high, max(float(loads.max()), 0.0)),
            )
        )  # fmt: skip
    return tuple(reached)


def stated_loads(reach: Sequence[Reach], feasible: Array, at: Mapping[str, float]) -> tuple[float, ...]:
    """Return the load at which U of each is stated: as asked for, no farther than it reaches."""
    stated = []
    for one, loads in zip(reach, feasible.T, strict=True):
        value = min(max(at.get(one.load, one.end), one.low), one.high)
        # What hangs there, where it is the same: a row has to reach it, and units were converted.
        nearest = float(loads[np.argmin(np.abs(loads - value))])
        same = abs(nearest - value) <= _SAME * one.largest and one.low <= nearest <= one.high
        stated.append(nearest if same else value)
    return tuple(stated)


def refuse_beyond(
    reach: Sequence[Reach], stated: Sequence[float], U: Mapping[str, float], at: Mapping[str, float]
) -> None:
    """Refuse a demand of U at a load that is not reached.

    Raises
    ------
    ConfigError
        ``plan-infeasible``: with the nearest load of which U can be asked
    """
    for one, nearest in zip(reach, stated, strict=True):
        asked = at.get(one.load, _farther(*one.calibrated))
        if one.load not in U or abs(asked - nearest) <= AS_READ * one.largest:
            continue
        raise ConfigError(
            "U is asked for at a load that is not calibrated, or that nothing can put on", where="--u",
            got=f"{one.load} at {asked:.5g} {one.unit}" + ("" if one.load in at else ", the largest load"),
            expected=f"a load that the record's interval and the feasible loads reach: {one.text}",
            next_step=f'nearest: --u "{one.load}={U[one.load]:.5g} {one.unit} at {nearest:.5g} {one.unit}"',
            rule="plan-infeasible",
        )  # fmt: skip


def _farther(low: float, high: float) -> float:
    return high if high >= -low else low
