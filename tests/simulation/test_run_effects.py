"""Each effect switched on alone on the virtual machine: what it changes, by how much, and nothing else."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError
from toolkit.simulation.acquisition import true_program
from toolkit.simulation.cells import CELLS
from toolkit.simulation.plan import read_plan, with_effects
from toolkit.simulation.run import simulate
from toolkit.simulation.steps import RunSteps

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
FORCES = {"FY", "MZ"}
AT_CELLS = {*CELLS, *FORCES}
AT_HUB = {*AT_CELLS, "T_TREAD"}

# Effect as written -> signals of the recording that may change; True where the true forces change too.
WHAT = {
    "unit_error.E5=2": ({"E5", *FORCES}, False),
    "channel_sign.FZ": ({"FZ"}, False),
    "channel_sign.E5": ({"E5", *FORCES}, False),
    "channel_sign.MZ": ({"MZ"}, False),
    "channel_swap.D51.D52": ({"D51", "D52", *FORCES}, False),
    "channel_swap.FY.MZ": (FORCES, False),
    "wrong_calibration=turned": (FORCES, False),
    "channel_delay.FY=20ms": ({"FY"}, False),
    "filter_lag.SA=0.2s": ({"SA"}, False),
    "saturation.D51=0.3mV/V": ({"D51", *FORCES}, False),
    "quantisation.D52=0.01mV/V": ({"D52", *FORCES}, False),
    "dead_band.MZ=10N*m": ({"MZ"}, False),
    "rectification.FY": ({"FY"}, False),
    "zero_offset.D51=0.01mV/V": ({"D51", *FORCES}, False),
    "zero_offset.FZ=50N": ({"FZ"}, False),
    "zero_drift.E5=0.01": ({"E5", *FORCES}, False),
    "thermal_drift.D52=0.001": ({"D52", *FORCES}, False),
    "creep.E5=fraction:0.01,time_constant:5s": ({"E5", *FORCES}, False),
    "hysteresis.D51=0.01": ({"D51", *FORCES}, False),
    "nonlinearity.D51=quadratic:0.01": ({"D51", *FORCES}, False),
    "crosstalk.FZ.FY=0.01": (AT_CELLS, False),
    "crosstalk.D51.D52=0.01": ({"D52", *FORCES}, False),
    "sensitivity_error.D51=2%": ({"D51", *FORCES}, False),
    "steer_offset=0.3": (AT_HUB, True),
    "camber_offset=0.5": (AT_HUB, True),
    "steer_compliance=5e-5": (AT_HUB, True),
    "backlash=0.4": (AT_HUB, True),
    "load_lag=0.8s": ({*AT_HUB, "FZ"}, True),
    "relaxation=0.4m": (AT_HUB, True),
    "thermal_friction=peak_per_K:-0.01,stiffness_per_K:-0.005": (AT_HUB, True),
    "pressure_change=-30kPa": (AT_HUB, True),
    "wear=0.001": (AT_HUB, True),
    "plysteer=0.3": (AT_HUB, True),
    "conicity=60N": (AT_HUB, True),
    "load_friction=-0.2": (AT_HUB, True),
    "speed_friction=1": (AT_HUB, True),
    "viscoelastic_settling=fraction:0.03,time_constant:4s": (AT_HUB, True),
    "nonuniformity.FY=30N": (AT_CELLS, True),
    "turn_slip=800": (AT_HUB, True),
    "drum_curvature=0.15": (AT_HUB, True),
    "surface_friction=0.85": (AT_HUB, True),
    "drum_runout.FZ=40N": ({*AT_HUB, "FZ"}, True),
    "drum_runout.MZ=5N*m": (AT_CELLS, True),
}
STEPS = {"slip_angles_rad": tuple(np.radians([4.0, -4.0, 8.0])), "loads_N": (2000.0, 5000.0)}


@pytest.fixture(scope="module")
def plan():
    read = read_plan(EXAMPLES / "continuous_plan.toml")
    quiet = {name: dataclasses.replace(getattr(read.cells, name), noise_V_V=0.0) for name in CELLS}
    return dataclasses.replace(
        read,
        runs=(
            RunSteps(rotation="forward", outer="load", extra=(("order", "1"),), **STEPS),
            RunSteps(rotation="reverse", outer="load", extra=(("order", "2"),), **STEPS),
        ),
        cells=dataclasses.replace(read.cells, **quiet),
        acquisition=dataclasses.replace(read.acquisition, FZ_noise_N=0.0, SA_noise_rad=0.0),
        motion=dataclasses.replace(read.motion, ambient_drift_K_s=0.01),
    )


@pytest.fixture(scope="module")
def base(plan):
    return simulate(plan)


def run(plan, *texts):
    turned = true_program(plan.cells).with_negated(("E5",))
    return simulate(with_effects(plan, list(texts)), None, {"turned": turned})


def signal(test, name, file=0):
    return test.files[file].signals[name]


def test_every_effect_of_the_machine_is_here():
    written = {text.partition("=")[0].partition(".")[0] for text in WHAT}
    assert written == {name for name, one in effects().items() if one.stage != "dynamics"}


@pytest.mark.parametrize("text", list(WHAT))
def test_an_effect_changes_what_it_says_and_nothing_else(plan, base, text):
    allowed, forces = WHAT[text]
    made = run(plan, text)
    for before, after in zip(base.files, made.files, strict=True):
        changed = {n for n, v in before.signals.items() if not np.array_equal(v, after.signals[n])}
        assert changed <= allowed
        assert changed, "it does something"
        truth = [
            (b.FY_N, b.MZ_Nm) != (a.FY_N, a.MZ_Nm) for b, a in zip(before.truth, after.truth, strict=True)
        ]
        assert any(truth) is forces


@pytest.mark.parametrize(
    "text", ["zero_offset=0.01mV/V", "zero_drift=0.01", "thermal_drift=0.001", "hysteresis=0.001"]
)
def test_what_comes_after_the_tare_is_not_in_it(plan, base, text):
    assert run(plan, text).tare == base.tare


def test_what_reads_the_tare_reads_it_too(plan, base):
    for text, factor in (("sensitivity_error=0.5", 1.5), ("channel_sign", -1.0)):
        made = dict(run(plan, text).tare)
        assert made == {name: pytest.approx(factor * value, rel=1e-5) for name, value in base.tare}


def pull(test):
    """FY and MZ of the first block at zero slip angle: forward, reversed (machine axes)."""
    blocks = [
        next(b for b in file.truth if b.step_SA_rad == 0.0 and b.step_FZ_N == 4000.0) for file in test.files
    ]
    return tuple((b.FY_N, b.MZ_Nm) for b in blocks)


@pytest.fixture(scope="module")
def straight(plan):
    steps = {"slip_angles_rad": (0.0,), "loads_N": (4000.0,)}
    return dataclasses.replace(
        plan,
        runs=tuple(
            RunSteps(rotation=rotation, mounting=mounting, **steps)
            for mounting in ("normal", "turned")
            for rotation in ("forward", "reverse")
        ),
    )


def test_pull_has_the_symmetries_of_reversal_and_of_the_turned_tire(straight):
    """conicity (F+R)/2, plysteer (F-R)/2 of FY; turned round, conicity turns and plysteer stays."""
    for text, forward, reverse, turned in (
        ("conicity=60N", 60.0, 60.0, -60.0),
        ("plysteer=0.2", None, -1.0, 1.0),
        ("steer_offset=-0.2", None, -1.0, 1.0),
        ("crosstalk.FZ.FY=0.015", 60.0, 60.0, 60.0),
    ):
        test = run(straight, text)
        F, R, T, _ = (float(file.signals["FY"].mean()) for file in test.files)
        if forward is None:  # as multiples of the forward force: a slip angle of 0.2 deg
            assert F < -100
            assert (R / F, T / F) == (pytest.approx(reverse, rel=1e-6), pytest.approx(turned, rel=1e-6))
        else:
            assert (F, R, T) == tuple(pytest.approx(x, abs=1e-6) for x in (forward, reverse, turned)), text
    F, R, T, _ = (float(file.signals["FY"].mean()) for file in run(straight, "camber_offset=0.5").files)
    assert abs(F) > 20
    assert (pytest.approx(F, rel=1e-9), pytest.approx(F, rel=1e-9)) == (R, T)


def test_a_symmetric_tire_reverses_as_the_machine_feels_it(plan):
    """Effects without a side keep FY_reverse = -FY_forward and MZ_reverse = MZ_forward, in motion too."""
    same = dataclasses.replace(plan, motion=dataclasses.replace(plan.motion, ambient_drift_K_s=0.0))
    for text in ("relaxation=0.4m", "turn_slip=800", "backlash=0.4", "steer_compliance=5e-5", "load_lag=0.8s",
                 "viscoelastic_settling=0.03", "drum_curvature=0.15", "speed_friction=1"):  # fmt: skip
        test = run(same, text)
        np.testing.assert_allclose(signal(test, "FY", 1), -signal(test, "FY", 0), atol=1e-6)
        np.testing.assert_allclose(signal(test, "MZ", 1), signal(test, "MZ", 0), atol=1e-8)


def test_the_sensor_does_not_see_the_carriages_errors(plan, base):
    for text in ("steer_offset=0.3", "backlash=0.4", "steer_compliance=5e-5"):
        assert np.array_equal(signal(run(plan, text), "SA"), signal(base, "SA"))
    true = run(plan, "steer_offset=0.3").files[0].truth[0].SA_rad
    assert true == pytest.approx(base.files[0].truth[0].SA_rad - math.radians(0.3))


def test_the_recorded_load_lags_its_command_by_the_time_constant(plan):
    """Behind a ramp of rate r a first-order lag trails by r tau, once the start has died away."""
    slow = dataclasses.replace(plan, motion=dataclasses.replace(plan.motion, load_rate_N_s=500.0))
    test = run(slow, "load_lag=0.5s")
    late = signal(test, "FZ_CMD") - signal(test, "FZ")
    assert late.max() == pytest.approx(500.0 * 0.5, rel=1e-3)


def test_revolution_locked_forces_follow_their_shaft(plan, base):
    test = run(plan, "nonuniformity.FY=amplitude_1:30N,phase_1:25")
    angle = signal(base, "TIRE_ANGLE")
    extra = signal(test, "FY") - signal(base, "FY")
    np.testing.assert_allclose(extra, 30 * np.cos(angle + np.radians(25)), atol=1e-6)
    # one turn of a tire of effective radius 0.97 x 0.316 m, of a drum of 8.5 m: 7.66 km/h
    t = signal(base, "t")
    rolled = 7.66 / 3.6 * (t[-1] - t[0])
    assert angle[-1] - angle[0] == pytest.approx(rolled / (0.97 * 0.316), rel=1e-9)
    drum = signal(base, "DRUM_ANGLE")
    assert drum[-1] - drum[0] == pytest.approx(2 * np.pi * rolled / 8.5, rel=1e-9)
    assert np.all(np.diff(signal(base, "DRUM_ANGLE", 1)) < 0)


@pytest.mark.parametrize(("heat", "cooling"), [(0.5, 60.0), (1.0, 15.0)])
def test_heat_of_the_tread_is_slip_work_less_what_has_left(plan, heat, cooling):
    """T' = heat |FY V sin(SA)| - (T - room)/cooling, integrated over the recording apart from the chain."""
    motion = dataclasses.replace(
        plan.motion, ambient_drift_K_s=0.0, tread_heating_K_J=heat * 1e-3, tread_cooling_s=cooling
    )
    s = simulate(dataclasses.replace(plan, motion=motion)).files[0].signals
    rise = s["T_TREAD"] - s["T_AMBIENT"]
    power = np.abs(s["FY"] * s["V"] * np.sin(s["SA"])) * 1e-3

    def integral(y):
        return float(np.sum((y[1:] + y[:-1]) / 2 * np.diff(s["t"])))

    assert rise[0] == 0
    assert heat * integral(power) == pytest.approx(rise[-1] + integral(rise) / cooling, rel=2e-3)


def test_warmth_and_wear_go_on_from_file_to_file_and_cool_between(plan):
    test = simulate(plan)
    end, start = test.files[0].signals, test.files[1].signals
    warm = end["T_TREAD"][-1] - end["T_AMBIENT"][-1]
    assert start["T_TREAD"][0] - start["T_AMBIENT"][0] == pytest.approx(warm * math.exp(-30 / 60), rel=1e-6)
    assert start["t"][0] - end["t"][-1] == pytest.approx(30.0)
    worn = run(plan, "wear=0.01")
    new = abs(signal(worn, "FY", 0) / signal(test, "FY", 0))
    old = abs(signal(worn, "FY", 1) / signal(test, "FY", 1))
    moving = np.abs(np.degrees(signal(test, "SA"))) > 1
    assert new[moving][0] < old[moving][0]


def test_a_heated_tire_grips_less_going_on(plan, base):
    made = run(plan, "thermal_friction=peak_per_K:-0.01,stiffness_per_K:-0.01")
    ratio = np.abs(signal(made, "FY")) / np.abs(signal(base, "FY")).clip(1.0)
    at = np.abs(np.degrees(signal(base, "SA"))) > 3.9
    assert np.all(ratio[at] < 1)
    assert ratio[at][-1] < ratio[at][0]
    rise = signal(made, "T_TREAD")[at] - 294.15
    # friction and stiffness by one factor: the whole curve is scaled
    np.testing.assert_allclose(ratio[at], 1 - 0.01 * rise, atol=2e-3)


def test_only_the_runs_of_a_condition(plan, base):
    made = run(plan, "surface_friction@order:2=0.8")
    assert np.array_equal(signal(made, "FY", 0), signal(base, "FY", 0))
    assert not np.array_equal(signal(made, "FY", 1), signal(base, "FY", 1))


def test_effects_act_in_the_order_of_the_stages_however_they_are_given(plan):
    texts = [
        "channel_sign.FY",
        "sensitivity_error.D51=0.05",
        "relaxation=0.4m",
        "backlash=0.4",
        "drum_curvature=0.1",
    ]
    one, other = run(plan, *texts), run(plan, *reversed(texts))
    for name in one.files[0].signals:
        assert np.array_equal(signal(one, name), signal(other, name)), name


def test_two_effects_of_two_stages_compose(plan, base):
    """A gain on a cell after an offset at the hub: E5 = (1 + g) (E5 with the offset), by the linear map."""
    offset, both = (
        run(plan, "zero_offset.FY=100N"),
        run(plan, "zero_offset.FY=100N", "sensitivity_error.E5=0.1"),
    )
    np.testing.assert_allclose(signal(both, "E5"), 1.1 * signal(offset, "E5"), rtol=1e-12)
    np.testing.assert_allclose(signal(offset, "FY") - signal(base, "FY"), 100.0, atol=1e-6)
    np.testing.assert_allclose(signal(offset, "MZ"), signal(base, "MZ"), atol=1e-7)


def test_within_a_stage_the_given_order_holds(plan):
    clipped = run(plan, "saturation.FY=1000N", "unit_error.FY=2")
    scaled = run(plan, "unit_error.FY=2", "saturation.FY=1000N")
    assert np.abs(signal(clipped, "FY")).max() == pytest.approx(2000.0)
    assert np.abs(signal(scaled, "FY")).max() == pytest.approx(1000.0)


def test_a_wrong_calibration_must_be_known(plan):
    with pytest.raises(ConfigError, match="not known"):
        simulate(with_effects(plan, ["wrong_calibration=m15-r9"]))


def test_a_dwell_recording_remembers_the_moves_it_leaves_out(virtual_plan):
    """2.26 s after each load step a lag of 3 s still shows; a lag of 0.05 s does not."""
    short = dataclasses.replace(virtual_plan, slip_angles_rad=(0.0,), rotations=("forward",))
    plain = simulate(short).files[0].columns["FZ"]
    slow = simulate(with_effects(short, ["load_lag=3s"])).files[0].columns["FZ"]
    quick = simulate(with_effects(short, ["load_lag=0.05s"])).files[0].columns["FZ"]
    assert (slow < plain - 5).mean() > 0.9
    np.testing.assert_allclose(quick, plain, atol=0.02)
