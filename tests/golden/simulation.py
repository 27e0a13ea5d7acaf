"""Recordings and truth of the virtual machine: a test with and without effects, a session, moves too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.golden.entries import golden
from tests.golden.surface import PLANS
from tests.golden.workplace import Workplace, csv_columns, toml_values

EFFECTS = ("relaxation=0.5m", "zero_offset.D51=0.002mV/V", "crosstalk.FZ.FY=0.01", "channel_swap.D51.D52")


def simulated(place: Workplace, plan: Path, *words: object, every: int = 40) -> dict[str, Any]:
    """Simulate a plan into ``test`` of this place; return the answer, the truth and the recordings."""
    answer = place.packaged("simulate", plan, "--out", "test", "--csv", "csv", *words)
    truth = place.folder / "test" / "truth.json"
    return answer | {
        "truth": json.loads(truth.read_text()) if truth.exists() else None,
        "recordings": {
            path.name: csv_columns(path, every=every) for path in sorted((place.folder / "csv").glob("*.csv"))
        },
    }


def packaged_test(place: Workplace) -> tuple[Path, dict[str, Any]]:
    """Return the packaged virtual test as files, simulated once, and what was answered."""

    def simulate(room: Workplace) -> tuple[Path, dict[str, Any]]:
        return room.folder / "test", simulated(room, PLANS / "test_plan.toml")

    return place.once("packaged test", simulate)


def short_plan() -> str:
    """Return the packaged plan with five slip angles, forward and reversed."""
    angles = 'slip_angles = { value = [0, 2, -2, 6, -6], unit = "deg" }\n'
    return (PLANS / "test_plan.toml").read_text(encoding="utf-8").replace("[label]", angles + "\n[label]")


def simulate_plan(place: Workplace, plan: str, *words: object) -> Path:
    """Write a plan and simulate it; return the test's folder."""
    (place.folder / "tire.tir").write_bytes((PLANS / "tire.tir").read_bytes())
    path = place.write({"plan.toml": plan}) / "plan.toml"
    simulated = place.packaged("simulate", path, "--out", "test", *words)
    if simulated["exit_code"]:
        raise RuntimeError(f"the plan cannot be simulated: {simulated['answer']}")
    return place.folder / "test"


@golden("simulation/test", quick=True)
def dwell_test(place: Workplace) -> Any:
    """The packaged test: forward and reversed, averages of dwells."""
    return packaged_test(place)[1]


@golden("simulation/effects", quick=True)
def with_effects(place: Workplace) -> Any:
    """A shorter test with effects of every stage, and another seed."""
    words = [word for effect in EFFECTS for word in ("--effect", effect)]
    plan = place.write({"plan.toml": short_plan()}) / "plan.toml"
    return simulated(place, plan, *words, "--seed", 11)


@golden("simulation/continuous")
def continuous(place: Workplace) -> Any:
    """Every row of moves too, with the case that is made of it."""
    effects = ("--effect", "relaxation=0.4m", "--effect", "thermal_friction", "--effect", "load_lag=0.3s")
    answer = simulated(place, PLANS / "continuous_plan.toml", "--case", "case", *effects[:2], every=200)
    return answer | {"case": toml_values(next((place.folder / "case").glob("*.toml")))}


@golden("simulation/session", quick=True)
def session(place: Workplace) -> Any:
    """A reference-load session and what its calibration comes to."""
    answer = place.packaged("simulate", PLANS / "session_plan.toml", "--out", "session")
    folder = place.folder / "session"
    registry = place.folder / "calibrations"
    registry.mkdir()
    calibrated = place.answer("calibrate", folder / "SESSION.toml", calibrations=registry)
    loads = calibrated["answer"]["loads"]
    return answer | {
        "files": {path.name: csv_columns(path) for path in sorted(folder.glob("*.csv"))},
        "session": toml_values(folder / "SESSION.toml"),
        "coefficients": {name: load["coefficients"] for name, load in loads.items()},
    }


@golden("simulation/flat-table", quick=True)
def flat_table(place: Workplace) -> Any:
    """A maker's table of the packaged tire on a flat surface."""
    (place.folder / "tire.tir").write_bytes((PLANS / "tire.tir").read_bytes())
    plan = """schema = 1
kind = "table"
title = "a flat surface"
date = 2026-03-18
machine = "m15-virtual"
[tire]
file = "tire.tir"
"""
    path = place.write({"plan.toml": plan}) / "plan.toml"
    return place.packaged("simulate", path, "--out", "table") | {
        "files": {path.name: csv_columns(path) for path in sorted((place.folder / "table").glob("*.csv"))}
    }
