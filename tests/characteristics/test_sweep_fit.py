"""The length by which FY lags a steered slip angle, against tires that are integrated apart."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.characteristics.sweep_factory import STIFFNESS, Form, relaxing, string, sweep, triangle
from tests.conftest import SHARED_DATA
from toolkit.characteristics.sweep_fit import fit_sweep
from toolkit.machine.protocol import Delay, Sweeping

V, RATE, AMPLITUDE = 2.128, np.radians(1.0), np.radians(1.5)
T = np.arange(0.0, 24.0, 0.02)
TTC = SHARED_DATA / "ttc_cornering" / "cornering_IA0_P83kPa.csv"
DELAY = Sweeping(
    speeds_m_s=(1.0, 4.0), steer_rates_rad_s=(0.01, 0.1), source="test",
    delay=Delay(value_s=0.0, u_s=0.002, source="test"),
)  # fmt: skip


def steered(t: np.ndarray) -> np.ndarray:
    return triangle(t, amplitude=AMPLITUDE, rate=RATE)


@pytest.mark.parametrize("form", ["constant", "spring"])
@pytest.mark.parametrize("length", [0.2, 0.5, 0.8])
def test_the_length_of_a_relaxing_tire(length: float, form: Form) -> None:
    fit = fit_sweep(sweep(T, steered(T), relaxing(T, steered, length=length, V=V, form=form)), DELAY)
    assert fit is not None
    assert fit.length_m == pytest.approx(length, rel=0.035)
    assert abs(fit.length_m - length) < 2 * fit.form_m + 2 * fit.u_m
    assert fit.form_m < 0.03 * length + 0.002
    assert fit.stiffness_N_rad == pytest.approx(STIFFNESS, rel=0.01)
    assert (fit.delay_s, fit.delay_u_s) == (0.0, 0.002)


def test_a_stretched_string_has_half_its_contact_beside_its_length() -> None:
    # By hand: behind a ramp the string is late by sigma + a, whatever its stiffness.
    FY = string(T, steered, length=0.4, half_contact=0.07, V=V)
    fit = fit_sweep(sweep(T, steered(T), FY), None)
    assert fit is not None
    assert fit.length_m == pytest.approx(0.47, rel=0.015)
    assert abs(fit.length_m - 0.47) < 2 * fit.form_m
    assert fit.delay_s is None


def test_a_delay_of_the_channel_adds_what_is_rolled_in_it() -> None:
    for tau in (0.02, -0.02):
        FY = relaxing(T, steered, length=0.4, V=V, form="constant")
        late = np.interp(T - tau, T, FY)
        fit = fit_sweep(sweep(T, steered(T), late), None)
        assert fit is not None
        assert fit.length_m == pytest.approx(0.4 + V * tau, abs=0.005)


def test_a_slip_angle_that_is_late_gives_a_negative_length() -> None:
    FY = np.interp(T + 0.03, T, -STIFFNESS * steered(T))
    fit = fit_sweep(sweep(T, steered(T), FY), None)
    assert fit is not None
    assert fit.length_m == pytest.approx(-V * 0.03, abs=0.005)


def test_without_steering_there_is_no_length() -> None:
    angle, force = np.random.default_rng(1).standard_normal((2, len(T)))
    assert fit_sweep(sweep(T, 0.01 + 1e-5 * angle, -600 + 20 * force), None) is None


WHITE = pytest.mark.campaign("white noise, which asks less than the coloured one of every run")


MORE = pytest.mark.campaign("twice as many draws")


@pytest.mark.campaign("dozens of drawn sweeps: lengths of known tires lie within their U in every run")
@pytest.mark.parametrize(
    ("rho", "draws"),
    [pytest.param(0.0, 40, marks=WHITE), (0.9, 20), pytest.param(0.9, 40, marks=MORE)],
)
def test_u_is_the_scatter_of_many_under_noise_of_any_colour(rho: float, draws: int) -> None:
    FY, rng = (
        relaxing(T, steered, length=0.5, V=V, form="constant"),
        np.random.default_rng([25, int(10 * rho)]),
    )
    fits = []
    for _ in range(draws):
        noise = rng.standard_normal(len(T) + 50)
        for i in range(1, len(noise)):
            noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
        fits.append(fit_sweep(sweep(T, steered(T), FY + 25 * noise[50:]), None))
    lengths = np.array([fit.length_m for fit in fits if fit])
    u = np.array([fit.u_m for fit in fits if fit])
    assert len(lengths) == draws
    # A standard deviation of 20 values is known to 16 %, of 40 to 11 %.
    assert float(np.sqrt(np.mean(u**2))) == pytest.approx(float(np.std(lengths, ddof=1)), rel=0.25)


def test_gaps_and_other_rows_between_do_not_move_it() -> None:
    # Only the passes near zero of a wide sweep: each begins with what the tire brings along.
    def wide(t: np.ndarray) -> np.ndarray:
        return triangle(t, amplitude=np.radians(4.0), rate=2 * RATE)

    t = np.arange(0.0, 40.0, 0.02)
    FY, SA = relaxing(t, wide, length=0.5, V=V, form="spring"), wide(t)
    rows = np.flatnonzero(np.abs(SA) <= np.radians(1.5))
    parts = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) > 1) + 1)
    gaps = tuple(slice(int(part[0]), int(part[-1]) + 1) for part in parts)
    fit = fit_sweep(sweep(t[rows], SA[rows], FY[rows], stretches=gaps), None)
    assert fit is not None
    assert fit.length_m == pytest.approx(0.5, abs=0.02)


def test_the_scale_of_force_and_angle_is_none_of_its_business() -> None:
    FY = relaxing(T, steered, length=0.5, V=V, form="constant")
    plain, scaled = (
        fit_sweep(sweep(T, steered(T), FY), None),
        fit_sweep(sweep(T, 2 * steered(T), 7 * FY), None),
    )
    assert plain is not None
    assert scaled is not None
    assert scaled.length_m == pytest.approx(plain.length_m, rel=1e-6)
    assert dataclasses.replace(scaled, stiffness_N_rad=0.0).rows == len(T)


@pytest.mark.skipif(not TTC.exists(), reason="the recording of the TTC is not here")
def test_a_real_sweep_whose_channels_have_a_delay_of_their_own() -> None:
    # A flat belt at 40.2 km/h and 3.2 deg/s. A tire of 0.3 m would be 27 ms late; the crossings of zero, up
    # and down, are 5 ms apart at most, by lines through each pass, which know no drift but its mean. The
    # channels' own delay takes the rest: one speed tells no length.
    table = np.genfromtxt(TTC, delimiter=",", names=True)
    for first in range(0, len(table), 1249):
        part = table[first : first + 1249]
        SA, t, speed = np.radians(part["SA_deg"]), part["ET_s"], part["V_kph"] / 3.6
        rows = np.flatnonzero(np.abs(SA) <= np.radians(1.0))
        pieces = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) > 1) + 1)
        gaps = tuple(slice(int(p[0]), int(p[-1]) + 1) for p in pieces if len(p) > 20)
        fit = fit_sweep(sweep(t[rows], SA[rows], part["FY_N"][rows], V=speed[rows], stretches=gaps), None)
        assert fit is not None
        up, down = ([], [])
        for piece in gaps:
            line = np.polyfit(SA[rows][piece], part["FY_N"][rows][piece], 1)
            (up if SA[rows][piece][-1] > SA[rows][piece][0] else down).append(-line[1] / line[0])
        by_lines = (np.mean(up) - np.mean(down)) / 2 / fit.steer_rate_rad_s * fit.speed_m_s
        assert fit.length_m == pytest.approx(by_lines, abs=0.08)
        assert abs(fit.length_m) < 0.06
