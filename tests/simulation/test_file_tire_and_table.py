"""A tire file on the virtual machine, and the maker's flat-surface table of a plan."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.effects.signals import drive
from toolkit.errors import ConfigError, ToolkitError
from toolkit.simulation.file_tire import read_file_tire
from toolkit.simulation.plan import read_plan, with_effects
from toolkit.simulation.run import simulate
from toolkit.simulation.steady import settled, steady_of, table_csv, write_table
from toolkit.simulation.truth import truth_document
from toolkit.tires.table import read_table
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_evaluate import evaluate_tir

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
TIRE = EXAMPLES / "tire.tir"
PULLING = Path(__file__).parent / "riddles" / "tire.tir"
SA, LOADS = np.radians(np.linspace(-10, 10, 21)), (1500.0, 4000.0, 6500.0)


@pytest.fixture(scope="module")
def plan():
    return read_plan(EXAMPLES / "continuous_plan.toml")


def on_machine(plan, rotation, *, IA=0.0, FZ=4000.0, pressure=230e3):
    steady = steady_of(plan, rotation=rotation, facing=1.0, pressure_Pa=pressure)
    d = drive(np.arange(21.0), SA, np.full(21, FZ), IA=IA, V=plan.machine.drum.speed_m_s)
    return steady(d.SA, d)


@pytest.mark.parametrize("FZ", LOADS)
def test_forces_are_those_of_the_evaluated_file_in_the_machines_axes(FZ):
    """ISO-W to the machine: y and z turn, and SA, FY, MZ with them; a reversed drum turns FY once more."""
    read = read_plan(EXAMPLES / "continuous_plan.toml")
    pulling = dataclasses.replace(read, tire_file=read_file_tire(PULLING))
    iso, _ = evaluate_tir(read_tir(PULLING), SA=-SA, FZ=FZ, V=read.machine.drum.speed_m_s)
    forward, reverse = (on_machine(pulling, one, FZ=FZ) for one in ("forward", "reverse"))
    np.testing.assert_allclose(forward.FY, -iso.FY, rtol=1e-12)
    np.testing.assert_allclose(forward.MZ, -iso.MZ, rtol=1e-12)
    np.testing.assert_allclose(reverse.FY, iso.FY, rtol=1e-12)
    np.testing.assert_allclose(reverse.MZ, -iso.MZ, rtol=1e-12)


def test_camber_turns_with_the_travel_and_pressure_is_the_true_one(plan):
    cambered, _ = evaluate_tir(read_tir(TIRE), SA=-SA, FZ=4000.0, IA=-0.01)
    np.testing.assert_allclose(on_machine(plan, "reverse", IA=0.01).FY, cambered.FY, rtol=1e-9)
    soft, _ = evaluate_tir(read_tir(TIRE), SA=-SA, FZ=4000.0, P=200e3)
    np.testing.assert_allclose(on_machine(plan, "forward", pressure=200e3).FY, -soft.FY, rtol=1e-9)


def test_pressure_change_is_a_tire_at_another_pressure(plan):
    less = with_effects(plan, ["pressure_change=-30kPa"])
    for FZ in LOADS:
        there, _ = evaluate_tir(read_tir(TIRE), SA=0.05, FZ=FZ, P=200e3)
        assert settled(less, {})(-0.05, FZ, "forward")[0] == pytest.approx(-float(there.FY), rel=1e-9)


def test_no_load_no_force(plan):
    for FZ in (0.0, -100.0):
        made = on_machine(plan, "forward", FZ=FZ)
        assert not made.FY.any()
        assert not made.MZ.any()


def test_sizes_come_from_the_file(plan):
    assert (plan.tire.nominal_load_N, plan.tire.free_radius_m) == (4000.0, 0.316)
    assert plan.pressure_Pa == 230e3
    assert (plan.tire.conicity_N, plan.tire.plysteer_rad) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("file = 'none.tir'", "none.tir"),
        ("file = 5", "tire.tir"),
        (f"file = '{TIRE}'\nplysteer = {{ value = 1, unit = 'deg' }}", "plysteer"),
        ("file = 'bad.tir'", "FITTYP"),
        ("file = 'flat.tir'", "UNLOADED_RADIUS"),
        ("file = 'empty.tir'", "no lateral force"),
    ],
)
def test_bad_tire_files_are_told_as_such(tmp_path, line, told):
    text = TIRE.read_text()
    (tmp_path / "bad.tir").write_text(text.replace("FITTYP = 61", "FITTYP = 7"))
    (tmp_path / "flat.tir").write_text(text.replace("UNLOADED_RADIUS = 0.316", "UNLOADED_RADIUS = 0"))
    (tmp_path / "empty.tir").write_text(text.replace("PKY1 = -15.8", ""))
    (tmp_path / "plan.toml").write_text(f"date = 2026-03-17\n[tire]\n{line}\n")
    with pytest.raises(ToolkitError) as caught:
        read_plan(tmp_path / "plan.toml")
    assert told in str(caught.value)
    assert caught.value.exit_code == 2


def test_the_makers_table_is_the_tire_on_a_flat_road(plan, tmp_path):
    table = read_table(write_table(plan, tmp_path), axes="SAE")
    iso, _ = evaluate_tir(read_tir(TIRE), SA=-table["SA"], FZ=table["FZ"], V=plan.machine.drum.speed_m_s)
    np.testing.assert_allclose(table["FY"], -iso.FY, rtol=2e-5, atol=1e-3)
    np.testing.assert_allclose(table["MZ"], -iso.MZ, rtol=2e-5, atol=1e-4)
    assert len(table["SA"]) == len(plan.slip_angles_rad) * len(plan.loads_N)
    curved = with_effects(plan, ["drum_curvature=0.2"])
    assert table_csv(curved) != table_csv(plan)


def test_the_truth_of_a_test_has_the_effects_of_road_and_tire_and_no_others(plan):
    small = dataclasses.replace(plan, runs=plan.runs[:1], rotations=("forward",))

    def stiffness(*texts):
        document = truth_document(simulate(with_effects(small, list(texts))))
        return document["per_load"][1]["at_step"]["stiffness"][0]["slope_cornering"]

    plain = stiffness()
    # PKY1 F0 sin(2 arctan(FZ / (PKY2 F0))) at 4 kN and the nominal pressure (Pacejka 2012, 4.E25)
    assert plain == pytest.approx(15.8 * 4000 * math.sin(2 * math.atan(1 / 1.62)), rel=1e-4)
    assert stiffness("drum_curvature=0.2") == pytest.approx(0.8 * plain, rel=1e-5)
    assert stiffness("steer_compliance=5e-5", "sensitivity_error=0.1") == plain


def test_pseudo_angles_of_the_published_tire_are_not_for_a_file(tmp_path):
    (tmp_path / "plan.toml").write_text(
        f"date = 2026-03-17\n[tire]\nfile = '{TIRE}'\nconicity = {{ value = 1, unit = 'N' }}\n"
    )
    with pytest.raises(ConfigError):
        read_plan(tmp_path / "plan.toml")


def test_a_file_tire_leaves_out_names_of_the_other_magic_formula(tmp_path):
    text = TIRE.read_text()
    version = next(line for line in text.splitlines() if line.startswith("FITTYP"))
    (tmp_path / "mixed.tir").write_text(text.replace(version, "FITTYP = 5"))
    found = read_file_tire(tmp_path / "mixed.tir")
    assert "PKY6" not in found.tir.coefficients()
    assert [one.rule for one in found.tir.findings()] == ["tir-foreign-names"]
