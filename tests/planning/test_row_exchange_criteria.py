"""Update formulas against the inverse that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.planning.row_exchange import CRITERIA, Criterion, criterion, together, with_each_row


@pytest.mark.parametrize("by", CRITERIA)
@pytest.mark.parametrize("wanted", [1, 3, 5])
def test_a_row_more_is_that_of_the_inverse(by: Criterion, wanted: int) -> None:
    rng = np.random.default_rng(wanted)
    X, rows, targets = rng.normal(size=(9, 5)), rng.normal(size=(20, 5)), rng.normal(size=(7, wanted))
    information = X.T @ X
    updated = with_each_row(np.asarray(np.linalg.inv(information)), rows, targets, by)
    inverted = [
        criterion(np.linalg.inv(information + np.outer(row, row))[:wanted, :wanted], targets, by)
        for row in rows
    ]
    np.testing.assert_allclose(updated, inverted, rtol=1e-9)


@pytest.mark.parametrize("by", CRITERIA)
def test_a_row_more_never_makes_it_worse(by: Criterion) -> None:
    rng = np.random.default_rng(8)
    X, targets = rng.normal(size=(6, 3)), rng.normal(size=(4, 3))
    covariance = np.asarray(np.linalg.inv(X.T @ X))
    after = with_each_row(covariance, rng.normal(size=(30, 3)), targets, by)
    assert np.all(after <= criterion(covariance, targets, by) + 1e-12)


def test_a_singular_covariance_is_infinite_by_d() -> None:
    assert criterion(np.zeros((2, 2)), np.eye(2), "D") == float("inf")


def test_responses_are_summed_and_by_g_the_largest_counts() -> None:
    values = [np.array([1.0, 5.0]), np.array([2.0, 3.0])]
    assert together(values, "I").tolist() == [3.0, 8.0]
    assert together(values, "G").tolist() == [2.0, 5.0]
