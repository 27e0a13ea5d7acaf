"""How effects are written: what is understood, and what is refused with all parts."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import toolkit
from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.simulation.effect_text import parse_effect
from toolkit.simulation.plan import read_plan, with_effects

MACHINE = load_machine("m15-virtual")
EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"


def one(text):
    made = parse_effect(text, MACHINE)
    assert len(made) == 1
    return made[0]


SIGMA = {"relaxation_length": 0.5, "falling": 0.0, "with_load": 1.0}


@pytest.mark.parametrize(
    ("text", "channel", "parameters"),
    [
        ("relaxation=0.5m", None, SIGMA),
        ("relaxation=500mm", None, SIGMA),
        ("relaxation=0.5", None, SIGMA),
        ("relaxation.relaxation_length=0.5 m", None, SIGMA),
        ("relaxation = relaxation_length:5e-1m", None, SIGMA),
        ("zero_offset.D51=0.002mV/V", "D51", {"offset": 0.002}),
        ("zero_offset.D51=2e-6 V/V", "D51", {"offset": 0.002}),
        ("zero_offset.FY=10lbf", "FY", {"offset": 44.482216152605}),
        ("zero_drift.E5=-0.001 mV/V/min", "E5", {"rate": -0.001}),
        ("creep.D52=fraction:1%,time_constant:2min", "D52", {"fraction": 0.01, "time_constant": 120.0}),
        ("channel_sign.E5", "E5", {}),
        ("steer_offset=0.3", None, {"offset": 0.3}),
        ("steer_offset=0.005235987755982989rad", None, {"offset": 0.3}),
        ("steer_compliance=5e-5rad/(N*m)", None, {"compliance": 5e-5}),
        ("turn_slip=300 N*m", None, {"force": 300.0}),
        ("channel_delay.FY=-20 ms", "FY", {"delay": -0.02}),
        ("unit_error.FZ=lbf read as N", "FZ", {"factor": 1 / 4.4482216152605}),
        ("drum_curvature=15%", None, {"reduction": 0.15, "moment_exponent": 1.5}),
        ("pressure_change=-2 psi", None, {"pressure_error": -13.789514}),
    ],
)
def test_values_in_any_unit_of_their_dimension(text, channel, parameters):
    made = one(text)
    assert made.channel == channel
    assert made.values == {name: pytest.approx(value, rel=1e-6) for name, value in parameters.items()}


def test_without_a_channel_every_cell_is_meant():
    assert [each.channel for each in parse_effect("zero_offset=0.01", MACHINE)] == ["D51", "D52", "E5"]
    assert one("drum_runout=40").channel == "FZ"
    assert one("nonuniformity=40").channel == "FY"


def test_two_signals_and_a_record():
    leak, swap = one("crosstalk.FZ.FY=0.01"), one("channel_swap.D51.D52")
    assert (leak.source, leak.channel, leak.values) == ("FZ", "FY", {"coefficient": 0.01})
    assert (swap.source, swap.channel) == ("D51", "D52")
    assert one("wrong_calibration=m15-r1").source == "m15-r1"


def test_what_is_not_given_is_off_or_usual():
    heat = one("thermal_friction=peak_per_K:-0.004").values
    assert (heat["peak_per_K"], heat["stiffness_per_K"]) == (-0.004, 0.0)
    assert heat["time_constant"] > 0
    assert one("nonuniformity.FY=amplitude_2:5N").values["amplitude_1"] == 0.0


def test_conditions():
    made = one("load_lag@order:1+2=1.5s")
    assert made.condition == ("order", ("1", "2"))
    assert made.acts_under({"order": "2"})
    assert not made.acts_under({"order": "3"})
    assert not made.acts_under({})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("relaxaton=0.5m", "did you mean 'relaxation'?"),
        ("relaxation", "no number"),
        ("relaxation=", "no number"),
        ("relaxation=x", "no number"),
        ("relaxation=nan", "no number"),
        ("relaxation=infm", "no number"),
        ("relaxation=1e999m", "no number"),
        ("steer_offset=1e200deg", "no number"),
        ("relaxation=0.5s", "another dimension"),
        ("relaxation=0.5blorps", "unit"),
        ("relaxation=0.5degC", "another dimension"),
        ("relaxation=-0.5m", "from 0 to 5 m"),
        ("relaxation.relaxation_lenght=0.5", "did you mean 'relaxation_length'?"),
        ("relaxation=relaxation_lenght:0.5", "did you mean 'relaxation_length'?"),
        ("relaxation=0.5m,0.6m", "given twice"),
        ("relaxation.D51=0.5m", "whole machine"),
        ("channel_swap.D51", "two signals"),
        ("wrong_calibration.FY=m15-r1", "whole machine"),
        ("zero_offset.D53=1", "D52"),
        ("zero_offset.D51.D52=1", "one signal"),
        ("zero_offset.D51=1N", "another dimension"),
        ("zero_offset.SA=1deg", "SA"),
        ("crosstalk=0.01", "two signals"),
        ("crosstalk.FZ=0.01", "two signals"),
        ("crosstalk.FZ.FZ=0.01", "two signals"),
        ("crosstalk.D51.FY=0.01", "cannot join"),
        ("channel_swap.D51.FY", "cannot join"),
        ("channel_sign.E5=1", "present or absent"),
        ("wrong_calibration", "not named"),
        ("coulomb_friction=1", "equation of motion"),
        ("load_lag@order=1s", "condition"),
        ("load_lag@=1s", "condition"),
        ("", "unknown effect"),
    ],
)
def test_what_cannot_be_is_told_with_all_parts(text, told):
    with pytest.raises(ConfigError) as caught:
        parse_effect(text, MACHINE)
    error = caught.value
    assert told in str(error)
    assert f"--effect {text}" in str(error.where)
    assert all((error.got, error.expected, error.next_step, error.rule)) or not text
    assert error.exit_code == 2


def test_a_plan_knows_its_tire_and_its_runs():
    published = read_plan(EXAMPLES / "test_plan.toml")
    with pytest.raises(ConfigError, match="does not depend on its pressure"):
        with_effects(published, ["pressure_change=10kPa"])
    assert with_effects(published, ["camber_offset=0.2"]).effects
    with pytest.raises(ConfigError) as caught:
        with_effects(published, ["load_lag@order:7=1s"])
    assert "rotation:forward" in str(caught.value.expected)
    assert with_effects(read_plan(EXAMPLES / "continuous_plan.toml"), ["pressure_change=10kPa"]).effects


@given(st.text(max_size=40))
def test_any_text_is_an_effect_or_a_clear_error(text):
    with contextlib.suppress(ConfigError):
        assert parse_effect(text, MACHINE)


@given(
    st.sampled_from(["relaxation", "zero_offset.D51", "creep", "crosstalk.FZ.FY", "load_lag@order:1"]),
    st.text(alphabet="0123456789.eE+-:, mNVs/%()*^nai_", max_size=30),
)
def test_any_value_is_a_number_or_a_clear_error(name, value):
    with contextlib.suppress(ConfigError):
        assert parse_effect(f"{name}={value}", MACHINE)
