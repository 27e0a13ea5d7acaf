"""Conditions of a table at which no tire is tested."""

import math
from pathlib import Path

import pytest

from toolkit.tires.table import read_table
from toolkit.tires.table_fit import condition_findings, row_findings


@pytest.mark.parametrize(
    ("column", "cells", "said"),
    [
        ("P [bar]", ("34", "34"), "inflation pressure 34 bar (3400 kPa)"),
        ("P [kPa]", ("230", "34"), "inflation pressure 34 kPa"),
        ("V [m/s]", ("-200", "20"), "speed 200 m/s (720 km/h)"),
        ("IA [rad]", ("0", "2"), "inclination angle 2 rad (115 deg)"),
        ("P [psi]", ("34", "30"), ""),
        ("V [km/h]", ("-60", "60"), ""),
    ],
)
def test_conditions_at_which_no_tire_is_tested_are_told_with_unit_and_row(
    tmp_path: Path, column: str, cells: tuple[str, str], said: str
) -> None:
    path = tmp_path / "t.csv"
    path.write_text(f"SA [deg],FZ [N],FY [N],{column}\n1,3000,-900,{cells[0]}\n2,3000,-1700,{cells[1]}\n")
    told = condition_findings(read_table(path))
    assert [finding.message.startswith(said) for finding in told] == [True] * bool(said)
    assert all(finding.where.startswith(f"t.csv, {column[0]}") for finding in told)


@pytest.mark.parametrize(("pounds", "surface"), [(True, 0.9), (False, 0.9), (False, 0.2)])
def test_less_friction_than_a_dry_surface_has_is_told(tmp_path: Path, pounds: bool, surface: float) -> None:
    """FY in pounds under a header that says N leaves every stiffness possible, and 0.2 of the load."""
    path, rows = tmp_path / "t.csv", []
    for degrees in range(-12, 13):
        side = -surface * 4000.0 * math.tanh(12 * math.radians(degrees) / surface)
        rows.append(f"{degrees},4000,{side / (4.448222 if pounds else 1.0):.2f}")
    path.write_text("SA [deg],FZ [N],FY [N]\n" + "\n".join(rows) + "\n")
    told = row_findings(read_table(path))
    assert [finding.rule for finding in told] == (["implausible-friction"] if pounds or surface < 0.3 else [])


def test_a_table_without_side_force_has_none_that_is_too_small(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("SA [deg],FZ [N],MZ [N*m]\n-10,4000,-1\n0,4000,0\n10,4000,1\n")
    assert not row_findings(read_table(path))
