"""`toolkit fit --model mf61 --tir`: the file gives the table's forces again."""

import csv
import json

import numpy as np
import pytest

from tests.cli.one_command import run
from tests.tires.fmu.fmu_factory import outputs_of
from toolkit.cli import convert, evaluate, fit
from toolkit.errors import ToolkitError
from toolkit.tires.models.magic_formula import value
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_evaluate import evaluate_tir


def written(folder):
    lines = ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for FZ in (2000.0, 3500.0, 5000.0):
        for degrees in np.arange(-10.0, 10.5, 1.0):
            SA = np.radians(degrees)
            FY = value((11.0, 1.3, -FZ, -0.5, 0.0, 0.0), SA)
            MZ = value((10.0, 2.3, 0.03 * FZ, -1.0, 0.0, 0.0), SA)
            lines.append(f"{degrees},{FZ},{FY:.4f},{MZ:.5f}")
    path = folder / "tire.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def table(tmp_path):
    return written(tmp_path)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Return the tire file and the FMU of one fit of the table, to read, and what the command says of it."""
    folder = tmp_path_factory.mktemp("fitted")
    table, tir, fmu = written(folder), folder / "x.tir", folder / "x.fmu"
    code, text = run(
        fit.command, table, "--model", "mf61", "--tir", tir, "--fmu", fmu, "--fmi", "3", "--json"
    )
    assert code in (0, 1)
    return tir, fmu, json.loads(text)


def test_the_tire_file_gives_the_table_again_in_its_axes(table, fitted, tmp_path):
    tir, _, answer = fitted
    out = tmp_path / "out.csv"
    assert [(one["channel"], one["load_N"]) for one in answer["fits"]] == [("FY", None), ("MZ", None)]
    assert "tir-radius" in {finding["rule"] for finding in answer["findings"]}
    file = read_tir(tir)
    assert (file.number("FITTYP"), file.number("FNOMIN"), file.get("TYRESIDE")) == (61.0, 3500.0, "UNKNOWN")
    run(evaluate.command, tir, table, "--axes", "SAE", "--out", out)
    measured, made = (
        np.array([[float(x) for x in row] for row in list(csv.reader(path.read_text().splitlines()))[1:]])
        for path in (table, out)
    )
    error = np.linalg.norm(made[:, 3] - measured[:, 2]) / np.linalg.norm(measured[:, 2])
    assert 100 * error == pytest.approx(answer["fits"][0]["error_percent"], rel=1e-6)
    assert error < 0.01


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (["--tir", "x.tir"], "tir-needs-global"),
        (["--model", "pacejka94", "--tir", "x.tir"], "tir-needs-global"),
        (["--model", "mf52", "--model", "mf61", "--tir", "x.tir"], "tir-needs-global"),
        (["--model", "mf61", "--tir", "x.tir", "--side", "top"], "unknown-side"),
        (["--model", "mf61", "--weights", "heavy"], "unknown-weights"),
        (["--model", "mf61", "--rated-load", "-1"], "wrong-value"),
    ],
)
def test_what_a_tire_file_cannot_hold_is_refused_before_anything_is_fitted(
    table, tmp_path, monkeypatch, options, rule
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("toolkit.lab.tire_tests.fit_models.fit_table_models", None)
    with pytest.raises(ToolkitError) as caught:
        run(fit.command, table, *options)
    assert (caught.value.rule, caught.value.exit_code) == (rule, 2)
    assert caught.value.next_step
    assert not (tmp_path / "x.tir").exists()


def test_the_table_is_never_replaced_and_one_load_is_refused(table, tmp_path):
    with pytest.raises(ToolkitError) as caught:
        run(fit.command, table, "--model", "mf61", "--tir", table)
    assert caught.value.rule == "original"
    table.write_text("\n".join(table.read_text().splitlines()[:22]) + "\n")
    with pytest.raises(ToolkitError) as caught:
        run(fit.command, table, "--model", "mf61", "--tir", tmp_path / "x.tir")
    assert caught.value.rule == "one-load"
    assert not (tmp_path / "x.tir").exists()


OTHER = pytest.mark.campaign("an older formula in the same file: that with most of it holds in every run")


@pytest.mark.parametrize(("model", "fittyp"), [pytest.param("mf52", 6.0, marks=OTHER), ("mf62", 61.0)])
def test_the_file_tells_its_formula_side_rated_load_radius_and_ranges(table, tmp_path, model, fittyp):
    tir = tmp_path / "x.tir"
    code, text = run(
        fit.command, table, "--model", model, "--tir", tir, "--side", "left", "--rated-load", "4000",
        "--radius", "0.32", "--json",
    )  # fmt: skip
    file = read_tir(tir)
    assert code in (0, 1)
    assert file.number("FITTYP") == fittyp
    assert (file.number("FNOMIN"), file.number("UNLOADED_RADIUS")) == (4000.0, 0.32)
    assert file.get("TYRESIDE") == "LEFT"
    assert (file.number("FZMIN"), file.number("FZMAX")) == (2000.0, 5000.0)
    assert file.number("ALPMAX") == pytest.approx(np.radians(10.0))
    assert file.get("NOMPRES") is None  # the table has no pressure
    rules = {finding["rule"] for finding in json.loads(text)["findings"]}
    assert "tir-conditions" in rules
    assert not {"tir-radius", "tir-side"} & rules
    out = tmp_path / "out.csv"
    run(evaluate.command, tir, table, "--axes", "SAE", "--out", out)
    measured, made = (
        np.array([[float(x) for x in row] for row in list(csv.reader(path.read_text().splitlines()))[1:]])
        for path in (table, out)
    )
    for column, channel in ((3, "FY"), (4, "MZ")):
        error = 100 * np.linalg.norm(made[:, column] - measured[:, column - 1])
        error /= np.linalg.norm(measured[:, column - 1])
        one = next(f for f in json.loads(text)["fits"] if f["channel"] == channel)
        assert error == pytest.approx(one["error_percent"], rel=1e-6)


def test_the_fmu_is_the_tire_of_the_tire_file(fitted, tmp_path):
    tir, fmu, answer = fitted
    assert answer["fmu"] == str(fmu)
    again = {fmi: tmp_path / f"again-{fmi}.fmu" for fmi in ("2", "3")}
    for fmi, path in again.items():
        run(convert.command, tir, path, "--fmi", fmi)
    SA, FZ = np.linspace(-0.2, 0.2, 41), np.full(41, 3000.0)
    expected = evaluate_tir(read_tir(tir), SA=SA, FZ=FZ)[0]
    for path in (fmu, *again.values()):
        outputs = outputs_of(path, {"SA": SA, "FZ": FZ})
        np.testing.assert_allclose(outputs["FY"], expected.FY, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(outputs["MZ"], expected.MZ, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        (["--fmu", "x.fmu"], "fmu-needs-global"),
        (["--model", "mf61", "--model", "brush", "--fmu", "x.fmu"], "fmu-needs-global"),
        (["--model", "mf61", "--fmu", "x.fmu", "--fmi", "1"], "fmi-version"),
    ],
)
def test_an_fmu_that_cannot_be_is_refused_before_anything_is_fitted(table, tmp_path, options, rule):
    target = tmp_path / "x.fmu"
    with pytest.raises(ToolkitError) as caught:
        run(fit.command, table, *(target if option == "x.fmu" else option for option in options))
    assert caught.value.rule == rule
    assert not target.exists()


def test_the_fmu_of_a_file_without_longitudinal_coefficients_says_so(fitted, tmp_path):
    code, text = run(convert.command, fitted[0], tmp_path / "x.fmu", "--json")
    notes = [finding for finding in json.loads(text)["findings"] if finding["rule"] == "tir-no-coefficients"]
    assert code == 0
    assert "FX holds nothing" in notes[0]["message"]
