"""Every characteristic of a test as one row: name, load, direction, and a number that knows its parts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.characteristics.direction import CHANNELS, Channel, Direction
from toolkit.characteristics.groups import group
from toolkit.characteristics.pull import pull
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.scatter import Scatter, scatter_of
from toolkit.characteristics.shared import Shared
from toolkit.characteristics.stiffness import stiffness
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.reduction.common_load import at_one_angle, slopes

if TYPE_CHECKING:
    from toolkit.characteristics.model import DirectionFit
    from toolkit.reduction.model import ReducedTest

BOTH = "both"
# Beyond the outermost measured slip angle by more than this, a curve is not read.
_REACH_RAD = math.radians(0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One characteristic.

    ``name`` as in `Pull` and `Stiffness`, or ``FY`` and ``MZ`` at the slip angle ``SA_rad``; ``rotation``
    is ``both`` for what needs both directions.
    """

    name: str
    load_N: float
    rotation: str
    number: Uncertain
    SA_rad: float | None = None

    @property
    def series(self) -> tuple[str, str, float | None]:
        """What is the same at every load: (name, rotation, slip angle)."""
        return self.name, self.rotation, self.SA_rad


def directions_of(reduced: ReducedTest, fits: Sequence[DirectionFit]) -> tuple[Direction, ...]:
    """Return the directions of a test with their curves, lightest load first, forward before reverse."""
    return tuple(Direction(group=one, fit=fit) for one, fit in zip(group(reduced), fits, strict=True))


def rows_of(directions: Sequence[Direction], *, shared: Shared) -> tuple[Row, ...]:
    """Return every characteristic of a test: pull, stiffness, and FY and MZ at its slip angle steps."""
    steps = {c.step_SA for one in directions for c in one.group.conditions if c.step_SA is not None}
    scatter = scatter_of(directions)
    readers = [Reader(one, shared=shared, scatter=scatter) for one in directions]
    found: list[Row] = []
    for load in sorted({one.group.load_N for one in directions}):
        there = {r.group.rotation: r for r in readers if r.group.load_N == load}
        for name, number in pull(there.get("forward"), there.get("reverse")).items():
            found.append(Row(name=name, load_N=load, rotation=BOTH, number=number))
    for reader in readers:
        load, rotation = reader.group.load_N, reader.group.rotation
        for name, number in stiffness(reader).items():
            found.append(Row(name=name, load_N=load, rotation=rotation, number=number))
        found += _at_angles(reader, sorted(steps))
    return tuple(_with_load_and_pressure(found, shared))


def _at_angles(reader: Reader, angles: Sequence[float]) -> list[Row]:
    SA = reader.group.SA
    found = []
    for angle in angles:
        if not SA[0] - _REACH_RAD <= angle <= SA[-1] + _REACH_RAD:
            continue
        for channel in CHANNELS:
            number = reader.value(channel, angle)
            if number is not None:
                found.append(
                    Row(
                        name=channel,
                        load_N=reader.group.load_N,
                        rotation=reader.group.rotation,
                        number=number,
                        SA_rad=angle,
                    )
                )
    return found


def _with_load_and_pressure(rows: Sequence[Row], shared: Shared) -> list[Row]:
    """Add what an error of the load cell and of the pressure does to each value.

    An error of the load attributes a value to a wrong load: -dy/dFZ times the error, dy/dFZ from the
    neighbouring loads of the same series. With one load alone y is taken as proportional to it.
    """
    series: dict[tuple[str, str, float | None], list[int]] = {}
    for index, row in enumerate(rows):
        series.setdefault(row.series, []).append(index)
    found = list(rows)
    for places in series.values():
        loads = np.array([rows[i].load_N for i in places])
        steep = slopes(loads, np.array([rows[i].number.value for i in places]))
        for i, slope in zip(places, steep, strict=True):
            row = rows[i]
            value = row.number.value
            by_load = value / row.load_N if slope is None else slope.value
            parts: list[Part] = [shared.load_part(-by_load, row.load_N)]
            pressure = shared.pressure_part(value)
            if pressure is not None:
                parts.append(pressure)
            found[i] = replace(row, number=row.number.with_parts(*parts))
    return found


def point_u(directions: Sequence[Direction], *, shared: Shared) -> Mapping[tuple[str, int], dict[str, float]]:
    """Return the whole standard uncertainty of every condition as measured: (file, first row) -> channel.

    Sources: the record, the cells' zeros or tares, the scatter of the rows and about the curves, and through
    the curve's slopes the slip angle (zero and scale), the load and the pressure.
    """
    every = [(one, place) for one in directions for place in range(len(one.group.conditions))]
    groups = at_one_angle([one.group.conditions[place] for one, place in every])
    scatter = scatter_of(directions)
    found: dict[tuple[str, int], dict[str, float]] = {}
    for channel in CHANNELS:
        squares = _squares(directions, channel, shared, scatter)
        for members in groups:
            pairs = [every[index] for index in members]
            conditions = [one.group.conditions[place] for one, place in pairs]
            FZ = np.array([c.FZ for c in conditions])
            y = np.array([c.FY if channel == "FY" else c.MZ for c in conditions])
            for (one, place), c, value, slope in zip(pairs, conditions, y, slopes(FZ, y), strict=True):
                load = shared.load_part(float(value / c.FZ) if slope is None else slope.value, c.FZ)
                pressure = shared.pressure_part(float(value))
                more = load.u**2 + (pressure.u**2 if pressure else 0.0)
                u = math.sqrt(squares[id(one)][place] + more)
                found.setdefault((c.file, c.first_row), {})[channel] = u
    return found


def _squares(
    directions: Sequence[Direction], channel: Channel, shared: Shared, scatter: Scatter
) -> dict[int, np.ndarray]:
    """Return the variance of each condition of each direction but for load and pressure."""
    from toolkit.tires.evaluate import slope_at

    found = {}
    for one in directions:
        conditions = one.group.conditions
        rows = np.array([c.u_FY if channel == "FY" else c.u_MZ for c in conditions])
        total = rows**2
        for moved in (shared.calibration_rows(channel, conditions), shared.zero_rows(channel, conditions)):
            total = total + np.sum(moved**2, axis=0)
        if shared.tared and not shared.u_cell_zero:
            total = (
                total + np.array([c.u_FY_zero if channel == "FY" else c.u_MZ_zero for c in conditions]) ** 2
            )
        fit = one.curve(channel)
        if fit is not None:
            SA = one.group.SA
            slope = slope_at(fit, SA)
            total = total + scatter.each(one, channel)
            total = total + (slope * shared.SA.u) ** 2 + (slope * SA * shared.SA_scale.relative) ** 2
        found[id(one)] = total
    return found
