"""`toolkit evaluate`: a grid with forces, in every axis system, and what is refused."""

import csv
import functools
import json

import pytest

from tests.cli import one_command
from toolkit.channels import AXES, signs
from toolkit.cli import evaluate
from toolkit.errors import ToolkitError

TIRE = """[UNITS]
LENGTH = 'meter'
FORCE = 'newton'
ANGLE = 'radians'
[MODEL]
FITTYP = 61
[DIMENSION]
UNLOADED_RADIUS = 0.3
[VERTICAL]
FNOMIN = 4000
[SLIP_ANGLE_RANGE]
ALPMIN = -0.2
ALPMAX = 0.2
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.1
PKX1 = 20
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1
PKY1 = -20
PKY2 = 1.6
PHY1 = 0.002
[ALIGNING_COEFFICIENTS]
QCZ1 = 1.1
QBZ1 = 9
QDZ1 = 0.1
"""


run = functools.partial(one_command.run, evaluate.command)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "x.tir").write_text(TIRE)
    (tmp_path / "g.csv").write_text("SA [deg],FZ [N]\n-4,4000\n2,4000\n4,4e3\n")
    return tmp_path / "x.tir", tmp_path / "g.csv"


def test_the_grid_comes_back_with_its_own_digits(files, tmp_path):
    out = tmp_path / "out.csv"
    assert run(*files, "--out", out)[0] == 0
    rows = list(csv.reader(out.read_text().splitlines()))
    assert rows[0] == ["SA [deg]", "FZ [N]", "FX [N]", "FY [N]", "MZ [N*m]"]
    assert [row[:2] for row in rows[1:]] == [["-4", "4000"], ["2", "4000"], ["4", "4e3"]]
    code, printed = run(*files)
    assert (code, printed) == (0, out.read_text())


def test_json_holds_the_same_numbers(files):
    answer = json.loads(run(*files, "--json")[1])
    assert (answer["schema"], answer["axes"], answer["model"]) == (1, "ISO-W", "mf61")
    assert answer["units"] == {"SA": "deg", "FZ": "N", "FX": "N", "FY": "N", "MZ": "N*m"}
    assert [row["SA"] for row in answer["rows"]] == [-4.0, 2.0, 4.0]
    # ISO-W: FY falls, MZ rises with the slip angle; FZ of either sign is the load.
    assert answer["rows"][0]["FY"] > answer["rows"][1]["FY"] > answer["rows"][2]["FY"]
    assert answer["rows"][0]["MZ"] < 0 < answer["rows"][2]["MZ"]


@pytest.mark.parametrize("axes", AXES)
def test_one_tire_in_every_axis_system(files, axes):
    tire, grid = files
    turn = signs("ISO-W", axes)
    iso = json.loads(run(tire, grid, "--json")[1])["rows"]
    grid.write_text("SA [deg],FZ [N]\n" + "".join(f"{turn['SA'] * row['SA']},{row['FZ']}\n" for row in iso))
    turned = json.loads(run(tire, grid, "--axes", axes, "--json")[1])["rows"]
    for one, other in zip(iso, turned, strict=True):
        assert (other["FY"], other["MZ"]) == (turn["FY"] * one["FY"], turn["MZ"] * one["MZ"])
    slope = turned[2]["FY"] - turned[0]["FY"]
    assert (slope > 0) == ((turned[2]["SA"] > turned[0]["SA"]) == (axes == "adapted-SAE"))


def test_slip_ratio_pressure_camber_and_speed_columns(files):
    tire, grid = files
    grid.write_text("SA [deg],FZ [kN],IA [deg],KAPPA [%],P [kPa],V [km/h]\n2,4,1,-5,250,60\n")
    code, out = run(tire, grid, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["rows"][0]["FX"] < 0
    assert "tir-no-pressure" in {finding["rule"] for finding in answer["findings"]}


def test_beyond_the_range_ends_with_one_and_still_answers(files):
    tire, grid = files
    grid.write_text("SA [deg],FZ [N]\n15,4000\n")
    code, out = run(tire, grid, "--json")
    assert code == 1
    assert [finding["rule"] for finding in json.loads(out)["findings"]] == ["tir-range"]
    assert json.loads(out)["rows"][0]["FY"] < 0


def test_without_a_load_there_is_no_force_of_any_sign(files):
    tir, grid = files
    grid.write_text("SA [deg],FZ [N]\n-4,0\n4,0\n0,4000\n")
    for axes in AXES:
        _, text = run(tir, grid, "--axes", axes)
        assert "-0.0," not in text
        assert not text.rstrip().endswith("-0.0")
        assert "-0.0" not in run(tir, grid, "--axes", axes, "--json")[1]


def test_loads_of_both_signs_are_refused(files):
    tir, grid = files
    grid.write_text("SA [deg],FZ [N]\n-4,-4000\n4,4000\n2,-4000\n0,3\n")
    with pytest.raises(ToolkitError) as caught:
        run(tir, grid)
    assert (caught.value.exit_code, caught.value.rule) == (2, "mixed-load-signs")
    assert "row 3" in str(caught.value.where)


def test_raw_angles_differ_by_the_tangent(files):
    star, raw = (
        json.loads(run(*files, "--angles", a, "--json")[1])["rows"][2]["FY"] for a in ("star", "raw")
    )
    assert 0 < abs(star) - abs(raw) < 0.002 * abs(star)


def test_columns_of_forces_in_the_grid_are_replaced_and_said(files):
    tire, grid = files
    grid.write_text("SA [deg],FZ [N],FY [N]\n2,4000,1\n")
    answer = json.loads(run(tire, grid, "--json")[1])
    assert answer["rows"][0]["FY"] < -100
    assert [finding["rule"] for finding in answer["findings"]] == ["grid-columns"]


@pytest.mark.parametrize(
    ("grid_text", "options", "rule"),
    [
        ("SA [deg]\n1\n", [], "missing-column"),
        ("FZ [N]\n1\n", [], "missing-column"),
        ("SA,FZ [N]\n1,2\n", [], "unknown-unit"),
        ("SA [deg],FZ [N]\n1,nan\n", [], "text-cell"),
        ("SA [deg],FZ [N]\n", [], "no-data"),
        ("SA [deg],FZ [N]\n1,2\n", ["--axes", "ISO"], "unknown-axes"),
        ("SA [deg],FZ [N]\n1,2\n", ["--angles", "tan"], "unknown-angles"),
        ("SA [deg],FZ [N]\n1,2\n", ["--out", "x.xlsx"], "output-name"),
    ],
)
def test_bad_input_is_refused_and_writes_nothing(files, tmp_path, grid_text, options, rule):
    tire, grid = files
    grid.write_text(grid_text)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ToolkitError) as caught:
        run(tire, grid, *options)
    assert (caught.value.rule, caught.value.exit_code) == (rule, 2)
    assert caught.value.next_step
    assert sorted(tmp_path.iterdir()) == before


def test_an_input_is_never_replaced(files):
    tire, grid = files
    with pytest.raises(ToolkitError) as caught:
        run(tire, grid, "--out", grid)
    assert caught.value.rule == "original"


@pytest.mark.parametrize("axes", AXES)
def test_a_tire_that_rolls_backward_is_one_that_rolls_forward_turned_round(tmp_path, axes):
    (tmp_path / "x.tir").write_text(
        TIRE.replace("PHY1 = 0.002", "PHY1 = 0").replace("QBZ1 = 9", "QBZ1 = 9\nQDZ8 = -0.1")
    )
    (tmp_path / "back.csv").write_text("SA [deg],IA [deg],FZ [N],V [km/h]\n-4,2,4000,-60\n3,-1,3000,-30\n")
    (tmp_path / "forth.csv").write_text("SA [deg],IA [deg],FZ [N],V [km/h]\n-4,-2,4000,60\n3,1,3000,30\n")
    back, forth = (
        json.loads(run(tmp_path / "x.tir", tmp_path / f"{name}.csv", "--axes", axes, "--json")[1])["rows"]
        for name in ("back", "forth")
    )
    for one, other in zip(back, forth, strict=True):
        assert one["FY"] == pytest.approx(-other["FY"], rel=1e-12)
        assert one["MZ"] == pytest.approx(other["MZ"], rel=1e-12)
        assert abs(one["MZ"]) > 1


FOREIGN_61 = "RBX3 = 40\nPPX1 = 0.3\n", "RBY4 = 60\nPKY6 = -2\nPEY5 = 3\n", "QDZ10 = 0.4\nPPZ1 = 0.3\n"
FOREIGN_52 = "", "PHY3 = 0.05\n", ""
COMBINED = "RBX1 = 12\nRCX1 = 1.1\n", "RBY1 = 8\nRCY1 = 1.05\nRVY5 = 1.9\nRVY6 = 20\n", "QDZ8 = -0.1\n"


def tire_of(fittyp, *more):
    """Return the tire with further lines (longitudinal, lateral, aligning)."""
    head, rest = TIRE.replace("FITTYP = 61", f"FITTYP = {fittyp}").split("[LATERAL_COEFFICIENTS]\n")
    lateral, aligning = rest.split("[ALIGNING_COEFFICIENTS]\n")
    added = ["".join(parts) for parts in zip(*more, strict=True)]
    lateral, aligning = lateral + added[1], aligning + added[2]
    return f"{head}{added[0]}[LATERAL_COEFFICIENTS]\n{lateral}[ALIGNING_COEFFICIENTS]\n{aligning}"


@pytest.mark.parametrize(
    ("fittyp", "foreign", "names"),
    [
        (5, FOREIGN_61, "RBX3, PPX1, RBY4, PKY6, PEY5, QDZ10, PPZ1"),
        (52, FOREIGN_61, "RBX3, PPX1, RBY4, PKY6, PEY5, QDZ10, PPZ1"),
        (61, FOREIGN_52, "PHY3"),
        (62, FOREIGN_52, "PHY3"),
    ],
)
def test_names_of_the_other_magic_formula_change_nothing_and_are_told(tmp_path, fittyp, foreign, names):
    grid = tmp_path / "g.csv"
    grid.write_text("SA [deg],FZ [N],IA [deg],KAPPA [1]\n-4,4000,4,0.05\n3,3000,-3,-0.02\n2,3500,2,0\n")
    (tmp_path / "plain.tir").write_text(tire_of(fittyp, COMBINED))
    (tmp_path / "mixed.tir").write_text(tire_of(fittyp, COMBINED, foreign))
    plain, mixed = (run(tmp_path / f"{name}.tir", grid, "--json") for name in ("plain", "mixed"))
    assert (plain[0], mixed[0]) == (0, 1)
    assert json.loads(mixed[1])["rows"] == json.loads(plain[1])["rows"]
    (finding,) = json.loads(mixed[1])["findings"]
    assert finding["rule"] == "tir-foreign-names"
    assert f": {names} of MF " in finding["message"]


def test_names_that_change_nothing_anyway_are_not_told(tmp_path):
    neutral = (
        "RBX3 = 0\n",
        "RBY4 = 0\nPKY4 = 2\nPHY3 = 0\n",
        "PPZ1 = 0\n[SCALING_COEFFICIENTS]\nLKYC = 1\nLMUV = 0\n",
    )
    (tmp_path / "g.csv").write_text("SA [deg],FZ [N]\n-4,4000\n")
    (tmp_path / "x.tir").write_text(tire_of(5, neutral))
    code, out = run(tmp_path / "x.tir", tmp_path / "g.csv", "--json")
    assert (code, json.loads(out)["findings"]) == (0, [])


@pytest.mark.parametrize(("column", "number"), [("SA [rad]", "3"), ("SA [deg]", "91"), ("IA [deg]", "80")])
def test_an_angle_of_no_tire_is_told(files, tmp_path, column, number):
    grid = tmp_path / "angles.csv"
    other = "SA [deg]," if column.startswith("IA") else ""
    grid.write_text(f"{other}FZ [N],{column}\n{'3,' * bool(other)}4000,{number}\n")
    code, out = run(files[0], grid, "--json")
    assert code == 1
    assert "unusual-condition" in [finding["rule"] for finding in json.loads(out)["findings"]]
