"""Mandel's h and k against a published example, the standard's table of limits, and draws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from toolkit.comparison.precision import consistencies, h_limit, k_limit

# Glucose in serum, material A, ASTM E691: eight laboratories, three results each, and its table of h and k.
GLUCOSE = [
    (41.03, 41.45, 41.37), (41.17, 42.00, 41.15), (41.01, 40.68, 42.66), (39.37, 42.37, 42.63),
    (41.88, 41.19, 41.32), (43.28, 40.50, 42.28), (41.08, 41.27, 39.02), (43.36, 42.65, 41.72),
]  # fmt: skip
H = (-0.39, -0.13, -0.11, -0.10, -0.09, 0.83, -1.75, 1.75)
K = (0.21, 0.46, 1.00, 1.70, 0.34, 1.32, 1.17, 0.77)


def test_glucose_has_its_published_statistics() -> None:
    laboratories = consistencies(GLUCOSE)
    for laboratory, h, k in zip(laboratories, H, K, strict=True):
        assert laboratory.h == pytest.approx(h, abs=0.006)
        assert laboratory.k == pytest.approx(k, abs=0.006)
    # Eight laboratories of three: 5 % at |h| 1.75 and k 1.67, 1 % at 2.06 and 1.96.
    assert [laboratory.k_departure for laboratory in laboratories] == [
        None, None, None, "straggler", None, None, None, None
    ]  # fmt: skip
    assert laboratories[6].h_departure == "straggler"
    assert laboratories[7].h_departure is None


# Critical values of ISO 5725-2, tables 6 and 7: h at 1 % and 5 %, k of two results at 1 % and 5 %.
@pytest.mark.parametrize(
    ("p", "h_one", "h_five", "k_one", "k_five"),
    [
        (3, 1.15, 1.15, 1.71, 1.65), (5, 1.72, 1.57, 2.05, 1.81), (6, 1.87, 1.66, 2.14, 1.85),
        (8, 2.06, 1.75, 2.25, 1.88), (10, 2.18, 1.80, 2.32, 1.90),
    ],
)  # fmt: skip
def test_the_limits_are_the_standards(
    p: int, h_one: float, h_five: float, k_one: float, k_five: float
) -> None:
    assert h_limit(p, 0.01) == pytest.approx(h_one, abs=0.0101)
    assert h_limit(p, 0.05) == pytest.approx(h_five, abs=0.0101)
    assert k_limit(1, p, 0.01) == pytest.approx(k_one, abs=0.0101)
    assert k_limit(1, p, 0.05) == pytest.approx(k_five, abs=0.0101)


MORE = pytest.mark.campaign("three times as many drawn comparisons")


@pytest.mark.parametrize("draws", [2000, pytest.param(6000, marks=MORE)])
def test_laboratories_of_different_numbers_are_stragglers_as_often_as_the_level_says(draws: int) -> None:
    """Drawn comparisons of alike laboratories: k of each is beyond its own limit in 5 % of them."""
    rng = np.random.default_rng(5)
    sizes = (2, 3, 5, 2, 8, 4)
    beyond = np.zeros(len(sizes))
    for _ in range(draws):
        drawn = consistencies([rng.normal(size=size).tolist() for size in sizes])
        beyond += [laboratory.k_departure is not None for laboratory in drawn]
    # Three standard errors of a share of 5 %.
    assert np.all(np.abs(beyond / draws - 0.05) < 3 * np.sqrt(0.05 * 0.95 / draws))


def test_unit_and_origin_do_not_matter() -> None:
    moved = [[1000 * value - 7.0 for value in values] for values in GLUCOSE]
    for there, here in zip(consistencies(GLUCOSE), consistencies(moved), strict=True):
        assert here.h == pytest.approx(there.h)
        assert here.k == pytest.approx(there.k)


@pytest.mark.parametrize(
    ("results", "h", "k"),
    [
        ([(1.0,)], False, False),
        ([(1.0, 2.0), (1.5, 3.0)], False, True),
        ([(1.0,), (2.0,), (4.0,)], True, False),
        ([(1.0, 2.0), (2.0,), (4.0,)], True, False),
        ([(1.0, 1.0), (2.0, 2.0), (4.0, 4.0)], True, False),
        ([(1.0, 3.0), (3.0, 1.0), (2.0, 2.0)], False, True),
    ],
)
def test_what_cannot_be_told_is_none(results: list[tuple[float, ...]], h: bool, k: bool) -> None:
    laboratories = consistencies(results)
    assert all((laboratory.h is not None) == h for laboratory in laboratories)
    assert all((laboratory.k is not None) == k for laboratory in laboratories)


def test_a_laboratory_without_repeats_has_no_k_beside_those_that_have() -> None:
    laboratories = consistencies([(1.0, 2.0), (1.5, 3.0), (2.0,)])
    assert [laboratory.k is None for laboratory in laboratories] == [False, False, True]


def test_of_three_results_two_that_print_alike_make_no_outlier_of_the_third() -> None:
    """h is then at its largest, 2 / sqrt(3), beyond both limits of the standard."""
    rounded, exact = consistencies([[100.0], [101.0], [101.0]]), consistencies([[100.0], [101.0], [101.0001]])
    assert [laboratory.h_departure for laboratory in rounded] == [None, None, None]
    assert rounded[0].h == pytest.approx(-2 / math.sqrt(3))
    assert [laboratory.h_departure for laboratory in exact] == ["outlier", None, None]
