"""What an effect may ask of a case: the widest range of a channel is that of one run."""

from types import SimpleNamespace

import numpy as np

from toolkit.diagnosis.search.case_view import CaseView


def view(*runs):
    ends = np.cumsum([len(run) for run in runs])
    slices = tuple(slice(int(end) - len(run), int(end)) for end, run in zip(ends, runs, strict=True))
    column = np.concatenate(runs)
    kept = np.isfinite(column) & (column < 100)
    return CaseView(
        SimpleNamespace(
            case=SimpleNamespace(channels=()),
            model=SimpleNamespace(outputs=()),
            observed={"F": column},
            kept={"F": kept},
            slices=slices,
            runs=(),
        ),
        "F",
    )


def test_a_range_is_never_taken_over_two_runs():
    low, high = np.array([-3.0, np.nan, 0.0]), np.array([0.5, 4.0, 1.0])
    assert view(low, high).widest("F") == (0.5, 4.0)


def test_a_row_that_does_not_count_widens_no_range():
    assert view(np.array([0.0, 500.0, 2.0])).widest("F") == (0.0, 2.0)


def test_what_was_not_recorded_has_no_range():
    assert view(np.array([np.nan]), np.array([np.nan])).widest("F") is None
    assert view(np.array([1.0])).widest("T") is None
