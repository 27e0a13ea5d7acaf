"""Estimate: coverage factors of the GUM's own table."""

import math

import pytest

from toolkit.estimate import Estimate, coverage_factor, effective_dof

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
