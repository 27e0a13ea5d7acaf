"""Makers' tables: of forces, whose curves are known, and of characteristics; and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from toolkit.comparison.compare import DEFAULT_ANGLES
from toolkit.comparison.maker_table import (
    is_characteristics_table,
    maker_characteristics,
    maker_conditions,
    maker_rows,
)
from toolkit.errors import ToolkitError

# A tire in SAE axes: FY = -D sin(C arctan(B SA)), MZ = Dm sin(Cm arctan(Bm SA)); D and Dm grow with the load.
B, C, BM, CM = 12.0, 1.3, 15.0, 2.3


def forces(SA: np.ndarray, load: float) -> tuple[np.ndarray, np.ndarray]:
    FY = -0.95 * load * np.sin(C * np.arctan(B * SA))
    return FY, 0.012 * load * np.sin(CM * np.arctan(BM * SA))


def table(
    path: Path, *, axes: str = "SAE", header: str = "SA [deg],FZ [N],FY [N],MZ [N*m]", more: str = ""
) -> Path:
    flip = {"SAE": (1, 1, 1), "adapted-SAE": (-1, 1, 1), "ISO-W": (-1, -1, -1)}[axes]
    lines = [header]
    for load in (2000.0, 4000.0):
        for degrees in np.linspace(-12, 12, 49):
            FY, MZ = forces(np.radians(degrees), load)
            lines.append(f"{flip[0] * degrees},{-load},{flip[1] * FY!r},{flip[2] * MZ!r}{more}")
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", ""))
    return path


@pytest.mark.parametrize("axes", ["SAE", "adapted-SAE", "ISO-W"])
def test_a_table_in_any_axes_gives_the_tire_s_characteristics(axes: str, tmp_path: Path) -> None:
    rows, findings = maker_rows(
        table(tmp_path / "m.csv", axes=axes), axes=axes, angles_rad=DEFAULT_ANGLES, identity="m"
    )
    assert [f.rule for f in findings if f.level != "note"] == []
    by_key = {(r.name, round(r.load_N), r.SA_rad): r.number.value for r in rows}
    assert {r.rotation for r in rows} == {"forward"}
    one = math.radians(1)
    for load in (2000.0, 4000.0):
        slope = 0.95 * load * C * B
        assert by_key["slope_cornering", load, None] == pytest.approx(slope, rel=1e-4)
        assert by_key["slope_aligning", load, None] == pytest.approx(0.012 * load * CM * BM, rel=1e-4)
        FY, MZ = forces(np.array([one, -one]), load)
        assert by_key["secant_cornering", load, None] == pytest.approx(-(FY[0] - FY[1]) / (2 * one), rel=1e-4)
        assert by_key["secant_aligning", load, None] == pytest.approx((MZ[0] - MZ[1]) / (2 * one), rel=1e-4)
        for angle in DEFAULT_ANGLES:
            FY, MZ = forces(np.array([angle]), load)
            assert by_key["FY", load, angle] == pytest.approx(FY[0], abs=1e-3 * load)
            assert by_key["MZ", load, angle] == pytest.approx(MZ[0], abs=1e-5 * load)


def test_wrong_axes_are_a_finding(tmp_path: Path) -> None:
    path = table(tmp_path / "m.csv", axes="adapted-SAE")
    _, findings = maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
    assert "axes-contradiction" in {f.rule for f in findings}


def test_a_slip_angle_that_the_table_does_not_reach_is_left_out(tmp_path: Path) -> None:
    angles = [math.radians(a) for a in (12.4, 12.6)]
    rows, _ = maker_rows(table(tmp_path / "m.csv"), axes="SAE", angles_rad=angles, identity="m")
    assert {round(math.degrees(r.SA_rad), 1) for r in rows if r.SA_rad} == {12.4}


def test_a_table_of_several_cambers_is_refused(tmp_path: Path) -> None:
    path = table(tmp_path / "m.csv", header="SA [deg],FZ [N],FY [N],MZ [N*m],IA [deg]", more=",0")
    text = path.read_text().splitlines()
    path.write_text("\n".join([*text[:-1], text[-1][:-1] + "4"]))
    with pytest.raises(ToolkitError) as caught:
        maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
    assert caught.value.rule == "table-varies"


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("SA [deg]", "SA [rad]", "impossible-value"),  # 12 rad: the unit is wrong
        ("\n-12.0,-2000.0,", "\n-12.0,-1e300,", "impossible-value"),
        ("FY [N]", "FY [MN]", "impossible-value"),
        ("FY [N]", "FY [kN]", "impossible-value"),  # 2 MN
        ("MZ [N*m]", "MZ [MN*m]", "impossible-value"),
    ],
)
def test_what_no_tire_does_is_a_wrong_unit(tmp_path: Path, old: str, new: str, rule: str) -> None:
    path = table(tmp_path / "m.csv")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ToolkitError) as caught:
        maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
    assert caught.value.rule == rule
    assert caught.value.next_step


def test_a_semicolon_separates_as_in_tables_of_forces(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    path.write_text(FIGURES)
    plain = maker_characteristics(path, identity="f")
    path.write_text(FIGURES.replace(",", ";"))
    assert is_characteristics_table(path)
    assert maker_characteristics(path, identity="f") == plain


def test_a_misspelt_characteristic_is_told_the_right_name(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    path.write_text("FZ [N],conicty [N]\n2500,40\n")
    assert is_characteristics_table(path)
    with pytest.raises(ToolkitError) as caught:
        maker_characteristics(path, identity="f")
    assert caught.value.expected == "conicity [unit]"


def test_a_table_too_short_to_fit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text("SA [deg],FZ [N],FY [N]\n-1,4000,900\n1,4000,-900\n")
    with pytest.raises(ToolkitError) as caught:
        maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
    assert caught.value.exit_code == 2


FIGURES = """FZ [lbf],conicity [N],U_conicity [N],plysteer [lbf],secant_cornering [lbf/deg],PRAT [lbf*ft]
567,50,4,-20,180,2
833,70,,-30,220,3
"""


def test_characteristics_in_the_maker_s_units(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    path.write_text(FIGURES)
    assert is_characteristics_table(path)
    rows = {(r.name, round(r.load_N)): r for r in maker_characteristics(path, identity="f")}
    light, heavy = round(567 * 4.4482216152605), round(833 * 4.4482216152605)
    assert rows["conicity", light].number.estimate().u == 2.0  # U is k = 2
    assert rows["conicity", heavy].number.estimate().u == 0.0
    assert rows["plysteer", light].number.value == pytest.approx(-20 * 4.4482216152605)
    per_rad = 180 * 4.4482216152605 * 180 / math.pi
    assert rows["secant_cornering", light].number.value == pytest.approx(per_rad)
    assert rows["PRAT", heavy].number.value == pytest.approx(3 * 1.3558179483314004)
    assert rows["secant_cornering", light].rotation == "forward"
    assert rows["conicity", light].rotation == "both"


def test_a_table_of_forces_is_none_of_characteristics(tmp_path: Path) -> None:
    assert not is_characteristics_table(table(tmp_path / "m.csv"))


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ("conicity [N]", "conicty [N]", "unknown-column"),
        ("plysteer [lbf]", "plysteer", "unknown-unit"),
        ("plysteer [lbf]", "conicity [N]", "doubled-column"),
        ("plysteer [lbf]", "plysteer [lbf*ft]", "unit-dimension"),
        ("secant_cornering [lbf/deg]", "secant_cornering [lbf]", "unit-dimension"),
        ("plysteer [lbf]", "plysteer [lbf/deg]", "unit-dimension"),
        ("FZ [lbf],", "slope_cornering [N/deg],", "missing-column"),
        ("833,70", "567,70", "doubled-load"),
        ("833,70", "0,70", "doubled-load"),
        ("833,70", ",70", "empty-cell"),
        ("833,70", "833,x", "text-cell"),
        ("833,70", "833,inf", "text-cell"),
        ("833,70", "833,1e300", "wrong-value"),
        ("833,70", "1e9,70", "wrong-value"),
        ("567,50,4", "567,50,-4", "wrong-value"),
        ("FZ [lbf],conicity [N]", "FZ [lbf],CRAT [lbf*ft]", "missing-column"),
        ("833,70,,", "833,70,", "ragged-row"),
        ("567,50,4,-20,180,2\n833,70,,-30,220,3\n", "", "no-data"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, old: str, new: str, rule: str) -> None:
    assert old in FIGURES
    path = tmp_path / "figures.csv"
    path.write_text(FIGURES.replace(old, new))
    with pytest.raises(ToolkitError) as caught:
        maker_characteristics(path, identity="f")
    assert caught.value.rule == rule
    assert caught.value.exit_code == 2


def test_a_pressure_that_no_tire_has_is_told(tmp_path: Path) -> None:
    header = "SA [deg],FZ [N],FY [N],MZ [N*m],P [{}]"
    said = {}
    for unit in ("bar", "psi"):
        path = table(tmp_path / f"{unit}.csv", header=header.format(unit), more=",34")
        _, findings = maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
        said[unit] = [finding.message for finding in findings if finding.rule == "unusual-condition"]
    assert said["psi"] == []
    assert [message.endswith("; 34 psi would be 234 kPa") for message in said["bar"]] == [True]


def test_no_text_and_no_file(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    path.write_bytes(b"FZ [N],conicity [N]\n1,\x81\n")
    for one, rule in ((path, "encoding"), (tmp_path / "none.csv", "no-file")):
        with pytest.raises(ToolkitError) as caught:
            maker_characteristics(one, identity="f")
        assert caught.value.rule == rule


def test_a_real_table_of_a_hundred_hertz_compares_with_a_thinned_copy_of_itself(tmp_path: Path) -> None:
    """Calspan's cornering run at 100 Hz: rows that the two share none of tell the same stiffness."""
    from tests.conftest import SHARED_DATA

    source = SHARED_DATA / "ttc_cornering" / "cornering_IA0_P83kPa.csv"
    if not source.is_file():
        pytest.skip(f"{source} is not at hand")
    head, *lines = source.read_text().splitlines()
    names = head.split(",")
    wanted = {"SA_deg": "SA [deg]", "FZ_N": "FZ [N]", "FY_N": "FY [N]", "MZ_Nm": "MZ [N*m]"}
    places = [names.index(name) for name in wanted]
    cells = [[line.split(",")[i] for i in places] for line in lines]
    slopes = []
    for name, rows in (("all", cells[::2]), ("thin", cells[1::6])):
        path = tmp_path / f"{name}.csv"
        path.write_text("\n".join([",".join(wanted.values()), *(",".join(row) for row in rows)]))
        read, findings = maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity=name)
        assert [f.rule for f in findings] == []
        slopes.append([r.number.estimate() for r in read if r.name == "slope_cornering"])
    assert len(slopes[0]) == len(slopes[1]) == 5
    for one, other in zip(*slopes, strict=True):
        U, _ = one.expanded()
        V, _ = other.expanded()
        assert abs(one.value - other.value) < math.hypot(U, V)
    values = [one.value for one in slopes[0]]
    assert values == sorted(values)  # the cornering stiffness grows with the load up to the rated one


@pytest.mark.parametrize(("column", "value"), [("IA [deg]", "3"), ("KAPPA [1]", "0.05")])
def test_a_table_of_another_condition_than_a_test_has_is_refused(
    tmp_path: Path, column: str, value: str
) -> None:
    path = table(tmp_path / "m.csv", header=f"SA [deg],FZ [N],FY [N],MZ [N*m],{column}", more=f",{value}")
    with pytest.raises(ToolkitError) as caught:
        maker_rows(path, axes="SAE", angles_rad=DEFAULT_ANGLES, identity="m")
    assert caught.value.exit_code == 2
    assert caught.value.rule in ("table-varies", "no-pure-slip")


def test_a_table_states_its_pressure_and_speed(tmp_path: Path) -> None:
    header = "SA [deg],FZ [N],FY [N],MZ [N*m],P [bar],V [km/h]"
    path = table(tmp_path / "m.csv", header=header, more=",2.6,60")
    assert dict(maker_conditions(path, axes="SAE")) == {"pressure": "260.0 kPa", "speed": "60.00 km/h"}
    assert dict(maker_conditions(table(tmp_path / "bare.csv"), axes="SAE")) == {
        "pressure": None,
        "speed": None,
    }
