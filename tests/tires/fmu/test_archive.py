"""A tire as FMU: compiled, validated, run by another program's importer, equal to what is evaluated."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

import toolkit
from tests.conftest import SHARED_DATA
from tests.tires.fmu.fmu_factory import grid, outputs_of
from toolkit.errors import ConfigError
from toolkit.reduction.selection import Selection
from toolkit.tires.fmu import archive
from toolkit.tires.fmu.archive import fmu_of
from toolkit.tires.fmu.equations import equations_of_file, equations_of_fit
from toolkit.tires.global_data import measured
from toolkit.tires.global_model import ModelFit, make_rows
from toolkit.tires.models import find
from toolkit.tires.tir import parse_tir, read_tir
from toolkit.tires.tir_evaluate import evaluate_tir

WHOLE = Selection(rows=np.ones(12, dtype=np.bool_))
# A tire with every kind of term: combined slip, camber, pressure, friction that falls with speed.
FULL = """
[MODEL]
FITTYP = 61
LONGVL = 16.7
[DIMENSION]
UNLOADED_RADIUS = 0.32
[OPERATING_CONDITIONS]
INFLPRES = 220000
NOMPRES = 200000
[VERTICAL]
FNOMIN = 4000
[SCALING_COEFFICIENTS]
LMUY = 0.9
LMUV = 0.2
LKYC = 1.1
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.1
PDX2 = -0.1
PDX3 = 3
PEX1 = 0.1
PEX3 = -0.2
PEX4 = 0.1
PKX1 = 22
PKX2 = 0.4
PKX3 = -0.2
PHX1 = 0.001
PVX1 = 0.01
PPX1 = -0.3
PPX4 = 0.1
RBX1 = 12
RBX2 = -10
RBX3 = 2
RCX1 = 1.1
REX1 = -0.3
RHX1 = 0.004
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = -1.0
PDY2 = 0.12
PDY3 = -2
PEY1 = -0.8
PEY2 = -0.5
PEY3 = 0.2
PEY4 = -4
PEY5 = 10
PKY1 = -16
PKY2 = 1.7
PKY3 = 0.4
PKY4 = 1.9
PKY5 = 1
PKY6 = -0.9
PHY1 = 0.002
PVY1 = 0.01
PVY3 = -0.2
PPY1 = -0.6
PPY3 = -0.1
RBY1 = 7
RBY2 = 2.5
RBY3 = 0.02
RBY4 = 3
RCY1 = 1.05
REY1 = 0.3
RHY1 = 0.02
RVY1 = 0.05
RVY3 = -0.5
RVY4 = 12
RVY5 = 1.9
RVY6 = -10
[ALIGNING_COEFFICIENTS]
QBZ1 = 10
QBZ2 = -1.5
QBZ4 = 0.3
QBZ5 = -0.2
QBZ9 = 18
QBZ10 = 0.5
QCZ1 = 1.15
QDZ1 = 0.11
QDZ3 = 0.2
QDZ6 = 0.002
QDZ8 = -0.3
QEZ1 = -1.5
QEZ4 = 0.2
QHZ1 = 0.001
PPZ1 = -0.4
SSZ1 = 0.02
SSZ2 = 0.01
SSZ3 = 0.4
"""


def _files():
    yield parse_tir(FULL, where="full.tir")
    yield parse_tir(FULL.replace("FITTYP = 61", "FITTYP = 6") + "[X_COEFFICIENTS]\nLGAY = 0.8\nPHY3 = 0.02\n")
    yield read_tir(Path(toolkit.example("tire")))
    yield read_tir(SHARED_DATA / "goodyear_feda_tir" / "335_65R22_5_G275MSA_60psi.tir")


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("number", range(4))
def test_an_fmu_of_a_tire_file_gives_what_is_evaluated(tmp_path: Path, number: int, fmi: str) -> None:
    tir, path = list(_files())[number], tmp_path / "tire.fmu"
    equations = equations_of_file(tir)
    path.write_bytes(fmu_of(equations, name="tire", fmi=fmi).content)
    assert validate_fmu(str(path)) == []
    rows = {
        name: column for name, column in grid().items() if name != "P" or "P" in equations.program.quantities
    }
    expected, _ = evaluate_tir(tir, **rows)
    outputs = outputs_of(path, rows)
    assert sorted(outputs) == ["FX", "FY", "MZ"]
    for name, values in outputs.items():
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["brush", "tmeasy", "lugre", "pacejka94", "mf62"])
def test_an_fmu_of_a_fitted_model_gives_its_forces_in_iso_axes(tmp_path: Path, name: str) -> None:
    model, rows = find(name), grid()
    rows["V"] = np.abs(rows["V"]) + 1
    data = measured(
        {"SA": np.tile([-0.1, 0.1], 6), "FZ": np.repeat([2000.0, 4000.0, 6000.0], 4), "FY": np.ones(12)},
        axes="SAE",
    )
    values = model.values({})
    # Every parameter at a place of its own within its bounds, so that none is neutral.
    moved = np.clip(values + 0.7 * np.array([entry.size for entry in model.parameters]), *_bounds(model))
    fit = ModelFit(
        model=name, values=moved, fits=tuple(map(_Channel, model.channels)), curves=(), selection=WHOLE
    )
    equations = equations_of_fit(model, fit, data)
    path = tmp_path / "tire.fmu"
    path.write_bytes(fmu_of(equations, name=name).content)
    assert validate_fmu(str(path)) == []
    sides = {"SAE": -1, "adapted-SAE": -1, "ISO-W": 1}[model.axes]
    asked = make_rows(
        (-1 if model.axes == "SAE" else 1) * rows["SA"], rows["FZ"], FNOMIN=data.rows.FNOMIN, IA=rows["IA"],
        P=rows["P"], V=rows["V"], KAPPA=rows["KAPPA"], NOMPRES=data.rows.NOMPRES,
        UNLOADED_RADIUS=data.rows.UNLOADED_RADIUS, LONGVL=data.rows.LONGVL,
    )  # fmt: skip
    forces = model.forces(moved.tolist(), asked)
    outputs = outputs_of(path, {entry.name: rows[entry.name] for entry in equations.inputs})
    assert set(outputs) == set(model.channels)
    for channel, outcome in outputs.items():
        expected = (1 if channel == "FX" else sides) * forces[channel]
        np.testing.assert_allclose(outcome, expected, rtol=1e-9, atol=1e-9)


class _Channel:
    def __init__(self, channel: str) -> None:
        self.channel = channel


def _bounds(model):
    return [entry.low for entry in model.parameters], [entry.high for entry in model.parameters]


def test_a_parameter_of_the_fmu_is_the_coefficient_of_the_file(tmp_path: Path) -> None:
    path, rows = tmp_path / "tire.fmu", grid()
    path.write_bytes(fmu_of(equations_of_file(parse_tir(FULL)), name="tire").content)
    expected, _ = evaluate_tir(parse_tir(FULL.replace("LMUY = 0.9", "LMUY = 0.7")), **rows)
    np.testing.assert_allclose(outputs_of(path, rows, {"LMUY": 0.7})["FY"], expected.FY, rtol=1e-9, atol=1e-9)


def test_a_coefficient_that_chooses_the_equations_is_no_parameter() -> None:
    names = [entry.name for entry in equations_of_file(parse_tir(FULL)).parameters]
    assert "LMUY" in names
    assert "LMUV" not in names


def test_the_same_tire_gives_the_same_bytes_and_another_another_identity() -> None:
    def token(content: bytes) -> bytes:
        with zipfile.ZipFile(io.BytesIO(content)) as fmu:
            return fmu.read("modelDescription.xml").split(b"guid=")[1][:40]

    one, again, other = (
        fmu_of(equations_of_file(parse_tir(text)), name="tire").content
        for text in (FULL, FULL, FULL.replace("PKY1 = -16", "PKY1 = -17"))
    )
    assert one == again
    assert token(one) != token(other)


def test_an_iteration_is_refused_with_what_can_be_written(tmp_path: Path) -> None:
    model = find("treadsim")
    data = measured(
        {"SA": np.tile([-0.1, 0.1], 6), "FZ": np.repeat([2000.0, 4000.0, 6000.0], 4), "FY": np.ones(12)},
        axes="SAE",
    )
    fit = ModelFit(
        model="treadsim", values=model.values({}), fits=(_Channel("FY"),), curves=(), selection=WHOLE
    )
    with pytest.raises(ConfigError, match="cannot be written as C") as caught:
        equations_of_fit(model, fit, data)
    assert "brush" in str(caught.value)


def test_without_a_compiler_the_sources_stand_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "_COMPILERS", ("no-such-compiler",))
    fmu = fmu_of(equations_of_file(parse_tir(FULL)), name="tire", fmi="3")
    assert fmu.binary is None
    with zipfile.ZipFile(io.BytesIO(fmu.content)) as files:
        names = files.namelist()
    assert "sources/tire.c" in names
    assert "sources/buildDescription.xml" in names
    assert not [name for name in names if name.startswith("binaries")]


def test_another_version_of_fmi_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown version"):
        fmu_of(equations_of_file(parse_tir(FULL)), name="tire", fmi="1")
