"""Findings of a session's readings: what a person should look at before the candidate is approved."""

from __future__ import annotations

from toolkit.calibration.fit.findings import COARSE, session_findings
from toolkit.calibration.fit.readings import SessionReadings, ShuntCheck, readings_of
from toolkit.calibration.fit.session_fit import SessionFit
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.findings import Finding, Level

TEMPERATURE_C = (18.0, 28.0)  # ISO 376
OPERATING_C = (-40.0, 85.0)  # strain-gauge cells beyond their compensated range, OIML R 60: -10 to 40


def readings_findings(readings: SessionReadings, where: str) -> tuple[Finding, ...]:
    """Return the findings of a session's readings; ``where`` names the session."""
    findings = [
        Finding(
            rule="bridge-range",
            where=name,
            message=f"a bridge output of {ratio:.4g} mV/V, over {limit:g}: is its unit, excitation or scale "
            'right? A bridge of semiconductor gauges is stated: bridge = "semiconductor"',
            level="error",
        )
        for name, ratio, limit in readings.largest_ratio
        if ratio > limit
    ]
    findings += [
        Finding(
            rule="zero-drift",
            where=zero.load,
            message=f"the zeros of {', '.join(zero.cells)} moved by {zero.drift:+.4g} {zero.unit} "
            f"({zero.percent_fs:+.3g} % of full scale), tolerance {zero.tolerance:.4g} {zero.unit}",
            level="error" if abs(zero.percent_fs) > 100 * COARSE else "warning",
        )
        for zero in readings.zero_loads
        if abs(zero.drift) > zero.tolerance
    ]
    findings += [finding for shunt in readings.shunts if (finding := _shunt(shunt)) is not None]
    findings += [
        Finding(
            rule="creep",
            where=f"creep at {load}",
            message="two readings of one indication, or of the load, are needed: nothing was evaluated",
            level="note",
        )
        for load in readings.creep_left_out
    ]
    findings += [
        Finding(
            rule="scale-unit",
            where=name,
            message='a scale without a unit is not applied: write scale = { value, unit = "mV/V" }',
            level="note",
        )
        for name in readings.unscaled
    ]
    findings += _temperature(readings.temperature_C, where)
    return tuple(findings)


def _temperature(celsius: float | None, where: str) -> list[Finding]:
    """Return that a session was too warm or too cold, with the unit that may have been meant."""
    (low, high), (coldest, warmest) = TEMPERATURE_C, OPERATING_C
    if celsius is None or low <= celsius <= high:
        return []
    message = f"{celsius:.4g} degC; ISO 376 asks for {low:g} to {high:g} degC"
    possible = coldest <= celsius <= warmest
    if not possible:
        message = (
            f"{celsius:.4g} degC, where strain-gauge cells work from {coldest:g} to {warmest:g} degC: no "
            "session was made there"
        )
    # What was written, had it been written in kelvin or in degF.
    for number, unit in ((celsius + 273.15, "K"), (1.8 * celsius + 32, "degF")):
        if low <= number <= high:
            message += f"; if {number:.3g} {unit} is stated, {number:.3g} degC would be within"
    level: Level = "note" if possible else "error"
    return [Finding(rule="temperature", where=where, message=message, level=level)]


def _shunt(shunt: ShuntCheck) -> Finding | None:
    where = f"{shunt.name}, {shunt.source}"
    if shunt.difference_percent is None or shunt.expected is None:
        message = f"a shunt step of {shunt.measured:.6g} {shunt.unit} without an expected one in that unit"
        return Finding(rule="shunt", where=where, message=message, level="note")
    if shunt.within:
        return None
    zero = "" if shunt.zero is not None or shunt.source == "shunt_measured" else ", no zero reading before it"
    message = (
        f"the shunt gives {shunt.measured:.6g} {shunt.unit} for {shunt.expected:.6g}: "
        f"{shunt.difference_percent:+.3g} %, tolerance {shunt.tolerance_percent:g} %{zero}"
    )
    return Finding(rule="shunt", where=where, message=message)


def all_findings(fit: SessionFit, record: CalibrationRecord) -> tuple[Finding, ...]:
    """Return what a session says of itself: its data and fit, and the readings that its record holds."""
    readings = readings_of(record, fit.session.table)
    return session_findings(fit) + readings_findings(readings, fit.session.path.name)
