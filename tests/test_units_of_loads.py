"""A load is the same load in N, kN, kgf, gf, lbf and lb, whichever file it stands in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.session_file import Amount
from toolkit.errors import ToolkitError
from toolkit.machine import load_machine, read_protocol
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.planning.demands import load_of
from toolkit.recording.folder import read_test_folder
from toolkit.recording.read import read_recording
from toolkit.simulation.plan import read_plan

# By definition: the standard acceleration 9.80665 m/s^2 (CGPM 1901), the pound 0.45359237 kg (1959).
NEWTONS = {
    "N": 1.0, "kN": 1e3, "kgf": 9.80665, "gf": 9.80665e-3,
    "lbf": 0.45359237 * 9.80665, "lb": 0.45359237 * 9.80665,
}  # fmt: skip
PLANS = Path(__file__).parents[2] / "toolkit" / "examples" / "virtual"
LOADS_N = (1112.0, 3705.5, 6103.25)

units = pytest.mark.parametrize("unit", NEWTONS)


def stated(unit: str, *loads_N: float) -> list[float]:
    return [load / NEWTONS[unit] for load in loads_N]


@units
def test_a_recording(unit: str, tmp_path: Path) -> None:
    lines = [f"FZ load [{unit}],D52 [lbf],D51 [lbf],E5 [lbf],SA [deg]"]
    lines += [f"{load!r},1,2,3,0" for load in stated(unit, *LOADS_N)]
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    recording = read_recording(tmp_path / "run.csv", load_machine(DEFAULT_MACHINE))
    np.testing.assert_allclose(recording["FZ"].si, LOADS_N, rtol=1e-14)


@units
def test_the_rated_load_of_a_test(unit: str, tmp_path: Path) -> None:
    (rated,) = stated(unit, 4000.0)
    (tmp_path / "test.toml").write_text(
        f'schema = 1\nmachine = "{DEFAULT_MACHINE}"\nrated_load = {{ value = {rated!r}, unit = "{unit}" }}\n'
    )
    (tmp_path / "run.csv").write_text("FZ load [N],D52 [lbf],D51 [lbf],E5 [lbf],SA [deg]\n1,1,2,3,0\n")
    assert read_test_folder(tmp_path).info.rated_load_N == pytest.approx(4000.0, rel=1e-14)


@units
def test_a_protocol(unit: str, tmp_path: Path) -> None:
    (tmp_path / "protocol.toml").write_text(
        'schema = 1\nsource = "house"\nslip_angles = { value = [0], unit = "deg" }\n'
        f'loads = {{ value = {stated(unit, *LOADS_N)!r}, unit = "{unit}" }}\n'
        'slip_angle_tolerance = { value = 0.5, unit = "deg" }\nload_tolerance = 0.05\n'
        'settle_revolutions = 2\naverage_revolutions = 1\nacquisition = "after_settling"\n'
    )
    assert read_protocol(tmp_path / "protocol.toml").loads_N == pytest.approx(LOADS_N, rel=1e-14)


@units
def test_a_plan_of_a_simulation(unit: str, tmp_path: Path) -> None:
    (first, second) = stated(unit, 1500.0, 3000.0)
    (tmp_path / "plan.toml").write_text(
        'schema = 1\nkind = "test"\ndate = 2026-03-17\n'
        f'slip_angles = {{ value = [0, 1], unit = "deg" }}\n'
        f'loads = {{ value = [{first!r}, {second!r}], unit = "{unit}" }}\n'
    )
    runs = read_plan(tmp_path / "plan.toml").recordings
    loads = sorted({load for run in runs for load in run.loads_N})
    assert loads == pytest.approx([1500.0, 3000.0], rel=1e-14)


@units
def test_a_load_in_words_and_a_quantity(unit: str) -> None:
    (load,) = stated(unit, 3700.0)
    assert Amount(value=load, unit=unit).si("force", "doctest") == pytest.approx(3700.0, rel=1e-14)
    assert load_of(f"{load:.15f} {unit}") == pytest.approx(3700.0, rel=1e-12)


def response(unit: str, folder: Path) -> tuple[np.ndarray, float]:
    """Return the SI coefficients of a session whose loads stand in a unit, and its residual sd [N]."""
    rng = np.random.default_rng(11)
    loads_N = np.tile([0.0, 1000.0, 2500.0, 4000.0, -2500.0], 8)
    cell = loads_N / 2000 + 1e-4 * rng.normal(size=40)
    folder.mkdir()
    lines = [f"A [mV/V],FY [{unit}],run,direction"]
    for row, (x, load) in enumerate(zip(cell.tolist(), stated(unit, *loads_N.tolist()), strict=True)):
        lines.append(f"{x!r},{load!r},{1 + row // 20},up")
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    (folder / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "rig"\ndate = 2026-01-05\noperator = "A"\n'
        'temperature = { value = 20.0, unit = "degC" }\nindications = ["A"]\nloads = ["FY"]\n'
        'data = "loads.csv"\n'
    )
    fit = calibrate(folder / "SESSION.toml", Registry(folder / "registry")).record.load("FY")
    assert fit.residual_sd is not None
    return np.array(fit.coefficients) * NEWTONS[unit], fit.residual_sd * NEWTONS[unit]


@units
def test_a_session(unit: str, tmp_path: Path) -> None:
    coefficients, sd = response(unit, tmp_path / "other")
    expected, expected_sd = response("N", tmp_path / "newtons")
    np.testing.assert_allclose(coefficients, expected, rtol=1e-9, atol=1e-9)
    assert sd == pytest.approx(expected_sd, rel=1e-9)


def test_a_mass_is_no_load(tmp_path: Path) -> None:
    with pytest.raises(ToolkitError):
        Amount(value=400.0, unit="kg").si("force", "doctest")
