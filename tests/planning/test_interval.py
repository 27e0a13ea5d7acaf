"""Drift against a Kalman smoother, risks against draws, intervals that follow from them."""

from __future__ import annotations

import datetime as dt
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from statsmodels.tsa.statespace.structural import UnobservedComponents

from toolkit.errors import ConfigError
from toolkit.planning.interval import FEWEST, YEAR, Path, drift_of, path_of, plan_interval

BEGIN = dt.date(2015, 1, 1)


def path(errors: list[float] | NDArray[np.float64], years: float = 1.0, cut: int | None = None) -> Path:
    """A path read every so many years; ``cut``: from this reading on it has another level."""
    readings = [
        (BEGIN + dt.timedelta(days=round(i * years * YEAR)), float(error), int(cut is not None and i >= cut))
        for i, error in enumerate(errors)
    ]
    result = path_of("FY", "FY 1 N", readings)
    assert result is not None
    return result


def test_the_trend_is_that_of_a_kalman_smoother() -> None:
    """At one q and r, with equal steps: statsmodels' trend with a random walk."""
    rng = np.random.default_rng(1)
    y = 0.1 * np.arange(12) + np.cumsum(rng.normal(0, 0.1, 12)) + rng.normal(0, 0.05, 12)
    one = path(y)
    regular = Path(
        load="FY", check_load="", begin=BEGIN, years=np.arange(12.0), errors=one.errors, segment=one.segment
    )
    drift = drift_of(regular)
    at = int(np.argmin(np.abs(drift.walk - 0.1) + np.abs(drift.noise - drift.noise[2])))
    model = UnobservedComponents(y, "lldtrend")
    model.ssm.initialize_approximate_diffuse(1e8)
    smoothed = model.smooth([drift.noise[at] ** 2, drift.walk[at] ** 2])
    assert drift.trend[at] == pytest.approx(float(smoothed.smoothed_state[1, -1]), rel=1e-4)
    assert drift.u_trend[at] ** 2 == pytest.approx(float(smoothed.smoothed_state_cov[1, 1, -1]), rel=1e-4)


def test_the_risk_is_that_of_drawn_errors() -> None:
    drift = drift_of(path([0, 0.3, 0.5, 0.9, 1.1]))
    rng = np.random.default_rng(2)
    at = rng.choice(len(drift.weight), p=drift.weight, size=200_000)
    trend = rng.normal(drift.trend[at], drift.u_trend[at])
    for years in (0.5, 2.0):
        error = trend * years + rng.normal(0, np.sqrt(drift.walk[at] ** 2 * years + drift.noise[at] ** 2))
        assert drift.beyond(years) == pytest.approx(float(np.mean(np.abs(error) > 1)), abs=0.004)


def test_a_cut_path_keeps_its_trend() -> None:
    """An adjustment of two tolerances in its middle is no drift."""
    steady = 0.1 * np.arange(10) + np.random.default_rng(3).normal(0, 0.02, 10)
    adjusted = steady + np.where(np.arange(10) >= 5, -2.0, 0.0)
    whole, parted = drift_of(path(steady)), drift_of(path(adjusted, cut=5))
    assert parted.trend_per_year == pytest.approx(whole.trend_per_year, abs=0.05)
    assert abs(drift_of(path(adjusted)).trend_per_year - whole.trend_per_year) > 0.1


def test_a_steady_instrument_may_wait_and_a_drifting_one_may_not() -> None:
    rng = np.random.default_rng(4)
    quiet = path(rng.normal(0, 0.05, 9))
    fast = path(0.8 * np.arange(9) + rng.normal(0, 0.05, 9))
    long, short = (plan_interval([one], reliability=0.95) for one in (quiet, fast))
    assert long.capped
    assert long.days == int(1.5 * long.seen_days)
    # 0.8 tolerances a year reach one after 1.25 years; noise and doubt take some of it.
    assert 250 < short.days < 1.25 * YEAR
    assert short.chosen.beyond <= 0.05
    together = plan_interval([quiet, fast], reliability=0.95)
    assert together.days == short.days
    assert plan_interval([fast], reliability=0.99).days < short.days


def test_tests_at_risk_are_the_chance_times_their_number() -> None:
    plan = plan_interval([path([0, 0.3, 0.5, 0.9, 1.1])], reliability=0.9, tests_a_year=200.0)
    for risk in plan.risks:
        assert risk.recalled_a_year == pytest.approx(200 * risk.beyond)
        assert risk.sessions_a_year == pytest.approx(YEAR / risk.days)
    beyond = [risk.beyond for risk in plan.risks]
    assert beyond == sorted(beyond)


def test_where_nothing_serves_no_interval_is_named() -> None:
    plan = plan_interval([path([0, 5, -3, 8, -6, 4])], reliability=0.95)
    assert plan.days == 0
    assert plan.chosen.beyond > 0.05


def test_too_short_a_history_is_refused() -> None:
    assert path_of("FY", "", []) is None
    assert path_of("FY", "", [(BEGIN + dt.timedelta(days=i), 0.1, 0) for i in range(FEWEST - 1)]) is None
    assert path_of("FY", "", [(BEGIN, 0.1 * i, 0) for i in range(6)]) is None  # all on one day
    with pytest.raises(ConfigError) as refused:
        plan_interval([], reliability=0.95)
    assert refused.value.rule == "plan-history"


MORE = pytest.mark.campaign("150 histories in place of 50")


@pytest.mark.parametrize(("worlds", "least"), [(50, 0.76), pytest.param(150, 0.88, marks=MORE)])
def test_histories_in_drawn_worlds_keep_the_reliability_on_the_whole(worlds: int, least: float) -> None:
    """The grid's own prior, drawn and read eight times: at the end of its interval an error is inside."""
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(worlds):
        walk, noise, trend = rng.uniform(0, 0.4), rng.uniform(0.02, 0.2), rng.normal(0, 0.4)
        t = np.arange(8.0)
        level = trend * t + np.append(0, np.cumsum(rng.normal(0, walk, 7)))
        plan = plan_interval([path(level + rng.normal(0, noise, 8))], reliability=0.9)
        if plan.days:
            years = plan.days / YEAR
            error = trend * years + rng.normal(0, math.hypot(walk * math.sqrt(years), noise))
            inside.append(abs(error) <= 1)
    assert len(inside) > 8 / 15 * worlds
    # Of some thirty a share of 0.9 is sure to three times 0.05.
    assert np.mean(inside) >= least
