"""Effects on one channel, each alone, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.rig import setting
from toolkit.effects.catalogue import effect
from toolkit.effects.catalogue.unit_error import factors
from toolkit.units import unit

T = np.linspace(0.0, 20.0, 4001)
WAVE = 2.0 * np.sin(0.8 * T) - 0.3


def act(name, y=WAVE, *, t=T, **values):
    return effect(name).channel(y, values, setting(t))


def test_constants_factors_and_signs():
    np.testing.assert_allclose(act("zero_offset", offset=0.25) - WAVE, 0.25, atol=1e-12)
    np.testing.assert_allclose(act("sensitivity_error", gain_error=0.02), 1.02 * WAVE)
    np.testing.assert_allclose(act("unit_error", factor=4.448), 4.448 * WAVE)
    np.testing.assert_array_equal(act("channel_sign"), -WAVE)
    np.testing.assert_array_equal(act("rectification"), np.abs(WAVE))
    np.testing.assert_allclose(
        act("nonlinearity", quadratic=0.1, cubic=-0.2), WAVE + 0.1 * WAVE**2 - 0.2 * WAVE**3
    )


@pytest.mark.parametrize("name", ["channel_swap", "wrong_calibration"])
def test_another_signal_takes_its_place(name):
    np.testing.assert_array_equal(act(name), 3.0 * np.sin(T))


def test_crosstalk_is_a_share_of_another_signal():
    np.testing.assert_allclose(act("crosstalk", coefficient=0.03) - WAVE, 0.09 * np.sin(T), atol=1e-12)


def test_drifts_are_linear_in_time_and_temperature_and_know_no_load():
    for y in (WAVE, 10 * WAVE):
        np.testing.assert_allclose(act("zero_drift", y, rate=0.6) - y, 0.01 * T, atol=1e-12)
        # 0.2 K/s in the rig, counted from the case's first row
        np.testing.assert_allclose(act("thermal_drift", y, coefficient=0.5) - y, 0.1 * T, atol=1e-12)


def test_a_later_run_counts_its_temperature_from_the_first_one():
    here = setting(T, channels={"T": 300.0 + 0 * T}, first={"T": 290.0})
    made = effect("thermal_drift").channel(WAVE, {"coefficient": 0.5}, here)
    np.testing.assert_allclose(made - WAVE, 5.0, atol=1e-12)


def test_a_delay_is_the_same_time_at_every_rate_and_may_be_negative():
    for rate in (0.5, 2.0):
        for delay in (0.3, -0.3):
            made = act("channel_delay", np.sin(rate * T), delay=delay)
            inner = slice(200, -200)
            np.testing.assert_allclose(made[inner], np.sin(rate * (T[inner] - delay)), atol=1e-4)


def test_a_filter_has_its_gain_and_phase():
    rate, tau = 3.0, 0.4
    made = act("filter_lag", np.sin(rate * T), time_constant=tau)
    settled = slice(1500, None)
    basis = np.column_stack([np.sin(rate * T), np.cos(rate * T)])[settled]
    a, b = np.linalg.lstsq(basis, made[settled], rcond=None)[0]
    # 1 / (1 + i omega tau)
    assert a == pytest.approx(1 / (1 + (rate * tau) ** 2), abs=1e-4)
    assert b == pytest.approx(-rate * tau / (1 + (rate * tau) ** 2), abs=1e-4)
    assert act("filter_lag", np.full_like(T, 5.0), time_constant=tau) == pytest.approx(5.0)


def test_creep_goes_on_after_a_step():
    step = np.where(T > 0, 1.0, 0.0)
    made = act("creep", step, fraction=0.02, time_constant=4.0)
    # The step is a ramp over the first interval of 5 ms.
    np.testing.assert_allclose(made[1:], 1 + 0.02 * (1 - np.exp(-(T[1:] - 0.0025) / 4.0)), atol=1e-6)


@pytest.mark.parametrize("rate", [0.5, 5.0])
def test_a_sharp_hysteresis_is_a_band_of_its_full_height_at_any_rate(rate):
    y = np.sin(rate * T)
    made = act("hysteresis", y, width=0.1, reach=0.02, gain=0.0)
    later = (T > 2 * np.pi / rate) & (np.abs(y) < 0.5)
    up, down = later & (np.cos(rate * T) > 0), later & (np.cos(rate * T) < 0)
    # all gaps are wound up at once: a parallelogram whose branches are as far apart everywhere
    assert np.mean((y - made)[up]) - np.mean((y - made)[down]) == pytest.approx(0.1, rel=0.03)
    assert (y - made)[up] == pytest.approx(0.05, abs=0.004)
    assert (y - made)[down] == pytest.approx(-0.05, abs=0.004)


def test_a_hysteresis_that_reaches_over_the_whole_range_is_the_lens_of_Rayleigh():
    y = 3.0 * np.sin(T)
    made = act("hysteresis", y, width=0.1, reach=1.0, gain=0.0)
    later = T > 2 * np.pi
    up = later & (np.cos(T) > 0)
    # Rayleigh's loop: parabolas, here half their height apart from the chord
    parabola = 0.05 * (1 - (y / 3.0) ** 2)
    np.testing.assert_allclose((y - made)[up], parabola[up], atol=0.004)


def test_a_recording_that_begins_on_the_first_loading_has_the_same_hysteresis():
    y = 2.0 * np.sin(0.8 * T)
    whole = act("hysteresis", y, width=0.1, reach=1.0, gain=0.0, _span=2.0, _middle=0.0)
    late = slice(200, None)  # at 1 s, before the first reversal
    cut = act("hysteresis", y[late], t=T[late], width=0.1, reach=1.0, gain=0.0, _span=2.0, _middle=0.0)
    np.testing.assert_allclose(cut, whole[late], atol=1e-12)


def test_flat_stepped_and_dead():
    assert np.abs(act("saturation", level=1.2)).max() == 1.2
    inside = np.abs(WAVE) < 1.2
    np.testing.assert_array_equal(act("saturation", level=1.2)[inside], WAVE[inside])
    stepped = act("quantisation", step=0.25)
    np.testing.assert_array_equal(stepped / 0.25, np.round(stepped / 0.25))
    assert np.abs(stepped - WAVE).max() <= 0.125 + 1e-12
    dead = act("dead_band", width=0.4)
    assert np.all(dead[np.abs(WAVE) <= 0.2] == 0)
    out = np.abs(WAVE) > 0.2
    np.testing.assert_allclose(np.abs(WAVE[out]) - np.abs(dead[out]), 0.2, atol=1e-12)


@pytest.mark.parametrize(("name", "angle"), [("nonuniformity", 7.0 * T), ("drum_runout", 1.5 * T)])
def test_revolutions_are_locked_to_their_own_angle(name, angle):
    values = {"amplitude_1": 30.0, "phase_1": 40.0, "amplitude_2": 10.0, "phase_2": -20.0}
    made = act(name, **values) - WAVE
    expected = 30.0 * np.cos(angle + np.radians(40)) + 10.0 * np.cos(2 * angle - np.radians(20))
    np.testing.assert_allclose(made, expected, atol=1e-9)
    # over whole revolutions nothing is left
    whole = np.linspace(0.0, 2 * np.pi, 721)[:-1]
    channels = {"TIRE_ANGLE": whole, "DRUM_ANGLE": whole}
    here = setting(whole, channels=channels)
    assert effect(name).channel(np.zeros(720), values, here).mean() == pytest.approx(0, abs=1e-10)


def test_factors_of_confused_units_are_ratios_of_units():
    for text, factor in factors().items():
        if " read as " not in text:
            continue
        true, taken = text.split(" read as ")
        # the number stays and its unit is taken for another: channel over true value
        assert factor == pytest.approx(unit(taken).factor / unit(true).factor, rel=1e-9), text


def test_every_unit_of_the_one_list_may_be_taken_for_another_of_its_dimension():
    named = factors()
    assert named["lbf read as N"] == pytest.approx(1 / 4.4482216152605)
    assert named["l/min read as m^3/h"] == pytest.approx(1000 / 60)
    assert not any("degC" in text or "N read as N*m" in text for text in named)
