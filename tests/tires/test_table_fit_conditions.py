"""Conditions of a table at which no tire is tested."""

from pathlib import Path

import pytest

from toolkit.tires.table import read_table
from toolkit.tires.table_fit import condition_findings


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
