"""The doubt of a machine's corrections in characteristics: one error, the same in every row."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tests.characteristics.tire_factory import LOAD, M15, reduced_test
from toolkit.characteristics.characterise import characterise, characteristic_rows
from toolkit.machine import Correction
from toolkit.machine.definition import Machine


def corrected(effect: str, unit: str, u: float, **place: str) -> Machine:
    told = Correction(
        effect=effect, channel=place.get("channel"), source=place.get("source"), parameter="", value=0.0,
        unit=unit, u=u, reason="measured apart", by="a tester", date="2026-04-01", answer_sha256="a" * 64,
        case_sha256="b" * 64, code_version="0",
    )  # fmt: skip
    return dataclasses.replace(M15, version=2, corrections=(told,))


def budgets(machine: Machine) -> dict[str, dict[str, float]]:
    reduced = reduced_test()
    found = characterise(reduced, machine=machine, record=None)
    rows = characteristic_rows(reduced, found, machine=machine, record=None)
    return {row.name: dict(row.number.by_source()) for row in rows if row.rotation in ("both", "forward")}


def test_the_doubt_of_a_leak_is_in_conicity_and_cancels_in_plysteer() -> None:
    made = budgets(corrected("crosstalk", "N/N", 0.002, channel="FY", source="FZ"))
    # FY = FY_shown - c FZ in the machine's axes in both directions alike: all of it in the half sum of the
    # two, none in the half difference.
    assert made["conicity"]["machine correction"] == pytest.approx(0.002 * LOAD, rel=1e-6)
    assert made["plysteer"].get("machine correction", 0.0) < 1e-9 * LOAD
    assert "machine correction" not in made["PRAT"]


def test_the_doubt_of_a_zero_widens_that_of_the_slip_angle() -> None:
    before = budgets(M15)["plysteer"]["slip angle zero"]
    after = budgets(corrected("steer_offset", "deg", 0.12))["plysteer"]["slip angle zero"]
    stated = M15.stated_uncertainty("SA").u
    assert after / before == pytest.approx(math.hypot(stated, math.radians(0.12)) / stated, rel=1e-9)


def test_the_doubt_of_a_compliance_counts_at_the_largest_moment() -> None:
    before = budgets(M15)["plysteer"]["slip angle zero"]
    after = budgets(corrected("steer_compliance", "rad/(N*m)", 1e-5))["plysteer"]["slip angle zero"]
    largest = max(abs(one.MZ) for one in reduced_test().conditions)
    stated = M15.stated_uncertainty("SA").u
    assert after / before == pytest.approx(math.hypot(stated, 1e-5 * largest) / stated, rel=1e-9)


def test_a_machine_without_corrections_has_no_such_part() -> None:
    assert not any("machine correction" in parts for parts in budgets(M15).values())
