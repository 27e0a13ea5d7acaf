"""The thesis's three riddles on one virtual tire: the case that the simulator writes, and its answer.

Each plan of ``riddles/`` says in its head what happened in the laboratory. Sizes are those that the plan
injects; the answer must name the effect, or a class that holds it, and nothing beside it.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.simulation.case import write_case
from toolkit.simulation.plan import read_plan
from toolkit.simulation.run import simulate

RIDDLES = Path(__file__).parent / "riddles"


def answer(folder, plan):
    return diagnose(read_case(write_case(simulate(plan), folder)[0]), None).diagnosis


def told(found):
    """Return the one effect that was found, with its parameters by name."""
    assert len(found.effects) == 1, [one.name for one in found.effects]
    (effect,) = found.effects
    return effect, {one.name: one for one in effect.parameters}


def covers(parameter, truth):
    low, high = parameter.ci95
    reach = (high - low) / 2
    # 95 % twice over: four standard errors, for one fixed seed
    assert abs(parameter.value - truth) <= 2 * reach
    assert reach < 0.05 * truth


@pytest.fixture(scope="module")
def flat_table(tmp_path_factory):
    return answer(tmp_path_factory.mktemp("flat"), read_plan(RIDDLES / "flat_table.toml"))


@pytest.mark.campaign("the slowest of the riddles: it is asked of a brush in every run")
def test_a_makers_flat_table_against_the_lower_values_of_a_drum(flat_table):
    effect, parameters = told(flat_table)
    assert "drum_curvature" in (effect.name, *effect.equivalent_to)
    assert effect.stage == "road"
    covers(parameters["reduction"], 0.15)
    # what the free factors of friction and stiffness alone leave is several times the noise
    FY = next(one for one in flat_table.fit.held_out if one.channel == "FY")
    assert FY.augmented_rmse < 1.2 * FY.noise_floor < 0.5 * FY.refitted_rmse


@pytest.mark.campaign(
    "a null of the virtual machine: another one, and the brush without its drum, hold in every run"
)
def test_the_same_tire_without_the_drum_misses_nothing(tmp_path):
    plan = dataclasses.replace(read_plan(RIDDLES / "flat_table.toml"), effects=())
    found = answer(tmp_path, plan)
    assert found.verdict == "nothing"
    assert found.effects == ()


@pytest.mark.campaign(
    "a whole diagnosis of the virtual machine: a tire of bristles asks a riddle in every run"
)
def test_sandpaper_against_steel(tmp_path):
    found = answer(tmp_path, read_plan(RIDDLES / "surfaces.toml"))
    effect, parameters = told(found)
    assert "surface_friction" in (effect.name, *effect.equivalent_to)
    covers(parameters["mu_factor"], 0.85)
    assert parameters["mu_factor"].runs == ("runs/run03.csv", "runs/run04.csv")  # those on steel


@pytest.mark.campaign(
    "a whole diagnosis of the virtual machine: a tire of bristles asks a riddle in every run"
)
def test_five_repeats_of_which_two_had_another_actuator_speed(tmp_path):
    found = answer(tmp_path, read_plan(RIDDLES / "repeats.toml"))
    effect, parameters = told(found)
    assert {"load_lag", "viscoelastic_settling"} & {effect.name, *effect.equivalent_to}
    if effect.name == "load_lag":
        covers(parameters["time_constant"], 1.5)
    # the first two repeats, forward and reversed
    assert parameters["time_constant"].runs == tuple(f"runs/run{n:02d}.csv" for n in (1, 2, 3, 4))


def test_the_first_two_repeats_differ_in_conicity_and_plysteer_and_nobody_else():
    """The riddle itself: half sum and half difference of FY, forward and reversed, in the settled blocks."""
    plan = read_plan(RIDDLES / "repeats.toml")
    plan = dataclasses.replace(
        plan, runs=tuple(dataclasses.replace(run, slip_angles_rad=(0.0,)) for run in plan.runs)
    )
    files = simulate(plan).files
    pulls = []
    for forward, reverse in zip(files[::2], files[1::2], strict=True):
        F, R = (one.truth[-1].FY_N for one in (forward, reverse))
        pulls.append(((F + R) / 2, (F - R) / 2))
    slow, quick = pulls[:2], pulls[2:]
    assert max(abs(a - b) for one in quick for a, b in zip(one, quick[0], strict=True)) < 1e-9
    assert all(abs(one[1] - quick[0][1]) > 1.0 for one in slow)
