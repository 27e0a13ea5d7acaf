import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import toolkit
from toolkit.cli import simulate
from toolkit.errors import ConfigError, OutputError

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
SHORT = "date = 2026-03-17\nslip_angles = { value = [0], unit = 'deg' }\n"


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    app = typer.Typer()
    app.command("simulate")(simulate.command)
    app.command("other")(lambda: None)

    def call(*arguments):
        return CliRunner().invoke(app, ["simulate", *map(str, arguments)], standalone_mode=False)

    return call


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_a_whole_test_of_26_files(run, tmp_path):
    found = run(EXAMPLES / "test_plan.toml", "--out", tmp_path / "t", "--json")
    assert found.return_value == 0
    answer = json.loads(found.stdout)
    assert (answer["schema"], answer["kind"], answer["simulated"]) == (1, "test", True)
    assert len(answer["recordings"]) == 26
    assert len(list((tmp_path / "t").glob("*.xlsx"))) == 26
    assert {p.name for p in (tmp_path / "t").iterdir()} == {*answer["files"]}
    assert not any(angle in name for name in answer["recordings"] for angle in ("deg", "-", "+"))


def test_seed_and_effect(run, short, tmp_path):
    run(short, "--out", tmp_path / "a")
    run(
        short,
        "--out",
        tmp_path / "b",
        "--seed",
        3,
        "--effect",
        "drum_runout=60",
        "--effect",
        "crosstalk.FZ.FY=0.02",
    )
    truth = json.loads((tmp_path / "b" / "truth.json").read_text(encoding="utf-8"))
    assert truth["seed"] == 3
    runout, leak = truth["effects"]
    assert (runout["name"], runout["channel"]) == ("drum_runout", "FZ")
    assert runout["parameters"][0] == {"name": "amplitude_1", "value": 60.0, "unit": "N"}
    assert (leak["name"], leak["channel"], leak["from"]) == ("crosstalk", "FY", "FZ")
    assert leak["parameters"] == [{"name": "coefficient", "value": 0.02, "unit": "N/N"}]
    assert (tmp_path / "a" / "FM_run_1.xlsx").read_bytes() != (tmp_path / "b" / "FM_run_1.xlsx").read_bytes()


def test_session(run, tmp_path):
    found = run(EXAMPLES / "session_plan.toml", "--out", tmp_path / "s", "--json")
    answer = json.loads(found.stdout)
    assert (answer["kind"], answer["session"], answer["points"] >= 30) == ("session", "SESSION.toml", True)
    assert found.return_value == 0


def test_text_is_marked(run, short, tmp_path):
    assert "SIMULATED" in run(short, "--out", tmp_path / "t").stdout


def test_unknown_effect_and_nothing_written(run, short, tmp_path):
    found = run(short, "--out", tmp_path / "t", "--effect", "drum_runaut=1")
    assert isinstance(found.exception, ConfigError)
    assert "did you mean 'drum_runout'?" in str(found.exception)
    assert not (tmp_path / "t").exists()


def test_missing_plan_and_foreign_folder(run, short, tmp_path):
    assert isinstance(run(tmp_path / "none.toml", "--out", tmp_path / "t").exception, ConfigError)
    assert isinstance(run(short, "--out", tmp_path).exception, OutputError)


def test_a_named_registry_without_the_machine_is_a_stand_alone_run(run, short, tmp_path):
    (tmp_path / "calibrations").mkdir()
    found = run(short, "--out", tmp_path / "t", "--calibrations", tmp_path / "calibrations", "--json")
    assert json.loads(found.stdout)["acquisition_program"]["record"] is None
    missing = run(short, "--out", tmp_path / "u", "--calibrations", tmp_path / "none")
    assert isinstance(missing.exception, ConfigError)
