"""Sweeps that are planned: within the machine, apart from a delay, what is promised and what it costs."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.characteristics.sweep_factory import relaxing, sweep, triangle
from tests.planning.planning_factory import LOADS, earlier
from toolkit.characteristics.sweep_fit import fit_sweep
from toolkit.characteristics.sweep_length import relaxation_length
from toolkit.errors import ConfigError
from toolkit.machine import Delay, Machine, Sweeping, load_machine
from toolkit.planning import sweep_search
from toolkit.planning.demands import parse_demand
from toolkit.planning.sweep_plan import planned_sweeps, refuse_beyond
from toolkit.planning.sweep_search import AMPLITUDES_RAD, PRIOR_M, SweepChoice, energy_J, least_sweeps
from toolkit.planning.tread import Tread
from toolkit.reduction.sweep import SMALL_RAD

VIRTUAL = load_machine("m15-virtual")
LOAD = LOADS[2]


def machine(**stated: Any) -> Machine:
    assert VIRTUAL.sweeping is not None
    return dataclasses.replace(VIRTUAL, sweeping=dataclasses.replace(VIRTUAL.sweeping, **stated))


def least(text: str, own: Machine = VIRTUAL, **options: Any) -> SweepChoice:
    return least_sweeps(
        options.pop("tires", (earlier(),)), parse_demand(text), options.pop("loads", (LOAD,)), machine=own,
        between_files_s=30.0, to_load_s=2.5,
    )  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def predicted_once() -> Iterator[None]:
    """What a steering says of a tire hangs on no demand: it is predicted once for all tests."""
    predicted: Any = sweep_search._predicted
    made: dict[tuple[Any, ...], tuple[Any, Any]] = {}

    def once(case: Any, steering: Any, sweeping: Any) -> Any:
        key = (id(case.earlier), case.load_N, case.length_m, steering, sweeping)
        if key not in made:
            made[key] = case.earlier, predicted(case, steering, sweeping)  # kept, so that no other has its id
        return made[key][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep_search, "_predicted", once)
        yield


@functools.cache
def least_of_40_mm() -> SweepChoice:
    return least("relaxation_length=40 mm")


def test_what_is_swept_is_what_is_fitted() -> None:
    assert max(AMPLITUDES_RAD) < SMALL_RAD


def test_two_speeds_within_the_limits_of_the_machine_where_nobody_states_a_delay() -> None:
    choice = least_of_40_mm()
    assert choice.feasible
    assert len(choice.design.speeds_m_s) == 2
    stated = VIRTUAL.sweeping
    assert isinstance(stated, Sweeping)
    for speed in choice.design.speeds_m_s:
        assert stated.speeds_m_s[0] - 1e-9 <= speed <= stated.speeds_m_s[1] + 1e-9
        rate = choice.design.steering.rate_rad_m * speed
        assert stated.steer_rates_rad_s[0] - 1e-9 <= rate <= stated.steer_rates_rad_s[1] + 1e-9


@pytest.mark.campaign(
    "two more searches: sweeps at two speeds, where no delay is stated, are planned in every run"
)
def test_a_stated_delay_takes_one_speed_and_its_uncertainty_is_in_the_budget() -> None:
    sure = machine(delay=Delay(value_s=0.0, u_s=0.001, source="test"))
    choice = least("relaxation_length=40 mm", sure)
    assert len(choice.design.speeds_m_s) == 1
    assert choice.seconds < least_of_40_mm().seconds
    (speed,) = choice.design.speeds_m_s
    assert dict(choice.reaches[0].sources)["delay"] == pytest.approx(speed * 0.001)
    # One that is hardly known is no help: two speeds again.
    assert (
        len(
            least(
                "relaxation_length=25 mm", machine(delay=Delay(value_s=0, u_s=0.1, source="t"))
            ).design.speeds_m_s
        )
        == 2
    )


def test_a_smaller_demand_takes_longer_and_one_that_is_too_small_is_told_with_the_nearest() -> None:
    wide, narrow = least("relaxation_length=60 mm"), least("relaxation_length=18 mm")
    assert wide.feasible
    assert narrow.feasible
    assert wide.seconds <= narrow.seconds
    none = least("relaxation_length=0.1 mm")
    assert not none.feasible
    assert none.worst > 1


@pytest.mark.parametrize("text", ["relaxation_length=0.1 mm", "relaxation_length=40 mm"])
def test_the_search_ends_where_all_sweeps_looked_at_would(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A steering that one tire at one load rules out is foretold for no other; the answer is that of all."""
    demand, loads = parse_demand(text), LOADS[1:4]
    assert VIRTUAL.sweeping is not None
    cases = [
        sweep_search._Case(earlier=earlier(), load_N=load, length_m=length)
        for load in loads
        for length in PRIOR_M
    ]
    every = []
    for place, steering in enumerate(sweep_search._steerings()):
        basis = [sweep_search._predicted(case, steering, VIRTUAL.sweeping) for case in cases]
        speeds = tuple(sweep_search._speeds(steering, VIRTUAL.sweeping))
        for cycles in itertools.product(sweep_search._CYCLES, repeat=2):
            design = sweep_search.SweepDesign(
                steering=steering, speeds_m_s=(speeds[0], speeds[-1]), cycles=cycles, loads_N=loads
            )
            reaches = [
                sweep_search._reach(case, fit, design, demand) for case, fit in zip(cases, basis, strict=True)
            ]
            worst = max(reach.ratio for reach in reaches)
            seconds = design.seconds(between_files_s=30.0, to_load_s=2.5)
            every.append((max(worst, 1.0), seconds, place, design))
    foretold = []
    predicted = sweep_search._predicted

    def counted(case: Any, steering: Any, sweeping: Any) -> Any:
        foretold.append((case, steering))
        return predicted(case, steering, sweeping)

    monkeypatch.setattr(sweep_search, "_predicted", counted)
    best = min(every, key=lambda entry: entry[:3])
    choice = least(text, loads=loads)
    assert (choice.design, choice.seconds) == (best[3], best[1])
    assert len(foretold) <= 0.6 * 8 * len(cases)


def test_both_ends_of_the_prior_are_served_and_a_measured_length_takes_its_place() -> None:
    values = sorted(reach.value for reach in least_of_40_mm().reaches)
    assert values == pytest.approx(sorted(PRIOR_M))
    known = dataclasses.replace(earlier(), lengths_m={LOAD: 0.43})
    (reach,) = least("relaxation_length=40 mm", tires=(known,)).reaches
    assert reach.value == pytest.approx(0.43)


@pytest.mark.campaign(
    "sixteen sweeps are fitted: one plan of sweeps is simulated and processed in every run (cli/test_plan.py)"
)
def test_what_is_promised_is_what_sweeps_on_the_same_tire_say() -> None:
    choice = least_of_40_mm()
    design, rng = choice.design, np.random.default_rng(3)
    density = earlier().rows_density(LOAD, "forward")
    reached = []
    recorded = []
    for place, V in enumerate(design.speeds_m_s):
        t = np.arange(0.0, design.load_s(place), 0.02)
        rate = design.steering.rate_rad_m * V

        def steered(at: np.ndarray, rate: float = rate) -> np.ndarray:
            return triangle(at, amplitude=design.steering.amplitude_rad, rate=rate)

        recorded.append((V, t, steered(t), relaxing(t, steered, length=PRIOR_M[1], V=V, form="constant")))
    for _ in range(8):
        fits = []
        for V, t, SA, force in recorded:
            FY = force + math.sqrt(density / 0.02) * rng.standard_normal(len(t))
            fits.append(fit_sweep(sweep(t, SA, FY, V=V, load=LOAD, name=str(V)), VIRTUAL.sweeping))
        number = relaxation_length([fit for fit in fits if fit], load_N=LOAD, owner="m", test="t")
        assert number is not None
        reached.append(dict(number.by_source())["noise in time"])
    promised = next(reach for reach in choice.reaches if reach.value == pytest.approx(PRIOR_M[1]))
    assert np.mean(reached) == pytest.approx(dict(promised.sources)["noise in time"], rel=0.3)


@pytest.mark.parametrize(
    ("text", "own", "rule"),
    [
        ("relaxation_length", VIRTUAL, "plan-demand"),
        ("relaxation_length=40 mm", load_machine("m15"), "plan-demand"),
        ("relaxation_length=40 mm", machine(speeds_m_s=(2.0, 2.0)), "plan-infeasible"),
        ("relaxation_length=40 mm", machine(steer_rates_rad_s=(1.0, 2.0)), "plan-infeasible"),
    ],
)
def test_what_cannot_be_planned_is_refused(text: str, own: Machine, rule: str) -> None:
    with pytest.raises(ConfigError) as caught:
        least(text, own)
    assert caught.value.rule == rule
    assert caught.value.next_step


def test_the_cost_of_sweeps_by_hand() -> None:
    choice = least_of_40_mm()
    design, tread = choice.design, Tread.of(VIRTUAL, (earlier(),))
    shown = planned_sweeps(choice, (earlier(),), tread)
    assert 60 * shown.minutes == pytest.approx(choice.seconds)
    rolled = design.steering.cycle_m * sum(design.cycles)
    # A force C a at the angle a slides by C a^2 a metre, C A^2 / 3 in the mean; FY falls off a little.
    C = abs(float(np.diff(earlier().force([-0.01, 0.01], LOAD, "forward"))[0]) / 0.02)
    by_hand = C * design.steering.amplitude_rad**2 / 3 * rolled
    assert energy_J(design, (earlier(),)) == pytest.approx(by_hand, rel=0.15)
    assert shown.sliding_kJ == pytest.approx(energy_J(design, (earlier(),)) / 1e3)
    for limits in ({"energy_J": 1.0}, {"rise_K": 1e-6}):
        with pytest.raises(ConfigError, match="alone go beyond a limit"):
            refuse_beyond(shown, dataclasses.replace(tread, **limits), math.inf)
    with pytest.raises(ConfigError, match="alone go beyond a limit"):
        refuse_beyond(shown, tread, 0.5)
    refuse_beyond(shown, tread, math.inf)
