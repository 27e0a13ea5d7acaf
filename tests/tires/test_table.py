"""Tables with units: what is read, what is refused, and the finding of contradicted axes."""

import numpy as np
import pytest

from toolkit.channels import signs
from toolkit.errors import (
    CellError,
    ColumnError,
    ConfigError,
    FitError,
    ToolkitError,
    UnitError,
    UnreadableError,
)
from toolkit.tires.models import model
from toolkit.tires.models.magic_formula import value
from toolkit.tires.table import read_table
from toolkit.tires.table_fit import fit_table

SA_DEG = np.arange(-10.0, 10.5, 1.0)


def rows(axes="SAE", loads=(2000.0, 4000.0)):
    flip = signs("SAE", axes)
    lines = []
    for FZ in loads:
        SA = np.radians(SA_DEG)
        FY = value((11.0, 1.3, -FZ, -0.5, 0.002, 10.0), SA)
        MZ = value((10.0, 2.3, 0.03 * FZ, -1.0, 0.002, 1.0), SA)
        lines += [
            f"{flip['SA'] * a:.6f},{-FZ},{flip['FY'] * fy:.8f},{flip['MZ'] * mz:.8f}"
            for a, fy, mz in zip(SA_DEG, FY, MZ, strict=True)
        ]
    return lines


def write(tmp_path, lines, header="SA [deg],FZ [N],FY [N],MZ [N*m]"):
    path = tmp_path / "tire.csv"
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def test_load_is_positive_and_columns_are_in_SI(tmp_path):
    table = read_table(write(tmp_path, ["2,-1,3,4", "4,-1,3,4"], "SA [deg],FZ [kN],FY [lbf],MZ [lbf*ft]"))
    assert table["FZ"].tolist() == [1000.0, 1000.0]
    assert table["SA"] == pytest.approx(np.radians([2.0, 4.0]))
    assert table["FY"][0] == pytest.approx(3 * 4.4482216152605)
    assert table["MZ"][0] == pytest.approx(4 * 4.4482216152605 * 0.3048)


def test_optional_columns_and_semicolons(tmp_path):
    table = read_table(write(tmp_path, ["1;2;3;4;5;6"], "SA [deg];FZ [N];FY [N];IA [deg];P [kPa];t [s]"))
    assert table["P"].tolist() == [5000.0]
    assert table.get("MZ") is None


def test_columns_are_known_by_their_names_as_those_of_recordings_are(tmp_path):
    header = "Time [ms],Fz load [kN],Slip angle [deg],Lateral force (kN),inflation pressure in bar"
    table = read_table(write(tmp_path, ["20,-4,2,-1.5,2.4"], header))
    assert table["t"].tolist() == [0.02]
    assert table["FZ"].tolist() == [4000.0]
    assert table["SA"] == pytest.approx(np.radians([2.0]))
    assert table["FY"].tolist() == [-1500.0]
    assert table["P"] == pytest.approx([2.4e5])


@pytest.mark.parametrize(
    ("header", "lines", "error", "rule"),
    [
        ("SA [deg],FY [N],MZ [N*m]", ["1,2,3"], ColumnError, "missing-column"),
        ("SA [deg],FZ [N]", ["1,2"], ColumnError, "missing-column"),
        ("SA [deg],FZ [N],FY [N],FY [N]", ["1,2,3,4"], ColumnError, "doubled-column"),
        ("SA,FZ [N],FY [N]", ["1,2,3"], ColumnError, "unknown-unit"),
        ("SA [deg],FZ [N],FY [N],SLIP [1]", ["1,2,3,4"], ColumnError, "unknown-column"),
        ("SA [deg],FZ [N],FY [furlong2]", ["1,2,3"], UnitError, "unknown-unit"),
        ("SA [deg],FZ [N],FY [N*m]", ["1,2,3"], UnitError, "unit-dimension"),
        ("SA [deg],FZ [N],FY [N]", [], UnreadableError, "no-data"),
        ("", [], UnreadableError, "no-data"),
        ("SA [deg],FZ [N],FY [N]", ["1,2,x"], CellError, "text-cell"),
        ("SA [deg],FZ [N],FY [N]", ["1,2,nan"], CellError, "text-cell"),
        ("SA [deg],FZ [N],FY [N]", ["1,2,"], CellError, "empty-cell"),
        ("SA [deg],FZ [N],FY [N]", ["1,2"], CellError, "ragged-row"),
        ("SA [deg],FZ [N],FY [N]", ["1,2,1_000"], CellError, "text-cell"),
    ],
)
def test_bad_tables_are_refused_with_place_and_next_step(tmp_path, header, lines, error, rule):
    with pytest.raises(error) as caught:
        read_table(write(tmp_path, lines, header))
    assert caught.value.rule == rule
    assert caught.value.exit_code == 2
    assert "tire.csv" in caught.value.where
    assert caught.value.next_step


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_where_something_else_stands_between_the_cells(tmp_path, separator):
    header = separator.join(["SA [deg]", "FZ [N]", "FY [N]"])
    rows = [separator.join(row) for row in (["-1,5", "2000,0", "300,25"], ["0", "2100", "3,5e1"])]
    table = read_table(write(tmp_path, rows, header))
    np.testing.assert_allclose(table["SA"], np.deg2rad([-1.5, 0.0]), rtol=1e-15)
    np.testing.assert_array_equal(table["FY"], [300.25, 35.0])
    assert table.cells[0] == ("-1.5", "2000.0", "300.25")


def test_commas_that_may_stand_between_thousands_are_refused(tmp_path):
    with pytest.raises(UnreadableError) as caught:
        read_table(write(tmp_path, ["1;2,000;3,000"], "SA [deg];FZ [N];FY [N]"))
    assert caught.value.rule == "ambiguous-text"
    for cell, told in (("1.234,5", ""), ("1,5", ", with a comma where numbers are read with points")):
        with pytest.raises(CellError) as wrong:
            read_table(write(tmp_path, [f"1.5;{cell};3.5"], "SA [deg];FZ [N];FY [N]"))
        assert wrong.value.got == repr(cell) + told


def test_a_number_beyond_every_float_is_told_as_it_is_written(tmp_path):
    with pytest.raises(CellError) as caught:
        read_table(write(tmp_path, ["1e999,2,3"], "SA [deg],FZ [N],FY [N]"))
    assert caught.value.next_step == "remove or mend that row"


def test_missing_and_binary_files_and_unknown_axes(tmp_path):
    with pytest.raises(UnreadableError):
        read_table(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ToolkitError):
        read_table(tmp_path / "binary.csv")
    with pytest.raises(ConfigError, match="axis system"):
        read_table(write(tmp_path, rows()), axes="ISO")


@pytest.mark.parametrize("axes", ["SAE", "adapted-SAE", "ISO-W", "machine"])
def test_right_axes_are_no_finding_and_wrong_ones_are(tmp_path, axes):
    path = write(tmp_path, rows(axes))
    right = fit_table(read_table(path, axes=axes), model("magic_formula"))
    assert [finding.rule for finding in right.findings if finding.level != "note"] == []
    assert {fit.axes for fit in right.fits} == {axes}
    other = "adapted-SAE" if axes != "adapted-SAE" else "SAE"
    wrong = fit_table(read_table(path, axes=other), model("magic_formula"))
    assert [f.rule for f in wrong.findings if f.level != "note"] == ["axes-contradiction"] * 2
    # Never flipped: the fitted numbers are those of the table either way.
    assert wrong.fits[0].values == right.fits[0].values


def test_blocks_have_their_mean_load(tmp_path):
    result = fit_table(read_table(write(tmp_path, rows())), model("magic_formula"))
    assert [(fit.load_N, fit.channel) for fit in result.fits] == [
        (2000.0, "FY"), (2000.0, "MZ"), (4000.0, "FY"), (4000.0, "MZ"),
    ]  # fmt: skip
    assert all(fit.error_percent < 0.01 for fit in result.fits)


def test_three_points_are_an_error_and_a_thin_block_a_finding(tmp_path):
    with pytest.raises(FitError) as caught:
        fit_table(read_table(write(tmp_path, rows()[:3])), model("magic_formula"))
    assert caught.value.rule == "too-few-points"
    result = fit_table(read_table(write(tmp_path, rows()[:24])), model("magic_formula"))
    assert [finding.rule for finding in result.findings if finding.level != "note"] == ["too-few-points"] * 2
    assert len(result.fits) == 2


def test_a_missing_load_is_an_error_and_a_block_without_one_a_finding(tmp_path):
    lines = rows()
    airborne = [",".join([line.split(",")[0], "0.0", *line.split(",")[2:]]) for line in lines]
    with pytest.raises(FitError, match="load is missing") as caught:
        fit_table(read_table(write(tmp_path, airborne)), model("magic_formula"))
    assert caught.value.rule == "no-load-block"
    assert "FZ" in caught.value.next_step
    result = fit_table(read_table(write(tmp_path, airborne[:21] + lines[21:])), model("magic_formula"))
    assert [f.rule for f in result.findings if f.level != "note"] == ["no-load-block"] * 2
    assert [fit.load_N for fit in result.fits] == [4000.0, 4000.0]


@pytest.mark.parametrize(
    ("header", "cell", "column"),
    [
        ("SA [deg],FZ [N],FY [N]", "1e300", "FY [N]"),
        ("SA [deg],FZ [N],FY [kN]", "1e307", "FY [kN]"),  # infinite in SI
        ("SA [deg],FZ [N],MZ [N*m]", "-3e7", "MZ [N*m]"),
        ("FY [N],FZ [N],SA [deg]", "1e6", "SA [deg]"),
        ("FY [N],FZ [N],SA [rad]", "-4.0", "SA [rad]"),  # degrees under a header of radians
        ("FY [N],SA [deg],FZ [kN]", "-1e5", "FZ [kN]"),
        ("SA [deg],FZ [N],FY [N],P [kPa]", "2e6", "P [kPa]"),
        ("SA [deg],FZ [N],FY [N],V [km/h]", "1e6", "V [km/h]"),
        ("SA [deg],FZ [N],FY [N],T [degC]", "-300", "T [degC]"),
    ],
)
def test_a_value_that_no_tire_can_have_is_an_error_that_names_row_and_column(tmp_path, header, cell, column):
    width = header.count(",")
    good = ",".join(["1.0"] * (width + 1))
    path = tmp_path / "tire.csv"
    path.write_text("\n".join([header, good, ",".join(["1.0"] * width + [cell]), good]) + "\n")
    with pytest.raises(CellError) as caught:
        read_table(path, measured=False)
    assert caught.value.rule == "impossible-value"
    assert f"row 3, column '{column}'" in caught.value.where
    assert float(caught.value.got) == float(cell)
    assert caught.value.next_step
    assert caught.value.expected


def test_what_large_machines_measure_is_read(tmp_path):
    path = tmp_path / "tire.csv"
    path.write_text(
        "SA [deg],FZ [kN],FY [kN],MZ [kN*m],TIRE_ANGLE [deg],V [km/h],P [bar],t [s]\n"
        "-180,-500,450,80,1e6,400,25,1.7e9\n90,-600,0,0,0,0,0,0\n"
    )
    table = read_table(path)
    assert table["FZ"].tolist() == pytest.approx([5e5, 6e5])
    assert table["SA"].tolist() == pytest.approx([-np.pi, np.pi / 2])
