"""Kinds of simulation: one file each, every fact stated, and nobody who asks their class."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import toolkit.diagnosis.simulators as simulators
from tests.conftest import EXAMPLES
from tests.diagnosis.cases import HEAD, TWO, write_case
from tests.diagnosis.tire_case import python_tire, sweep, toml
from tests.golden.cases import TIRE_FILE
from toolkit.diagnosis.case.case import KINDS
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import builder, model_of
from toolkit.diagnosis.simulators.simulator import Capability

REGISTRY = EXAMPLES.parents[1] / "calibrations"
FACTS = {one.name: None for one in dataclasses.fields(Capability)}
ROOM = Path(simulators.__file__).parent


def test_every_kind_of_the_case_file_has_one_file_and_every_such_file_is_a_kind() -> None:
    modules = [one.name for one in pkgutil.iter_modules([str(ROOM)])]
    building = [
        name for name in modules if hasattr(importlib.import_module(f"{simulators.__name__}.{name}"), "build")
    ]
    assert sorted(building) == sorted(KINDS)
    for kind in KINDS:
        assert callable(builder(kind))


@pytest.mark.parametrize("fact", FACTS)
def test_a_kind_that_leaves_a_fact_out_is_told_which(fact: str) -> None:
    with pytest.raises(TypeError, match=fact):
        Capability(**{name: value for name, value in FACTS.items() if name != fact})


def test_a_simulator_of_its_own_is_asked_twice_and_moves_along_its_recording(tmp_path: Path) -> None:
    stated = model_of(read_case(write_case(tmp_path)), None).capability
    assert stated.repeats is not None
    assert stated.together is None
    assert stated.motion is not None
    assert not stated.motion.integrates
    assert stated.motion.units("F") == ("N", "m/s", "m/s*s")
    sizes = stated.motion.sizes("F", lambda name: {"F": 60.0, "v": 0.3}[str(name)])
    assert (sizes.force, sizes.speed, sizes.fastest, sizes.has_position) == (60.0, 0.3, 0.3, False)


def test_an_equation_integrates_several_sets_at_once_and_knows_its_own_sizes(tmp_path: Path) -> None:
    text = HEAD.replace('kind = "python"', 'kind = "ode"\nstates = ["h", "v"]\nforce_terms = { v = "N/kg" }')
    text = text.replace('function = "simulate"\n', "").replace(
        'F = { unit = "N", role = "output" }', 'h = { unit = "m", role = "output" }'
    )
    equation = """
def rhs(t, x, u, p):
    return [x[1], -9.81]
def outputs(x, u, p):
    return {"h": x[0]}
def initial(p):
    return [100.0, 0.0]
"""
    t = np.arange(30) * 0.1
    rows = pd.DataFrame({"t": t, "v": 0.0 * t, "a": 0.0 * t, "h": 100 - 9.81 * t**2 / 2})
    frames = {"r0__csv": rows, "r1__csv": rows.assign(h=rows["h"] + 1e-6)}
    case = read_case(write_case(tmp_path, text + TWO, simulator=equation, **frames))
    stated = model_of(case, None).capability
    assert stated.together is not None
    assert stated.motion is not None
    assert stated.motion.integrates
    assert stated.motion.units("v") == ("N/kg", "m/s", "m")
    sizes = stated.motion.sizes("v", lambda _: 1.0)
    assert sizes.has_position
    assert (sizes.force, sizes.fastest, sizes.farthest) == pytest.approx(
        (9.81, 9.81 * t[-1], 100.0), rel=1e-5
    )
    # It starts at rest and only falls: what may run over is counted to its place.
    assert sizes.level == sizes.place


def test_a_tire_file_states_its_load_and_a_calibration_its_cells(tmp_path: Path) -> None:
    text = toml('kind = "machine"\ntire = "tire.tir"', mu="LMUY")
    frames = {f"r{i}__csv": sweep("SAE", seed=i) for i in range(2)}
    stated = model_of(
        read_case(write_case(tmp_path, text, simulator=None, tire__tir=TIRE_FILE, **frames)), REGISTRY
    ).capability
    assert stated.nominal_load_N == 4000.0
    assert (stated.cells, stated.motion, stated.repeats, stated.together) == ((), None, None, None)
    assert model_of(read_case(python_tire(tmp_path / "python")), None).capability.nominal_load_N is None


def test_nobody_asks_a_simulation_for_its_class_or_for_what_it_may_lack() -> None:
    for path in sorted(ROOM.parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                asked = ast.unparse(node)
                probed = node.func.id in ("getattr", "hasattr", "isinstance")
                assert not (probed and "model" in asked.lower()), f"{path.name}: {asked}"
