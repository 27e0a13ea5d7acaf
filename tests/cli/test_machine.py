"""`toolkit machine`: from an answer to the next version of a definition, never silently; and back."""

import json
import re
import shutil

import pytest

from tests import commands
from tests.diagnosis.answer.test_model_text import offset_machine
from toolkit.errors import ConfigError, OutputError
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.machine.definition import machine_file
from toolkit.simulation.model_file import read_model

WHY = ("--reason", "zero measured with the wheel at rest", "--by", "a tester", "--on", "2026-04-01")


@pytest.fixture(scope="module")
def run():
    return commands.result


@pytest.fixture(scope="module")
def answered(run, tmp_path_factory):
    """A case on the m15 whose slip angle shows 0.3 deg too much, and its answer."""
    folder = tmp_path_factory.mktemp("machine")
    case = offset_machine(folder)
    assert run("diagnose", case, "--out", folder / "answer", "--quiet").return_value == 1
    return folder


@pytest.fixture(scope="module")
def second(run, answered):
    out = answered / "m15-2.toml"
    found = run(
        "machine", "correct", answered / "answer", "--effect", "steer_offset", *WHY, "--out", out, "--json"
    )
    assert found.return_value == 0, found.exception
    return json.loads(found.stdout)


def test_a_class_of_zero_and_plysteer_becomes_a_zero_by_decision(answered, second):
    (made,) = second["corrections"]
    # whichever of the two the answer has fitted, the recorded angle is 0.3 deg too large
    assert made["value"] == pytest.approx(0.3, abs=0.005)
    assert (made["effect"], made["unit"], made["equivalent_to"]) == ("steer_offset", "deg", ["plysteer"])
    assert 0 < made["u"] < 0.002
    model = read_model(answered / "answer" / "model.toml")
    assert (made["answer_sha256"], made["case_sha256"]) == (model.sha256, model.case_sha256)
    assert (made["reason"], made["by"], made["date"]) == (WHY[1], WHY[3], WHY[5])
    assert (second["version"], second["supersedes"]) == (2, sha256_file(machine_file("m15")))
    assert load_machine("m15").corrections == ()


def test_show_tells_the_version_and_every_correction(run, answered, second):
    made = json.loads(run("machine", "show", answered / "m15-2.toml", "--json").stdout)
    assert made["version"] == 2
    assert made["corrections"] == second["corrections"]
    text = run("machine", "show", answered / "m15-2.toml").stdout
    assert "steer_offset (or plysteer)" in text
    assert WHY[1] in text
    assert "no corrections" in run("machine", "show", "m15").stdout


def test_the_corrected_machine_misses_nothing_on_the_same_recordings(run, answered, second):
    text = (answered / "CASE.toml").read_text()
    (answered / "next.toml").write_text(text.replace('machine = "m15"', 'machine = "m15-2.toml"'))
    found = run("diagnose", answered / "next.toml", "--out", answered / "again", "--json")
    made = json.loads(found.stdout)
    assert (made["verdict"], found.return_value) == ("nothing", 0)
    (note,) = [one for one in made["findings"] if one["rule"] == "case-model"]
    assert "version 2" in note["where"]


def test_a_definition_is_never_written_over(run, answered, second):
    before = (answered / "m15-2.toml").read_bytes()
    found = run(
        "machine", "correct", answered / "answer", "--effect", "steer_offset", *WHY, "--out",
        answered / "m15-2.toml",
    )  # fmt: skip
    assert isinstance(found.exception, OutputError)
    assert (answered / "m15-2.toml").read_bytes() == before


@pytest.mark.parametrize(
    ("effect", "change", "said"),
    [
        ("relaxation", None, "cannot become a correction"),
        ("sensitivity_error", None, "new calibration"),
        ("steer_compliance", None, "does not name this effect"),
        ("steer_offset", ("complete = true", "complete = false"), "cut off"),
        ("steer_offset", (r"standard_error = (?=0\.000[0-9]+\n*$)", "# "), "no standard error"),
        ("steer_offset", ("equivalent_to =", 'runs = ["r0.csv"]\nequivalent_to ='), "in some runs only"),
    ],
)
def test_what_an_answer_does_not_support_is_refused_and_nothing_is_written(
    run, answered, tmp_path, effect, change, said
):
    folder = tmp_path / "case"
    shutil.copytree(answered, folder)
    model = folder / "answer" / "model.toml"
    if change:
        text = model.read_text()
        assert re.search(*(change[0], text))
        model.write_text(re.sub(*change, text))
    out = tmp_path / "made.toml"
    found = run("machine", "correct", model, "--effect", effect, *WHY, "--out", out)
    assert isinstance(found.exception, ConfigError)
    assert said in str(found.exception)
    assert found.exception.rule == "machine-correction"
    assert not out.exists()


def test_the_answer_of_another_machine_corrects_nothing(run, answered, tmp_path):
    found = run(
        "machine", "correct", answered / "answer", "--effect", "steer_offset", *WHY,
        "--machine", "m15-virtual", "--out", tmp_path / "v.toml",
    )  # fmt: skip
    assert "another machine" in str(found.exception)
    assert not (tmp_path / "v.toml").exists()


@pytest.mark.parametrize("which", ["--reason", "--by"])
def test_nobody_and_no_reason_decide_nothing(run, answered, tmp_path, which):
    given = list(WHY)
    given[given.index(which) + 1] = " "
    found = run(
        "machine", "correct", answered / "answer", "--effect", "steer_offset", *given, "--out",
        tmp_path / "m.toml",
    )  # fmt: skip
    assert isinstance(found.exception, ConfigError)
    assert not (tmp_path / "m.toml").exists()
