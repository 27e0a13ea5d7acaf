"""`toolkit diagnose`: exit codes, the answer's keys, files that are there whole or not at all."""

import functools
import json
import re

import numpy as np
import pandas as pd
import pytest

from tests import commands
from tests.diagnosis.cases import HEAD, SIMULATOR, TWO, carriage, write_case
from toolkit.errors import OutputError, ToolkitError

KEYS = {
    "schema", "title", "verdict", "remaining", "complete", "skipped", "mismatch", "effects",
    "nominal_parameters", "fit", "not_found", "next_measurements", "timing",
}  # fmt: skip
PREDICT = '[[recording.predict]]\nfile = "more.csv"\n'


@pytest.fixture
def run():
    return functools.partial(commands.result, "diagnose")


def answered(out):
    return json.loads((out / "diagnosis.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)


def test_what_was_left_out_is_named_shown_and_predicted(run, tmp_path):
    seen = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    ahead = carriage(seed=7, coulomb=0.0, drag=800.0)
    case = write_case(tmp_path, HEAD + TWO + PREDICT, more__csv=ahead.drop(columns="F"), **seen)
    found = run(case, "--out", tmp_path / "out", "--json")
    assert found.return_value == 1
    said, made = json.loads(found.stdout), answered(tmp_path / "out")
    assert said.pop("out") == str(tmp_path / "out")
    assert said == made
    assert set(made) >= KEYS
    assert (made["schema"], made["verdict"], made["complete"], made["skipped"]) == (1, "named", True, [])
    (effect,) = made["effects"]
    assert set(effect) >= {
        "name", "stage", "channel", "statement", "equation", "parameters", "equivalent_to", "evidence",
    }  # fmt: skip
    assert (effect["name"], effect["stage"], effect["channel"]) == ("quadratic_drag", "dynamics", "F")
    assert set(effect["evidence"]) == {"held_out_log_score_gain", "p_value"}
    drag = effect["parameters"][0]
    assert set(drag) == {"name", "value", "unit", "ci95", "runs"}
    assert (drag["name"], drag["unit"], drag["runs"]) == ("drag", "N/(m/s)^2", None)
    assert drag["ci95"][0] < drag["value"] < drag["ci95"][1]
    # 2 N of noise over 160 rows against 0.03 (m/s)^2 beside a free viscous term: some 15; four of them
    assert drag["value"] == pytest.approx(800.0, abs=60.0)
    (one,) = made["fit"]["held_out"]
    assert set(one) == {
        "channel", "unit", "nominal_rmse", "refitted_rmse", "augmented_rmse", "noise_floor", "spread",
        "with_laws_rmse", "noise",
    }  # fmt: skip
    assert one["with_laws_rmse"] is None
    assert made["laws"] == []
    # White noise of 2 N: third differences of 160 rows know it to some 15 %.
    assert set(one["noise"]) == {"sensor_sd", "process_sd", "how"}
    assert (one["noise"]["sensor_sd"], one["noise"]["how"]) == (pytest.approx(2.0, rel=0.3), "differences")
    assert one["augmented_rmse"] < 2.4 < 7 < one["refitted_rmse"] <= one["nominal_rmse"]
    (place,) = made["mismatch"]
    assert set(place) == {"channel", "p_value", "share_of_variance", "where"}
    assert set(place["where"][0]) == {"variable", "from", "to", "unit", "runs"}
    assert [set(one) for one in made["nominal_parameters"]] == [
        {"name", "before", "after", "with_laws", "unit", "prior_sd", "shift_in_sd"}
    ] * 2
    assert set(made["not_found"][0]) >= {"name", "minimum_detectable", "unit", "observable"}
    page = (tmp_path / "out" / "diagnosis.html").read_text(encoding="utf-8")
    assert "quadratic_drag" in page
    assert not re.findall(r'(?:src|href)\s*=\s*"(?!data:)|url\(|@import|<script', page)
    guess = pd.read_csv(tmp_path / "out" / "predictions" / "more.csv")
    away = {name: float(np.sqrt(np.mean((guess[f"F_{name}"] - ahead["F"]) ** 2))) for name in
            ("nominal", "refitted", "augmented")}  # fmt: skip
    assert away["augmented"] < 3 < away["refitted"]


@pytest.mark.campaign("two whole diagnoses: frozen answers come again bit by bit in every run (tests/golden)")
def test_an_answer_repeats_but_for_its_timing(run, tmp_path):
    case = write_case(tmp_path, HEAD + TWO + PREDICT, more__csv=carriage(seed=7, rows=20))
    texts = []
    for name in ("one", "two"):
        run(case, "--out", tmp_path / name, "--quiet")
        made = answered(tmp_path / name)
        del made["timing"]
        files = (tmp_path / name / "diagnosis.html", tmp_path / name / "predictions" / "more.csv")
        texts.append([json.dumps(made), *(path.read_bytes() for path in files)])
    assert texts[0] == texts[1]


def test_nothing_missing_ends_with_0(run, tmp_path):
    frames = {f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)}
    found = run(write_case(tmp_path, **frames), "--out", tmp_path / "out", "--quiet")
    assert found.return_value == 0
    assert found.stdout == ""
    assert answered(tmp_path / "out")["verdict"] == "nothing"


def test_a_spent_budget_is_an_answer_that_says_so(run, tmp_path):
    slow = SIMULATOR.replace("import pandas", "import time\n    time.sleep(600)\n    import pandas")
    found = run(write_case(tmp_path, simulator=slow), "--out", tmp_path / "out", "--budget", "1")
    assert found.return_value == 1
    made = answered(tmp_path / "out")
    assert set(made) >= KEYS
    assert made["complete"] is False
    assert "joint fits" in made["skipped"]
    assert "the budget was spent" in found.stdout
    assert "budget" in (tmp_path / "out" / "diagnosis.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("toml", "simulator"),
    [
        (HEAD.replace("unit =", "unti =", 1) + TWO, SIMULATOR),
        (HEAD + TWO, "def simulate(inputs, p):\n    raise ValueError\n"),
        (HEAD.replace("a = {", "b = {") + TWO, SIMULATOR),
    ],
)
def test_a_case_that_cannot_be_used_ends_with_2_and_leaves_nothing(run, tmp_path, toml, simulator):
    found = run(write_case(tmp_path, toml, simulator=simulator), "--out", tmp_path / "out")
    assert isinstance(found.exception, ToolkitError)
    assert found.exception.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_told_before_the_search(run, tmp_path):
    (tmp_path / "out").write_text("a file")
    text = "def simulate(inputs, p):\n    raise AssertionError('was run')\n"
    found = run(write_case(tmp_path, simulator=text), "--out", tmp_path / "out" / "deeper")
    assert isinstance(found.exception, OutputError)


def test_no_number_of_a_search_that_did_not_run_is_made_up(run, tmp_path):
    still = carriage(rows=5).assign(F=1.0)
    found = run(write_case(tmp_path, r0__csv=still, r1__csv=still), "--out", tmp_path / "out")
    assert found.return_value == 1
    made = answered(tmp_path / "out")
    assert (made["verdict"], made["complete"]) == ("untestable", True)
    assert made["fit"]["held_out"][0]["noise_floor"] is None


@pytest.mark.campaign("a second effect: the answer of one is held key by key in every run")
def test_an_effect_of_some_runs_names_them(run, tmp_path):
    dated = TWO.replace('"r0.csv"\n', '"r0.csv"\ndate = "2026-03-01"\n') + 'date = "2026-03-02"\n'
    files = {f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)}
    files["r1__csv"]["F"] += 30.0
    found = run(write_case(tmp_path, HEAD + dated, **files), "--out", tmp_path / "out")
    (one,) = answered(tmp_path / "out")["effects"]
    assert one["parameters"][0]["runs"] in (["r0.csv"], ["r1.csv"])
    assert f"In {one['parameters'][0]['runs'][0]} alone." in found.stdout


def test_a_document_without_libreoffice_is_refused_before_the_search(run, tmp_path, monkeypatch):
    monkeypatch.delenv("TOOLKIT_SOFFICE", raising=False)
    monkeypatch.setenv("PATH", "")
    found = run(tmp_path / "no-case.toml", "--out", tmp_path / "out", "--pdf")
    assert isinstance(found.exception, ToolkitError)
    assert found.exception.rule == "no-soffice"  # and not that there is no such case
    assert not (tmp_path / "out").exists()
