"""A new effect is one file: in its folder it is listed, explained, simulated, searched for and named."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, TWO, cell_case, write_case
from tests.effects import test_facts
from tests.recipes import file_of
from toolkit.cli.main import run
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects import catalogue


@pytest.fixture
def tension_gain(tmp_path, monkeypatch):
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "tension_gain.py").write_text(file_of("Add an effect"))
    monkeypatch.setattr(catalogue, "__path__", [*catalogue.__path__, str(folder)])
    catalogue.effects.cache_clear()
    yield catalogue.effect("tension_gain")
    monkeypatch.undo()
    catalogue.effects.cache_clear()


def test_it_stands_behind_the_last_of_its_stage(tension_gain):
    names = list(catalogue.effects())
    stages = [effect.stage for effect in catalogue.effects().values()]
    assert names.index("tension_gain") == len(stages) - 1 - stages[::-1].index("load_cells")


def called(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        run([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


def test_it_is_explained_and_simulated(tension_gain, tmp_path, capsys):
    assert called("explain", "tension_gain", "--json") == 0
    assert json.loads(capsys.readouterr().out)["equation"] == tension_gain.equation
    plan = tmp_path / "plan.toml"
    plan.write_text("date = 2026-03-17\nslip_angles = { value = [0], unit = 'deg' }\n")
    arguments = (plan, "--out", tmp_path / "out", "--effect", "tension_gain.D51=2%")
    assert called("simulate", *arguments) == 0
    assert "tension_gain on D51: gain = 0.02 1" in capsys.readouterr().out
    (applied,) = json.loads((tmp_path / "out" / "truth.json").read_text())["effects"]
    assert applied["parameters"] == [{"name": "gain", "value": 0.02, "unit": "1"}]


def test_a_case_is_searched_for_it_and_names_it(tension_gain, tmp_path):
    frames = {}
    for i in range(2):
        rng = np.random.default_rng(i)
        t = np.arange(150) * 0.1
        load = 400.0 * np.sin(0.7 * t + i) + 100.0 * np.sin(2.3 * t)
        F = np.where(load > 0, 1.05, 1.0) * load + rng.normal(0, 1.0, 150)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": t, "L": load, "F": F})
    case = read_case(write_case(tmp_path / "case", cell_case(0.001) + TWO, simulator=CELL, **frames))
    (listed,) = (
        one for one in candidates(problem_of(case, model_of(case, None))) if one.name == "tension_gain"
    )
    assert (listed.active.channel, len(listed.starts)) == ("F", 1)
    answer = diagnose(case, None, limits=None).diagnosis
    assert [effect.name for effect in answer.effects] == ["tension_gain"]
    low, high = answer.effects[0].parameters[0].ci95
    assert low < 0.05 < high


def test_a_fact_that_is_missing_is_told(tension_gain):
    bare = dataclasses.replace(tension_gain, on_channel=None)
    with pytest.raises(AssertionError, match="says on which kinds"):
        test_facts.test_the_kind_of_the_effect_has_its_facts(bare)
    test_facts.test_the_kind_of_the_effect_has_its_facts(tension_gain)
    with pytest.raises(AssertionError):
        test_facts.test_an_effect_that_follows_time_says_so(dataclasses.replace(tension_gain, in_time=True))
