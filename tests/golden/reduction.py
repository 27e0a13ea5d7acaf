"""Reduced tests: conditions, characteristics with their uncertainty, curves, and the workbook of a test."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from tests.golden.entries import golden
from tests.golden.simulation import packaged_test, short_plan, simulate_plan
from tests.golden.surface import FIGURE_4_4, PLANS
from tests.golden.workplace import Workplace, sheets

SHEETS = (
    "reduced",
    "fits",
    "fit_parameters",
    "characteristics",
    "at_angles",
    "points",
    "budgets",
    "findings",
)


def _processed(place: Workplace, test: Path, *words: object, every: int = 1) -> dict[str, Any]:
    answer = place.packaged("process", test, "--out", "test.xlsx", *words)
    workbook = place.folder / "test.xlsx"
    return answer | {"workbook": sheets(workbook, SHEETS, every=every) if workbook.exists() else None}


@golden("reduction/figure-4-4", quick=True)
def figure_4_4(place: Workplace) -> Any:
    """The recording of the source document, in a test of its own."""
    folder = place.write({"test.toml": 'schema = 1\nmachine = "m15"\ndate = 2019-12-31\n'}, "figure")
    shutil.copy(FIGURE_4_4, folder)
    return _processed(place, folder) | {
        "inspect": place.packaged("inspect", folder / FIGURE_4_4.name, "--prove", "--known-at", "2026-06-01")
    }


@golden("reduction/virtual", quick=True)
def virtual(place: Workplace) -> Any:
    """The packaged virtual test."""
    return _processed(place, packaged_test(place)[0], every=5)


@golden("reduction/own-protocol")
def own_protocol(place: Workplace) -> Any:
    """A small test judged by a protocol that it departs from."""
    protocol = """schema = 1
source = "a protocol of its own"
slip_angles = { value = [0, 1, -1, 2, -2, 6], unit = "deg" }
loads = { value = [250, 567, 833], unit = "lbf" }
slip_angle_tolerance = { value = 0.5, unit = "deg" }
load_tolerance = 0.05
settle_revolutions = 2.5
average_revolutions = 1.0
acquisition = "after_settling"
"""
    path = place.write({"protocol.toml": protocol}) / "protocol.toml"
    return _processed(place, simulate_plan(place, short_plan()), "--protocol", path)


@golden("reduction/effects", quick=True)
def effects(place: Workplace) -> Any:
    """A small test with effects in tire, carriage and cells."""
    words = ["--effect", "zero_drift.D51=0.001mV/V/min", "--effect", "drum_curvature=0.15"]
    words += ["--effect", "sensitivity_error.E5=0.02", "--effect", "plysteer=0.2deg"]
    return _processed(place, simulate_plan(place, short_plan(), *words))


@golden("reduction/reversed-only", quick=True)
def reversed_only(place: Workplace) -> Any:
    """A small test with the drum reversed and no forward run: no pull can be told."""
    plan = short_plan().replace('["forward", "reverse"]', '["reverse"]')
    return _processed(place, simulate_plan(place, plan))


@golden("reduction/tare")
def tare(place: Workplace) -> Any:
    """A small test whose tare is a file, and one without any."""
    answers = {}
    for name in ("file", "none"):
        room = place.room(name)
        test = simulate_plan(room, short_plan())
        text = (test / "test.toml").read_text()
        (test / "test.toml").write_text(text[: text.index("[tare]")])
        if name == "file":
            first = sorted(test.glob("*.xlsx"))[0]
            (test / "test.toml").write_text(text[: text.index("[tare]")] + f'[tare]\nfile = "{first.name}"\n')
        answers[name] = _processed(room, test)
    return answers


@golden("reduction/continuous")
def continuous(place: Workplace) -> Any:
    """A test whose recordings hold the moves too: rows are discarded by revolution."""
    return _processed(place, simulate_plan(place, (PLANS / "continuous_plan.toml").read_text()), every=5)
