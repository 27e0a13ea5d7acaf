"""`toolkit plan test`: a plan that the machine's own commands can use."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re
import shutil
import zipfile
from pathlib import Path

import pytest

import toolkit
from tests import commands
from tests.planning.class_factory import DELAY, answer, found, write_case
from tests.planning.planning_factory import LOADS, earlier
from toolkit.declared import json_value
from toolkit.errors import ConfigError
from toolkit.lab.plans import protocol_plan
from toolkit.planning import protocol_plan as planning
from toolkit.planning import protocol_search, run_changes
from toolkit.planning.sweep_search import least_sweeps

ROOT = Path(toolkit.__file__).resolve().parents[1]
CALIBRATIONS = ROOT / "calibrations"


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    return commands.result


NEAR = LOADS[1:4]
"""Loads of the earlier test about that which is asked for: further ones are tried alike, and take as long."""


@pytest.fixture(autouse=True)
def few_starts(monkeypatch):
    """A plan is a little longer at most: `test_protocol_search.py` has the exchange from all its starts."""
    monkeypatch.setattr(protocol_search, "_STARTS", 2)


@pytest.fixture
def quick(monkeypatch):
    """An earlier test that takes no time to simulate."""
    monkeypatch.setattr(protocol_plan, "_virtual", lambda _order, _like: earlier(NEAR))


@pytest.mark.campaign("from a plan to its test and back: the plan of sweeps goes that way in every run")
def test_the_plan_of_a_tire_file_is_simulated_and_processed_without_a_finding(run, tmp_path):
    tire = ROOT / "toolkit" / "examples" / "virtual" / "tire.tir"
    asked = ["--u", "conicity", "--u", "slope_cornering=2 %", "--load", "567 lbf", "--load", "833 lbf"]
    planned = run(
        "plan", "test", "--like", tire, *asked, "--out", "p", "--calibrations", CALIBRATIONS, "--json"
    )
    assert planned.return_value == 0, planned
    answer = json.loads(planned.stdout)
    assert answer["schema"] == 1
    assert answer["feasible"] is True
    assert sorted(answer["files"].values()) == ["plan.toml", "protocol.toml"]
    assert answer["plan"]["rows"] < answer["protocol"]["rows"] == 130
    assert run("simulate", "p/plan.toml", "--out", "t", "--calibrations", CALIBRATIONS).return_value == 0
    done = run("process", "t", "--protocol", "p/protocol.toml", "--calibrations", CALIBRATIONS, "--json")
    assert done.return_value == 0
    test = json.loads(done.stdout)
    assert test["findings"] == []
    assert len(test["conditions"]) == answer["plan"]["rows"]
    # What was planned is what the test says: the scatter of one test is sure to a third.
    pull = {round(entry["load_N"], -2): entry for entry in test["characteristics"]["pull"]}
    for value in answer["values"]:
        if value["name"] == "conicity":
            U = pull[round(value["load_N"], -2)]["conicity"]["expanded_uncertainty"]
            assert U == pytest.approx(value["planned_U"], rel=0.5)


def test_the_text_says_what_is_assumed_and_given_up_and_no_earlier_test_is_the_class_of_passenger_tires(
    run, quick, tmp_path
):
    shown = run("plan", "test", "--u", "slope_cornering=3 %", "--load", "833 lbf", "--out", "p")
    assert shown.return_value == 0, shown
    for part in ("U by protocol", "assumed:", "given up:", "the reversed runs", "no calibration record"):
        assert part in shown.stdout
    tires = str(json.loads((tmp_path / "p" / "plan.json").read_text())["tires"])
    assert [part for part in ("0.41", "1.11") if part not in tires] == []


def test_what_cannot_be_reached_names_the_nearest_plan_and_writes_nothing(run, quick, tmp_path):
    failed = run("plan", "test", "--u", "plysteer=1 N", "--load", "833 lbf", "--minutes", 20, "--out", "p")
    error = failed.exception
    assert isinstance(error, ConfigError)
    assert error.rule == "plan-infeasible"
    assert "slip angle zero" in str(error.expected)
    assert "rows" in str(error.next_step)
    assert not (tmp_path / "p").exists()


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (["--load", "833"], "plan-load"),
        (["--load", "2 t"], "plan-load"),
        (["--load", "9999 lbf"], "plan-load"),
        (["--u", "conicity=1 N", "--u", "conicity=2 N"], "plan-demand"),
        (["--u", "conicity=1 furlong"], "plan-demand"),
        (["--minutes", "0.5"], "plan-infeasible"),
        (["--between-files", "inf"], "usage"),
        (["--between-files", "1e300"], "usage"),
        (["--between-files", "1e50"], "plan-infeasible"),
        (["--minutes", "inf"], "usage"),
    ],
)
def test_what_cannot_be_planned_is_refused_by_its_rule(run, quick, arguments, rule):
    failed = run("plan", "test", *arguments)
    assert isinstance(failed.exception, ConfigError)
    assert failed.exception.rule == rule


def test_a_tire_file_that_is_not_there(run):
    failed = run("plan", "test", "--like", "none.tir", "--calibrations", CALIBRATIONS)
    assert failed.exception is not None
    assert failed.exception.exit_code == 2


def left_open(home, *, delay=DELAY, recording=""):
    """A case, and an answer that leaves a late and a lagging channel as one class."""
    from toolkit.diagnosis.case.reader import read_case

    case = write_case(home / "case", delay=delay)
    text = case.read_text(encoding="utf-8")
    assert "[recording]\n" in text
    case.write_text(text.replace("[recording]\n", f"[recording]\n{recording}"), encoding="utf-8")
    folder = home / "answer"
    folder.mkdir()
    leaves = answer(read_case(case).sha256, found("channel_delay", "filter_lag"))
    (folder / "diagnosis.json").write_text(json.dumps({"schema": 1, **json_value(leaves)}), encoding="utf-8")
    (folder / "model.toml").write_text('[answer]\ncase = "../case/CASE.toml"\n', encoding="utf-8")
    return folder


@pytest.fixture
def diagnosed(tmp_path):
    return left_open(tmp_path)


def test_the_next_run_is_written_with_what_each_member_predicts(run, diagnosed, tmp_path):
    planned = run("plan", "next", diagnosed, "--out", "n", "--json")
    assert planned.return_value == 0, planned
    plan = json.loads(planned.stdout)
    assert set(plan["members"]) == {"channel_delay on F", "filter_lag on F"}
    assert plan["power"] > 0.9 > plan["power_of_repeat"]
    assert plan["complete"] is True
    assert sorted(plan["files"]) == [
        "next.csv",
        "next_F.png",
        "next_F_apart.png",
        "operator.txt",
        "predictions.csv",
    ]
    header, *rows = (tmp_path / "n" / "next.csv").read_text().splitlines()
    assert header == "t,u"
    assert len(rows) == 500
    predicted = (tmp_path / "n" / "predictions.csv").read_text().splitlines()[0]
    assert set(predicted.split(",")) == {"t", "F_channel_delay_on_F", "F_filter_lag_on_F"}
    operator = (tmp_path / "n" / "operator.txt").read_text()
    assert re.search(r"as fast as", operator)
    # The ends of the inputs that were written, and no other.
    inputs = [float(row.split(",")[1]) for row in rows]
    assert f"u from {min(inputs):.4g} to {max(inputs):.4g} mm, at most" in operator


@pytest.mark.campaign("the sheet of another plan: that of a test is drawn in every run")
@pytest.mark.skipif(not shutil.which("soffice"), reason="LibreOffice is not installed")
def test_the_sheet_of_the_next_run_draws_what_each_member_predicts(run, diagnosed, tmp_path):
    template = ROOT / "report_templates" / "plan.docx"
    planned = run("plan", "next", diagnosed, "--out", "n", "--template", template, "--json")
    assert planned.return_value == 0, planned
    document = json.loads(planned.stdout)["document"]
    assert [figure["tag"] for figure in document["figures"]] == [
        "tk:figure.plan_figure_1",
        "tk:figure.plan_figure_2",
    ]
    assert "filter_lag on F" in document["figures"][0]["alt"]
    assert (tmp_path / "n" / "plan.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.campaign("the text beside the answer, whose numbers and files are held in every run")
def test_the_text_of_the_next_run_shows_every_pair(run, diagnosed):
    shown = run("plan", "next", diagnosed)
    assert shown.return_value == 0, shown
    for part in ("if true", "channel_delay on F", "by a repeat", "assumed:"):
        assert part in shown.stdout


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--limit", "u=2..1"], "NAME=LOW..HIGH"),
        (["--limit", "w=1..2"], "of u"),
        (["--limit", "u=a..b"], "NAME=LOW..HIGH"),
        (["--limit", "u=0..inf"], "NAME=LOW..HIGH"),
        (["--limit", "u=0..1e300"], "NAME=LOW..HIGH"),
        (["--rate", "u=0"], "NAME=MOST"),
        (["--rate", "u=1..2"], "NAME=MOST"),
        (["--rate", "w=1"], "of u"),
        (["--limit", "u=-1..1", "--limit", "u=-2..2"], "each input once"),
        (["--sample-rate", "20"], "50 Hz at least"),
        (["--minutes", "0.1"], "0.1663 min at least"),
    ],
)
def test_a_limit_that_cannot_be_read(run, diagnosed, arguments, part):
    failed = run("plan", "next", diagnosed, *arguments)
    assert failed.exception.rule == "plan-next"
    assert part in str(failed.exception.expected)


def test_limits_within_which_nothing_parts_are_refused_with_what_would(run, diagnosed, tmp_path):
    failed = run("plan", "next", diagnosed, "--rate", "u=0.01", "--out", "n")
    error = failed.exception
    assert (error.rule, error.exit_code) == ("plan-infeasible", 2)
    assert "channel_delay" in str(error.next_step)
    # How long it would have to be, as it is, and at least.
    assert "times as many rows" in str(error.expected)
    assert "by no course less than" in str(error.expected)
    assert not (tmp_path / "n").exists()


def test_a_run_may_be_as_long_as_the_case_or_an_option_says(run, tmp_path):
    stated = 'longest_run = { value = 1, unit = "min" }\n'
    slow = ("--rate", "u=0.3", "--json")
    short = run("plan", "next", left_open(tmp_path / "a"), *slow)
    assert (short.exception.rule, short.exception.exit_code) == ("plan-infeasible", 2)
    by_case = run("plan", "next", left_open(tmp_path / "b", recording=stated), *slow)
    by_option = run("plan", "next", left_open(tmp_path / "c"), *slow, "--minutes", "1", "--out", "n")
    for planned in (by_case, by_option):
        assert planned.return_value == 0, planned
        said = json.loads(planned.stdout)
        assert 11 < said["seconds"] <= 60.1
        assert "times as long" in " ".join(said["steps"])
    rows = (tmp_path / "n" / "next.csv").read_text().splitlines()[1:]
    assert float(rows[-1].split(",")[0]) == pytest.approx(said["seconds"], abs=0.1)


@pytest.mark.parametrize(("limit", "told"), [("u=-1..1", False), ("u=-8..8", True)])
def test_an_input_beyond_what_was_recorded_is_said_to_be_known_by_equations_alone(
    run, diagnosed, limit, told
):
    planned = run("plan", "next", diagnosed, "--limit", limit, "--json")
    assert planned.return_value == 0, planned
    beyond = [
        text for text in json.loads(planned.stdout)["assumptions"] if "u was recorded from -2 to 2" in text
    ]
    assert bool(beyond) is told


def test_a_refusal_that_is_followed_is_a_plan(run, tmp_path, monkeypatch):
    """Where no single run may be longer or denser it is made again and again, as the refusal has asked."""
    monkeypatch.setattr(run_changes, "_DOUBLINGS", 0)
    slow = ("--rate", "u=0.15", "--json")
    short = run("plan", "next", left_open(tmp_path / "a"), *slow)
    assert (short.exception.rule, short.exception.exit_code) == ("plan-infeasible", 2)
    asked = re.search(r"--minutes (\S+)", str(short.exception.next_step))
    assert asked is not None
    planned = run("plan", "next", left_open(tmp_path / "b"), *slow, "--minutes", asked[1], "--out", "n")
    assert planned.return_value == 0, planned
    said = json.loads(planned.stdout)
    assert said["times"] > 1
    assert said["power"] > 0.9
    assert said["seconds"] <= 60 * float(asked[1])
    assert f"made {said['times']} times, one after the other" in " ".join(said["steps"])
    assert f"made {said['times']} times" in (tmp_path / "n" / "operator.txt").read_text()


def test_what_is_shorter_than_a_row_is_refused_with_the_rate_that_parts_it_and_planned_at_it(run, tmp_path):
    failed = run("plan", "next", left_open(tmp_path / "a", delay=0.004))
    assert (failed.exception.rule, failed.exception.exit_code) == ("plan-infeasible", 2)
    rate = re.search(r"--sample-rate (\d+)", str(failed.exception.next_step))
    assert rate is not None
    # What an option states for one plan the case may state for all.
    stated = f'sample_rate = {{ value = {rate[1]}, unit = "Hz" }}\n'
    planned = run(
        "plan", "next", left_open(tmp_path / "b", delay=0.004, recording=stated), "--out", "n", "--json"
    )
    assert planned.return_value == 0, planned
    said = json.loads(planned.stdout)
    assert said["together"] == []
    assert "a row every" in " ".join(said["steps"])
    t = [float(row.split(",")[0]) for row in (tmp_path / "n" / "next.csv").read_text().splitlines()[1:]]
    assert min(b - a for a, b in itertools.pairwise(t)) >= (1 - 1e-6) / float(rate[1])
    seldom = run(
        "plan", "next", left_open(tmp_path / "c", recording='sample_rate = { value = 20, unit = "Hz" }\n')
    )
    assert "CASE.toml" in str(seldom.exception.where)


def test_another_case_than_the_answers_is_refused(run, diagnosed, tmp_path):
    case = tmp_path / "case" / "CASE.toml"
    case.write_text(case.read_text() + "# another one\n", encoding="utf-8")
    failed = run("plan", "next", diagnosed, "--out", "n")
    assert failed.exception.rule == "plan-next"
    assert not (tmp_path / "n").exists()


def test_an_answer_without_its_model_asks_for_the_case(run, diagnosed):
    (diagnosed / "model.toml").unlink()
    failed = run("plan", "next", diagnosed)
    assert "--case" in str(failed.exception.next_step)


def test_a_file_that_is_no_answer(run, tmp_path):
    (tmp_path / "diagnosis.json").write_text("{}", encoding="utf-8")
    failed = run("plan", "next", tmp_path / "diagnosis.json")
    assert failed.exception.rule == "not-a-diagnosis"


def test_a_limit_below_what_was_recorded_is_kept_and_the_repeat_is_still_that_of_the_recording(
    run, diagnosed, tmp_path
):
    planned = run("plan", "next", diagnosed, "--limit", "u=-1.2..1.2", "--out", "n", "--json")
    assert planned.return_value == 0, planned
    inputs = [float(row.split(",")[1]) for row in (tmp_path / "n" / "next.csv").read_text().splitlines()[1:]]
    assert -1.2 <= min(inputs) < max(inputs) <= 1.2
    free = json.loads(run("plan", "next", diagnosed, "--json").stdout)
    assert json.loads(planned.stdout)["power_of_repeat"] == pytest.approx(free["power_of_repeat"], abs=0.2)


@pytest.mark.campaign(
    "a second limit: a range that is stated is kept in every run, and rates in tests/planning/test_drives.py"
)
def test_a_rate_that_is_stated_is_kept(run, diagnosed, tmp_path):
    planned = run("plan", "next", diagnosed, "--rate", "u=1.5", "--limit", "u=-4..4", "--out", "n", "--json")
    assert planned.return_value == 0, planned
    rows = [row.split(",") for row in (tmp_path / "n" / "next.csv").read_text().splitlines()[1:]]
    t, u = ([float(row[place]) for row in rows] for place in (0, 1))
    assert max(abs(b - a) for a, b in itertools.pairwise(u)) <= 1.5 * (t[1] - t[0]) * (1 + 1e-6)


@pytest.mark.campaign(
    "a second search to the nearest limit: a test that cannot be had names the nearest in every run"
)
def test_limits_that_no_run_keeps_name_the_nearest_that_one_does(run, diagnosed, tmp_path):
    failed = run("plan", "next", diagnosed, "--limit", "u=5..6", "--out", "n")
    error = failed.exception
    assert isinstance(error, ConfigError)
    assert (error.rule, error.exit_code) == ("plan-infeasible", 2)
    assert "r1.csv" in str(error.expected)
    assert not (tmp_path / "n").exists()
    limit = re.search(r"--limit ([^\s;]+)", str(error.next_step))
    assert limit is not None
    assert run("plan", "next", diagnosed, "--limit", limit[1]).return_value == 0


@pytest.mark.campaign(
    "a class of tires by its command: tests/planning plans it, and one tire goes this way in every run"
)
def test_a_class_is_planned_for_each_of_its_tires(run, quick, tmp_path):
    asked = ["--u", "slope_cornering=3 %", "--load", "833 lbf", "--spread", "stiffness=0.5..1.2"]
    planned = run("plan", "test", *asked, "--out", "p")
    assert planned.return_value == 0, planned
    assert "0.5 of its stiffness" in planned.stdout
    answer = json.loads((tmp_path / "p" / "plan.json").read_text())
    assert len(answer["tires"]) == 3
    assert [value["name"] for value in answer["values"]] == ["slope_cornering"]


def test_a_tire_file_of_other_loads_than_the_machines_is_refused(run, tmp_path):
    text = (ROOT / "toolkit" / "examples" / "virtual" / "tire.tir").read_text(encoding="utf-8")
    heavy = text.replace("FZMIN = 500", "FZMIN = 9000").replace("FZMAX = 8000", "FZMAX = 40000")
    (tmp_path / "heavy.tir").write_text(heavy, encoding="utf-8")
    failed = run("plan", "test", "--like", "heavy.tir", "--calibrations", CALIBRATIONS)
    assert failed.exception.rule == "plan-like"
    assert "FZMIN 9000 N" in str(failed.exception.got)


def test_a_tire_that_is_named_twice_is_refused(run, quick):
    failed = run("plan", "test", "--like", "a.tir", "--like", "a.tir")
    assert failed.exception.rule == "plan-like"


SWEPT = ("--u", "relaxation_length=40 mm", "--load", "833 lbf")


@pytest.fixture(scope="module")
def sought():
    """The search of sweeps, each once: most tests ask for the same, beside other things."""
    known = {}

    def search(tires, demand, loads_N, *, machine, between_files_s, to_load_s, tell):
        key = (tuple(tire.tire for tire in tires), demand, loads_N, machine.name, between_files_s, to_load_s)
        if key not in known:
            known[key] = least_sweeps(
                tires, demand, loads_N, machine=machine, between_files_s=between_files_s,
                to_load_s=to_load_s, tell=tell,
            )  # fmt: skip
        return known[key]

    return search


@pytest.fixture
def in_time(monkeypatch, sought):
    """The earlier test of the virtual machine, which states what it can sweep."""
    from tests.planning.test_sweep_search import VIRTUAL

    known = dataclasses.replace(earlier(NEAR), machine=VIRTUAL)
    monkeypatch.setattr(planning, "least_sweeps", sought)
    monkeypatch.setattr(protocol_plan, "_virtual", lambda _order, _like: known)


def test_sweeps_of_a_relaxation_length_are_simulated_and_processed(run, in_time, tmp_path):
    planned = run("plan", "test", *SWEPT, "--out", "p", "--json")
    assert planned.return_value == 0, planned
    answer = json.loads(planned.stdout)
    sweeps = answer["sweeps"]
    assert len({sweep["speed_m_s"] for sweep in sweeps["recordings"]}) == 2
    (value,) = (value for value in answer["values"] if value["name"] == "relaxation_length")
    assert value["planned_U"] <= value["demanded_U"] == pytest.approx(0.04)
    assert (value["unit"], value["protocol_U"]) == ("m", None)
    made = run(
        "simulate", "p/plan.toml", "--out", "t", "--effect", "relaxation=0.5m", "--calibrations", CALIBRATIONS
    )
    assert made.return_value == 0, made
    done = run("process", "t", "--protocol", "p/protocol.toml", "--calibrations", CALIBRATIONS, "--json")
    test = json.loads(done.stdout)
    assert test["findings"] == []
    lengths = [entry["relaxation_length"] for entry in test["characteristics"]["transient"]]
    (length,) = [entry for entry in lengths if entry is not None]
    # 0.5 m at the tire's nominal load of 4000 N.
    assert length["value"] == pytest.approx(0.5, abs=0.04)
    assert length["expanded_uncertainty"] < value["planned_U"]
    assert len(test["sweeps"]) == 2


def test_a_relaxation_length_alone_has_the_fewest_settled_steps_beside_it(run, in_time):
    shown = run("plan", "test", *SWEPT)
    assert shown.return_value == 0, shown
    for part in ("7 slip angles", "recordings in time", "sweep  ", "km/h", "part it from the length",
                 "it gives none of what is demanded"):  # fmt: skip
        assert part in shown.stdout


@pytest.mark.skipif(not shutil.which("soffice"), reason="LibreOffice is not installed")
def test_the_sheet_stands_beside_its_protocol_and_has_a_step_for_each_sweep(run, in_time, tmp_path):
    template = ROOT / "report_templates" / "plan.docx"
    done = run("plan", "test", *SWEPT, "--out", "p", "--template", template, "--json")
    assert done.return_value == 0, done
    assert json.loads(done.stdout)["document"]["warnings"] == []
    names = {"plan.docx", "plan.json", "plan.pdf", "plan.toml", "protocol.toml"}
    assert {path.name for path in (tmp_path / "p").iterdir()} == names
    with zipfile.ZipFile(tmp_path / "p" / "plan.docx") as sheet:
        text = re.sub("<[^>]*>", "", sheet.read("word/document.xml").decode())
    assert text.count("sweep in time: ") == 2
    assert " km/h" in text


@pytest.mark.parametrize(
    ("arguments", "rule", "part"),
    [
        (("--u", "relaxation_length"), "plan-demand", "no size"),
        pytest.param(
            ("--u", "relaxation_length=0.1 mm"),
            "plan-infeasible",
            "and 2 sweeps",
            marks=pytest.mark.campaign(
                "a length for which most is searched: a time too short is seen in every run"
            ),
        ),
        ((*SWEPT, "--minutes", "1"), "plan-infeasible", "--minutes"),
        ((*SWEPT, "--minutes", "3"), "plan-infeasible", "got:      3 min"),
        ((*SWEPT, "--sliding", "0.01"), "plan-infeasible", "alone go beyond"),
    ],
)
def test_a_relaxation_length_that_cannot_be_had_names_the_nearest(run, in_time, arguments, rule, part):
    with pytest.raises(ConfigError) as caught:
        raise run("plan", "test", *arguments, "--load", "833 lbf").exception
    assert caught.value.rule == rule
    assert part in str(caught.value)


def test_a_machine_that_states_no_sweeps_says_what_is_missing(run, quick):
    with pytest.raises(ConfigError, match=r"\[sweeping\]"):
        raise run("plan", "test", *SWEPT).exception
