"""Findings of a session's readings: what a person should look at before the candidate is approved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.fit.readings import SessionReadings, ShuntCheck

LARGEST_RATIO_MV_V = 10.0  # metal foil bridges give 1 to 4 mV/V at capacity
TEMPERATURE_C = (18.0, 28.0)  # ISO 376


def readings_findings(found: SessionReadings, where: str) -> tuple[Finding, ...]:
    """Return the findings of a session's readings; ``where`` names the session."""
    made = [
        Finding(
            rule="bridge-range",
            where=name,
            message=f"a bridge output of {ratio:.4g} mV/V, over {LARGEST_RATIO_MV_V:g}: is its unit, "
            "excitation or scale right?",
        )
        for name, ratio in found.largest_ratio
        if ratio > LARGEST_RATIO_MV_V
    ]
    made += [
        Finding(
            rule="zero-drift",
            where=one.load,
            message=f"the zeros of {', '.join(one.cells)} moved by {one.drift:+.4g} {one.unit} "
            f"({one.percent_fs:+.3g} % of full scale), tolerance {one.tolerance:.4g} {one.unit}",
        )
        for one in found.zero_loads
        if abs(one.drift) > one.tolerance
    ]
    made += [finding for one in found.shunts if (finding := _shunt(one)) is not None]
    made += [
        Finding(
            rule="creep",
            where=f"creep at {load}",
            message="two readings of one indication, or of the load, are needed: nothing was evaluated",
            level="note",
        )
        for load in found.creep_left_out
    ]
    made += [
        Finding(
            rule="scale-unit",
            where=name,
            message='a scale without a unit is not applied: write scale = { value, unit = "mV/V" }',
            level="note",
        )
        for name in found.unscaled
    ]
    low, high = TEMPERATURE_C
    if found.temperature_C is not None and not low <= found.temperature_C <= high:
        message = f"{found.temperature_C:.4g} degC; ISO 376 asks for {low:g} to {high:g} degC"
        made.append(Finding(rule="temperature", where=where, message=message, level="note"))
    return tuple(made)


def _shunt(one: ShuntCheck) -> Finding | None:
    where = f"{one.name}, {one.source}"
    if one.difference_percent is None or one.expected is None:
        message = f"a shunt step of {one.measured:.6g} {one.unit} without an expected one in that unit"
        return Finding(rule="shunt", where=where, message=message, level="note")
    if one.within:
        return None
    zero = "" if one.zero is not None or one.source == "shunt_measured" else ", no zero reading before it"
    message = (
        f"the shunt gives {one.measured:.6g} {one.unit} for {one.expected:.6g}: "
        f"{one.difference_percent:+.3g} %, tolerance {one.tolerance_percent:g} %{zero}"
    )
    return Finding(rule="shunt", where=where, message=message)
