"""The worker of a case's own code answers for the run that it is asked about, whatever it has learned."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.planning.class_factory import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, running


@pytest.mark.parametrize("calls", [[(0, 0), (1,)], [(0,), (0, 1)], [(0, 1, 0), (1, 2, 2), (3,)]])
def test_runs_that_come_twice_are_still_told_apart(tmp_path: Path, calls: list[tuple[int, ...]]) -> None:
    case = read_case(write_case(tmp_path))
    first = case.runs[0]
    further = [
        dataclasses.replace(
            first, name=f"{size}.csv", columns={**first.columns, "u": np.full(first.rows, size)}
        )
        for size in (3.0, 5.0, 7.0, 9.0)
    ]
    with running(case, WORKER_LIMITS) as code:
        assert code is not None
        model = model_of(case, None, code)
        for places in calls:
            code.learn([further[place] for place in places])
            for place in places:
                force = model.simulate(further[place], {"gain": 1.0}, ())["F"]
                np.testing.assert_allclose(force, further[place].columns["u"])
