"""A class of tires: similar tires are what the similarity method says, and a plan serves those between."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.tire_factory import M15
from tests.planning.planning_factory import LOADS, earlier
from toolkit.errors import ConfigError
from toolkit.planning.demands import parse_demand
from toolkit.planning.design import pace_of, standard
from toolkit.planning.protocol_search import Question, least_plan
from toolkit.planning.tire_class import PASSENGER, members, parse_spread
from toolkit.planning.tread import Tread
from toolkit.simulation.tire import lateral_force

ANGLES = np.radians(np.linspace(-10, 10, 21))
PROTOCOL = standard(M15, M15.rotations)


def test_a_similar_tire_has_the_force_of_another_slip_angle_times_its_friction() -> None:
    known, load = earlier(), LOADS[2]
    similar = known.similar(stiffness=0.6, friction=1.2, tire="soft")
    # The shifts of a curve stay where they are: about them the curve is that of the other slip angle.
    fit = known.curves[load, "forward"].fit.FY
    assert fit is not None
    Sh, Sv = fit.values[4], fit.values[5]
    moved = (ANGLES + Sh) * 0.6 / 1.2 - Sh
    expected = 1.2 * (known.force(moved, load, "forward") - Sv) + Sv
    np.testing.assert_allclose(similar.force(ANGLES, load, "forward"), expected, rtol=1e-9, atol=1e-6)


def test_what_is_read_of_a_similar_tire_follows_the_factors() -> None:
    demands = tuple(map(parse_demand, ("slope_cornering", "peak")))

    def values(stiffness: float, friction: float) -> list[float]:
        tire = earlier().similar(stiffness=stiffness, friction=friction, tire="")
        asked = Question(tires=(tire,), demands=demands, loads_N=LOADS[2:3])
        return [reach.value for reach in asked.reaches(PROTOCOL)]

    (stiffness, peak), (more, _), (_, higher) = values(1, 1), values(1.3, 1), values(1, 1.3)
    assert more == pytest.approx(1.3 * stiffness, rel=0.01)
    assert abs(higher) > 1.2 * abs(peak) * 0.98


def test_a_class_is_its_corners_and_the_tire_itself() -> None:
    assert members(earlier(), {}) == (earlier(),)
    one = members(earlier(), {"stiffness": (0.8, 1.2)})
    assert one[0] is earlier()
    assert len(one) == 3
    assert len(members(earlier(), {"stiffness": (0.8, 1.2), "friction": (0.9, 1.1)})) == 5
    assert len(members(earlier(), {"stiffness": (0.5, 0.8)})) == 2
    assert len({tire.tire for tire in one}) == 3


PROTOCOLS = pytest.mark.campaign("demands as large as the protocol's: stated ones are served in every run")


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(("slope_cornering", "conicity"), marks=PROTOCOLS),
        ("slope_cornering=3 %", "peak=3 %"),
    ],
)
def test_a_plan_for_a_class_serves_the_tires_between(names: tuple[str, ...]) -> None:
    spread = {"stiffness": (0.6, 1.4), "friction": (0.9, 1.1)}
    demands, loads, measured = tuple(map(parse_demand, names)), LOADS[2:3], LOADS[1:4]
    protocol = dataclasses.replace(PROTOCOL, loads_N=measured)
    tires = members(earlier(measured), spread)
    asked = Question.beside(protocol, tires=tires, demands=demands, loads_N=loads)
    planned = least_plan(asked, Tread(tires=tires, pace=pace_of(M15), speed_m_s=2.0))
    assert planned.feasible
    rng = np.random.default_rng(25)
    for _ in range(6):
        stiffness, friction = (float(rng.uniform(*spread[name])) for name in ("stiffness", "friction"))
        tire = earlier(measured).similar(stiffness=stiffness, friction=friction, tire="between")
        own = Question.beside(protocol, tires=(tire,), demands=demands, loads_N=loads)
        ratios = [reach.ratio for reach in own.reaches(planned.design)]
        assert max(ratios) < 1.01, (stiffness, friction, ratios)


@pytest.mark.campaign("two searches more: a class is planned for and served in every run")
def test_a_class_costs_what_its_most_demanding_tire_costs() -> None:
    demands, measured = (parse_demand("conicity"),), LOADS[1:4]
    protocol = dataclasses.replace(PROTOCOL, loads_N=measured)

    def rows(spread: dict[str, tuple[float, float]]) -> int:
        tires = members(earlier(measured), spread)
        asked = Question.beside(protocol, tires=tires, demands=demands, loads_N=LOADS[2:3])
        return least_plan(asked, Tread(tires=tires, pace=pace_of(M15), speed_m_s=2.0)).design.rows

    alone, together = rows({}), rows({"stiffness": (0.5, 1.5)})
    assert together >= alone


def test_the_range_of_passenger_tires_is_the_published_one_on_the_published_tire() -> None:
    force = float(lateral_force(slip_angle=math.radians(0.001), load=3700.0))
    coefficient = force / 0.001 / 3700.0  # a degree
    low, high = PASSENGER["stiffness"]
    assert low * coefficient == pytest.approx(0.11, abs=0.002)
    assert high * coefficient == pytest.approx(0.30, abs=0.002)


@pytest.mark.parametrize(
    "text",
    ["stiffness", "stiffness=1.2..0.8", "grip=0.8..1.2", "stiffness=-1..2", "stiffness=nan..2",
     "stiffness=0.5..1e9", "stiffness=..", "stiffness=1.2"],
)  # fmt: skip
def test_a_spread_that_cannot_be_read_is_refused(text: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_spread([text])
    assert error.value.rule == "plan-spread"


def test_a_factor_that_stands_twice_is_refused() -> None:
    with pytest.raises(ConfigError):
        parse_spread(["stiffness=0.8..1.2", "stiffness=0.7..1.2"])
