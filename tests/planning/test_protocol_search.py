"""The search for the least test: demands met by the whole budget, in fewer rows than the protocol."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.tire_factory import C_FY, M15, at_load
from tests.planning.planning_factory import LOADS, VARIANCES, earlier
from toolkit.errors import ConfigError
from toolkit.planning import protocol_search
from toolkit.planning.demands import parse_demand
from toolkit.planning.design import Design, Pace, standard
from toolkit.planning.protocol_search import (
    Judged,
    ProtocolSearch,
    Question,
    least_plan,
    load_sets,
    refuse_too_short,
)
from toolkit.planning.screen import criterion
from toolkit.planning.tread import Tread

PACE = Pace(condition_s=5.0, between_files_s=30.0)
SPEED = 20.0
PROTOCOL = standard(M15, M15.rotations)


NEAR = LOADS[1:4]
"""Of an earlier test for what each load is tried alike for: every load more takes as long again."""


def tread(
    *, energy_J: float = math.inf, rise_K: float = math.inf, measured: tuple[float, ...] = LOADS
) -> Tread:
    return Tread(tires=(earlier(measured),), pace=PACE, speed_m_s=SPEED, energy_J=energy_J, rise_K=rise_K)


def question(
    *demands: str, loads: tuple[float, ...] = LOADS, measured: tuple[float, ...] = LOADS
) -> Question:
    parsed = tuple(map(parse_demand, demands))
    protocol = dataclasses.replace(PROTOCOL, loads_N=measured)
    return Question.beside(protocol, tires=(earlier(measured),), demands=parsed, loads_N=loads)


@pytest.fixture(autouse=True)
def few_starts(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits are kept wherever the exchange starts: of more starts a plan is a little shorter at most."""
    if "all_starts" not in request.fixturenames:
        monkeypatch.setattr(protocol_search, "_STARTS", 2)


@pytest.fixture
def all_starts() -> None:
    """Ask for the exchange from as many starts as a command has it."""


@pytest.mark.usefixtures("all_starts")
def test_the_uncertainties_of_the_protocol_are_reached_in_fewer_rows() -> None:
    asked = question("conicity", "plysteer", "slope_cornering", "peak")
    found = least_plan(asked, tread())
    assert found.worst <= 1.0
    assert found.design.rows < PROTOCOL.rows
    # What is offered is judged by the whole budget, not by the screen.
    again = asked.reaches(found.design)
    assert max(reach.U / reach.limit for reach in again) == pytest.approx(found.worst)


def test_the_screen_of_the_exchange_agrees_with_the_budget() -> None:
    asked = question("conicity=2 N", "slope_cornering=2 %")
    search = ProtocolSearch(asked, tread(), LOADS)
    for size in (8, 11, 14):
        found = search.best(size)
        screened = criterion(search._screens, np.array([search._best[size]]))[0]
        assert screened == pytest.approx(found.worst, rel=0.05)


@pytest.mark.filterwarnings("error")
def test_a_demand_that_nothing_comes_near_is_screened_as_any_other() -> None:
    asked = question("conicity=2 N", loads=NEAR, measured=NEAR)
    absurd = question(f"conicity={2 * 2.0**-990} N", loads=NEAR, measured=NEAR)
    designs = np.array([[0, 3, 5, 6, 7, 10, 12], [0, 2, 4, 6, 8, 10, 12]])
    losses = []
    for one in (asked, absurd):
        search = ProtocolSearch(one, tread(measured=NEAR), NEAR)
        losses.append(criterion(search._screens, designs))
    assert np.argsort(losses[1]).tolist() == np.argsort(losses[0]).tolist()
    assert np.isfinite(losses[1]).all()


def test_the_screen_knows_what_the_form_of_the_curves_misses() -> None:
    """It adds up over both sides and directions: by squares alone it would be three times as large here."""
    form = np.array([0.0] * 7 + [30.0**2, 0.6**2, math.radians(0.01) ** 2])
    known = dataclasses.replace(earlier(), variances=VARIANCES + form, variances_u=0.0 * VARIANCES)
    demands = tuple(map(parse_demand, ("conicity=2 N", "slope_cornering=2 %", "FY@8deg=40 N")))
    asked = Question(tires=(known,), demands=demands, loads_N=LOADS)
    search = ProtocolSearch(asked, tread(), LOADS)
    for size in (10, 13):
        points = (
            tuple(range(0, 21, 2))[:size] if size < 11 else (0, 2, 4, 6, 8, 9, 10, 11, 12, 14, 16, 18, 20)
        )
        screened, _ = search._screens[0].ratios(np.array([points]))
        reaches = asked.reaches(search.design(points), known=True)
        budget = [1.96 * reach.u / reach.limit for reach in reaches]
        np.testing.assert_allclose(screened[0], budget, rtol=0.05)


@pytest.mark.campaign("four searches of one size each: the whole search is held in every run")
def test_more_slip_angles_are_never_worse() -> None:
    asked = question("conicity", loads=LOADS[2:3], measured=NEAR)
    search = ProtocolSearch(asked, tread(measured=NEAR), LOADS[2:3])
    worst = [search.best(size).worst for size in (7, 9, 11, 13)]
    assert worst == sorted(worst, reverse=True)


def test_a_demand_of_one_direction_needs_no_reversed_run() -> None:
    found = least_plan(question("slope_cornering=3 %", loads=LOADS[2:3], measured=NEAR), tread(measured=NEAR))
    assert found.design.rotations == ("forward",)


@pytest.mark.campaign("one more plan: what a curve asks of its slip angles is held in every run")
def test_every_plan_measures_a_curve_to_its_peak_on_both_sides() -> None:
    asked = question("conicity", loads=LOADS[2:3], measured=NEAR)
    degrees = np.degrees(least_plan(asked, tread(measured=NEAR)).design.slip_angles_rad)
    assert degrees.min() <= -8
    assert degrees.max() >= 8
    narrow = tuple(i for i, angle in enumerate(asked.candidates_rad) if abs(angle) < math.radians(3.5))
    assert len(narrow) == 7
    assert not asked.covers(narrow)


def test_no_test_makes_smaller_what_all_rows_share() -> None:
    asked = question("plysteer=1 N", loads=LOADS[2:3], measured=NEAR)
    floor = least_plan(asked, tread(measured=NEAR), minutes=60)
    (reach,) = floor.reaches
    assert floor.worst > 1
    # 0.05 deg of the steering's zero by the cornering stiffness, k = 1.96.
    stiffness = C_FY * at_load(LOADS[2])[0]
    assert reach.U == pytest.approx(1.96 * math.radians(0.05) * stiffness, rel=0.05)


def test_a_time_that_holds_no_curve_is_refused_with_the_least_that_does() -> None:
    with pytest.raises(ConfigError) as error:
        least_plan(question("conicity"), tread(), minutes=1.0)
    assert error.value.rule == "plan-infeasible"
    smallest = Design(slip_angles_rad=(0.0,) * 7, loads_N=LOADS, rotations=("forward", "reverse"))
    assert f"{math.ceil(10 * PACE.minutes(smallest)) / 10} min" in str(error.value.expected)


def test_a_demand_at_a_slip_angle_keeps_it_beside_demands_that_would_do_without() -> None:
    found = least_plan(question("FY@5deg=200 N", "conicity", "slope_cornering=3 %"), tread())
    assert 5.0 in np.round(np.degrees(found.design.slip_angles_rad), 9)
    assert found.worst <= 1
    assert {reach.demand.label for reach in found.reaches} == {"FY@5deg", "conicity", "slope_cornering"}


def test_a_demand_at_a_slip_angle_that_no_test_measures_is_refused() -> None:
    with pytest.raises(ConfigError) as error:
        question("FY@5.3deg=200 N")
    assert error.value.rule == "plan-demand"
    assert ", 5, " in str(error.value.expected)


def test_a_budget_of_energy_takes_gentler_slip_angles() -> None:
    asked = question("slope_cornering=4 %", loads=LOADS[2:3], measured=NEAR)
    free = least_plan(asked, tread(measured=NEAR))
    used = float(tread(measured=NEAR).energies_J(free.design).sum())
    spared = least_plan(asked, tread(energy_J=0.8 * used, measured=NEAR))
    assert spared.feasible
    assert tread(measured=NEAR).energies_J(spared.design).sum() <= 0.8 * used
    assert asked.covers([asked.candidates_rad.index(angle) for angle in spared.design.slip_angles_rad])
    impossible = least_plan(asked, tread(energy_J=0.01 * used, measured=NEAR))
    assert not impossible.feasible
    assert impossible.excess > 0


def test_a_limit_of_warmth_costs_pauses_and_they_count_in_the_time() -> None:
    asked = question("slope_cornering=3 %", loads=LOADS[2:3], measured=NEAR)
    free = least_plan(asked, tread(measured=NEAR))
    cold = tread(rise_K=1.05 * float(tread(measured=NEAR).rises_K(free.design).max()), measured=NEAR)
    paused = least_plan(asked, cold)
    assert paused.feasible
    waits = cold.pauses_s(paused.design) - PACE.between_files_s
    assert waits.max() > 0
    assert paused.minutes == pytest.approx(PACE.minutes(paused.design) + waits.sum() / 60)
    hurried = least_plan(asked, cold, minutes=0.9 * paused.minutes)
    assert not hurried.feasible or hurried.minutes <= 0.9 * paused.minutes


def test_further_loads_are_tried_the_nearest_first() -> None:
    asked = question("conicity", loads=LOADS[2:3])
    sets = load_sets(asked)
    assert sets[0] == LOADS[2:3]
    assert [len(loads) for loads in sets] == [1, 2, 3, 4, 5]
    assert set(sets[2]) == set(LOADS[1:4])


def test_a_demand_without_a_size_is_the_protocols() -> None:
    asked = question("conicity")
    for reach in asked.reaches(PROTOCOL):
        assert reach.ratio == pytest.approx(1 / 1.05)
    stricter = dataclasses.replace(asked, demands=(parse_demand("conicity=0.5 N"),))
    assert {reach.limit for reach in stricter.reaches(PROTOCOL)} == {0.5}


def test_no_slip_angle_is_planned_twice() -> None:
    search = ProtocolSearch(question("conicity", loads=LOADS[2:3]), tread(), LOADS[2:3])
    for size in (7, 9, 12):
        angles = search.best(size).design.slip_angles_rad
        assert len(set(angles)) == len(angles) == size
    assert search.most_within(1e6) == len(search.candidates)
    zero = search.candidates.index(min(search.candidates, key=abs))
    assert not search.question.covers((0, 2, 4, 6, 8, zero, zero, 12, 14, 16, 20))


def test_no_plan_leaves_a_curve_open_between_its_slip_angles() -> None:
    asked = question("plysteer", loads=LOADS[2:3], measured=NEAR)
    search = ProtocolSearch(asked, tread(measured=NEAR), LOADS[2:3])

    def judged(*degrees: float) -> Judged:
        return search.judged(search.design(tuple(search.candidates.index(a) for a in map(nearest, degrees))))

    def nearest(degrees: float) -> float:
        return min(search.candidates, key=lambda angle: abs(angle - math.radians(degrees)))

    # The zero is measured, and by derivatives that is all that plysteer needs; but nothing says how the curve
    # comes to it, and the wheel stands a little beside it.
    lopsided = judged(-10, -9, -8, -7, -6, 0, 10)
    assert lopsided.worst < 1.1
    assert lopsided.openness > 10
    assert not lopsided.feasible
    planned = least_plan(asked, tread(measured=NEAR))
    assert planned.feasible
    assert planned.openness <= 1
    assert judged(-10, -7, -3, 0, 3, 7, 10).openness < 2


def still_about_zero() -> tuple[Question, Tread]:
    """A tire whose conditions hardly scatter where the wheel runs straight, and what is asked of it."""
    known = earlier(LOADS[2:3])
    curves = {}
    for key, curve in known.curves.items():
        still = np.where(np.abs(curve.SA) < math.radians(0.5), 1e-6, 1.0)
        squares = {name: square * still for name, square in curve.squares.items()}
        curves[key] = dataclasses.replace(curve, squares=squares)
    tire = dataclasses.replace(known, curves=curves, variances=1e-9 * known.variances, load_spread=0.0)
    asked = Question(tires=(tire,), demands=(parse_demand("slope_cornering=3 %"),), loads_N=LOADS[2:3])
    return asked, dataclasses.replace(tread(), tires=(tire,))


def test_every_slip_angle_leaves_no_curve_open_however_still_one_of_them_is() -> None:
    asked, bears = still_about_zero()
    search = ProtocolSearch(asked, bears, LOADS[2:3])
    screen = search._screens[0]
    assert (screen.closed > 2 * screen.variances).any()
    # The curve comes to where hardly anything scatters through all that does.
    everything = search.judged(search._full)
    assert everything.openness == pytest.approx(0.5)
    assert everything.feasible
    gaps = [i for i, angle in enumerate(search.candidates) if not 0.02 < abs(angle) < 0.12]
    assert search.judged(search.design(tuple(gaps))).openness > 2 * everything.openness


def test_a_time_in_which_curves_stay_open_is_refused_with_the_least_that_closes_them() -> None:
    here = LOADS[2:3]
    # Every angle on one side: with one more on the other the curve is open about zero.
    asked = question(*[f"FY@{angle}deg=900 N" for angle in range(-10, 0)], loads=here, measured=here)
    bears = tread(measured=here)
    eleven, twelve = (
        PACE.minutes(Design(slip_angles_rad=(0.0,) * count, loads_N=here, rotations=("forward",)))
        for count in (11, 12)
    )
    with pytest.raises(ConfigError) as error:
        least_plan(asked, bears, minutes=(eleven + twelve) / 2)
    assert error.value.rule == "plan-infeasible"
    assert f"{twelve:g} min at least: 12 slip angles" in str(error.value.expected)
    assert least_plan(asked, bears, minutes=twelve).feasible


def test_a_time_that_holds_no_test_is_refused_before_anything_is_known_of_a_tire() -> None:
    demands = (parse_demand("conicity=2 N"), parse_demand("slope_cornering=3 %"))
    smallest = Design(slip_angles_rad=(0.0,) * 7, loads_N=LOADS, rotations=("forward", "reverse"))
    refuse_too_short(demands, LOADS, PACE, PACE.minutes(smallest))
    with pytest.raises(ConfigError) as error:
        refuse_too_short(demands, LOADS, PACE, 0.99 * PACE.minutes(smallest))
    assert error.value.rule == "plan-infeasible"
    assert f"{math.ceil(10 * PACE.minutes(smallest)) / 10} min" in str(error.value.expected)
    # One direction alone takes half of the time.
    refuse_too_short(demands[1:], LOADS, PACE, 0.5 * PACE.minutes(smallest))
