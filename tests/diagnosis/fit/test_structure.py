"""Smooth dependences of a residual: how many columns a recording of some rows is asked by."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.structure import groups
from toolkit.diagnosis.policy import STRUCTURE
from toolkit.diagnosis.simulators.build_simulator import model_of


@pytest.mark.parametrize(("rows", "left"), [(9, 0.5), (21, 0.06), (40, 0.01)])
def test_a_short_recording_has_fewer_knots_and_is_asked_all_the_same(tmp_path, rows, left):
    L = np.linspace(10.0, 90.0, rows)
    frame = pd.DataFrame({"t": np.arange(rows) * 1.0, "L": L, "F": L + 0.001 * (L - 50.0) ** 2})
    text = cell_case(0.01) + '[[recording.run]]\nfile = "r0.csv"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, r0__csv=frame, r1__csv=None))
    problem = problem_of(case, model_of(case, None, None))
    base = fit(problem)
    over = {each.variables: each.columns for each in groups(problem, base)}
    columns = over["L",]
    assert columns.shape[1] <= max(rows / STRUCTURE.rows_per_column, 1)
    bend = base.residual["F"] - base.residual["F"].mean()
    rest = bend - columns @ np.linalg.lstsq(columns, bend, rcond=None)[0]
    assert np.sum(rest**2) < left * np.sum(bend**2)


def test_a_simulation_that_is_open_where_nothing_was_recorded_is_asked_about_the_rest(tmp_path):
    """An effect on gauges has no value where one was not recorded, and no row of the output either."""
    L = np.linspace(10.0, 90.0, 40)
    F = L + 0.001 * (L - 50.0) ** 2
    F[[3, 17]] = np.nan
    frame = pd.DataFrame({"t": np.arange(40) * 1.0, "L": L, "F": F})
    text = cell_case(0.01) + '[[recording.run]]\nfile = "r0.csv"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, r0__csv=frame, r1__csv=None))
    problem = problem_of(case, model_of(case, None, None))
    base = fit(problem)
    left_open = replace(base, simulated={"F": np.where(np.isfinite(F), base.simulated["F"], np.nan)})
    over = {each.variables: each.columns for each in groups(problem, left_open)}
    assert all(np.isfinite(columns).all() for columns in over.values())
    bend = base.residual["F"][problem.kept["F"]]
    columns = over["F",][problem.kept["F"]]
    rest = bend - columns @ np.linalg.lstsq(columns, bend, rcond=None)[0]
    assert np.sum(rest**2) < 0.5 * np.sum(bend**2)
