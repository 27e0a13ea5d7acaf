"""Effects on road, carriage and tire, each alone: sign, symmetry, rate, speed, limits, conserved quantities.

Expected numbers come from the equations beside them, on a tire whose curve is known in closed form.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.rig import NOMINAL, PEAK, SLOPE, SPEED, TRAIL, driven, forces, setting, tire
from toolkit.effects.catalogue import effect
from toolkit.effects.catalogue.thermal_friction import HEATING_K_PER_KJ

ANGLES = np.radians(np.linspace(-15, 15, 61))
ODD = ["surface_friction", "drum_curvature", "load_friction", "speed_friction", "steer_compliance"]
VALUES = {
    "surface_friction": {"mu_factor": 0.8},
    "drum_curvature": {"reduction": 0.2},
    "load_friction": {"sensitivity": -0.2},
    "speed_friction": {"sensitivity": 1.0},
    "steer_compliance": {"compliance": 1e-4},
    "plysteer": {"pseudo_slip_angle": 0.3},
    "conicity": {"force_at_nominal_load": 60.0},
    "steer_offset": {"offset": 0.3},
    "camber_offset": {"angle": 0.5},
}


def curve(name, FZ=NOMINAL, *, V=SPEED, **changed):
    d = driven(ANGLES, FZ, t=np.arange(float(len(ANGLES))), V=V)
    return forces(effect(name), VALUES[name], d, **changed)


def slope(y):
    middle = len(ANGLES) // 2
    return (y[middle + 1] - y[middle - 1]) / (ANGLES[middle + 1] - ANGLES[middle - 1])


def plain(FZ=NOMINAL):
    return tire(driven(ANGLES, FZ, t=np.arange(float(len(ANGLES)))))


@pytest.mark.parametrize("name", ODD)
def test_effects_without_a_side_keep_the_curves_odd(name):
    made = curve(name, 5500.0)
    np.testing.assert_allclose(made.FY, -made.FY[::-1], atol=1e-6)
    np.testing.assert_allclose(made.MZ, -made.MZ[::-1], atol=1e-8)
    assert np.abs(made.FY - plain(5500.0).FY).max() > 10


@pytest.mark.parametrize("name", ["plysteer", "conicity", "steer_offset", "camber_offset"])
def test_effects_with_a_side_do_not(name):
    made = curve(name)
    even = (made.FY + made.FY[::-1]) / 2
    assert np.abs(even).max() > 30


def test_surface_friction_scales_the_peak_and_leaves_the_slope():
    made, base = curve("surface_friction"), plain()
    far = driven(np.full(1, 1.2), t=np.zeros(1))
    peak = forces(effect("surface_friction"), {"mu_factor": 0.8}, far).FY
    assert peak == pytest.approx(-0.8 * PEAK * NOMINAL, rel=1e-9)
    assert slope(made.FY) == pytest.approx(slope(base.FY), rel=5e-3)


def test_drum_curvature_scales_the_slopes_and_leaves_the_peak():
    made, base = curve("drum_curvature"), plain()
    # force as the patch length squared, moment as its cube: 0.8 and 0.8 ^ 1.5
    assert slope(made.FY) / slope(base.FY) == pytest.approx(0.8, rel=5e-3)
    assert slope(made.MZ) / slope(base.MZ) == pytest.approx(0.8**1.5, rel=1e-2)
    soft = forces(
        effect("drum_curvature"),
        {"reduction": 0.2, "moment_exponent": 1.9},
        driven(ANGLES, t=np.arange(float(len(ANGLES)))),
    )
    assert slope(soft.FY) / slope(base.FY) == pytest.approx(0.8, rel=5e-3)
    assert slope(soft.MZ) / slope(base.MZ) == pytest.approx(0.8**1.9, rel=1e-2)
    far = driven(np.full(1, 1.2), t=np.zeros(1))
    peak = forces(effect("drum_curvature"), {"reduction": 0.2}, far).FY
    assert peak == pytest.approx(-PEAK * NOMINAL, rel=1e-9)


def test_load_friction_is_none_at_the_nominal_load_and_linear_in_the_load():
    np.testing.assert_array_equal(curve("load_friction").FY, plain().FY)
    for FZ in (2000.0, 6000.0):
        far = driven(np.full(1, 1.2), FZ, t=np.zeros(1))
        peak = forces(effect("load_friction"), {"sensitivity": -0.2}, far).FY
        assert peak == pytest.approx(-(1 - 0.2 * (FZ / NOMINAL - 1)) * FZ, rel=1e-9)


def test_speed_friction_is_at_high_slip_only_and_other_at_another_speed():
    for V in (SPEED, 2 * SPEED):
        made = curve("speed_friction", V=V)
        assert slope(made.FY) == pytest.approx(slope(plain().FY), rel=5e-3)
        far = driven(np.full(1, 1.2), t=np.zeros(1), V=V)
        peak = forces(effect("speed_friction"), {"sensitivity": 1.0}, far).FY
        assert peak == pytest.approx(-NOMINAL / (1 + V * np.sin(1.2) / SPEED), rel=1e-9)


def test_steer_compliance_solves_its_own_equation_and_lowers_both_slopes():
    d = driven(ANGLES, t=np.arange(float(len(ANGLES))))
    made = effect("steer_compliance").drive(d, {"compliance": 1e-4}, setting(d.t), tire)
    np.testing.assert_allclose(made.SA, d.SA - 1e-4 * tire(made).MZ, atol=1e-9)
    # aligning stiffness CM = trail * slope * load; both slopes are divided by 1 + compliance * CM
    factor = 1 + 1e-4 * TRAIL * SLOPE * NOMINAL
    after = tire(made)
    assert slope(after.FY) == pytest.approx(slope(plain().FY) / factor, rel=5e-3)
    assert slope(after.MZ) == pytest.approx(slope(plain().MZ) / factor, rel=1e-2)


def test_steer_offset_and_plysteer_shift_the_curve_by_their_angle():
    shifted = driven(ANGLES - np.radians(0.3), t=np.arange(float(len(ANGLES))))
    np.testing.assert_allclose(curve("steer_offset").FY, tire(shifted).FY, rtol=1e-12)
    shifted = driven(ANGLES + np.radians(0.3), t=np.arange(float(len(ANGLES))))
    np.testing.assert_allclose(curve("plysteer").MZ, tire(shifted).MZ, rtol=1e-12)


def test_conicity_grows_with_load_and_turns_with_the_tire():
    for FZ in (2000.0, 6000.0):
        difference = curve("conicity", FZ).FY - plain(FZ).FY
        np.testing.assert_allclose(difference, 60.0 * FZ / NOMINAL, rtol=1e-9)
    turned = curve("conicity", facing=-1.0).FY - plain().FY
    np.testing.assert_allclose(turned, -60.0, rtol=1e-9)
    # an error of the wheel's camber does not turn with the tire
    np.testing.assert_array_equal(curve("camber_offset", facing=-1.0).FY, curve("camber_offset").FY)


def test_relaxation_is_first_order_in_the_distance_rolled():
    t = np.linspace(0.0, 3.0, 3001)
    step = np.where(t > 0, 1e-3, 0.0)
    for V in (1.0, 2.0):
        d = driven(step, t=t, V=V)
        made = effect("relaxation").drive(d, {"relaxation_length": 0.5, "falling": 0.0}, setting(t), tire)
        at = np.searchsorted(t, 0.5 / V)  # one relaxation length
        # within the first interval the angle is a ramp: half an interval early
        assert made.SA[at] / 1e-3 == pytest.approx(1 - np.exp(-1), abs=2e-3)
        assert made.SA[-1] == pytest.approx(1e-3 * (1 - np.exp(-3 * V / 0.5)), rel=1e-3)


def test_relaxation_follows_the_cornering_stiffness_and_keeps_a_steady_angle():
    d = driven(0.05, 2000.0)
    made = effect("relaxation").drive(d, {"relaxation_length": 0.5, "falling": 0.0}, setting(d.t), tire)
    np.testing.assert_allclose(made.SA, 0.05, rtol=1e-12)
    # this tire's stiffness is in proportion to the load: half the load, half the length
    t = np.linspace(0.0, 4.0, 4001)
    ramp = driven(1e-3 * t, 2000.0, t=t, V=1.0)
    late = effect("relaxation").drive(ramp, {"relaxation_length": 0.5, "falling": 0.0}, setting(t), tire)
    assert (ramp.SA - late.SA)[-1] == pytest.approx(1e-3 * 0.25, rel=1e-3)  # rate * sigma / V
    # the same length at all loads, and one that goes with the square of the stiffness
    for power, length in ((0.0, 0.5), (2.0, 0.125)):
        values = {"relaxation_length": 0.5, "falling": 0.0, "with_load": power}
        late = effect("relaxation").drive(ramp, values, setting(t), tire)
        assert (ramp.SA - late.SA)[-1] == pytest.approx(1e-3 * length, rel=1e-3)


@pytest.mark.parametrize("rate", [0.5, 5.0])
def test_backlash_makes_a_loop_of_the_gap_at_any_rate(rate):
    t = np.linspace(0.0, 4 * np.pi / rate, 4001)
    d = driven(0.05 * np.sin(rate * t), t=t)
    made = effect("backlash").drive(d, {"gap": 0.5}, setting(t), tire)
    late = d.SA - made.SA
    half = np.radians(0.25)
    assert late[500:].max() == pytest.approx(half, rel=1e-3)
    assert late[500:].min() == pytest.approx(-half, rel=1e-3)
    assert np.abs(late).max() <= half * (1 + 1e-12)


def test_load_lag_is_first_order_and_ends_at_the_command():
    t = np.linspace(0.0, 20.0, 4001)
    d = driven(0.02, np.where(t > 0, 6000.0, 2000.0), t=t)
    made = effect("load_lag").drive(d, {"time_constant": 1.5}, setting(t), tire)
    at = np.searchsorted(t, 1.5)
    assert (6000.0 - made.FZ[at]) / 4000.0 == pytest.approx(np.exp(-1), abs=2e-3)
    assert made.FZ[-1] == pytest.approx(6000.0, abs=4000 * np.exp(-13))
    assert np.array_equal(made.SA, d.SA)


def test_viscoelastic_settling_overshoots_by_its_fraction_and_dies_away_with_time():
    t = np.linspace(0.0, 40.0, 8001)
    values = {"fraction": 0.04, "time_constant": 5.0, "of_load": 0.0}
    d = driven(0.02, np.where(t > 0, 6000.0, 2000.0), t=t)
    for V in (1.0, 4.0):  # time and not distance
        moved = driven(0.02, d.FZ, t=t, V=V)
        made = forces(effect("viscoelastic_settling"), values, moved)
        rest = tire(moved)
        jump = (rest.FY[-1] - rest.FY[0]) * 0.04
        assert made.FY[1] - rest.FY[1] == pytest.approx(jump, rel=2e-3)
        at = np.searchsorted(t, 10.0)
        assert made.FY[at] - rest.FY[at] == pytest.approx(jump * np.exp(-2), rel=5e-3)
        assert made.FY[-1] == pytest.approx(rest.FY[-1], abs=abs(jump) * np.exp(-7.5))


def test_settling_of_the_load_alone_leaves_a_steering_step_alone():
    t = np.linspace(0.0, 40.0, 8001)
    values = {"fraction": 0.04, "time_constant": 5.0, "of_load": 1.0}
    steered = driven(np.where(t > 0, 0.02, 0.0), 4000.0, t=t)
    made = forces(effect("viscoelastic_settling"), values, steered)
    np.testing.assert_allclose(made.FY, tire(steered).FY, rtol=1e-12)
    # 4 % of a load step of 4000 N more, on a tire whose force at a small angle goes with the load
    loaded = driven(1e-3, np.where(t > 0, 6000.0, 2000.0), t=t)
    made, rest = forces(effect("viscoelastic_settling"), values, loaded), tire(loaded)
    assert made.FY[1] / rest.FY[1] == pytest.approx(1 + 0.04 * 4000 / 6000, rel=1e-3)
    assert made.FY[-1] == pytest.approx(rest.FY[-1], rel=1e-4)


def test_a_carcass_that_is_a_spring_lets_the_relaxation_length_fall_with_the_slope():
    """Where the slope is down to a share, so is the lag behind a slow ramp: rate * sigma / V."""
    t = np.linspace(0.0, 8.0, 8001)
    middle, rate, sigma = 0.04, 1e-4, 0.5  # slow: the length hardly changes within itself
    ramp = driven(middle + rate * (t - 8.0), t=t, V=1.0)
    late = {}
    for falling in (0.0, 0.5, 1.0):
        values = {"relaxation_length": sigma, "falling": falling}
        made = effect("relaxation").drive(ramp, values, setting(t), tire)
        late[falling] = (ramp.SA - made.SA)[-1]
    step, contact = 1e-6, middle - late[1.0]
    there = driven(np.array([contact - step, contact + step]), t=np.arange(2.0))
    zero = driven(np.array([-step, step]), t=np.arange(2.0))
    share = np.ptp(tire(there).FY) / np.ptp(tire(zero).FY)
    assert share < 0.9
    assert late[0.0] == pytest.approx(rate * sigma, rel=1e-3)
    assert late[1.0] == pytest.approx(rate * sigma * share, rel=3e-3)
    assert late[0.5] == pytest.approx(rate * sigma * (1 + share) / 2, rel=3e-3)


def test_heat_is_counted_from_the_reference_above_the_first_temperature():
    t = np.linspace(0.0, 10.0, 11)
    d = driven(0.001, 4000.0, t=t)
    here = setting(t, channels={"T_TREAD": 25.0 + t}, first={"T_TREAD": 25.0})
    values = {"peak_per_K": 0.0, "stiffness_per_K": -0.01, "time_constant": 8.0, "reference": 4.0}
    made = effect("thermal_friction").drive(d, values, here, tire)
    np.testing.assert_allclose(made.stiffness, 1 - 0.01 * (t - 4.0))  # nominal at 29 degC


def test_turn_slip_is_there_only_while_steering_and_turns_with_the_travel():
    t = np.linspace(0.0, 4.0, 401)
    SA = np.clip(t - 1.0, 0.0, 1.0) * 0.1  # 0.1 rad/s for one second
    for V in (1.0, 2.0):
        d = driven(SA, t=t, V=V)
        extra = forces(effect("turn_slip"), {"force": 500.0}, d).FY - tire(d).FY
        assert extra[150] == pytest.approx(-500.0 * 0.1 / V, rel=1e-6)
        assert np.abs(extra[t < 0.98]).max() == np.abs(extra[t > 2.02]).max() == 0
        back = forces(effect("turn_slip"), {"force": 500.0}, d, travel=-1.0).FY - tire(d).FY
        np.testing.assert_allclose(back, -extra, atol=1e-9)


def test_wear_counts_slip_work():
    t = np.linspace(0.0, 100.0, 101)
    d = driven(0.1, t=t)
    made = effect("wear").drive(d, {"rate": 1e-3}, setting(t, slip_work_before_kJ=7.0), tire)
    power_kW = abs(tire(d).FY[0]) * SPEED * np.sin(0.1) * 1e-3
    np.testing.assert_allclose(made.stiffness, 1 + 1e-3 * (7.0 + power_kW * t), rtol=1e-12)
    still = driven(0.0, t=t)
    assert np.ptp(effect("wear").drive(still, {"rate": 1e-3}, setting(t), tire).stiffness) == 0


def test_heat_without_a_thermometer_is_conserved():
    # T' = heat P - T / tau: what went in is what is stored and what has left.
    t = np.linspace(0.0, 60.0, 6001)
    d = driven(0.08 * np.sin(0.3 * t), t=t)
    here = setting(t, channels={})
    values = {"peak_per_K": 0.0, "stiffness_per_K": -0.01, "time_constant": 20.0}
    made = effect("thermal_friction").drive(d, values, here, tire)
    rise = (1 - made.stiffness) / 0.01
    power = np.abs(tire(d).FY * SPEED * np.sin(d.SA)) * 1e-3

    def integral(y):
        return float(np.sum((y[1:] + y[:-1]) / 2 * np.diff(t)))

    assert rise[0] == pytest.approx(0, abs=1e-12)
    assert HEATING_K_PER_KJ * integral(power) == pytest.approx(rise[-1] + integral(rise) / 20.0, rel=1e-5)


def test_a_recorded_temperature_drives_friction_and_stiffness():
    t = np.linspace(0.0, 10.0, 11)
    d = driven(0.05, t=t)
    values = {"peak_per_K": -0.005, "stiffness_per_K": -0.002, "time_constant": 20.0}
    made = effect("thermal_friction").drive(d, values, setting(t), tire)
    np.testing.assert_allclose(made.friction, 1 - 0.005 * 2.0 * t, rtol=1e-12)
    np.testing.assert_allclose(made.stiffness, 1 - 0.002 * 2.0 * t, rtol=1e-12)


def test_pressure_change_is_in_kPa_and_adds():
    d = driven()
    made = effect("pressure_change").drive(d, {"pressure_error": -20.0}, setting(d.t), tire)
    np.testing.assert_array_equal(made.pressure_error, -20e3)
