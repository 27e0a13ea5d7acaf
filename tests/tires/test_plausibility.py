"""Values that no tire has are refused; fitted sizes that no tire has are told: a unit is wrong."""

from pathlib import Path

import numpy as np
import pytest

from toolkit.tires.models.magic_formula import MODEL
from toolkit.tires.plausibility import LARGEST, size_findings
from toolkit.tires.table import read_table
from toolkit.tires.table_fit import fit_table

HEADER = "SA [deg],FZ [N],FY [N],MZ [N*m]"
# Cornering stiffness over load [1/rad] and trail [m] as published: a truck tire past its load, car tires
# (Gillespie 1992, 0.08 and 0.30 per degree), a bicycle's, a racing tire's.
TIRES = {
    "truck": (40_000.0, 3.2, 0.09), "stiff car": (4000.0, 17.0, 0.03), "bias ply": (4000.0, 4.6, 0.05),
    "bicycle": (450.0, 12.0, 0.008), "racing": (650.0, 35.0, 0.02),
}  # fmt: skip


def findings(
    path: Path,
    tire: str,
    *,
    header: str = HEADER,
    angle: float = 1.0,
    force: float = 1.0,
    moment: float = 1.0,
) -> list[tuple[str, str]]:
    """Write a tire's table with a column's numbers multiplied, fit it, and return rules and places."""
    load, per_load, trail = TIRES[tire]
    rng, lines = np.random.default_rng(3), [header]
    for FZ in (0.6 * load, load):
        SA = np.radians(np.linspace(-10, 10, 41))
        FY = -FZ * np.sin(1.3 * np.arctan(per_load / 1.3 * SA)) + rng.normal(0, 0.003 * FZ, len(SA))
        MZ = trail * np.cos(1.1 * np.arctan(8 * SA)) * -FY
        rows = np.column_stack([np.degrees(SA) * angle, np.full(len(SA), FZ), FY * force, MZ * moment])
        lines += [",".join(f"{one:.6g}" for one in row) for row in rows]
    path.write_text("\n".join(lines))
    table = read_table(path)
    found = fit_table(table, MODEL).findings
    return [(one.rule, one.where) for one in found if one.rule.startswith("implausible")]


@pytest.mark.parametrize("tire", TIRES)
def test_no_published_size_is_odd(tmp_path: Path, tire: str) -> None:
    assert findings(tmp_path / "t.csv", tire) == []


@pytest.mark.parametrize(
    ("wrong", "channels"),
    [
        ({"angle": np.pi / 180}, "FY"),  # radians named deg
        ({"angle": 3.0, "header": HEADER.replace("deg", "rad")}, None),  # 30 rad: refused before
        ({"angle": 0.3, "header": HEADER.replace("deg", "rad")}, "FY"),  # deg named rad, within half a turn
        ({"force": 1e-3, "moment": 1e-3}, "friction, FY"),  # kN named N
        ({"force": 30.0, "moment": 30.0}, "FY"),
        ({"moment": 1e3}, "MZ"),  # N·mm named N·m
        (
            {"moment": 1.0, "force": 0.2248},
            "friction",
        ),  # pounds named newtons: a stiffness within the range of tires
    ],
)
def test_a_wrong_unit_shows_in_the_size_of_a_stiffness(
    tmp_path: Path, wrong: dict[str, float], channels: str | None
) -> None:
    path = tmp_path / "t.csv"
    if channels is None:
        with pytest.raises(Exception, match="no tire has such a value"):
            findings(path, "bicycle", **wrong)
        return
    told = findings(path, "bicycle", **wrong)
    stiff = [channel for channel in channels.split(", ") if channel != "friction"]
    assert [where for rule, where in told if rule == "implausible-stiffness"] == [
        f"t.csv, {x}" for x in stiff
    ]
    assert any(rule == "implausible-friction" for rule, _ in told) is ("friction" in channels)
    assert {rule for rule, _ in told} <= {"implausible-stiffness", "implausible-friction"}


def test_a_slope_that_the_data_do_not_determine_is_not_judged(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = [f"{one:.3f},1000,{-0.02 * one:.4f}" for one in np.linspace(4, 10, 30)]
    path.write_text("\n".join(["SA [deg],FZ [N],FY [N]", *rows]))
    fits = fit_table(read_table(path), MODEL).fits
    assert fits[0].slope_at_zero is None
    assert size_findings(fits, "t.csv") == ()


def test_loads_that_no_tire_is_tested_at_are_named(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    TIRES["in kilonewtons"] = (4.0, 12.0, 0.03)
    try:
        assert findings(path, "in kilonewtons") == [("implausible-load", "t.csv, FZ")]
    finally:
        del TIRES["in kilonewtons"]


def test_the_largest_sizes_stand_once() -> None:
    # The largest aircraft tires carry some 300 kN.
    assert 3e5 < LARGEST["force"] <= 1e6
    assert LARGEST["moment"] <= 1e5
