"""By which conditions effects may be confined to some runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of

HEAD = case_text("python", parameters={"gain": (1.0, "1", 0.01)}, inputs={"L": "N"}, outputs={"F": "N"})


@pytest.mark.parametrize(
    ("levels", "groups"),
    [
        (("on", "off", "on"), {("r0.csv", "r2.csv"), ("r1.csv",)}),
        (("1", "2", "1"), {("r0.csv", "r2.csv"), ("r1.csv",)}),
        (("dry", "wet", "icy"), {("r0.csv",), ("r1.csv",), ("r2.csv",), ("r0.csv", "r2.csv")}),
        (("0.20", "0.17", "0.068"), set()),
        (("20", "40"), {("r0.csv",), ("r1.csv",)}),
    ],
)
def test_a_number_of_each_runs_own_groups_none(
    tmp_path: Path, levels: tuple[str, ...], groups: set[tuple[str, ...]]
) -> None:
    """Where each run starts is no reason why a sensor should read otherwise in one of them."""
    t, text, frames = np.arange(40) * 0.1, HEAD, {}
    for k, level in enumerate(levels):
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": np.sin(t + k), "F": np.sin(t + k)})
        text += f'\n[[recording.run]]\nfile = "r{k}.csv"\nlevel = "{level}"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, **frames))
    problem = problem_of(case, model_of(case, None, None))
    found = {
        tuple(sorted(each.active.runs))
        for each in candidates(problem)
        if each.name == "zero_offset" and each.active.runs is not None
    }
    assert found == groups
