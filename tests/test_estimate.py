"""Estimate: coverage factors of the GUM's own table."""

import math

import pytest

from toolkit.estimate import Estimate, coverage_factor, effective_dof, plus_minus

# JCGM 100:2008, table G.2: t_p(v) for p = 95 % and 95.45 %.
TABLE_G2 = [(1, 12.71, 13.97), (4, 2.78, 2.87), (10, 2.23, 2.28), (50, 2.01, 2.05), (math.inf, 1.960, 2.000)]


@pytest.mark.parametrize(("dof", "p95", "p9545"), TABLE_G2)
def test_table_g2(dof: float, p95: float, p9545: float) -> None:
    assert coverage_factor(dof, 0.95) == pytest.approx(p95, abs=0.005)
    assert coverage_factor(dof, 0.9545) == pytest.approx(p9545, abs=0.005)


def test_no_interval_below_one_degree_of_freedom() -> None:
    assert math.isnan(coverage_factor(0.5))


def test_welch_satterthwaite_of_the_gum() -> None:
    # JCGM 100:2008, H.1.6: end gauge, u = 25, 9.7, 2.9, 16.6 nm with 18, 25.6, 50, 2 degrees of freedom.
    contributions = [(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)]
    assert effective_dof(contributions) == pytest.approx(16.7, abs=0.4)


def test_scaled_keeps_the_relative_uncertainty() -> None:
    one = Estimate(value=-2.0, u=0.1, unit="N/rad", dof=5).scaled(math.pi / 180, "N/deg")
    assert one.u / abs(one.value) == pytest.approx(0.05)
    assert one.dof == 5


# Value, uncertainty, print: JCGM 100, 7.2.6; ILAC-P14:09/2020 (at most two significant digits).
PRINTS = [
    (-118.7, 97.2, "-119 ± 97"),
    (1301.2, 112.8, "1300 ± 110"),
    (0.0, 0.0996, "0.00 ± 0.10"),
    (99.96, 0.996, "100.0 ± 1.0"),
    (-0.2, 60.0, "0 ± 60"),
    (-0.004, 0.1, "0.00 ± 0.10"),
    (1.0, 9.96e2, "0 ± 1000"),
    (123456.0, 1234.0, "123500 ± 1200"),
    (0.5, 0.01, "0.500 ± 0.010"),
    (5.0, 0.0, "5"),
    (5.0, math.nan, "5"),
    (5.0, math.inf, "5"),
    (math.nan, 0.1, "nan"),
    (math.inf, 0.1, "inf"),
    (0.0, 3.2e-9, "0 ± 3.2e-9"),
]


@pytest.mark.parametrize(("value", "U", "text"), PRINTS)
def test_a_value_is_printed_to_the_last_place_of_its_uncertainty(value: float, U: float, text: str) -> None:
    assert plus_minus(value, U) == text
    assert plus_minus(value, U, decimal_comma=True) == text.replace(".", ",")


def test_another_unit_has_places_of_its_own() -> None:
    lbf = Estimate(value=1301.2, u=112.8, unit="N").scaled(1 / 4.4482216152605, "lbf")
    assert plus_minus(lbf.value, lbf.u) == "293 ± 25"
