"""Differences: what is shared cancels, loads are met, decisions hold over the table."""

from __future__ import annotations

import gc
import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from tests.comparison.comparison_factory import LOADS, conicity, entry, own, row
from toolkit.characteristics.uncertain import Part
from toolkit.comparison.differences import at_load, differences, holm, two_sided_p


def test_the_difference_of_two_tests_loses_what_they_share() -> None:
    record = Part(source="calibration", key="calibration/r1/FY/0", u=30.0)
    one = entry("a", row("conicity", 4000.0, 50.0, record, own("a", 3.0)))
    other = entry("b", row("conicity", 4000.0, 57.0, record, own("b", 4.0)))
    ((found,), left_out) = differences([one, other], level=0.05)
    assert (found.difference.value, found.difference.u) == (7.0, 5.0)
    assert found.u_apart == pytest.approx(math.hypot(math.hypot(30, 3), math.hypot(30, 4)))
    assert found.p == pytest.approx(2 * stats.norm.sf(7 / 5))
    assert left_out == ()


def test_another_record_shares_nothing() -> None:
    def record(sha: str) -> Part:
        return Part(source="calibration", key=f"calibration/{sha}/FY/0", u=30.0)

    pair = [entry(n, row("conicity", 4000.0, 50.0, record(n))) for n in ("r1", "r2")]
    ((found,), _) = differences(pair, level=0.05)
    assert found.difference.u == pytest.approx(30 * math.sqrt(2))


@pytest.mark.parametrize("dof", [1.0, 4.0, 11.5, math.inf])
def test_p_is_student_s(dof: float) -> None:
    expected = 2 * (stats.norm.sf(1.7) if math.isinf(dof) else stats.t.sf(1.7, dof))
    assert two_sided_p(-3.4, 2.0, dof) == pytest.approx(expected, rel=1e-12)
    assert two_sided_p(3.4, 0.0, dof) is None


@pytest.mark.parametrize("seed", range(5))
def test_holm_against_another_implementation(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # It asks for a collection of all objects, some seconds where every module of the tests is loaded.
    monkeypatch.setattr(gc, "collect", lambda: 0)
    p = np.random.default_rng(seed).uniform(0, 0.2, 30) ** 2
    assert holm(p.tolist()) == pytest.approx(multipletests(p, method="holm")[1])


def test_holm_leaves_out_what_was_not_decided() -> None:
    assert holm([0.01, None, 0.04]) == (0.02, None, 0.04)
    assert holm([]) == ()


def test_the_error_is_controlled_over_the_table_not_the_row() -> None:
    """Tests of one tire whose values scatter by their own u: 5 % of rows fall outside, not most tables."""
    rng = np.random.default_rng(11)
    tables = 200
    wrong_rows = wrong_tables = 0
    for _ in range(tables):
        a, b = (
            entry(
                name,
                *(
                    row("conicity", 1000.0 * (i + 1), float(rng.normal(0, 2)), own(name, 2.0, i))
                    for i in range(20)
                ),
            )
            for name in ("a", "b")
        )
        found, _ = differences([a, b], level=0.05)
        wrong_rows += sum(one.p is not None and one.p < 0.05 for one in found)
        wrong_tables += any(one.significant for one in found)
    # Binomial, four standard deviations: 5 % of 4000 rows, at most 5 % of 200 tables.
    assert wrong_rows == pytest.approx(200, abs=4 * math.sqrt(4000 * 0.05 * 0.95))
    assert wrong_tables <= 10 + 4 * math.sqrt(200 * 0.05 * 0.95)


def test_characteristics_and_curves_are_two_tables() -> None:
    """A hundred forces at slip angles do not weaken the decision on one characteristic."""
    angles = [math.radians(a) for a in range(1, 11)]
    a, b = (
        entry(
            name,
            row("conicity", 4000.0, value, own(name, 1.0)),
            *(row("FY", 4000.0, 0.0, own(name, 1.0, s), rotation="forward", SA_rad=s) for s in angles),
        )
        for name, value in (("a", 0.0), ("b", 3.5))
    )
    found, _ = differences([a, b], level=0.05)
    one = next(f for f in found if f.name == "conicity")
    assert one.p_holm == one.p
    assert one.significant
    assert {f.part for f in found} == {"characteristics", "curves"}


def test_a_parabola_over_the_load_is_met_exactly_and_its_parts_are_weighted() -> None:
    shared = Part(source="load", key="FZ", u=2.0)
    rows = [
        row("conicity", load, 3.0 + 2e-3 * load - 1e-7 * load**2, shared, own("b", 1.0, load))
        for load in LOADS
    ]
    found = at_load(rows, 4600.0, owner="b")
    assert found is not None
    assert found.value == pytest.approx(3.0 + 2e-3 * 4600 - 1e-7 * 4600**2)
    by_source = dict(found.by_source())
    assert by_source["load"] == pytest.approx(2.0)  # Lagrange's weights add up to one
    # Lagrange's weights at 4600 of 2000, 4000, 6000, by hand.
    weights = [(600 * -1400) / (-2000 * -4000), (2600 * -1400) / (2000 * -2000), (2600 * 600) / (4000 * 2000)]
    assert by_source["fit"] == pytest.approx(math.hypot(*weights))
    # Line through 4000 and 6000 against the parabola: -1e-7 (4600 - 4000)(4600 - 6000), over sqrt 3.
    assert by_source["load interpolation"] == pytest.approx(1e-7 * 600 * 1400 / math.sqrt(3))


def test_a_measured_load_is_taken_as_it_is() -> None:
    rows = [row("conicity", load, load, own("b", 1.0, load)) for load in LOADS]
    assert at_load(rows, 4000.0, owner="b") == rows[1].number


@pytest.mark.parametrize(
    ("load", "there"), [(1899.0, False), (1901.0, True), (6299.0, True), (6301.0, False)]
)
def test_beyond_the_loads_nothing_is_read(load: float, there: bool) -> None:
    rows = [row("conicity", one, one, own("b", 1.0, one)) for one in LOADS]
    assert (at_load(rows, load, owner="b") is not None) is there


def test_one_and_two_loads() -> None:
    one = at_load([row("conicity", 4000.0, 80.0, own("b", 1.0))], 4100.0, owner="b")
    assert one is not None
    assert one.value == 80.0
    assert dict(one.by_source())["load interpolation"] == pytest.approx(80 * 0.025 / math.sqrt(3))
    two = at_load(
        [row("conicity", x, x / 100, own("b", 1.0, x)) for x in (4000.0, 5000.0)], 4400.0, owner="b"
    )
    assert two is not None
    assert two.value == pytest.approx(44.0)
    assert dict(two.by_source())["load interpolation"] == pytest.approx(0.01 * 400 / 2 / math.sqrt(3))


def test_what_lacks_is_said() -> None:
    one = entry("a", row("conicity", 4000.0, 1.0, own("a", 1.0)), row("plysteer", 4000.0, 1.0, own("a", 1.0)))
    other = conicity("b", 1.0, 2.0, loads=(5000.0, 6000.0))
    found, left_out = differences([one, other], level=0.05)
    assert found == ()
    assert left_out == ("b has no plysteer", "b does not reach the load 4000 N (899 lbf)")
