"""Reduced test to characteristics: curves of every load and direction, and what is read off them.

Each characteristic is one row, and each condition has its uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.characteristics.catalogue import of_scope
from toolkit.characteristics.characteristic import BOTH, Characteristic
from toolkit.characteristics.groups import (
    CHANNELS,
    Channel,
    Direction,
    DirectionFit,
    Group,
    directions_of,
    group,
)
from toolkit.characteristics.model import Characteristics, Point, Row
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.scatter import Scatter, scatter_of
from toolkit.characteristics.shared_errors import SharedErrors, shared_errors_of
from toolkit.characteristics.sweep_fit import fit_sweep
from toolkit.characteristics.sweep_length import sweep_findings
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.errors import FitError
from toolkit.findings import Finding
from toolkit.machine import Machine
from toolkit.reduction.common_load import at_one_angle, slopes
from toolkit.reduction.model import ReducedTest
from toolkit.reduction.sweep import Sweep
from toolkit.tires.evaluate import estimate_at
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.model import Curve
from toolkit.units import in_both

# Beyond the outermost measured slip angle by more than this, a curve is not read.
_REACH_RAD = math.radians(0.5)

# What a number is of, until it is a row.
_Key = tuple[Characteristic, float, str, float | None]


def characterise(
    reduced: ReducedTest, *, machine: Machine, record: CalibrationRecord | None, sweeps: Sequence[Sweep] = ()
) -> Characteristics:
    """Fit every load and direction and derive the characteristics.

    ``record`` gives the covariance of its coefficients; None where the reduced test came without it.
    ``sweeps`` are its recordings in time.
    """
    groups = group(reduced)
    fits, findings = _fit(groups)
    lags = [fit_sweep(sweep, machine.sweeping) for sweep in sweeps]
    swept = tuple(fit for fit in lags if fit is not None)
    directions = directions_of(reduced, fits, swept)
    shared = shared_errors_of(reduced, machine=machine, record=record)
    return Characteristics(
        fits=fits,
        rows=tuple(replace(row, parts=()) for row in rows_of(directions, shared=shared)),
        findings=(*findings, *_line_findings(directions), *sweep_findings(sweeps, lags, directions)),
        sweeps=swept,
        points=tuple(
            Point(file=file, first_row=row, u_FY=u["FY"], u_MZ=u["MZ"])
            for (file, row), u in point_u(directions, shared=shared).items()
        ),
    )


def characteristic_rows(
    reduced: ReducedTest,
    characteristics: Characteristics,
    *,
    machine: Machine,
    record: CalibrationRecord | None,
) -> tuple[Row, ...]:
    """Return the rows that have a value, with the parts of their uncertainty, to compare them."""
    rows = rows_of(
        directions_of(reduced, characteristics.fits, characteristics.sweeps),
        shared=shared_errors_of(reduced, machine=machine, record=record),
    )
    return tuple(row for row in rows if row.estimate is not None)


def _curve(group: Group, channel: Literal["FY", "MZ"]) -> Curve:
    return Curve(SA=group.SA, y=group.values(channel), channel=channel, load_N=group.load_N, axes="SAE")


def _fit(groups: tuple[Group, ...]) -> tuple[tuple[DirectionFit, ...], tuple[Finding, ...]]:
    """Fit every curve that can be fitted, all in one batch; the others become findings and None."""
    declared = [
        (index, curve) for index, g in enumerate(groups) for curve in (_curve(g, "FY"), _curve(g, "MZ"))
    ]
    refused = {(index, curve.channel): why_not(curve) for index, curve in declared}
    good = [(index, curve) for index, curve in declared if refused[index, curve.channel] is None]
    solved = dict(
        zip(
            [(index, curve.channel) for index, curve in good],
            fit_curves([curve for _, curve in good]) if good else (),
            strict=True,
        )
    )
    findings = _refused_findings(groups, refused)
    findings += [
        Finding(rule="not-converged", where=f"{_where(groups[index])}, {channel}", message=fit.message)
        for (index, channel), fit in solved.items()
        if not fit.converged
    ]
    fits = tuple(
        DirectionFit(
            rotation=g.rotation, load_N=g.load_N, FY=solved.get((index, "FY")), MZ=solved.get((index, "MZ"))
        )
        for index, g in enumerate(groups)
    )
    return fits, tuple(findings)


def _refused_findings(
    groups: tuple[Group, ...], refused: Mapping[tuple[int, Literal["FY", "MZ"]], FitError | None]
) -> list[Finding]:
    """Return one finding for all curves of a direction that have the same problem."""
    places: dict[tuple[str, str, str], dict[str, dict[int, None]]] = {}
    for (index, channel), problem in refused.items():
        if problem is not None:
            text = f"{problem.what} (got {problem.got}, expected {problem.expected})"
            key = (groups[index].rotation, problem.rule or "not-fitted", text)
            places.setdefault(key, {}).setdefault(channel, {})[index] = None
    findings = []
    for (rotation, rule, text), channels in places.items():
        loads = dict.fromkeys(index for indices in channels.values() for index in indices)
        where = in_both([groups[index].load_N for index in loads], "lbf", ".0f")
        findings.append(
            Finding(
                rule=rule,
                where=f"drum {rotation}, {where}, {' and '.join(channels)}",
                message=f"{text}; what these curves feed is null",
            )
        )
    return findings


def _where(group: Group) -> str:
    return f"drum {group.rotation}, {in_both(group.load_N, 'lbf', '.0f')}"


def _line_findings(directions: Sequence[Direction]) -> list[Finding]:
    """Hold the curve's value at SA = 0 against the line through the nearest points."""
    findings = []
    for direction in directions:
        SA = direction.group.SA
        if not (len(SA) > 1 and SA[0] <= 0.0 <= SA[-1]):
            if direction.fit.FY is not None:
                message = "the slip angles lie on one side of zero: stiffness and pull at SA = 0 are null"
                findings.append(Finding(rule="one-sided", where=_where(direction.group), message=message))
            continue
        for channel, unit, fit in (("FY", "N", direction.fit.FY), ("MZ", "N*m", direction.fit.MZ)):
            if fit is None:
                continue
            at_zero = estimate_at(fit, 0.0)
            line = float(np.interp(0.0, SA, direction.group.values(channel)))
            # The line itself is wrong by the curve's bend: a fiftieth of the range is left to it.
            limit = max(5 * at_zero.u, 0.02 * float(np.ptp(direction.group.values(channel))))
            if abs(at_zero.value - line) > limit:
                findings.append(
                    Finding(
                        rule="curve-against-line",
                        where=_where(direction.group),
                        message=f"{channel} at SA = 0 is {in_both(at_zero.value, unit)} by the curve, "
                        f"{in_both(line, unit)} by the line through the nearest points: look at the "
                        "residuals",
                    )
                )
    return findings


def rows_of(
    directions: Sequence[Direction],
    *,
    shared: SharedErrors,
    scatter: Scatter | None = None,
    wanted: Callable[[Characteristic, float | None], bool] = lambda _declared, _SA: True,
) -> tuple[Row, ...]:
    """Return every characteristic of a test, with parts: of its loads, its directions, its slip angle steps.

    What the test cannot give is a row without an estimate that says what lacks.

    Parameters
    ----------
    scatter : of the conditions about the curves; by default what the residuals show
    wanted : which characteristics are read, and at which slip angles [rad]; by default all
    """
    steps = sorted({
        c.step_SA for direction in directions for c in direction.group.conditions if c.step_SA is not None
    })  # fmt: skip
    scatter = scatter_of(directions) if scatter is None else scatter
    readers = [Reader(direction, shared=shared, scatter=scatter) for direction in directions]
    numbers: dict[_Key, Uncertain | None] = {}
    for load in sorted({direction.group.load_N for direction in directions}):
        runs = {reader.group.rotation: reader for reader in readers if reader.group.load_N == load}
        for declared in (d for d in of_scope("load") if wanted(d, None)):
            complete = all(rotation in runs for rotation in declared.runs)
            number = declared.read(declared, *(runs[r] for r in declared.runs)) if complete else None
            numbers[declared, load, BOTH, None] = number
    for reader in readers:
        load, rotation = reader.group.load_N, reader.group.rotation
        for declared in (d for d in of_scope("direction") if wanted(d, None)):
            numbers[declared, load, rotation, None] = declared.read(declared, reader)
        at = [SA for SA in steps if any(wanted(declared, SA) for declared in of_scope("angle"))]
        listed = [declared for declared in of_scope("angle") if any(wanted(declared, SA) for SA in at)]
        numbers |= {key: n for key, n in at_angles(reader, at, listed).items() if wanted(key[0], key[3])}
    by_load: dict[float, list[Direction]] = {}
    for direction in directions:
        by_load.setdefault(direction.group.load_N, []).append(direction)
    return tuple(
        lacking_row(key[0], key[1:], by_load[key[1]])
        if number is None
        else Row.of(key[0].name, number, load_N=key[1], rotation=key[2], SA_rad=key[3])
        for key, number in _with_load_and_pressure(numbers, shared).items()
    )


def at_angles(
    reader: Reader, angles: Sequence[float], declared: Sequence[Characteristic] | None = None
) -> dict[_Key, Uncertain | None]:
    """Return what is read at slip angles [rad] inside those measured; angles that give nothing are left out.

    Parameters
    ----------
    declared : the characteristics to read; by default all that are read at slip angles
    """
    SA = reader.group.SA
    numbers: dict[_Key, Uncertain | None] = {}
    for angle in angles:
        if not SA[0] - _REACH_RAD <= angle <= SA[-1] + _REACH_RAD:
            continue
        read: dict[_Key, Uncertain | None] = {
            (entry, reader.group.load_N, reader.group.rotation, angle): entry.read(entry, reader, angle)
            for entry in (of_scope("angle") if declared is None else declared)
        }
        if any(number is not None for number in read.values()):
            numbers |= read
    return numbers


def lacking_row(
    declared: Characteristic, key: tuple[float, str, float | None], directions: Sequence[Direction]
) -> Row:
    """Return the row of a characteristic that the directions of its load do not give.

    Parameters
    ----------
    key : load [N], rotation, slip angle [rad]
    """
    load, rotation, SA = key
    read_off = [direction for direction in directions if rotation in (BOTH, direction.group.rotation)]
    return Row(
        name=declared.name, load_N=load, rotation=rotation, SA_rad=SA, lacking=declared.why_lacking(read_off)
    )


def _with_load_and_pressure(
    numbers: Mapping[_Key, Uncertain | None], shared: SharedErrors
) -> dict[_Key, Uncertain | None]:
    """Add what an error of the load cell and of the pressure does to each value.

    An error of the load attributes a value to a wrong load: -dy/dFZ times the error, dy/dFZ from the
    neighbouring loads of the same series. With one load alone y is taken as proportional to it.
    """
    series: dict[tuple[str, str, float | None], list[tuple[_Key, Uncertain]]] = {}
    for key, number in numbers.items():
        if number is not None:
            declared, _, rotation, SA = key
            series.setdefault((declared.name, rotation, SA), []).append((key, number))
    complete = dict(numbers)
    for members in series.values():
        loads = np.array([load for (_, load, _, _), _ in members])
        steep = slopes(loads, np.array([number.value for _, number in members]))
        for (key, number), slope in zip(members, steep, strict=True):
            load = key[1]
            by_load = number.value / load if slope is None else slope.value
            parts: list[Part] = [shared.load_part(-by_load, load)]
            pressure = shared.pressure_part(number.value)
            if pressure is not None:
                parts.append(pressure)
            complete[key] = number.with_parts(*parts)
    return complete


def point_u(
    directions: Sequence[Direction], *, shared: SharedErrors
) -> Mapping[tuple[str, int], dict[str, float]]:
    """Return the whole standard uncertainty of every condition as measured: (file, first row) -> channel.

    Sources: the record, the cells' zeros or tares, the scatter of the rows and about the curves, and through
    the curve's slopes the slip angle (zero and scale), the load and the pressure.
    """
    sources = [
        (direction, place) for direction in directions for place in range(len(direction.group.conditions))
    ]
    groups = at_one_angle([direction.group.conditions[place] for direction, place in sources])
    scatter = scatter_of(directions)
    uncertainties: dict[tuple[str, int], dict[str, float]] = {}
    for channel in CHANNELS:
        squares = _squares(directions, channel, shared, scatter)
        for places in groups:
            pairs = [sources[index] for index in places]
            conditions = [direction.group.conditions[place] for direction, place in pairs]
            FZ = np.array([c.FZ for c in conditions])
            y = np.array([c.FY if channel == "FY" else c.MZ for c in conditions])
            for (direction, place), c, value, slope in zip(pairs, conditions, y, slopes(FZ, y), strict=True):
                load = shared.load_part(float(value / c.FZ) if slope is None else slope.value, c.FZ)
                pressure = shared.pressure_part(float(value))
                variance = load.u**2 + (pressure.u**2 if pressure else 0.0)
                u = math.sqrt(squares[id(direction)][place] + variance)
                uncertainties.setdefault((c.file, c.first_row), {})[channel] = u
    return uncertainties


def _squares(
    directions: Sequence[Direction], channel: Channel, shared: SharedErrors, scatter: Scatter
) -> dict[int, np.ndarray]:
    """Return the variance of each condition of each direction but for load and pressure."""
    from toolkit.tires.evaluate import slope_at

    variances = {}
    for direction in directions:
        conditions = direction.group.conditions
        rows = np.array([c.u_FY if channel == "FY" else c.u_MZ for c in conditions])
        total = rows**2
        for shift in (shared.calibration_rows(channel, conditions), shared.zero_rows(channel, conditions)):
            total = total + np.sum(shift**2, axis=0)
        if shared.tared and not shared.u_cell_zero:
            total = (
                total + np.array([c.u_FY_zero if channel == "FY" else c.u_MZ_zero for c in conditions]) ** 2
            )
        fit = direction.curve(channel)
        if fit is not None:
            SA = direction.group.SA
            slope = slope_at(fit, SA)
            total = total + scatter.each(direction, channel)
            total = total + (slope * shared.SA.u) ** 2 + (slope * SA * shared.SA_scale.relative) ** 2
        variances[id(direction)] = total
    return variances
