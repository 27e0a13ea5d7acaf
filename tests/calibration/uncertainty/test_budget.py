"""Budgets: published examples, variance components of known truth, statements, bad input."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.calibration.uncertainty_factory import levels, record_of_table, table_of
from toolkit.calibration.uncertainty.budget import calibration_budget, combine, predict
from toolkit.calibration.uncertainty.model import Temperature
from toolkit.errors import SessionError
from toolkit.estimate import round_uncertainty

# JCGM 100:2008, H.3, table H.6: thermometer readings less 20 degC, and observed corrections.
T = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
B = np.array([-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160])


def test_the_thermometer_of_the_gum() -> None:
    """H.3.3 and H.3.4: y1, y2, their uncertainties and correlation, the correction at 30 degC."""
    table = table_of(T - 20.0, B)
    record = record_of_table(table)
    (one,) = record.loads
    y2, y1 = one.coefficients
    u2, u1 = one.standard_errors
    assert (round(y1, 4), round(u1, 4)) == (-0.1712, 0.0029)
    assert (round(y2, 5), round(u2, 5)) == (0.00218, 0.00067)
    assert round(one.covariance[0][1] / (u1 * u2), 3) == -0.930
    assert one.residual_sd == pytest.approx(0.0035, abs=5e-5)
    made = predict(record, table, None, "F", {"S": 10.0})
    assert round(made.budget.at, 4) == -0.1494
    fit = made.budget.component("fit")
    assert (round(fit.u, 4), fit.dof) == (0.0041, 9)
    assert made.beyond == ("S",)


def test_the_end_gauge_of_the_gum() -> None:
    """H.1.6, H.1.7: u_c = 32 nm, 16 degrees of freedom, t_99 = 2.92, U_99 = 93 nm."""
    u, dof, k, U = combine([(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)], 0.99)
    assert u == pytest.approx(32.0, abs=0.5)
    assert math.floor(dof) in (16, 17)  # 16.7 from H.1's own rounded parts, 17 from these
    assert k == pytest.approx(2.92, abs=0.03)
    assert U == pytest.approx(93.0, abs=1.0)


def test_whole_degrees_of_freedom_stay_whole() -> None:
    # One component alone: its own dof, whatever the quotient rounds to. t_95(9) = 2.26 (table G.2).
    for u in np.geomspace(1e-7, 1e7, 200):
        assert combine([(float(u), 9.0)], 0.95)[2] == pytest.approx(2.262, abs=5e-4)


@pytest.mark.campaign(
    "hundreds of drawn sessions: each component of a budget stands against its formula in every run"
)
def test_variance_components_of_known_truth() -> None:
    """Means over 200 sessions: each component unbiased, none holds another's share."""
    rng = np.random.default_rng(11)
    load, run, direction = levels(runs=6)
    down = np.array([one == "down" for one in direction])
    within, offset, gain, reversal = 0.10, 0.30, 0.40, 0.25
    squares = []
    for _ in range(200):
        shift, slope = rng.normal(0, offset, 6), rng.normal(0, gain, 6)
        at = run.astype(int) - 1
        e = shift[at] + slope[at] * load / 1000 + np.where(down, -reversal, reversal)
        read = (load - e - rng.normal(0, within, len(load))) / 500
        table = table_of(read, load, run=run, direction=direction)
        parts = calibration_budget(record_of_table(table), table, None, "F")
        squares.append([
            parts.component(name).u ** 2
            for name in ("repeatability", "reproducibility", "reversibility", "interpolation")
        ])  # fmt: skip
    mean = np.mean(squares, axis=0)
    assert mean[0] == pytest.approx(within**2, rel=0.03)
    # sd of the mean of 200 chi-squares with 5 dof: about 4.5 %
    assert mean[1] == pytest.approx(offset**2 + gain**2, rel=0.15)
    assert mean[2] == pytest.approx(reversal**2 / 3, rel=0.03)
    assert mean[3] < 0.1 * within**2


def test_a_bent_curve_is_interpolation_and_not_scatter() -> None:
    rng = np.random.default_rng(3)
    load, run, direction = levels(runs=4)
    x = load / 500
    bend = 2.0 * (x - 1.1) ** 2
    table = table_of(x, load, run=run, direction=direction)
    line = np.polynomial.Polynomial.fit(x, bend, 1)
    misfit = np.sqrt(np.mean((bend - line(x)) ** 2))
    seen = table_of((load + rng.normal(0, 0.05, len(load)) + bend) / 500, load, run=run, direction=direction)
    parts = calibration_budget(record_of_table(seen), seen, None, "F")
    assert parts.component("interpolation").u == pytest.approx(misfit, rel=0.03)
    assert parts.component("repeatability").u == pytest.approx(0.05, rel=0.2)
    assert table.rows == seen.rows


def test_mountings_stand_for_runs_where_the_cell_was_turned() -> None:
    load, run, direction = levels(runs=4)
    rng = np.random.default_rng(8)
    rotation = np.array([0.0, 0.0, 120.0, 240.0])[run.astype(int) - 1]
    table = table_of((load + rng.normal(0, 0.1, len(load))) / 500, load, run=run, direction=direction,
                     rotation=rotation)  # fmt: skip
    part = calibration_budget(record_of_table(table), table, None, "F").component("reproducibility")
    assert "3 mountings" in part.description


def simple(**settings: object) -> tuple[object, object]:
    load, run, direction = levels()
    rng = np.random.default_rng(4)
    table = table_of((load + rng.normal(0, 0.1, len(load))) / 500, load, run=run, direction=direction)
    return record_of_table(table, **settings), table  # type: ignore[arg-type]


def test_what_is_stated_goes_in_by_hand_calculation() -> None:
    """A sensitivity of 500 N per mV/V: every type B component is arithmetic on what was stated."""
    record, table = simple(
        fit_zero="tared",
        reference={"uncertainty": {"F": {"U": 0.6, "k": 2, "unit": "N"}}},
        cells={"S": {"resolution": 1e-4, "u": 2e-4, "temperature_coefficient": 1e-5}},
        zero=[{"when": "before", "values": {"S": 1e-4}}, {"when": "after", "values": {"S": 7e-4}}],
        creep=[{"load": "F", "seconds": 30, "value": {"S": 2.0}},
               {"load": "F", "seconds": 300, "value": {"S": 2.001}}],
    )  # fmt: skip
    made = calibration_budget(record, table, None, "F", 500.0, temperature=Temperature(half_range_K=10.0))  # type: ignore[arg-type]
    wanted = {
        "reference": 0.3,  # U = 0.6 N with k = 2 is stated of every load
        "resolution": 500 * 1e-4 / math.sqrt(6),  # ISO 376 annex C: r/sqrt(6) of two readings
        "indication": 500 * 2e-4,
        "zero": 500 * 6e-4 / math.sqrt(3),
        "creep": 0.5 / 1000 * 500 / math.sqrt(3),  # 0.001 mV/V are 0.5 N of 1000 N
        "temperature": 1e-5 * 10 * 500 / math.sqrt(3),
    }
    for name, u in wanted.items():
        assert made.component(name).u == pytest.approx(u, rel=2e-3), name
    assert made.not_stated == ()
    assert made.u == pytest.approx(math.sqrt(sum(part.u**2 for part in made.components)))
    assert sum(made.share(part) for part in made.components) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("unit", "U", "expected"), [("N", 0.6, (0.3, 0.3, 0.3)), ("%", 0.06, (0.0, 0.15, 0.3))]
)
def test_an_amount_holds_at_every_load_and_a_share_grows(
    unit: str, U: float, expected: tuple[float, ...]
) -> None:
    record, table = simple(reference={"uncertainty": {"F": {"U": U, "k": 2, "unit": unit}}})
    for at, u in zip((0.0, 500.0, 1000.0), expected, strict=True):
        made = calibration_budget(record, table, None, "F", at)  # type: ignore[arg-type]
        assert made.component("reference").u == pytest.approx(u, abs=1e-9)


def test_what_is_not_stated_is_listed_with_zero() -> None:
    record, table = simple()
    made = calibration_budget(record, table, None, "F")  # type: ignore[arg-type]
    assert made.not_stated == ("reference", "resolution", "indication", "zero", "creep", "temperature")
    assert all(part.u == 0 for part in made.components if not part.stated)


def test_one_run_tells_nothing_of_the_next() -> None:
    load, run, direction = levels(runs=1)
    rng = np.random.default_rng(5)
    table = table_of((load + rng.normal(0, 0.1, len(load))) / 500, load, run=run, direction=direction)
    assert "reproducibility" in calibration_budget(record_of_table(table), table, None, "F").not_stated


def test_of_few_rows_check_loads_tell_the_interpolation() -> None:
    rng = np.random.default_rng(6)
    load = np.sort(rng.uniform(100, 1000, 15))
    table = table_of((load + rng.normal(0, 0.1, 15)) / 500, load)
    record = record_of_table(table)
    assert "interpolation" in calibration_budget(record, table, None, "F").not_stated
    there = np.linspace(150, 950, 9)
    check = dataclasses.replace(table_of((there + 3.0) / 500, there), run=None, up=None)
    part = calibration_budget(record, table, check, "F").component("interpolation")
    assert part.u == pytest.approx(3.0, rel=0.03)


@pytest.mark.parametrize("at", [-1.0, 1000.1, math.nan, math.inf])
def test_a_load_outside_the_range_is_refused(at: float) -> None:
    record, table = simple()
    with pytest.raises(SessionError) as caught:
        calibration_budget(record, table, None, "F", at)  # type: ignore[arg-type]
    assert all(caught.value.as_dict().values())


@pytest.mark.parametrize("given", [{}, {"S": math.nan}, {"S": 1.0, "T": 1.0}])
def test_indications_that_are_not_the_records_are_refused(given: dict[str, float]) -> None:
    record, table = simple()
    with pytest.raises(SessionError):
        predict(record, table, None, "F", given)  # type: ignore[arg-type]


def test_a_legacy_record_has_no_budget() -> None:
    record, table = simple()
    legacy = dataclasses.replace(record, kind="legacy")  # type: ignore[type-var]
    with pytest.raises(SessionError, match="no budget"):
        calibration_budget(legacy, table, None, "F")  # type: ignore[arg-type]


def test_a_change_of_units_scales_the_budget() -> None:
    load, run, direction = levels()
    rng = np.random.default_rng(9)
    read = (load + rng.normal(0, 0.1, len(load))) / 500
    budgets = [
        calibration_budget(record_of_table(table), table, None, "F")
        for table in (
            table_of(read, load, run=run, direction=direction),
            table_of(1000 * read, 1000 * load, run=run, direction=direction),
        )
    ]
    assert budgets[1].U == pytest.approx(1000 * budgets[0].U, rel=1e-9)


def test_rounding_is_up_where_it_would_lower_by_more_than_a_twentieth() -> None:
    # EA-4/02 M 6.3 and ILAC-P14: at most two digits.
    assert round_uncertainty(1.05, digits=1) == "1"
    assert round_uncertainty(1.06, digits=1) == "2"
    assert round_uncertainty(0.001249) == "0.0012"
    assert round_uncertainty(123456.0) == "120000"
    assert (round_uncertainty(0.0), round_uncertainty(math.nan)) == ("0", "not determined")
    with pytest.raises(ValueError):
        round_uncertainty(1.0, digits=3)


@pytest.mark.parametrize("grows", [True, False])
def test_a_reading_scatters_as_the_rows_near_its_load_show(grows: bool) -> None:
    """A noise of 0.02 + 0.5 F/FS, and one of 0.3 everywhere: repeatability at both ends of the curve.

    Of a variance known to some twenty rows near an end the standard deviation is known to 15 %: two of them.
    """
    rng = np.random.default_rng(5)
    load, run, direction = levels(runs=6)
    true = 0.02 + 0.5 * load / load.max() if grows else np.full(len(load), 0.3)
    table = table_of((load - rng.normal(0, 1, len(load)) * true) / 500, load, run=run, direction=direction)
    record = record_of_table(table)
    at_end = calibration_budget(record, table, None, "F", float(load.max())).component("repeatability").u
    at_zero = calibration_budget(record, table, None, "F", 0.0).component("repeatability").u
    assert at_end == pytest.approx(0.52 if grows else 0.3, rel=0.3)
    assert at_zero < 0.1 if grows else at_zero == pytest.approx(0.3, rel=0.3)
