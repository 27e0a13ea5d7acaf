"""An answer's model.toml by the commands: written, taken up again by `diagnose`, run by `simulate`."""

import json
import shutil

import pandas as pd
import pytest

from tests import commands
from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.errors import ConfigError, OutputError
from toolkit.simulation.model_file import read_model


@pytest.fixture(scope="module")
def run():
    return commands.result


@pytest.fixture(scope="module")
def answered(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    seen = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    case = write_case(folder, HEAD + TWO, **seen)
    found = run("diagnose", case, "--out", folder / "out", "--json")
    assert json.loads(found.stdout)["model"] == "model.toml"
    return folder


@pytest.mark.campaign(
    "a diagnosis by the command: that a model misses nothing is held in every run (test_model_text)"
)
def test_the_model_as_the_simulation_misses_nothing_and_ends_with_0(run, answered, tmp_path):
    model = answered / "out" / "model.toml"
    found = run("diagnose", answered / "CASE.toml", "--model", model, "--out", tmp_path / "again", "--json")
    assert found.return_value == 0
    made = json.loads(found.stdout)
    assert (made["verdict"], made["model"]) == ("nothing", None)
    assert not (tmp_path / "again" / "model.toml").exists()
    assert "quadratic_drag.F.drag" in {one["name"] for one in made["nominal_parameters"]}
    (note,) = [one for one in made["findings"] if one["rule"] == "case-model"]
    assert read_model(model).sha256[:16] in note["where"]


def test_the_model_that_an_answer_starts_from_is_not_written_over(run, answered):
    model = answered / "out" / "model.toml"
    before = model.read_bytes()
    found = run("diagnose", answered / "CASE.toml", "--model", model, "--out", answered / "out")
    assert isinstance(found.exception, OutputError)
    assert model.read_bytes() == before


def test_an_older_model_does_not_stay_beside_an_answer_that_names_nothing(run, answered, tmp_path):
    clean = {f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)}
    case = write_case(tmp_path, HEAD + TWO, **clean)
    (tmp_path / "out").mkdir()
    shutil.copy(answered / "out" / "model.toml", tmp_path / "out" / "model.toml")
    assert run("diagnose", case, "--out", tmp_path / "out", "--quiet").return_value == 0
    assert not (tmp_path / "out" / "model.toml").exists()


def test_a_model_is_simulated_on_inputs(run, answered, tmp_path):
    ahead = carriage(seed=7, coulomb=0.0, drag=800.0, noise=0.0)
    ahead.drop(columns="F").to_csv(tmp_path / "ahead.csv", index=False)
    model = answered / "out" / "model.toml"
    found = run("simulate", model, "--inputs", tmp_path / "ahead.csv", "--out", tmp_path / "out", "--json")
    assert found.return_value == 0
    made = json.loads(found.stdout)
    assert made["files"] == ["ahead.csv"]
    assert made["simulated"] is True
    assert made["effects"] == ["quadratic_drag on F"]
    assert made["model_sha256"] == read_model(model).sha256
    F = pd.read_csv(tmp_path / "out" / "ahead.csv")["F"]
    # noise of 2 N over 160 rows and three parameters: 0.3 N; five of them
    assert (F - ahead["F"]).abs().max() < 1.5


@pytest.mark.parametrize(
    ("given", "error"),
    [
        ((), "run on inputs"),
        (("--inputs", "none.csv"), "cannot be read"),
        (("--inputs", "in.csv", "--effect", "relaxation=0.5m"), "inputs alone"),
        (("--inputs", "in.csv", "--seed", "3"), "inputs alone"),
        (("--inputs", "in.csv", "--condition", "order"), "condition is not whole"),
        (("--inputs", "short.csv"), "no column 'a'"),
    ],
)
def test_what_a_model_cannot_be_run_with_is_told_and_nothing_is_written(
    run, answered, tmp_path, monkeypatch, given, error
):
    monkeypatch.chdir(tmp_path)
    carriage(seed=7).to_csv("in.csv", index=False)
    carriage(seed=7)[["t", "v"]].to_csv("short.csv", index=False)
    found = run("simulate", answered / "out" / "model.toml", *given, "--out", "out")
    assert found.exception is not None
    assert error in str(found.exception)
    assert not (tmp_path / "out").exists()


def test_inputs_belong_to_a_model_file(run, tmp_path):
    (tmp_path / "plan.toml").write_text('kind = "test"\ndate = 2026-01-01\n')
    carriage(seed=7).to_csv(tmp_path / "in.csv", index=False)
    found = run("simulate", tmp_path / "plan.toml", "--inputs", tmp_path / "in.csv", "--out", tmp_path / "o")
    assert isinstance(found.exception, ConfigError)
    assert found.exception.rule == "model-file"


@pytest.mark.campaign(
    "the document by the command: an answer's document is made and told in every run (tests/report/diagnosis)"
)
@pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")), reason="LibreOffice and poppler make the PDF"
)
def test_the_answer_as_a_verified_document(run, answered, tmp_path):
    found = run(
        "diagnose",
        answered / "CASE.toml",
        "--out",
        tmp_path / "out",
        "--pdf",
        "--by",
        "second person",
        "--json",
    )
    made = json.loads(found.stdout)["document"]
    assert made["verified"] is True
    assert made["warnings"] == []
    assert (tmp_path / "out" / "diagnosis.pdf").read_bytes()[:5] == b"%PDF-"
    assert next(one["tag"] for one in made["figures"]) == "tk:figure.diagnosis_errors"


def test_a_template_that_cannot_be_used_ends_before_the_search(run, answered, tmp_path):
    (tmp_path / "bad.docx").write_text("no Word file")
    found = run(
        "diagnose", answered / "CASE.toml", "--out", tmp_path / "out", "--template", tmp_path / "bad.docx"
    )
    assert found.exception is not None
    assert not (tmp_path / "out").exists()
