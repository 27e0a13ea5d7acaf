"""Control charts of an instrument: the error of each check load, session by session.

A point is the error (fitted - reference) that the record in force before a session makes at a check load of
that session. Check loads of different sessions are the same where all their reference loads agree within a
share of full scale; repeated ones of a session are averaged. An as-left session has no point: it was
measured after an adjustment that the record before it does not know.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.control.as_found import Approvals, approvals_of, errors_by, in_use_before, phase_of
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.registry import Registry, load_many
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import stored_check
from toolkit.declared import Entry, derived
from toolkit.errors import ToolkitError
from toolkit.findings import Finding
from toolkit.units import si_scale

__all__ = ["LEAST_BASELINE", "Chart", "ChartPoint", "CheckLoad", "Series", "chart_findings", "control_chart"]

# Shewhart chart for individuals and moving range, one point a session.


# Run rules of a control chart: patterns that a process in control hardly ever draws.


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRule:
    """A rule of Nelson's list: its ``number``, in words, and the ``length`` of the stretch it looks at."""

    number: int
    text: str
    length: int
    test: Callable[[Array], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Break:
    """A rule that is broken by the points that end at ``index`` (from 0)."""

    rule: RunRule
    index: int


def broken_rules(z: Array) -> tuple[Break, ...]:
    """Return every rule that a stretch of points breaks, at the last point of the stretch, in their order.

    >>> [(one.rule.number, one.index) for one in broken_rules(np.array([0.0, 0.5, 3.5]))]
    [(1, 2)]
    """
    return tuple(
        Break(rule=rule, index=end)
        for end in range(len(z))
        for rule in RULES
        if end + 1 >= rule.length and rule.test(z[end + 1 - rule.length : end + 1])
    )


def _beyond(limit: float, least: int) -> Callable[[Array], bool]:
    # The last point itself must be out: else a point back in the middle would be told as breaking the rule.
    def test(z: Array) -> bool:
        return any(
            side * z[-1] > limit and int(np.count_nonzero(side * z > limit)) >= least for side in (1, -1)
        )

    return test


def _one_side(z: Array) -> bool:
    return bool((z > 0).all() or (z < 0).all())


def _steady(z: Array) -> bool:
    step = np.diff(z)
    return bool((step > 0).all() or (step < 0).all())


def _alternating(z: Array) -> bool:
    step = np.diff(z)
    return bool((step[:-1] * step[1:] < 0).all())


def _quiet(z: Array) -> bool:
    return bool((np.abs(z) <= 1).all())


def _none_in_the_middle(z: Array) -> bool:
    return bool((np.abs(z) > 1).all() and (z > 0).any() and (z < 0).any())


RULES = (
    RunRule(number=1, text="one point beyond 3 sigma", length=1, test=_beyond(3, 1)),
    RunRule(number=2, text="nine in a row on one side of the centre", length=9, test=_one_side),
    RunRule(number=3, text="six in a row rising or falling", length=6, test=_steady),
    RunRule(number=4, text="fourteen in a row alternating up and down", length=14, test=_alternating),
    RunRule(number=5, text="two of three beyond 2 sigma on one side", length=3, test=_beyond(2, 2)),
    RunRule(number=6, text="four of five beyond 1 sigma on one side", length=5, test=_beyond(1, 4)),
    RunRule(number=7, text="fifteen in a row within 1 sigma", length=15, test=_quiet),
    RunRule(number=8, text="eight in a row beyond 1 sigma on both sides", length=8, test=_none_in_the_middle),
)


D2, D4 = 1.128, 3.267
LEAST_BASELINE = 4
SETTLED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlLimits:
    """Centre, sigma and control limits, in the load's unit."""

    centre: float
    sigma: float
    lower: float
    upper: float
    mean_range: float
    upper_range: float
    points: Annotated[int, Entry("that make the limits")]

    @property
    @derived("whether they rest on few points")
    def provisional(self) -> bool:
        """Whether the baseline is too short for settled limits."""
        return self.points < SETTLED


def limits_of(values: Array) -> ControlLimits | None:
    """Return the limits of a baseline (points,); None where it is too short or does not scatter at all."""
    if len(values) < LEAST_BASELINE:
        return None
    centre, mean_range = float(values.mean()), float(np.abs(np.diff(values)).mean())
    sigma = mean_range / D2
    # Equal to the last digits: a sigma of rounding would call every later point an alarm.
    if sigma <= 1e-12 * float(np.abs(values).max()):
        return None
    return ControlLimits(
        centre=centre,
        sigma=sigma,
        lower=centre - 3 * sigma,
        upper=centre + 3 * sigma,
        mean_range=mean_range,
        upper_range=D4 * mean_range,
        points=len(values),
    )


def breaks_of(values: Array, limits: ControlLimits) -> tuple[Break, ...]:
    """Return the run rules that the points (points,) break against these limits."""
    return broken_rules((values - limits.centre) / limits.sigma)


SAME_PERCENT = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartPoint:
    """The error of a session's check load by the record in force before it."""

    session_record: Annotated[str, Entry(key="session")]
    date: dt.date
    record: str
    error: Annotated[float, Entry("in the load's unit")]
    rows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckLoad:
    """One check load: every load's reference value at its first session, as (name, value, unit)."""

    loads: tuple[tuple[str, float, str], ...]

    def __str__(self) -> str:
        acting = [f"{name} {value:g} {unit}" for name, value, unit in self.loads if value != 0]
        return ", ".join(acting) or "no load"


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """The chart of one load's error at one check load.

    ``limits`` is None where fewer than the least number of points are there to take them from; ``breaks``
    are at indices of ``points``. ``baseline`` points, from the first on, made the limits. ``unit`` is that of
    the newest session.
    """

    check_load: CheckLoad
    load: str
    unit: str
    tolerance: float
    points: tuple[ChartPoint, ...]
    baseline: int
    limits: ControlLimits | None
    breaks: tuple[Break, ...]

    @property
    def ranges(self) -> tuple[float, ...]:
        """Moving ranges, one fewer than the points."""
        return tuple(np.abs(np.diff([point.error for point in self.points])).tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """An instrument's charts; ``left_out`` names sessions without a point and why (record id, reason)."""

    instrument: str
    series: tuple[Series, ...]
    left_out: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Session:
    """Reference loads and errors in SI: the sessions of a history may be in several units."""

    record: CalibrationRecord
    before: str
    names: tuple[str, ...]
    references: Array
    errors: Array

    def scale(self, load: str) -> float:
        """Return the factor from a load's unit to SI."""
        return si_scale(self.record.load(load).unit)


def control_chart(
    registry: Registry,
    instrument: str,
    *,
    baseline: int | None = None,
    same_percent: float = SAME_PERCENT,
    load: str | None = None,
) -> Chart:
    """Return the control charts of an instrument, every session in the order of the dates.

    Parameters
    ----------
    baseline : the first sessions that the limits are taken from; None: all before the newest point
    same_percent : reference loads within this share of full scale are the same check load
    load : the errors of this load only

    Raises
    ------
    RegistryError, RecordError
        the ledger is damaged, or a record fails a gate
    """
    sessions, left_out = _sessions(registry, instrument)
    series: list[Series] = []
    for group in _groups(sessions, same_percent):
        first, row = group[0]
        check_load = CheckLoad(
            loads=tuple(
                (name, float(first.references[row, j]) / first.scale(name), first.record.load(name).unit)
                for j, name in enumerate(first.names)
            )
        )
        series += [
            _series(check_load, group, j, baseline)
            for j, name in enumerate(first.names)
            if load in (None, name)
        ]
    return Chart(instrument=instrument, series=tuple(series), left_out=tuple(left_out))


def chart_findings(chart: Chart, session_record: str) -> tuple[Finding, ...]:
    """Return a finding for each rule that the points of one session break."""
    findings = []
    for series in chart.series:
        for broken in series.breaks:
            point = series.points[broken.index]
            if point.session_record != session_record or series.limits is None:
                continue
            findings.append(
                Finding(
                    rule="chart",
                    where=f"{series.load} at {series.check_load}",
                    message=f"rule {broken.rule.number} ({broken.rule.text}) is broken: error "
                    f"{point.error:+.4g} {series.unit} by {point.record}, "
                    f"limits {series.limits.lower:+.4g} to {series.limits.upper:+.4g} "
                    f"of {series.limits.points} sessions",
                )
            )
    return tuple(findings)


def _sessions(registry: Registry, instrument: str) -> tuple[list[_Session], list[tuple[str, str]]]:
    ledger = registry.ledger(instrument)
    dated: list[tuple[str, int, _Session]] = []
    left_out: list[tuple[str, str]] = []
    standing = []
    for record_id in ledger.entered():
        status = status_of(record_id, ledger.of(record_id), dt.date.max)
        if status.ended:
            left_out.append((record_id, status.state))
        else:
            standing.append(record_id)
    checked: dict[str, CalibrationRecord] = {}
    for record_id, loaded in load_many(registry.folder / instrument, standing, ledger).items():
        if isinstance(loaded, ToolkitError):
            raise loaded
        checked[record_id] = loaded
    approvals = approvals_of(ledger)
    for at, record in enumerate(checked.values()):
        evaluated = _session(registry, record, ledger, checked, approvals)
        if isinstance(evaluated, str):
            left_out.append((record.id, evaluated))
        else:
            dated.append((record.date, at, evaluated))
    return [session for _, _, session in sorted(dated, key=lambda entry: entry[:2])], left_out


def _session(
    registry: Registry,
    record: CalibrationRecord,
    ledger: Ledger,
    checked: dict[str, CalibrationRecord],
    approvals: Approvals,
) -> _Session | str:
    if phase_of(record) == "as_left":
        return "as left: measured after an adjustment"
    check = stored_check(registry.folder, record)
    if check is None:
        return "no check loads"
    day = dt.date.fromisoformat(record.date)
    before = in_use_before(
        registry, record.instrument, day, but=record.id, ledger=ledger, checked=checked, approvals=approvals
    )
    if before is None:
        return "no record was in force before it"
    errors = errors_by(before, check, zero=record.zero)
    if isinstance(errors, str):
        return errors
    scale = np.array([si_scale(record.load(name).unit) for name in errors])
    return _Session(
        record=record,
        before=before.id,
        names=tuple(errors),
        references=check.matrix(tuple(errors)) * scale,
        errors=np.column_stack(list(errors.values())) * scale,
    )


def _groups(sessions: list[_Session], same_percent: float) -> list[list[tuple[_Session, int]]]:
    groups: list[list[tuple[_Session, int]]] = []
    for session in sessions:
        for row in range(len(session.references)):
            for group in groups:
                if _same(group[0], (session, row), same_percent):
                    group.append((session, row))
                    break
            else:
                groups.append([(session, row)])
    return groups


def _same(early: tuple[_Session, int], late: tuple[_Session, int], same_percent: float) -> bool:
    (a, i), (b, j) = early, late
    if a.names != b.names:
        return False
    full = np.array(
        [max(session.record.load(n).largest * session.scale(n) for session in (a, b)) for n in a.names]
    )
    return bool((np.abs(a.references[i] - b.references[j]) <= same_percent / 100 * full).all())


def _series(
    check_load: CheckLoad, group: list[tuple[_Session, int]], column: int, baseline: int | None
) -> Series:
    rows: dict[str, list[tuple[_Session, int]]] = {}
    for session, row in group:
        rows.setdefault(session.record.id, []).append((session, row))
    name = group[0][0].names[column]
    newest, scale = group[-1][0].record.load(name), group[-1][0].scale(name)
    points = []
    for record_id, members in rows.items():
        session = members[0][0]
        points.append(
            ChartPoint(
                session_record=record_id,
                date=dt.date.fromisoformat(session.record.date),
                record=session.before,
                error=float(np.mean([session.errors[row, column] for _, row in members])) / scale,
                rows=len(members),
            )
        )
    values = np.array([point.error for point in points])
    count = min(baseline, len(values)) if baseline is not None else max(len(values) - 1, 0)
    limits = limits_of(values[:count])
    return Series(
        check_load=check_load,
        load=newest.load,
        unit=newest.unit,
        tolerance=newest.check_tolerance,
        points=tuple(points),
        baseline=count,
        limits=limits,
        breaks=() if limits is None else breaks_of(values, limits),
    )
