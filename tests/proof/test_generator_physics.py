"""The generator's own physics against limits, conserved quantities and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from proof import dynamic_cases, instruments, noise, ode, tire_steady, tire_truth
from proof.model import Noise, Run
from proof.simulators import brush as brush_simulator

RNG = np.random.default_rng(11)
BRUSH = tire_steady.draw_brush(RNG)
MAGIC = tire_steady.draw_magic_formula(RNG, pressure=False)
ONE = tire_steady.Scales()


def test_the_bristles_slope_is_two_cp_a_squared() -> None:
    # Pacejka (2012), eq. 3.14: C_Fa = 2 c_p a^2, and the aligning stiffness is a/3 of it
    c = BRUSH.c
    h = 1e-6
    fy, mz = BRUSH.forces(np.array([-h, h]), np.full(2, c["FZ0"]), ONE)
    slope = 2 * c["cp"] * c["a0"] ** 2
    assert -(fy[1] - fy[0]) / (2 * h) == pytest.approx(slope, rel=1e-3)
    assert (mz[1] - mz[0]) / (2 * h) == pytest.approx(c["trail"] * slope * c["a0"] / 3, rel=1e-3)


def test_the_bristles_slide_at_mu_fz_without_moment() -> None:
    c = BRUSH.c
    fy, mz = BRUSH.forces(np.array([0.6]), np.array([c["FZ0"]]), ONE)
    assert -fy[0] == pytest.approx(c["mu"] * c["FZ0"], rel=1e-4)
    assert abs(mz[0]) < 1e-3 * c["mu"] * c["FZ0"] * c["a0"]


def test_the_bristles_agree_with_the_integral_over_the_patch() -> None:
    c, slip = BRUSH.c, math.radians(2.0)
    a, mu, fz = c["a0"], c["mu"], c["FZ0"]

    def shear(x: float) -> float:
        return min(c["cp"] * math.tan(slip) * (a - x), mu * 0.75 * fz / a * (1 - (x / a) ** 2))

    fy, _ = BRUSH.forces(np.array([slip]), np.array([fz]), ONE)
    assert -fy[0] == pytest.approx(quad(shear, -a, a, limit=200)[0], rel=2e-4)


def test_the_closed_brush_of_the_cases_is_the_limit_of_the_bristles() -> None:
    sa = np.linspace(-9, 9, 91)
    load = np.full(sa.size, 3000.0)
    closed = brush_simulator.simulate(pd.DataFrame({"SA": sa, "FZ": load}), dict(BRUSH.c))
    fy, mz = tire_steady.BristleTire(BRUSH.c, 2000).forces(np.radians(sa), load, ONE)
    assert np.abs(fy - closed["FY"]).max() < 1e-5 * 3000
    assert np.abs(mz - closed["MZ"]).max() < 1e-4 * 30


def test_the_magic_formula_has_the_slope_and_the_peak_that_its_coefficients_say() -> None:
    c = {**MAGIC.c, "PHY1": 0.0, "PHY2": 0.0, "PVY1": 0.0, "PVY2": 0.0}
    tire = tire_steady.MagicFormulaTire(c)
    stiffness = -c["PKY1"] * c["FNOMIN"] * math.sin(2 * math.atan(1 / c["PKY2"]))
    assert tire_steady.cornering_stiffness(tire, c["FNOMIN"]) == pytest.approx(stiffness, rel=1e-4)
    fy, _ = tire.forces(np.radians(np.linspace(0, 60, 2000)), np.full(2000, c["FNOMIN"]), ONE)
    assert -fy.min() == pytest.approx(c["PDY1"] * c["FNOMIN"], rel=1e-3)


def test_a_carcass_spring_relaxes_over_its_length_at_small_slip() -> None:
    n, step, length = 4000, 0.001, 0.5
    slip = np.full(n, math.radians(0.05))
    slip[0] = 0.0
    out = tire_truth.carcass(slip, np.full(n, 4000.0), np.full(n, step), length, MAGIC)
    reached = out[round(length / step)] / slip[-1]
    assert reached == pytest.approx(1 - math.exp(-1), abs=0.01)


@pytest.mark.parametrize("length", [0.02, 0.1, 0.5])
def test_behind_a_carcass_spring_a_ramp_comes_late_by_the_relaxation_length(length: float) -> None:
    """(sigma/V) a' + a = slip gives a ramp late by the distance sigma, however fine the steps are."""
    step = 0.014
    slip = np.radians(1e-3 * step * np.arange(1000))
    out = tire_truth.carcass(slip, np.full(1000, 4000.0), np.full(1000, step), length, MAGIC)
    late = float(slip[-1] - out[-1]) / (slip[1] - slip[0]) * step
    assert late == pytest.approx(length, rel=0.03)


def test_a_carcass_spring_never_overshoots_and_settles() -> None:
    slip = np.radians(np.concatenate([np.zeros(10), np.full(5000, 6.0)]))
    out = tire_truth.carcass(slip, np.full(slip.size, 4000.0), np.full(slip.size, 0.002), 0.4, MAGIC)
    assert np.all(np.diff(out) >= -1e-15)
    assert out[-1] == pytest.approx(slip[-1], rel=1e-6)


def test_a_slow_actuator_follows_a_ramp_late_by_its_time_constant_at_nominal_load() -> None:
    t = np.arange(4000) / 200
    force = tire_truth.actuator(t, 3990 + 1.0 * t, 0.4, 4000.0)
    assert 3990 + t[2000] - force[2000] == pytest.approx(0.4, rel=1e-3)
    # a progressive spring answers faster under load
    loaded = tire_truth.actuator(t, 7990 + 1.0 * t, 0.4, 4000.0)
    assert 7990 + t[2000] - loaded[2000] == pytest.approx(0.4 / 1.04, rel=1e-3)
    # and an actuator without lag gives what was commanded
    assert np.abs(tire_truth.actuator(t, force, 1e-6, 4000.0) - force).max() < 1e-4


def test_a_wheel_leans_and_pulls_to_the_same_side_whichever_way_the_drum_turns() -> None:
    tire = tire_steady.draw_magic_formula(RNG, pressure=False, camber=True, symmetric=True)
    t = np.arange(200) / 160
    still = {"t": t, "SA": np.zeros(200), "FZ": np.full(200, 4000.0), "V": np.full(200, 2.0)}
    found = {}
    for rotation in ("forward", "reverse"):
        run = Run(name="run01.csv", fine=still, rows=t, conditions={"rotation": rotation})
        found[rotation] = tire_truth.lateral(run, tire, ONE, {"camber_offset": {"angle": 1.0}})
    assert 30 < found["forward"]["FY"][0] < 90  # some 55 N/deg, to the right for a lean to the right
    assert found["reverse"]["FY"] == pytest.approx(found["forward"]["FY"])
    # mirrored in the plane across the motion: the moment about the vertical changes its sign
    assert found["reverse"]["MZ"] == pytest.approx(-found["forward"]["MZ"])
    assert abs(found["forward"]["MZ"][0]) > 0.1


def test_half_a_turn_about_the_vertical_turns_the_force_of_a_twisting_patch_round() -> None:
    """The rate of turn stays, travel and lateral force change their signs."""
    tire, t = tire_steady.draw_magic_formula(RNG, pressure=False, symmetric=True), np.arange(50) / 160
    steered = {"t": t, "SA": 4.0 * t, "FZ": np.full(50, 4000.0), "V": np.full(50, 2.0)}
    twisted = {}
    for rotation in ("forward", "reverse"):
        run = Run(name="r", fine=steered, rows=t, conditions={"rotation": rotation})
        with_it, without = (
            tire_truth.lateral(run, tire, ONE, e)["FY"] for e in ({"turn_slip": {"force": 900.0}}, {})
        )
        twisted[rotation] = with_it - without
    assert twisted["forward"] == pytest.approx(-900.0 * math.radians(4.0) / 2.0)
    assert twisted["reverse"] == pytest.approx(-twisted["forward"])


def test_conicity_follows_the_tire_when_it_is_turned_round_and_camber_stays_with_the_machine() -> None:
    tire = tire_steady.draw_magic_formula(RNG, pressure=False, camber=True, symmetric=True)
    t = np.arange(50) / 160
    still = {"t": t, "SA": np.zeros(50), "FZ": np.full(50, 4000.0), "V": np.full(50, 2.0)}

    def force(mounting: str, e: dict[str, dict[str, float]]) -> float:
        run = Run(name="r", fine=still, rows=t, conditions={"rotation": "forward", "mounting": mounting})
        return float(tire_truth.lateral(run, tire, ONE, e)["FY"][0])

    cone, lean = {"conicity": {"force_at_nominal_load": 40.0}}, {"camber_offset": {"angle": 1.0}}
    assert force("turned", cone) == pytest.approx(-force("normal", cone))
    assert force("normal", cone) == pytest.approx(40.0)
    assert force("turned", lean) == pytest.approx(force("normal", lean))


def test_a_resonance_leaves_slow_changes_alone_and_rings_at_its_frequency() -> None:
    t = np.arange(0, 20, 1 / 160)
    slow = tire_truth._resonance(t, np.sin(2 * math.pi * 0.02 * t), 2.0)
    assert np.abs(slow[1600:]).max() < 0.02
    struck = tire_truth._resonance(t, (t > 1.0).astype(float), 2.0)
    power = np.abs(np.fft.rfft(struck[160:]))
    assert np.fft.rfftfreq(struck.size - 160, 1 / 160)[int(power.argmax())] == pytest.approx(2.0, abs=0.1)


def test_a_gap_stays_within_its_flanks_and_rests_inside() -> None:
    sa = 2 * np.sin(np.linspace(0, 12, 5000))
    wheel = tire_truth.gap_with_contact(sa, 0.3)
    assert np.all(np.abs(sa - wheel) <= 0.15 + 1e-3)
    assert np.count_nonzero(np.diff(wheel) == 0) > 100


def test_the_relays_draw_a_loop_of_unit_height_about_a_line() -> None:
    x = np.concatenate([np.linspace(0, -1, 300), np.linspace(-1, 1, 600), np.linspace(1, -1, 600)])
    field = instruments.preisach(x, 1.0)
    up, down = field[300:900], field[900:]
    middle_up = np.interp(0.0, x[300:900], up)
    middle_down = np.interp(0.0, x[900:][::-1], down[::-1])
    assert middle_down - middle_up == pytest.approx(1.0, abs=0.03)
    assert middle_down + middle_up == pytest.approx(0.0, abs=0.03)
    assert abs(up[-1]) < 0.03


def test_relays_remember_where_the_load_turned_and_not_how_fast() -> None:
    slow, fast = np.linspace(0, 6 * math.pi, 6000), np.linspace(0, 6 * math.pi, 1500)
    a, b = (instruments.preisach(np.sin(t), 1.0)[-1] for t in (slow, fast))
    assert a == pytest.approx(
        b, abs=(6 * math.pi / 1500) ** 2 / 2
    )  # how far sampling misses the turning point


def test_resistor_and_capacitor_lag_a_ramp_by_their_time_constant() -> None:
    t = np.linspace(0, 5, 500)
    out = instruments.rc(t, 3.0 * t, 0.25)
    assert out[-1] == pytest.approx(3.0 * (5 - 0.25), rel=1e-6)


def test_creep_starts_at_nothing_and_ends_at_its_fraction() -> None:
    t = np.linspace(0, 60, 3000)
    p = {"fraction": 0.02, "time_constant": 4.0}
    y = instruments.analogue("creep", p, t, np.full(t.size, 100.0), {})
    assert y[0] == pytest.approx(100.0)
    assert y[-1] == pytest.approx(102.0, rel=1e-5)


def test_an_unknown_stage_is_an_error() -> None:
    with pytest.raises(KeyError):
        instruments.analogue("friction", {}, np.arange(3.0), np.arange(3.0), {})
    with pytest.raises(KeyError):
        instruments.digital("friction", {}, np.arange(3.0))


def test_bristle_friction_is_coulomb_in_steady_sliding() -> None:
    z, h = 0.0, 1e-4
    for _ in range(4000):
        force, rate = dynamic_cases.bristle(-0.3, z, 2.5, 1e-3)
        z += h * rate / 4
    assert force == pytest.approx(-2.5, rel=1e-6)


def _still(seconds: float, rate: float) -> Run:
    t = np.arange(round(seconds * rate) + 1) / rate
    return Run(name="run01.csv", fine={"t": t, "M": np.zeros(t.size)}, rows=t)


def _swing(
    run: Run, effects: dict[str, dict[str, float]], omega2: float, start: tuple[float, float]
) -> np.ndarray:
    def rhs(_t: float, x: np.ndarray, _u: dict[str, float]) -> np.ndarray:
        a, rate = dynamic_cases.left_out(x[0], x[1], x[2], effects, 1e-3)
        return np.array([x[1], -omega2 * math.sin(x[0]) + a, rate])

    return ode.truth(rhs, np.array([*start, 0.0]), run.fine["t"], {"M": run.fine["M"]}, longest=0.01)


def test_a_swing_without_losses_keeps_its_energy() -> None:
    x = _swing(_still(10, 100), {}, 20.0, (0.8, 0.0))
    energy = x[:, 1] ** 2 / 2 - 20.0 * np.cos(x[:, 0])
    assert np.ptp(energy) < 2e-4 * 20


def test_coulomb_friction_takes_four_times_its_angle_from_every_swing() -> None:
    # a harmonic oscillator with dry friction loses 4 f / omega^2 of amplitude a period
    x = _swing(_still(12, 200), {"coulomb_friction": {"coulomb": 0.02}}, 25.0, (0.1, 0.0))
    peaks = [x[i, 0] for i in range(1, len(x) - 1) if x[i - 1, 0] < x[i, 0] > x[i + 1, 0] and x[i, 0] > 0.02]
    assert np.mean(np.diff(peaks)) == pytest.approx(-4 * 0.02 / 25, rel=0.03)


def test_quadratic_drag_reaches_its_terminal_velocity() -> None:
    e = {"quadratic_drag": {"drag": 0.5}, "constant_force": {"force": 8.0}}
    x = _swing(_still(6, 50), e, 0.0, (0.0, 0.0))
    assert x[-1, 1] == pytest.approx(4.0, rel=1e-5)


@pytest.mark.parametrize("ar", [(), (0.5,), (0.9,), (1.1, -0.3)])
def test_noise_has_the_spread_asked_for_and_whitens_to_one(ar: tuple[float, ...]) -> None:
    n = Noise(sd=2.5, ar=ar)
    y = noise.coloured(n, 60_000, np.random.default_rng(4))
    assert y.std() == pytest.approx(2.5, rel=0.05)
    w = noise.whitened(n, y)
    assert w.std() == pytest.approx(1.0, rel=0.02)
    assert abs(np.corrcoef(w[1:], w[:-1])[0, 1]) < 0.02


def test_the_delay_of_the_filter_is_what_the_clock_is_corrected_by() -> None:
    t = np.arange(4000) / 200
    y = noise.anti_alias(t, np.sin(2 * math.pi * 0.2 * t), 10.0)
    late = noise.group_delay(t, 10.0)
    assert np.interp(12.0 + late, t, y) == pytest.approx(math.sin(2 * math.pi * 0.2 * 12.0), abs=1e-4)
