"""There and back: an effect that the virtual machine is given is the one that the engine names.

Five recordings of two steering rates, two speeds, both directions and a turned tire; inputs are exact, so
that the noise of FY and MZ is the cells'. In the ordinary run a riddle stands for all (`test_case_riddles`),
beside the test that nothing is put in; effects are a campaign, and `make proof` takes every one of them.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.simulation.case import write_case
from toolkit.simulation.plan import read_plan, with_effects
from toolkit.simulation.plan_file import CasePlan
from toolkit.simulation.run import simulate

PLAN = Path(toolkit.__file__).parent / "examples" / "virtual" / "continuous_plan.toml"
ALL = (
    "relaxation=0.4m", "zero_offset.FY=5N", "crosstalk.FZ.FY=0.01", "backlash=0.2deg",
    "steer_compliance=3e-5", "steer_offset=0.1deg", "camber_offset=0.5deg", "load_lag=0.4s",
    "plysteer=0.1deg",
    "conicity=30N",
    "thermal_friction=peak_per_K:-0.01,stiffness_per_K:-0.005", "pressure_change=-15kPa", "wear=0.001",
    "load_friction=-0.1", "speed_friction=0.5", "viscoelastic_settling=fraction:0.03,time_constant:4s",
    "nonuniformity.FY=20N", "turn_slip=800", "drum_curvature=0.1", "surface_friction=0.9",
    "drum_runout.FY=20N", "channel_delay.FY=30ms", "filter_lag.FY=0.1s", "saturation.FY=3000N",
    "quantisation.FY=100N", "dead_band.FY=100N", "rectification.FY", "channel_sign.MZ", "channel_swap.FY.MZ",
    "unit_error.FY=N read as lbf", "zero_drift.FY=5", "thermal_drift.FY=1",
    "creep.FY=fraction:0.02,time_constant:5s", "hysteresis.FY=50N", "nonlinearity.FY=cubic:3e-9",
    "sensitivity_error.MZ=2%",
)  # fmt: skip


@pytest.fixture(scope="module")
def plan():
    read = read_plan(PLAN)
    steps = {"slip_angles_rad": tuple(np.radians([2.0, -3.0, 8.0, -8.0, 0.0])), "loads_N": (2500.0, 5500.0)}
    return dataclasses.replace(
        read,
        runs=tuple(dataclasses.replace(read.runs[i], dwell_s=0.8, **steps) for i in (0, 1, 2, 4, 6)),
        acquisition=dataclasses.replace(
            read.acquisition, rows_per_revolution=8, SA_noise_rad=0.0, FZ_noise_N=0.0
        ),
        motion=dataclasses.replace(read.motion, ambient_drift_K_s=0.02),
    )


def answer(folder, plan):
    return diagnose(read_case(write_case(simulate(plan), folder)[0]), None).diagnosis


@pytest.mark.campaign("a whole diagnosis for each of the effects: the riddles name one of the same machine")
@pytest.mark.parametrize("text", ALL)
def test_what_was_put_in_is_named(plan, tmp_path, text):
    given = with_effects(plan, [text])
    if text.startswith("load_lag"):  # judged on the forces, from the command alone
        given = dataclasses.replace(given, case=CasePlan(load="commanded"))
    (switched,) = given.effects
    found = answer(tmp_path, given)
    assert found.effects, found.verdict
    effect = found.effects[0]
    assert switched.effect.name in (effect.name, *effect.equivalent_to)
    if effect.name == switched.effect.name:
        for one in effect.parameters:
            true = switched.values.get(one.name)
            if one.ci95 is None or not true:
                continue
            reach = (one.ci95[1] - one.ci95[0]) / 2
            # 95 % twice over for one fixed seed, and the digits of the CSV
            assert abs(one.value - true) <= 2 * reach + 2e-3 * abs(true), one.name


def test_nothing_is_named_where_nothing_was_put_in(plan, tmp_path):
    found = answer(tmp_path, plan)
    assert (found.verdict, found.effects) == ("nothing", ())
