"""Run rules and limits: each rule by a sequence that breaks it alone, and by one that just does not."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.calibration.control.chart import RULES, breaks_of, broken_rules, limits_of

# z that break exactly one rule, at the last point; and the same sequence with the last point harmless.
ONLY = {
    1: ([0.5, -0.5, 3.01], 3.0),
    2: ([0.5, 0.4, 0.6, 0.3, 0.5, 0.4, 0.6, 0.5, 0.2], -0.2),
    3: ([-0.9, -0.5, -0.1, 0.3, 0.7, 0.9], 0.6),
    4: ([0.5, -0.5] * 6 + [1.2, -0.5], 1.3),
    5: ([0.0, 2.1, -0.3, 2.1], 1.9),
    6: ([0.0, 1.2, 1.4, -0.1, 1.3, 1.1], 0.9),
    7: ([0.5, 0.5, -0.5, -0.5, 0.1] * 3, 1.01),
    8: ([1.5, -1.5, -1.2, 1.5, 1.2, -1.5, -1.2, 1.5], 0.9),
}


@pytest.mark.parametrize("number", ONLY)
def test_each_rule_by_a_sequence_that_breaks_it_alone(number: int) -> None:
    z, harmless = ONLY[number]
    found = broken_rules(np.array(z))
    assert [(one.rule.number, one.index) for one in found] == [(number, len(z) - 1)]
    assert broken_rules(np.array([*z[:-1], harmless])) == ()
    assert broken_rules(-np.array(z))[0].rule.number == number


def test_the_rules_are_the_eight_of_nelson() -> None:
    assert [(rule.number, rule.length) for rule in RULES] == [
        (1, 1), (2, 9), (3, 6), (4, 14), (5, 3), (6, 5), (7, 15), (8, 8),
    ]  # fmt: skip


def test_a_point_on_the_centre_is_on_no_side_and_one_on_the_limit_is_not_beyond_it() -> None:
    assert broken_rules(np.array([0.5] * 8 + [0.0])) == ()
    assert broken_rules(np.array([3.0])) == ()


def test_a_point_back_in_the_middle_breaks_no_rule_of_the_points_before_it() -> None:
    found = broken_rules(np.array([2.5, 2.5, 0.0]))
    assert [(one.rule.number, one.index) for one in found] == []


def test_the_limits_by_hand() -> None:
    # Moving ranges 2, 2, 2, 2: sigma 2/1.128, the range's limit 3.267 x 2.
    limits = limits_of(np.array([9.0, 11.0, 9.0, 11.0, 9.0]))
    assert limits is not None
    assert limits.centre == pytest.approx(9.8)
    assert limits.sigma == pytest.approx(1.7730496)
    assert (limits.lower, limits.upper) == pytest.approx((9.8 - 2.66 * 2, 9.8 + 2.66 * 2), abs=0.002)
    assert limits.upper_range == pytest.approx(6.534)
    assert limits.provisional
    assert [one.rule.number for one in breaks_of(np.array([15.2]), limits)] == [1]


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0, 3.0], [0.1 * 3, 0.3, 0.3, 0.3, 0.3]])
def test_a_short_or_constant_baseline_has_no_limits(values: list[float]) -> None:
    assert limits_of(np.array(values)) is None
