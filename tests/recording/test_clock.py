"""A time that stands twice is told as that, with all rows that it concerns."""

from __future__ import annotations

import numpy as np
import pytest

from tests.diagnosis.cases import HEAD, ONE, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.errors import CellError
from toolkit.recording.clock import time_fault
from toolkit.words.phrasebook import phrasebook


@pytest.mark.parametrize(
    ("times", "problem", "rows"),
    [
        ([0, 1, 1, 2, 2, 2], "a time stands twice", (3, 5, 6)),
        ([0, 2, 1, 1], "time does not rise", (3,)),
        ([0, 1, 0, 1, 0], "time does not rise", (3, 5)),
        ([np.nan, 1, 1, np.inf], "a row has no time", (1, 4)),
    ],
)
def test_a_fault_of_time_is_told_with_all_its_rows(
    times: list[float], problem: str, rows: tuple[int, ...]
) -> None:
    fault = time_fault(np.array(times, dtype=float))
    assert fault is not None
    assert (fault.problem, fault.rows) == (problem, rows)


@pytest.mark.parametrize("times", [[], [3.0], [-1.0, 0.0, 1e-9]])
def test_times_that_rise_have_no_fault(times: list[float]) -> None:
    assert time_fault(np.array(times)) is None


def test_a_case_says_how_many_rows_have_a_time_that_stands_twice_and_what_to_do(tmp_path) -> None:
    rows = "".join(f"{t},1,1,1\n" for t in (3.42, 3.43, 3.44, 3.44, 3.45, 3.45, 3.46))
    with pytest.raises(CellError, match="a time stands twice") as caught:
        read_case(write_case(tmp_path, HEAD + ONE, r0__csv="t,v,a,F\n" + rows))
    assert "row 4, column t" in str(caught.value.where)
    assert "rows 4 and 6" in caught.value.got
    assert "drop one row" in caught.value.next_step
    assert "sort" not in caught.value.next_step


@pytest.mark.parametrize("language", ["de", "fr"])
@pytest.mark.parametrize("times", [[0, 1, 1], [0, 2, 1], [0, np.nan, 1]])
def test_a_sweep_that_is_not_used_for_its_times_says_why_in_every_language(
    times: list[float], language: str
) -> None:
    fault = time_fault(np.array(times, dtype=float))
    assert fault is not None
    why = f"{fault.problem} ({len(fault.rows)} rows, the first is row {fault.rows[0]}): {fault.remedy}"
    said = phrasebook(language).say(f"the sweep says nothing: {why}")
    for english in ("the sweep", "row", fault.problem, fault.remedy):
        assert english not in said
