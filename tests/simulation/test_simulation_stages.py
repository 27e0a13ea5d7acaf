"""Each stage by itself: limiting cases, symmetry, the way back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.simulation import acquisition, carriage, cells, tire
from toolkit.simulation.tire import TireTruth, forces

ANGLES = np.radians(np.linspace(-10, 10, 41))


def test_symmetric_tire_reverses_as_the_machine_feels_it():
    plain = TireTruth(plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=0.0)
    forward = forces(plain, SA=ANGLES, FZ=4000.0, rotation="forward")
    reverse = forces(plain, SA=ANGLES, FZ=4000.0, rotation="reverse")
    np.testing.assert_allclose(reverse.FY, -forward.FY, atol=1e-9)
    np.testing.assert_allclose(reverse.MZ, forward.MZ, atol=1e-9)


def test_signs_are_those_of_SAE():
    found = forces(TireTruth(), SA=math.radians(2.0), FZ=4000.0, rotation="forward")
    assert found.FY < 0 < found.MZ


def test_conicity_alone_keeps_FY_and_flips_MZ():
    one = TireTruth(plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=60.0)
    forward, reverse = (forces(one, SA=0.0, FZ=3700.0, rotation=r) for r in ("forward", "reverse"))
    assert float(forward.FY) == pytest.approx(60.0, rel=1e-9)
    assert float(reverse.FY) == pytest.approx(60.0, rel=1e-9)
    assert float(forward.MZ) == pytest.approx(-float(reverse.MZ), rel=1e-12)
    assert abs(float(forward.MZ)) > 0.1


def test_plysteer_alone_flips_FY_and_keeps_MZ():
    one = TireTruth(plysteer_rad=math.radians(0.2), aligning_shift_rad=0.0, conicity_N=0.0)
    forward, reverse = (forces(one, SA=0.0, FZ=3700.0, rotation=r) for r in ("forward", "reverse"))
    # 0.2 deg x 1003 N/deg and 0.2 deg x 23.7 N·m/deg (published stiffness at 3.70 kN)
    assert float(forward.FY) == pytest.approx(-0.2 * 1003, rel=2e-3)
    assert float(forward.MZ) == pytest.approx(0.2 * 23.7, rel=3e-3)
    assert float(reverse.FY) == pytest.approx(-float(forward.FY), rel=1e-12)
    assert float(reverse.MZ) == pytest.approx(float(forward.MZ), rel=1e-12)


def test_a_camber_error_acts_as_conicity_does():
    flat = TireTruth(plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=0.0)
    conic = TireTruth(plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=60.0)
    gamma = tire.pseudo_camber(conic)
    for rotation in ("forward", "reverse"):
        a = forces(flat, SA=ANGLES, FZ=3700.0, rotation=rotation, camber=gamma)
        b = forces(conic, SA=ANGLES, FZ=3700.0, rotation=rotation)
        np.testing.assert_allclose(a.FY, b.FY, atol=1e-9)


def test_run_out_cancels_over_a_drum_revolution_but_not_over_one_of_the_tire():
    drum = {"speed_m_s": 2.128, "radius_m": 1.353}
    whole = 2 * np.pi * drum["radius_m"] / drum["speed_m_s"]
    assert whole == pytest.approx(3.995, abs=1e-3)
    for seconds, cancels in ((whole, True), (0.9, False)):
        time = np.linspace(0, seconds, 4000, endpoint=False)
        angle = carriage.drum_angle(time=time, **drum, start_rad=0.3, reverse=False)
        load = carriage.load_on_drum(carriage.RoadTruth(), load=np.full(4000, 4000.0), angle=angle)
        assert bool(abs(load.mean() - 4000.0) < 1e-6) is cancels


def test_rack_zero_shows_and_the_sensors_own_error_does_not():
    truth = carriage.CarriageTruth(steer_offset_rad=0.002)
    SA = carriage.wheel_angle(truth, step_rad=0.0)
    assert math.degrees(float(carriage.sensed_angle(truth, SA=SA))) == pytest.approx(-0.3)
    assert pytest.approx(math.radians(-0.3) - 0.002) == SA


@given(st.integers(0, 10_000))
def test_load_stops_within_the_spread(seed):
    found = carriage.set_load(carriage.CarriageTruth(), step_N=1000.0, rng=np.random.default_rng(seed))
    assert 970.0 <= found <= 1030.0


def test_wheels_weight_and_lateral_force_push_D51_D52_up_and_E5_down():
    # Figure 4.4: D51, D52 > 0 and E5 < 0 grow together under load; 28.9 lbf·m without lateral force.
    levers = np.array([0.05, 0.05, -0.10])
    seen = []
    for FY in (0.0, 500.0, 1500.0):
        MX = 0.3 * FY + carriage.CarriageTruth().overturning_Nm
        force = cells.cell_forces(np.array([[FY, -10.0, MX]]))[0]
        assert force[0] > 0 > force[2]
        assert force[1] > 0
        assert levers @ force == pytest.approx(MX)
        seen.append(force)
    assert np.all(np.diff(np.abs(np.array(seen)), axis=0) > 0)
    assert carriage.CarriageTruth().overturning_Nm == pytest.approx(28.9 * 4.4482216)


@given(st.tuples(*[st.floats(-6000, 6000)] * 3))
def test_cells_and_back(loads):
    truth = cells.CellsTruth()
    given = np.array([loads]) * [1.0, 0.03, 0.3]
    bridge = cells.outputs(truth, loads=given, tared=True)
    back = [bridge @ np.array(cells.true_coefficients(truth)[load]) for load in cells.LOADS]
    np.testing.assert_allclose(np.ravel(back), given[0], rtol=1e-9, atol=1e-6)


def test_published_rows_in_the_files_units():
    # The map is the published one: coefficients per lbf of cell force.
    truth = cells.CellsTruth()
    per_lbf = [cell.sensitivity_per_N * 4.4482216152605 for cell in truth.all]
    FY = [c * s / 4.4482216152605 for c, s in zip(cells.true_coefficients(truth)["FY"], per_lbf, strict=True)]
    MZ = [c * s / 1.3558179483314 for c, s in zip(cells.true_coefficients(truth)["MZ"], per_lbf, strict=True)]
    np.testing.assert_allclose(FY, [0.99719, 0.99718, 1.0228], rtol=1e-12)
    np.testing.assert_allclose(MZ, [-0.15688, 0.16197, 0.0026666], rtol=1e-12)


def test_filter_is_first_order():
    t = np.arange(4000) * 1e-3
    wave = np.sin(2 * np.pi * 1.0 * t)
    smooth = acquisition.low_pass(wave, time_constant=0.2, dt=1e-3)
    # |H| = 1 / sqrt(1 + (omega tau)^2) once the start has died away
    assert np.ptp(smooth[2000:]) / 2 == pytest.approx(1 / math.hypot(1, 2 * math.pi * 0.2), rel=5e-3)
    assert np.array_equal(acquisition.low_pass(wave, time_constant=0.0, dt=1e-3), wave)


def test_printed_digits_are_those_of_figure_4_4():
    shown = {s: acquisition.round_printed(s, np.array([v])).item() for s, v in (
        ("FZ", 248.814612), ("D52", 86.0607249), ("D51", 98.592611), ("E5", -182.41499), ("SA", -0.3019712),
        ("FY", 371.35536), ("MZ", -27.10164),
    )}  # fmt: skip
    assert shown == {
        "FZ": 248.8146, "D52": 86.06072, "D51": 98.59261, "E5": -182.415, "SA": -0.30197, "FY": 371.3554,
        "MZ": -27.1016,
    }  # fmt: skip
