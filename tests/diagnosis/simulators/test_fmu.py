"""Kind ``fmu``: units of FMI 2 and 3 as simulations, their names and units, what is refused, and a search."""

from __future__ import annotations

import functools
import io
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.errors import ConfigError, FitError
from toolkit.tires.fmu.archive import fmu_of
from toolkit.tires.fmu.equations import TireEquations, Variable
from toolkit.tires.recorded import record

FMU_HEAD = HEAD.replace(
    'kind = "python"\npath = "sim.py"\nfunction = "simulate"', 'kind = "fmu"\npath = "plant.fmu"'
)


@functools.cache
def plant(fmi: str = "2", *, speed: str = "v", force: str = "F") -> bytes:
    """Return F = mass a + c v as unit; the speed in mm/s where its name is ``speed_mm``."""
    factor = 1e-3 if speed == "speed_mm" else 1.0
    program = record(
        lambda q: {force: q["mass"] * q["a"] + q["c"] * q[speed] * factor}, [speed, "a", "mass", "c"]
    )
    equations = TireEquations(
        title="a carriage", reference="", program=program,
        inputs=(
            Variable(name=speed, unit="mm/s" if speed == "speed_mm" else "m/s", text="speed", start=0.0),
            Variable(name="a", unit="m/s^2", text="acceleration", start=0.0),
        ),
        parameters=(
            Variable(name="mass", unit="kg", text="mass", start=1.0),
            Variable(name="c", unit="N*s/m", text="viscous", start=1.0),
        ),
        outputs=(Variable(name=force, unit="N", text="force"),),
    )  # fmt: skip
    return fmu_of(equations, name="plant", fmi=fmi).content


def case_of(folder: Path, toml: str = FMU_HEAD + TWO, **files: object) -> Path:
    return write_case(folder, toml, simulator=None, **{"plant__fmu": plant(), **files})


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_unit_gives_its_outputs_at_every_row(tmp_path: Path, fmi: str) -> None:
    case = read_case(case_of(tmp_path, plant__fmu=plant(fmi)))
    run = case.runs[0]
    answer = model_of(case, None).simulate(run, {"mass": 95.0, "c": 200.0}, ())
    np.testing.assert_allclose(answer["F"], 95.0 * run.columns["a"] + 200.0 * run.columns["v"], rtol=1e-12)


def test_names_are_mapped_and_units_converted(tmp_path: Path) -> None:
    mapped = 'path = "plant.fmu"\ninputs = { speed_mm = "v" }\noutputs = { F = "push" }\n'
    toml = FMU_HEAD.replace('path = "plant.fmu"\n', mapped) + TWO
    case = read_case(case_of(tmp_path, toml, plant__fmu=plant(speed="speed_mm", force="push")))
    run = case.runs[0]
    answer = model_of(case, None).simulate(run, {"mass": 95.0, "c": 200.0}, ())
    np.testing.assert_allclose(answer["F"], 95.0 * run.columns["a"] + 200.0 * run.columns["v"], rtol=1e-12)


def test_a_longest_step_cuts_the_way_and_changes_nothing_without_states(tmp_path: Path) -> None:
    stepped = FMU_HEAD.replace(
        'path = "plant.fmu"\n', 'path = "plant.fmu"\nstep = { value = 30, unit = "ms" }\n'
    )
    case = read_case(case_of(tmp_path, stepped + TWO))
    assert case.simulation.step_s == pytest.approx(0.03)
    run = case.runs[0]
    answer = model_of(case, None).simulate(run, {"mass": 95.0, "c": 200.0}, ())
    np.testing.assert_allclose(answer["F"], 95.0 * run.columns["a"] + 200.0 * run.columns["v"], rtol=1e-12)


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        ("parameters.mass", "parameters.mas", "did you mean 'mass'"),
        ('path = "plant.fmu"\n', 'path = "plant.fmu"\ninputs = { sped = "v" }\n', "no input 'sped'"),
        ('path = "plant.fmu"\n', 'path = "plant.fmu"\ninputs = { v = "w" }\n', "no input or covariate"),
        ('path = "plant.fmu"\n', 'path = "plant.fmu"\noutputs = { F = "G" }\n', "no output 'G'"),
        ('unit = "kg"', 'unit = "m"', "mass in kg"),
    ],
)
def test_a_name_or_unit_that_does_not_fit_is_told(tmp_path: Path, good: str, bad: str, message: str) -> None:
    case = read_case(case_of(tmp_path, FMU_HEAD.replace(good, bad, 1) + TWO))
    with pytest.raises(ConfigError) as caught:
        model_of(case, None)
    assert caught.value.rule == "fmu"
    assert message in str(caught.value)


def _changed(content: bytes, *, drop: str = "", add: str = "", text: tuple[str, str] = ("", "")) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(buffer, "w") as target:
        for name in source.namelist():
            if not drop or not name.startswith(drop):
                data = source.read(name)
                if name == "modelDescription.xml" and text[0]:
                    assert text[0].encode() in data
                    data = data.replace(text[0].encode(), text[1].encode())
                target.writestr(name, data)
        if add:
            target.writestr(add, b"x")
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (None, "no archive"),
        ({"drop": "modelDescription"}, "no modelDescription.xml"),
        ({"drop": "binaries"}, "sources alone"),
        ({"add": "../outside"}, "leaves its folder"),
        ({"text": ('fmiVersion="2.0"', 'fmiVersion="1.0"')}, ""),
    ],
)
def test_a_file_that_is_no_usable_unit_is_told(
    tmp_path: Path, change: dict[str, Any] | None, message: str
) -> None:
    content = b"no archive at all" if change is None else _changed(plant(), **change)
    case = read_case(case_of(tmp_path, plant__fmu=content))
    with pytest.raises(ConfigError) as caught:
        model_of(case, None)
    assert caught.value.rule == "fmu"
    assert message in str(caught.value)
    assert not (tmp_path.parent / "outside").exists()


def test_a_unit_that_fails_says_when(tmp_path: Path) -> None:
    case = read_case(case_of(tmp_path))
    with pytest.raises(FitError, match="row") as caught:
        model_of(case, None).simulate(case.runs[0], {"mass": math.inf, "c": 200.0}, ())
    assert "t = " in str(caught.value)


def test_uneven_rows_are_refused_where_the_unit_takes_one_step(tmp_path: Path) -> None:
    one_size = _changed(plant(), text=('canHandleVariableCommunicationStepSize="true"', ""))
    uneven = carriage(seed=0)
    uneven.loc[3, "t"] += 0.02
    case = read_case(case_of(tmp_path, plant__fmu=one_size, r0__csv=uneven))
    with pytest.raises(FitError, match="one size alone"):
        model_of(case, None).simulate(case.runs[0], {"mass": 95.0, "c": 200.0}, ())


@pytest.mark.campaign("a whole diagnosis by a unit: what it simulates is held in every run")
def test_friction_that_the_unit_leaves_out_is_named(tmp_path: Path) -> None:
    # The recordings have 20 N of dry friction; the unit has none.
    answer = diagnose(read_case(case_of(tmp_path)), None).diagnosis
    assert answer.verdict == "named"
    assert "coulomb" in " ".join(effect.name for effect in answer.effects)
