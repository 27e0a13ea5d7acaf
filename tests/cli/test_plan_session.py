"""`toolkit plan session`: its files are a session once the readings stand in them; none is half-written."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import commands
from toolkit.simulation.cells import CELLS, LOADS, CellsTruth, outputs
from toolkit.simulation.session import LOAD_UNITS
from toolkit.units import to_si

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"


def toolkit(
    *arguments: object, code: int | None = 0, apart: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run the command line on words, in this process or ``apart`` in one of its own."""
    words = [*map(str, arguments)]
    if apart:
        result = subprocess.run(
            [sys.executable, "-c", "from toolkit.cli.main import run; run()", *words],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    else:
        result = subprocess.CompletedProcess(words, *commands.said(*words))
    assert code is None or result.returncode == code, result.stdout + result.stderr
    return result


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("home")
    shutil.copytree(CALIBRATIONS, home / "calibrations")
    return home


@pytest.fixture(scope="module")
def planned(home: Path) -> tuple[Path, dict[str, Any]]:
    out = home / "next"
    said = toolkit("plan", "session", "m15-virtual", "--out", out, "--home", home, "--json", apart=True)
    return out, json.loads(said.stdout)


def fill(path: Path, seed: int) -> None:
    """Write into a plan's file what the virtual hub shows under its loads."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    at = {name.split()[0]: number for number, name in enumerate(header)}
    loads = np.array([[float(row[at[load]]) for load in LOADS] for row in rows])
    si = np.column_stack([to_si(loads[:, i], LOAD_UNITS[load]) for i, load in enumerate(LOADS)])
    noise = np.random.default_rng(seed).normal(size=si.shape) * [0.4, 0.015, 0.15]
    shown = 1e3 * outputs(CellsTruth(), loads=si + noise, tared=True)
    for row, values in zip(rows, shown, strict=True):
        for cell, value in zip(CELLS, values.tolist(), strict=True):
            assert row[at[cell]] == ""
            row[at[cell]] = f"{value:.6f}"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def test_the_answer_and_the_files_are_of_one_plan(planned: tuple[Path, dict[str, Any]]) -> None:
    out, answer = planned
    assert answer["schema"] == 1
    assert {path.name for path in out.iterdir()} == {
        "SESSION.toml", "loads.csv", "check.csv", "sheet.csv", "plan.txt", "plan.json"
    }  # fmt: skip
    assert len((out / "loads.csv").read_text().splitlines()) == 1 + len(answer["rows"])
    assert len((out / "check.csv").read_text().splitlines()) == 1 + len(answer["check"])
    assert answer["timing"]["seconds"] < 60
    sheet = (out / "sheet.csv").read_text()
    assert sheet.count("preload to the largest load") == answer["runs"] + 1


def test_blank_readings_are_refused(planned: tuple[Path, dict[str, Any]], home: Path) -> None:
    out, _ = planned
    refused = toolkit("calibrate", out / "SESSION.toml", "--home", home, "--dry-run", code=2)
    assert "date" in refused.stderr


def test_a_plan_with_its_readings_is_a_session(
    planned: tuple[Path, dict[str, Any]], home: Path, tmp_path: Path
) -> None:
    out = tmp_path / "session"
    shutil.copytree(planned[0], out)
    fill(out / "loads.csv", 1)
    fill(out / "check.csv", 2)
    text = (out / "SESSION.toml").read_text()
    text = text.replace('date = ""', "date = 2026-11-02").replace(
        'operator = ""', 'operator = "first person"'
    )
    (out / "SESSION.toml").write_text(text)
    said = toolkit("calibrate", out / "SESSION.toml", "--home", home, "--json", code=None)
    answer = json.loads(said.stdout)
    assert said.returncode in (0, 1), said.stderr
    assert not {finding["rule"] for finding in answer["findings"]} & {
        "sign", "span", "few-points", "collinear", "duplicates", "check-load", "term"
    }  # fmt: skip
    approved = toolkit(
        "calibration", "approve", answer["record"]["id"], "--in-force-from", "2026-11-03", "--checked-by",
        "second person", "--home", home, "--json", code=None,
    )  # fmt: skip
    assert approved.returncode == 0, approved.stdout + approved.stderr
    # What was planned is what a budget of it says, within what estimates from 30 rows scatter.
    budget = json.loads(
        toolkit("calibration", "budget", answer["record"]["id"], "--home", home, "--json").stdout
    )
    for load in planned[1]["outlook"]:
        assert budget["loads"][load["load"]]["U"] == pytest.approx(load["U"], rel=0.6)


def test_a_plan_never_overwrites_readings(planned: tuple[Path, dict[str, Any]], home: Path) -> None:
    out, _ = planned
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    refused = toolkit("plan", "session", "m15-virtual", "--out", out, "--home", home, code=2)
    assert "the folder has a plan" in refused.stderr
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.campaign("the sheet of another plan: that of a test is drawn in every run")
@pytest.mark.skipif(not shutil.which("soffice"), reason="LibreOffice is not installed")
def test_a_template_makes_the_sheet_of_the_same_steps(home: Path, tmp_path: Path) -> None:
    out = tmp_path / "next"
    said = toolkit(
        "plan", "session", "cell", "--session", cell_session(tmp_path), "--loads", 33, "--out", out, "--home",
        home, "--json", "--template", CALIBRATIONS.parent / "report_templates" / "plan.docx", code=None,
    )  # fmt: skip
    document = json.loads(said.stdout)["document"]
    assert document["warnings"] == []
    assert {Path(document[kind]).name for kind in ("docx", "pdf")} == {"plan.docx", "plan.pdf"}
    with zipfile.ZipFile(out / "plan.docx") as package:
        text = package.read("word/document.xml").decode()
    with (out / "sheet.csv").open(newline="") as file:
        steps = [row["what to do"].strip() for row in csv.DictReader(file)]
    assert all(f">{step}<" in text for step in steps)


def test_a_template_without_a_folder_is_an_error_before_the_search(home: Path) -> None:
    refused = toolkit("plan", "session", "m15-virtual", "--home", home, "--template", "x.docx", code=2)
    assert "add --out DIR" in refused.stderr


@pytest.mark.campaign("the session of three cells: that of one cell serves in place of a record in every run")
def test_a_session_file_serves_in_place_of_the_record(home: Path, tmp_path: Path) -> None:
    folder = CALIBRATIONS / "m15-virtual"
    for name in ("loads", "check"):
        shutil.copy(folder / f"m15-virtual-r1.{name}.csv", tmp_path / f"{name}_simulated.csv")
    shutil.copy(folder / "m15-virtual-r1.session.toml", tmp_path / "SESSION.toml")
    said = toolkit(
        "plan", "session", "m15-virtual", "--session", tmp_path / "SESSION.toml", "--loads", 33, "--home",
        home, "--json",
    )  # fmt: skip
    assert len(json.loads(said.stdout)["rows"]) <= 33


@pytest.mark.parametrize(("model", "terms"), [("", 2), ('model = "polynomial"\ndegree = 2\n', 3)])
def test_a_cell_of_one_load_is_planned_too(home: Path, tmp_path: Path, model: str, terms: int) -> None:
    rng = np.random.default_rng(5)
    rows = [
        f"{force / 500 + 2e-8 * force**2 + 1e-5 * rng.normal():.7f},{force},{run},{way}"
        for run in (1, 2, 3)
        for way, forces in (("up", range(0, 1001, 100)), ("down", range(900, -1, -100)))
        for force in forces
    ]
    (tmp_path / "loads.csv").write_text("\n".join(["S [mV/V],FY [N],run,direction", *rows]) + "\n")
    (tmp_path / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "cell"\ndate = 2026-01-05\noperator = "A"\nindications = ["S"]\n'
        f'loads = ["FY"]\ndata = "loads.csv"\n{model}'
    )
    out = tmp_path / "next"
    said = toolkit(
        "plan", "session", "cell", "--session", tmp_path / "SESSION.toml", "--loads", "33", "--home", home,
        "--out", out, code=None,
    )  # fmt: skip
    assert said.returncode in (0, 1), said.stderr
    assert "FY" in said.stdout
    assert len((out / "check.csv").read_text().splitlines()) > terms
    assert (out / "loads.csv").read_text().startswith("S [mV/V],FY [N],run,direction,comment\n")


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (("m15-virtual", "--u", "FX=1 N"), "plan-demand"),
        (("m15-virtual", "--u", "FY"), "plan-demand"),
        (("m15-virtual", "--u", "FY=-1 N"), "plan-demand"),
        (("m15-virtual", "--u", "FY=60"), "plan-demand"),
        (("m15-virtual", "--u", "FY=1 kN/deg"), "plan-demand"),
        (("m15-virtual", "--u", "FY=1 N at 4 kN/rad"), "plan-demand"),
        (("m15-virtual", "--u", "FY=1e999 N"), "plan-demand"),
        (("m15-virtual", "--u", "FY=1 N", "--u", "FY=2 N"), "plan-demand"),
        (("m15-virtual", "--u", "FY=1 kg"), "plan-demand"),
        (("m15-virtual", "--u", "FY=0.1 N"), "plan-infeasible"),
        (("m15-virtual", "--minutes", "nan"), "usage"),
        (("m15-virtual", "--minutes", "-5"), "plan-demand"),
        (("m15-virtual", "--minutes", "100"), "plan-fixtures"),
        (("m15-virtual", "--loads", "3"), "plan-infeasible"),
        (("m15-virtual", "--criterion", "A"), "usage"),
        (("m15",), "plan-record"),
        (("nobody",), None),
        (("m15-virtual", "--machine", "m15-virtual"), "plan-demand"),
        (("m15-virtual", "--machine", "m15"), "unknown-machine"),
        (("m15-virtual", "--calibration", "m15-virtual-r1", "--session", "x.toml"), "plan-demand"),
        (("m15-virtual", "--calibration", "m15-r1", "--draft"), "plan-record"),
    ],
)
def test_what_cannot_be_planned_is_an_error(
    home: Path, tmp_path: Path, arguments: tuple[str, ...], rule: str | None
) -> None:
    out = tmp_path / "out"
    refused = toolkit("plan", "session", *arguments, "--home", home, "--out", out, "--json", code=2)
    error = json.loads(refused.stdout)["error"]
    assert rule is None or error["rule"] == rule
    assert error["next_step"]
    assert not out.exists()


LOADING = """name = "cell"
extends = "m15"
title = "cell"
kind = "real"
[loading]
run_minutes = 5
[[loading.fixture]]
name = "lateral pull"
per_newton = { FY = 1.0 }
weights = { value = [250, 500, 750, 1000], unit = "N" }
minutes = 1.5
"""


def cell_session(folder: Path) -> Path:
    """Write a session of a cell of one load; return its file."""
    rng = np.random.default_rng(5)
    rows = [
        f"{force / 500 + 1e-4 * rng.normal():.7f},{force},{run},{way}"
        for run in (1, 2, 3)
        for way, forces in (("up", range(0, 1001, 100)), ("down", range(900, -1, -100)))
        for force in forces
    ]
    (folder / "loads.csv").write_text("\n".join(["S [mV/V],FY [N],run,direction", *rows]) + "\n")
    (folder / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "cell"\ndate = 2026-01-05\noperator = "A"\nindications = ["S"]\n'
        'loads = ["FY"]\ndata = "loads.csv"\n'
    )
    return folder / "SESSION.toml"


def candidate(folder: Path) -> Path:
    """Return a home with a record of a cell that nobody has approved."""
    toolkit("init", folder / "lab")
    toolkit("calibrate", cell_session(folder), "--home", folder / "lab", code=None)
    return folder / "lab"


@pytest.mark.campaign(
    "two plans by a machine's own fixtures: fixtures are read and planned by in every run (tests/planning)"
)
def test_a_machine_definition_states_what_can_be_loaded(tmp_path: Path) -> None:
    home, machine = candidate(tmp_path), tmp_path / "cell.toml"
    machine.write_text(LOADING)
    plan = ("plan", "session", "cell", "--calibration", "cell-r1", "--draft", "--home", home, "--json")
    answer = json.loads(toolkit(*plan, "--machine", machine, code=None).stdout)
    assert {row["mount"] for row in answer["rows"]} <= {"", "lateral pull, +", "lateral pull, -"}
    assert {abs(row["loads"][0]) for row in answer["rows"]} <= {0, 250, 500, 750, 1000}
    assert answer["minutes"] > answer["runs"] * 5
    fixtures = tmp_path / "fixtures.toml"
    fixtures.write_text('instrument = "cell"\n' + LOADING.split("[loading]")[1].replace("loading.", ""))
    by_file = json.loads(toolkit(*plan, "--fixtures", fixtures, code=None).stdout)
    assert by_file["rows"] == answer["rows"]


def test_a_plan_from_a_candidate_is_a_draft_that_is_asked_for(tmp_path: Path) -> None:
    home = candidate(tmp_path)
    refused = toolkit("plan", "session", "cell", "--home", home, code=2)
    assert "--calibration ID --draft" in refused.stderr
    named = toolkit("plan", "session", "cell", "--calibration", "cell-r1", "--home", home, code=2)
    assert "add --draft" in named.stderr
    said = toolkit(
        "plan", "session", "cell", "--calibration", "cell-r1", "--draft", "--home", home, "--json", code=None
    )
    findings = json.loads(said.stdout)["findings"]
    assert next((finding["rule"], finding["level"]) for finding in findings) == ("draft", "note")
    # What has no such option does not advise it.
    due = toolkit("plan", "interval", "cell", "--home", home, code=2)
    assert "approve" in due.stderr
    assert "--draft" not in due.stderr


@pytest.mark.parametrize(
    ("demand", "said"),
    [
        ("FY=9", "NUMBER UNIT"),
        ("FY=9 %", "unit"),
        ("FY=1 N at 0 N", "other than 0"),
        ("FY=1 N at 4", "NUMBER"),
    ],
)
def test_a_demand_states_its_units(home: Path, demand: str, said: str) -> None:
    refused = toolkit("plan", "session", "m15-virtual", "--u", demand, "--home", home, code=2)
    assert said in refused.stderr


def test_temperature_and_polarity_stand_in_the_planned_session(planned: tuple[Path, dict[str, Any]]) -> None:
    text = (planned[0] / "SESSION.toml").read_text()
    assert "temperature = { value = 21.0" in text
    assert "state what this session finds" in text
