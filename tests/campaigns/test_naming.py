"""What a campaign names after one more run: the member ahead, where it explains that run at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.campaigns.sealed_classes import explains, fitted_again, named
from tests.planning.class_factory import T, found, problem, with_run, write_case
from toolkit.planning.members import members_of

EFFECT = found("channel_delay", "filter_lag")


@pytest.mark.parametrize(("times", "name"), [(1.0, "channel_delay"), (1.7, None)])
def test_nothing_is_named_where_the_member_ahead_leaves_most_of_the_run(
    tmp_path: Path, times: float, name: str | None
) -> None:
    """A quick sine: as the plant answers it, and as it would had it gone elsewhere from the middle on.

    Both members are far from the other one, and one is ahead by far more than a verdict asks for.
    """
    posed = problem(write_case(tmp_path / "before"))
    members = members_of(posed, (EFFECT,), EFFECT)
    u = np.sin(2 * np.pi * 2.0 * T) * np.minimum(T, 1.0)
    more = with_run(tmp_path / "after", u, seed=9)
    if times != 1:
        more.observed["F"][more.slices[-1].start + len(T) // 2 :] *= times
    again = fitted_again(more, members)
    assert again[0].fit.log_posterior - again[1].fit.log_posterior > 3
    first = next(member for member in members if member.label == again[0].label)
    assert explains(more, again[0], first) is (times == 1)
    assert named(more, again, members) == name
    assert named(more, again) is not None
