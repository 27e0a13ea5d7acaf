"""A case as the effects of the catalogue see it: spreads, durations and sizes of motion, at one place."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.parameter_units import channel_unit
from toolkit.diagnosis.simulators.setting import known_names
from toolkit.effects.surroundings import MotionSizes
from toolkit.errors import UnitError
from toolkit.units import is_unit, unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem


class CaseView:
    """`toolkit.effects.surroundings.Surroundings` of a problem, at a channel or state and its source."""

    def __init__(self, problem: Problem, channel: str | None = None, source: str | None = None) -> None:
        self._problem = problem
        self.channel, self.source = channel, source

    @property
    def drivers(self) -> frozenset[str]:
        """Channels that were recorded beside the outputs."""
        return frozenset(channel.name for channel in self._problem.case.drivers)

    @property
    def outputs(self) -> frozenset[str]:
        """Channels that are judged."""
        return frozenset(self._problem.names)

    @property
    def cells(self) -> frozenset[str]:
        """Load cells from which loads are computed."""
        return frozenset(self._problem.model.capability.cells)

    @property
    def nominal_load_N(self) -> float | None:
        """Nominal load that the simulation itself states [N]."""
        return self._problem.model.capability.nominal_load_N

    @property
    def rows(self) -> int:
        """Rows of all runs."""
        return self._problem.rows

    @cached_property
    def row_time(self) -> float:
        """Usual time from row to row [s]."""
        steps = [np.diff(run.t) for run in self._problem.runs if run.rows > 1]
        return float(np.median(np.concatenate(steps or [np.ones(1)])))

    @property
    def minutes(self) -> float:
        """Duration of all runs together [min]."""
        return sum(float(run.t[-1] - run.t[0]) for run in self._problem.runs if run.rows > 1) / 60

    @property
    def integrates(self) -> bool:
        """The simulation integrates its own equation of motion."""
        moving = self._problem.model.capability.motion
        return moving is not None and moving.integrates

    @cached_property
    def motion(self) -> MotionSizes:
        """Sizes of the motion that the place belongs to; of nothing that moves, the channel's own."""
        moving = self._problem.model.capability.motion
        if moving is not None:
            return moving.sizes(self.channel, self.spread)
        return MotionSizes(
            force=self.spread(self.channel), speed=1.0, place=1.0, fastest=1.0, farthest=1.0, level=1.0,
            has_position=False,
        )  # fmt: skip

    @property
    def way(self) -> tuple[float, float]:
        """Longest way of a run over the position and the usual one from row to row."""
        moving = self._problem.model.capability.motion
        return (0.0, 0.0) if moving is None else moving.way(self.channel)

    def origin(self, name: str | None) -> float | None:
        """Return the first recorded value of a channel whose scale has a zero by convention, else None."""
        if name is None:
            return None
        try:
            stated = unit(channel_unit(self._problem.case, self._problem.model, name))
        except UnitError:
            return None
        if not stated.is_interval:
            return None
        values = self.values(name)
        return float(values[0]) if len(values) else None

    def spread(self, name: str | None) -> float:
        """Return the largest magnitude of a channel over all runs, 1 where nothing was recorded of it."""
        if name is None:
            return 1.0
        values = np.abs(self.values(name) - (self.origin(name) or 0.0))
        return float(values.max()) if len(values) and values.max() > 0 else 1.0

    def values(self, name: str | None) -> Array:
        """Return the recorded values of a channel over all runs, (n,) without gaps; none where it was not."""
        if name is not None and name in self._problem.observed:
            values = self._problem.observed[name]
        else:
            columns = [run.columns[str(name)] for run in self._problem.runs if name in run.columns]
            values = np.concatenate(columns) if columns else np.zeros(0)
        return values[np.isfinite(values)]

    def widest(self, name: str | None) -> tuple[float, float] | None:
        """Return the ends of a channel in the run where its range is widest, None where it has none."""
        if name is not None and name in self._problem.observed:
            observed, kept = self._problem.observed[name], self._problem.kept[name]
            columns = [observed[rows][kept[rows]] for rows in self._problem.slices]
        else:
            columns = [run.columns[str(name)] for run in self._problem.runs if name in run.columns]
        finite = [column[np.isfinite(column)] for column in columns]
        ranges = [(float(column.min()), float(column.max())) for column in finite if len(column)]
        ends = max(ranges, key=lambda ends: ends[1] - ends[0], default=None)
        origin = self.origin(name)
        return ends if ends is None or origin is None else (ends[0] - origin, ends[1] - origin)

    def recorded_range(self, *names: str) -> float:
        """Return the range of the first of these channels that was recorded, 1 where none was."""
        known = known_names(self._problem.case)
        for name in (known.get(name, name) for name in names):
            columns = [run.columns[name] for run in self._problem.runs if name in run.columns]
            if columns:
                return float(np.ptp(np.concatenate(columns)))
        return 1.0

    def unit(self) -> str | None:
        """Return the unit of the place's channel, None where it is not known."""
        text = channel_unit(self._problem.case, self._problem.model, self.channel)
        return text if is_unit(text) else None

    def conditions(self, key: str) -> frozenset[str]:
        """Return the values that a condition has in the runs."""
        return frozenset(run.conditions[key] for run in self._problem.runs if key in run.conditions)
