"""What a simulation lacks, by its pages: a case of the home is diagnosed, isolated, and its answer shown."""

from __future__ import annotations

import copy
import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.built_once import built_once
from tests.workbench.conftest import ROOT, Served, plain, serving
from tests.workbench.test_jobs_page import done
from tests.workbench.test_page import ANSWER as WHOLE
from toolkit.errors import UnreadableError
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.sized_model import read_diagnosis

CASE, ANSWER = holding_id("cases/cell"), holding_id("diagnoses/cases/cell")
TOML = """schema = 1
title = "A cell that is not linear"
[simulation]
kind = "python"
path = "sim.py"
function = "simulate"
[simulation.parameters.gain]
value = 1.0
unit = "1"
sd = 0.001
[recording.channels]
L = { unit = "N", role = "input" }
F = { unit = "N", role = "output", sd = 0.4 }
[[recording.run]]
file = "r0.csv"
[[recording.run]]
file = "r1.csv"
[[recording.predict]]
file = "more.csv"
"""
SIMULATOR = """import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["gain"] * inputs["L"]})
"""


def _case_files() -> list[tuple[str, bytes]]:
    """Return a case: the cell has a part with the square of its load, which the simulation has not."""
    rng = np.random.default_rng(20260101)
    files = {"case.toml": TOML, "sim.py": SIMULATOR, "more.csv": "L\n100\n200\n300\n"}
    for run in range(2):
        load = np.linspace(10.0, 1200.0, 80) + rng.normal(0.0, 1.0, 80)
        force = load + 2e-5 * load**2 + rng.normal(0.0, 0.4, 80)
        rows = "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(load, force, strict=True))
        files[f"r{run}.csv"] = f"L,F\n{rows}"
    return [(name, text.encode()) for name, text in files.items()]


CASE_FILES = _case_files()


def with_case(lab: Path) -> Path:
    """Make a home with a case."""
    case = lab / "cases" / "cell"
    case.mkdir(parents=True)
    shutil.copytree(ROOT / "calibrations", lab / "calibrations")
    for name, data in CASE_FILES:
        (case / name).write_bytes(data)
    return lab


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a case."""
    return with_case(tmp_path_factory.mktemp("diagnosed") / "lab")


def _diagnose(folder: Path) -> None:
    with serving(with_case(folder / "lab")) as bench:
        assert f'data-case="{CASE}"' in bench.page("/diagnoses/list").body
        page = done(bench, bench.send(f"/case/{CASE}/diagnose", {}))
        assert 'data-state="findings"' in page.body, plain(page.body)
        assert f"/diagnosis/{ANSWER}" in page.body


@pytest.fixture(scope="module")
def answered(home: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same home, its case diagnosed from its page, for all who ask."""
    shutil.copytree(
        built_once(tmp_path_factory, "answered-page", _diagnose) / "lab", home, dirs_exist_ok=True
    )
    return home


def shown(bench: Served) -> str:
    page = bench.page(f"/diagnosis/{ANSWER}")
    assert page.status == 200
    return page.body


def test_the_answer_stands_on_its_page_number_by_number(answered: Path) -> None:
    answer = json.loads((answered / "diagnoses" / "cases" / "cell" / "diagnosis.json").read_text())
    assert answer["effects"][0]["name"] == "nonlinearity"
    with serving(answered) as bench:
        body = shown(bench)
        page = bench.page(f"/diagnosis/{ANSWER}")
        assert f'data-verdict="{answer["verdict"]}"' in body
        assert re.search(r">nonlinearity (of|on) F, quadratic [^<]+: explains \d+ % of", html.unescape(body))
        for effect in answer["effects"]:
            values = [float(value) for value in page.data(effect=effect["name"])]
            for parameter in effect["parameters"]:
                assert {parameter["value"], *parameter["ci95"]} <= set(values)
        for row in answer["fit"]["held_out"]:
            values = [float(value) for value in page.data(channel=row["channel"])]
            assert values == [row[f"{name}_rmse"] for name in ("nominal", "refitted", "augmented")] + [
                row["noise_floor"]
            ]


def test_its_figures_are_those_of_its_own_page_and_its_predictions_can_be_zoomed(answered: Path) -> None:
    folder = answered / "diagnoses" / "cases" / "cell"
    figures = (folder / "diagnosis.html").read_text().count("data:image/svg+xml;base64,")
    assert figures > 0
    with serving(answered) as bench:
        body = shown(bench)
    assert body.count("data:image/svg+xml;base64,") == figures
    assert len(re.findall("data-curves=", body)) == 1
    name, chart = read_diagnosis(folder).charts[0]
    assert name == "more.csv: F"
    # This case has no time: its rows are counted.
    assert (chart["x_label"], chart["series"][0]["x"]) == ("row", [1, 2, 3])
    assert chart["series"][0]["y"] == [100.0, 200.0, 300.0]


def test_from_the_workbench_a_case_runs_isolated(answered: Path) -> None:
    from toolkit.lab.desk.jobs import jobs_of

    (job,) = jobs_of(answered)
    assert "--isolated" in job.job.words


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"title": 1}', "\x00"])
def test_what_is_no_answer_is_refused_with_its_place(tmp_path: Path, text: str) -> None:
    (tmp_path / "diagnosis.json").write_text(text)
    with pytest.raises(UnreadableError) as caught:
        read_diagnosis(tmp_path)
    assert "diagnosis.json" in str(caught.value)


def test_a_picture_that_is_no_drawing_of_ours_is_not_shown(tmp_path: Path, answered: Path) -> None:
    folder = answered / "diagnoses" / "cases" / "cell"
    shutil.copy(folder / "diagnosis.json", tmp_path)
    (tmp_path / "diagnosis.html").write_text(
        '<img alt="a" src="https://example.com/x.svg"><img alt="b" src="data:text/html;base64,AAAA">'
        '<img alt="c&quot; onload=&quot;x" src="data:image/svg+xml;base64,AAAA">'
    )
    assert read_diagnosis(tmp_path).figures == (('c" onload="x', "data:image/svg+xml;base64,AAAA"),)


def test_predictions_stand_over_the_time_where_there_is_one(tmp_path: Path, answered: Path) -> None:
    shutil.copy(answered / "diagnoses" / "cases" / "cell" / "diagnosis.json", tmp_path)
    (tmp_path / "predictions").mkdir()
    (tmp_path / "predictions" / "b.csv").write_text(
        "t,S_nominal,S_refitted,W_nominal\n0.5,1,2,3\n1.5,4,5,nan\n"
    )
    (tmp_path / "predictions" / "c.csv").write_text("t,S_nominal\n1,\n")
    ((name, chart),) = read_diagnosis(tmp_path).charts
    assert (name, chart["x_label"]) == ("b.csv: S", "t")
    assert [(s["label"], s["x"], s["y"]) for s in chart["series"]] == [
        ("nominal", [0.5, 1.5], [1.0, 4.0]), ("refitted", [0.5, 1.5], [2.0, 5.0]),
    ]  # fmt: skip


def test_only_ids_have_pages(home: Path) -> None:
    with serving(home) as bench:
        assert bench.page("/diagnosis/cases%2Fcell").status == 404
        assert bench.send("/case/..%2F../diagnose", {}).status == 404
        assert bench.send(f"/case/{holding_id('cases')}/diagnose", {}).status == 404


@pytest.mark.parametrize(
    ("language", "sentence"),
    [
        ("en", "A part of what is missing has a name."),
        ("de", "Ein Teil dessen, was fehlt, hat einen Namen."),
        ("fr", "Une partie de ce qui manque a un nom."),
    ],
)
def test_a_small_name_is_a_part_in_every_language(tmp_path: Path, language: str, sentence: str) -> None:
    """A servo's lag took 21 % of what was off: 0.125 rad without, 0.111 rad with it, 0.0014 rad of noise."""
    home = tmp_path / "lab"
    shutil.copytree(ROOT / "calibrations", home / "calibrations")
    (home / "diagnoses" / "servo").mkdir(parents=True)
    answer = copy.deepcopy(WHOLE) | {"verdict": "named", "remaining": "unknown"}
    answer["fit"]["held_out"] = [
        channel | {"refitted_rmse": 0.12492, "augmented_rmse": 0.11084, "noise_floor": 0.00138}
        for channel in answer["fit"]["held_out"]
    ]
    (home / "diagnoses" / "servo" / "diagnosis.json").write_text(json.dumps(answer))
    with serving(home) as bench:
        page = bench.page(f"/diagnosis/{holding_id('diagnoses/servo')}", **{"Accept-Language": language})
    assert sentence in plain(page.body)
