import functools
import json
from pathlib import Path

import pytest

import toolkit
from tests import commands
from toolkit.errors import ConfigError, OutputError

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
SHORT = "date = 2026-03-17\nslip_angles = { value = [0], unit = 'deg' }\n"


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    return functools.partial(commands.result, "simulate")


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


def test_a_case_and_csv_beside_a_test(run, tmp_path):
    from toolkit.diagnosis.case.reader import read_case

    plan = (EXAMPLES / "continuous_plan.toml").read_text().partition("[[run]]")[0]
    plan = plan.replace("[2, -2, 5, -5, 9, -9, 0]", "[3]").replace("[2000, 4000, 6000]", "[4000]")
    (tmp_path / "plan.toml").write_text(plan)
    (tmp_path / "tire.tir").write_text((EXAMPLES / "tire.tir").read_text())
    found = run(
        tmp_path / "plan.toml", "--out", tmp_path / "t", "--case", tmp_path / "c", "--csv", tmp_path / "csv",
        "--effect", "relaxation=0.5m", "--json",
    )  # fmt: skip
    answer = json.loads(found.stdout)
    assert answer["record"] == "continuous"
    assert Path(answer["case"]) == tmp_path / "c" / "CASE.toml"
    assert [Path(one).name for one in answer["csv"]] == ["run01.csv", "run02.csv"]
    assert answer["effects"][0]["name"] == "relaxation"
    assert len(read_case(Path(answer["case"])).runs) == 2
    again = run(tmp_path / "plan.toml", "--out", tmp_path / "t", "--case", tmp_path / "c", "--quiet")
    assert again.return_value == 0


def test_a_case_that_cannot_be_or_a_foreign_folder_writes_nothing(run, short, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "keep.txt").write_text("keep")
    found = run(short, "--out", tmp_path / "t", "--case", tmp_path / "mine")
    assert isinstance(found.exception, OutputError)
    for option in ("--case", "--csv"):
        for folder in (tmp_path / "t", tmp_path / "t" / "inside"):
            assert isinstance(run(short, "--out", tmp_path / "t", option, folder).exception, OutputError)
    short.write_text(SHORT + "[case]\noutputs = 'cells'\n")
    found = run(short, "--out", tmp_path / "t", "--case", tmp_path / "c")
    assert isinstance(found.exception, ConfigError)
    assert not (tmp_path / "t").exists()
    session = run(EXAMPLES / "session_plan.toml", "--out", tmp_path / "t", "--case", tmp_path / "c")
    assert isinstance(session.exception, ConfigError)
    assert not (tmp_path / "t").exists()


def test_a_makers_table(run, tmp_path):
    (tmp_path / "plan.toml").write_text(SHORT + "kind = 'table'\n")
    found = run(tmp_path / "plan.toml", "--out", tmp_path / "t", "--json")
    answer = json.loads(found.stdout)
    assert (answer["kind"], answer["table"], answer["axes"]) == ("table", "table_simulated.csv", "SAE")
    assert (tmp_path / "t" / "table_simulated.csv").read_text().startswith("SA [deg],FZ [N],FY [N],MZ [N*m]")


def test_wrong_calibration_by_id_and_by_path(run, short, tmp_path):
    home = EXAMPLES.parents[2]
    record = home / "calibrations" / "m15-virtual" / "m15-virtual-r1.json"
    for name, options in (("m15-virtual-r1", ["--home", home]), (str(record), [])):
        found = run(
            short, "--out", tmp_path / "t", "--effect", f"wrong_calibration={name}", "--quiet", *options
        )
        assert found.return_value == 0, found.exception
    foreign = run(short, "--out", tmp_path / "t", "--effect", "wrong_calibration=m15-r1", "--home", home)
    assert "cannot be given" in str(foreign.exception)  # pounds-force, where these cells give mV/V
    none = run(short, "--out", tmp_path / "t", "--effect", "wrong_calibration=m15-r1")
    assert isinstance(none.exception, ConfigError)
