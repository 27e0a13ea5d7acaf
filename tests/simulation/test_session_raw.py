"""Virtual bridges recorded as ratios, millivolts or counts: every way leads back to the truth."""

import json
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.simulation.plan import read_plan
from toolkit.simulation.session import shunt_step, simulate_session
from toolkit.simulation.write import write_session

PLAN = (Path(toolkit.__file__).parent / "examples/virtual/session_plan.toml").read_text(encoding="utf-8")


def plan(folder, lines):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plan.toml").write_text(PLAN + lines + "\n", encoding="utf-8")
    return read_plan(folder / "plan.toml")


@pytest.mark.parametrize(
    ("lines", "unit"),
    [
        ('output = "mV/V"', "mV/V"),
        ('output = "mV"', "mV"),
        ('output = "mV"\nexcitation = { value = 5, unit = "V" }', "mV"),
        ('output = "count"', "count"),
        ('output = "count"\nscale = { value = 2e-7, unit = "mV/V" }', "count"),
    ],
)
def test_the_truth_is_recovered_within_its_uncertainty(tmp_path, lines, unit):
    files = write_session(simulate_session(plan(tmp_path, lines + "\nreadings = true")), tmp_path / "s")
    assert f"D51 [{unit}]" in (tmp_path / "s" / "loads_simulated.csv").read_text().splitlines()[0]
    made = calibrate(files[0], Registry(tmp_path / "cal"))
    truth = json.loads((tmp_path / "s" / "truth.json").read_text())["coefficients"]
    z = [
        (value - truth[one.load][term]) / error
        for one in made.record.loads
        for term, value, error in zip(one.terms, one.coefficients, one.standard_errors, strict=True)
        if term in truth[one.load]
    ]
    # Nine differences over their standard errors: chi-square of 9, 0.1 % points 0.97 and 27.9.
    assert 0.97 < np.sum(np.square(z)) < 27.9
    assert made.record.indication_units == ("mV/V",) * 3
    assert made.record.zero == "tared"
    assert [f for f in made.findings if f.level != "note"] == []
    assert Registry(tmp_path / "cal").load(made.record.id) == made.record


def test_its_readings_tell_what_was_put_in(tmp_path):
    lines = 'output = "count"\nreadings = true\nzero_drift = { value = 0.002, unit = "mV/V" }'
    files = write_session(simulate_session(plan(tmp_path, lines)), tmp_path / "s")
    made = calibrate(files[0], Registry(tmp_path / "cal"))
    # Noise of 5e-6 mV/V in each of two readings, and half a count of 4e-7.
    assert [one.drift for one in made.readings.zero] == pytest.approx([0.002] * 3, abs=5e-5)
    assert [one.measured for one in made.readings.shunts] == pytest.approx([1e3 * shunt_step()] * 3, abs=5e-5)
    assert all(one.within for one in made.readings.shunts)
    # 0.002 of 2 mV/V in each cell: FY sums them, 0.002 / 2 x 3000 lbf x 3 = 9 lbf, far out of tolerance.
    drift = {one.load: one.drift for one in made.readings.zero_loads}
    assert drift["FY"] == pytest.approx(9.0, rel=0.02)
    assert [f.where for f in made.findings if f.rule == "zero-drift"] == ["FY"]


def test_the_shunt_step_is_that_of_the_bridge():
    """Kirchhoff: node voltages of a 350 ohm bridge with 87 150 ohm across one arm, at 1 V."""
    arm = 350.0 * 87150.0 / (350.0 + 87150.0)
    assert shunt_step() == pytest.approx(350.0 / (350.0 + arm) - 0.5, rel=1e-12)


def test_readings_and_output_change_nothing_else(tmp_path):
    plain = simulate_session(plan(tmp_path / "a", ""))
    more = simulate_session(plan(tmp_path / "b", "readings = true"))
    assert np.array_equal(plain.indications, more.indications)
    assert np.array_equal(plain.check_indications, more.check_indications)
    counts = simulate_session(plan(tmp_path / "c", 'output = "count"'))
    assert np.array_equal(counts.indications, np.round(counts.indications))
    # 6 decimals of mV/V against counts of 4e-7 mV/V
    np.testing.assert_allclose(counts.indications * 4e-7, plain.indications, atol=0.5e-6 + 2e-7 + 1e-12)


@pytest.mark.parametrize(
    "line",
    [
        'output = "V"',
        'excitation = { value = 0, unit = "V" }',
        'excitation = { value = 10, unit = "A" }',
        "excitation = 10",
        'scale = { value = 0, unit = "mV/V" }',
        'scale = { value = 1e-7, unit = "mV" }',
        'readings = "yes"',
        'zero_drift = { value = nan, unit = "mV/V" }',
    ],
)
def test_bad_plans(tmp_path, line):
    with pytest.raises(ToolkitError) as caught:
        plan(tmp_path, line)
    assert caught.value.exit_code == 2
    assert caught.value.where
    assert caught.value.next_step
