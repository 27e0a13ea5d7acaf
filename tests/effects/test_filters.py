"""Delays and filters of sampled signals against the closed forms of a sine and a ramp."""

import numpy as np
import pytest

from toolkit.effects.filters import delayed, filtered

W = 2 * np.pi * 3.0  # 3 Hz sampled at 50 Hz: one seventeenth of a turn from row to row


def rows():
    rng = np.random.default_rng(3)
    return np.sort(np.arange(400) * 0.02 + rng.uniform(-0.002, 0.002, 400))


@pytest.mark.parametrize("delay", [0.004, 0.01, 0.031, -0.01])
def test_a_delayed_sine_keeps_its_size(delay):
    t = rows()
    inside = (t - delay > t[2]) & (t - delay < t[-3])
    made = delayed(t, np.sin(W * t), delay)
    # straight lines would lose (W h)^2/8 = 1.8 % in the middle between rows
    assert np.abs(made - np.sin(W * (t - delay)))[inside].max() < 4e-3


@pytest.mark.parametrize("tau", [0.005, 0.02, 0.1, 0.5])
def test_a_filtered_sine_is_smaller_and_late_by_the_closed_form(tau):
    t = rows()
    made = filtered(t, np.sin(W * t), tau)
    size, angle = 1 / np.hypot(1, W * tau), np.arctan(W * tau)
    settled = t > t[0] + 8 * tau
    assert np.abs(made - size * np.sin(W * t - angle))[settled].max() < 4e-3


def test_a_ramp_is_late_by_the_time_constant_and_no_delay_is_the_signal():
    t = rows()
    assert filtered(t, 2.0 * t, 0.05)[-1] == pytest.approx(2.0 * (t[-1] - 0.05), abs=1e-9)
    assert np.array_equal(delayed(t, np.sin(t), 0.0), np.sin(t))
    assert delayed(t[:0], t[:0], 0.1).size == 0
    assert filtered(t[:2], t[:2], 0.1).shape == (2,)


def test_a_gap_stays_a_gap():
    t = rows()
    x = np.sin(W * t)
    x[100] = np.nan
    made = delayed(t, x, 0.01)
    assert np.isnan(made).sum() in (1, 2)
