"""A model file as the tire of a plan: the same test as with its numbers and effects written out."""

import hashlib
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from toolkit.errors import ConfigError
from toolkit.simulation.case import write_case
from toolkit.simulation.plan import read_plan
from toolkit.simulation.run import simulate
from toolkit.tires.tir import read_tir

TIRE = Path(__file__).parent / "riddles" / "tire.tir"
PLAN = """kind = "test"
title = "by a model"
date = 2026-04-01
seed = 5
slip_angles = { value = [0, 2, -2, 6], unit = "deg" }
loads = { value = [2000, 4000], unit = "N" }
[tire]
file = "NAME"
"""
MODEL = """schema = 1
content = "augmented simulation"
title = "a tire"
code_version = "0"
axes = "AXES"
[answer]
verdict = "equivalent"
complete = true
case_sha256 = "0"
recordings = {}
[simulation]
kind = "machine"
machine = "m15"
tire = "tire.tir"
[simulation.sha256]
tire = "SHA"
[simulation.parameters.LMUY]
value = 0.9
unit = "1"
standard_error = 0.01
"""
OFFSET = """[[effect]]
name = "steer_offset"
[effect.parameters.offset]
value = SIGN0.3
unit = "deg"
standard_error = 0.01
"""
LEAK = """[[effect]]
name = "crosstalk"
source = "FZ"
channel = "FY"
[effect.parameters.coefficient]
value = 0.01
unit = "N/(N)"
"""
GRIP = """[[effect]]
name = "surface_friction"
WHERE
[effect.parameters.mu_factor]
value = 0.8
unit = "1"
"""


def made(folder, name, *, effects=(), model=None):
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(TIRE, folder / "tire.tir")
    if model is not None:
        sha = hashlib.sha256(TIRE.read_bytes()).hexdigest()
        (folder / "model.toml").write_text(model.replace("SHA", sha).replace("AXES", "machine"))
    text = PLAN.replace("NAME", name)
    if effects:
        listed = ", ".join(f'"{one}"' for one in effects)
        text = text.replace("[tire]", f"effects = [{listed}]\n[tire]")
    (folder / "plan.toml").write_text(text)
    return read_plan(folder / "plan.toml")


def same(one, other):
    for a, b in zip(simulate(one).files, simulate(other).files, strict=True):
        for name, values in a.signals.items():
            np.testing.assert_allclose(b.signals[name], values, rtol=1e-12, atol=1e-12, err_msg=name)


def test_a_model_is_the_tire_with_its_numbers_and_effects_written_out(tmp_path):
    by_model = made(tmp_path / "a", "model.toml", model=MODEL + OFFSET.replace("SIGN", "") + LEAK)
    by_hand = made(tmp_path / "b", "tire.tir", effects=("steer_offset=0.3deg", "crosstalk.FZ.FY=0.01"))
    text = (tmp_path / "b" / "tire.tir").read_text()
    changed = re.sub(r"(?m)^LMUY\s*=.*$", "LMUY = 0.9", text)
    assert changed.count("LMUY = 0.9") == 1
    (tmp_path / "b" / "tire.tir").write_text(changed)
    by_hand = read_plan(tmp_path / "b" / "plan.toml")
    same(by_model, by_hand)
    assert [one.effect.name for one in by_model.effects] == ["steer_offset", "crosstalk"]


def test_an_angle_told_in_another_axis_system_is_turned(tmp_path):
    ours = made(tmp_path / "a", "model.toml", model=MODEL + OFFSET.replace("SIGN", ""))
    (tmp_path / "b").mkdir()
    model = (MODEL + OFFSET.replace("SIGN", "-")).replace("AXES", "ISO-W")
    theirs = made(tmp_path / "b", "model.toml", model=model)
    same(ours, theirs)


def test_the_case_of_such_a_plan_has_the_refitted_tire_and_no_effect(tmp_path):
    plan = made(tmp_path / "a", "model.toml", model=MODEL + OFFSET.replace("SIGN", ""))
    files = write_case(simulate(plan), tmp_path / "case")
    tire = next(one for one in files if one.suffix == ".tir")
    assert read_tir(tire).coefficients() == {**read_tir(TIRE).coefficients(), "LMUY": 0.9}
    assert "steer" not in files[0].read_text()


def test_an_effect_of_a_condition_acts_in_those_runs(tmp_path):
    where = 'condition = { rotation = ["reverse"] }\nruns = ["r1.csv"]'
    plan = made(tmp_path / "a", "model.toml", model=MODEL + GRIP.replace("WHERE", where))
    assert plan.effects[0].condition == ("rotation", ("reverse",))


@pytest.mark.parametrize(
    ("change", "said", "rule"),
    [
        (('kind = "machine"', 'kind = "python"'), "no tire", "model-file"),
        (("parameters.LMUY", 'parameters."drum.speed"'), "number of the machine", "model-file"),
        (("WHERE", 'runs = ["r1.csv"]'), "single recordings", "model-file"),
        (("SHA", "00"), "not the one that was fitted", "model-changed"),
        (("value = 0.8", "value = true"), "no number", "model-file"),
        (("mu_factor", "mu_factr"), "unknown key", None),
        (('tire = "tire.tir"', ""), "no text", "model-file"),
    ],
)
def test_a_model_that_no_plan_can_use_is_refused(tmp_path, change, said, rule):
    model = (MODEL + GRIP).replace(*change).replace("WHERE", "")
    with pytest.raises(ConfigError, match=said) as caught:
        made(tmp_path, "model.toml", model=model)
    assert caught.value.next_step
    assert rule in (None, caught.value.rule)


def test_a_number_outside_what_the_effect_can_have_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="outside"):
        made(tmp_path, "model.toml", model=MODEL + GRIP.replace("WHERE", "").replace("0.8", "1e9"))


def test_a_file_without_the_reference_load_means_the_nominal_one(tmp_path):
    text = '[[effect]]\nname = "load_friction"\n[effect.parameters.sensitivity]\nvalue = -0.1\nunit = "1"\n'
    told = text + '[effect.parameters.reference]\nvalue = 1.0\nunit = "1"\n'
    without, with_it = (
        made(tmp_path / name, "model.toml", model=MODEL + one) for name, one in (("a", text), ("b", told))
    )
    same(without, with_it)
    other = made(tmp_path / "c", "model.toml", model=MODEL + told.replace("1.0", "1.2"))
    files = [simulate(one).files[0].signals["FY"] for one in (without, other)]
    assert not np.allclose(*files)
