"""A model sized by hand: what the simulation then says, and what is kept of it."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.workbench.test_diagnosis_page import SIMULATOR, TOML
from toolkit.diagnosis.by_hand import BY_HAND, Sized, Trial, as_fitted, kept_model, tried
from toolkit.diagnosis.forward import simulate_model
from toolkit.errors import ConfigError, FitError
from toolkit.files import sha256_file
from toolkit.simulation.model_file import ModelFile, read_model

MODEL = """schema = 1
content = "augmented simulation"
title = "A cell that is not linear"
code_version = "0"
axes = "machine"
[answer]
verdict = "named"
remaining = "nothing"
complete = true
case = "../case/case.toml"
case_sha256 = "{case}"
recordings = {{ "r0.csv" = "{r0}", "r1.csv" = "{r1}" }}
[simulation]
kind = "python"
path = "../case/sim.py"
function = "simulate"
[simulation.sha256]
path = "{sim}"
[simulation.parameters.gain]
value = 1.25
unit = "1"
standard_error = 0.001
[channels]
L = {{ unit = "N", role = "input" }}
F = {{ unit = "N", role = "output", sd = 0.4 }}
[[effect]]
name = "zero_offset"
stage = "load_cells"
channel = "F"
[effect.parameters.offset]
value = 3.0
unit = "N"
standard_error = 0.1
[[effect]]
name = "sensitivity_error"
stage = "load_cells"
channel = "F"
[effect.parameters.gain_error]
value = 0.02
unit = "1"
standard_error = 0.001
"""


@pytest.fixture
def model(tmp_path: Path) -> ModelFile:
    """A model F = (1.25 L + 3 N) 1.02 beside recordings of F = 1.3 L, one sample of which is missing."""
    case, answer = tmp_path / "case", tmp_path / "answer"
    case.mkdir()
    answer.mkdir()
    (case / "case.toml").write_text(TOML)
    (case / "sim.py").write_text(SIMULATOR)
    (case / "more.csv").write_text("L\n100\n200\n")
    for run in range(2):
        loads = [*range(10 + run, 400, 10)]
        rows = [f"{load},{'' if load == 51 else 1.3 * load}" for load in loads]
        (case / f"r{run}.csv").write_text("\n".join(["L,F", *rows, ""]))
    names = {
        "case": "case.toml", "r0": "r0.csv", "r1": "r1.csv", "sim": "sim.py",
    }  # fmt: skip
    (answer / "model.toml").write_text(
        MODEL.format(**{key: sha256_file(case / name) for key, name in names.items()})
    )
    return read_model(answer / "model.toml")


def trial(model: ModelFile, *sized: Sized, budget_s: float = 60.0) -> Trial:
    from toolkit.lab.studies.diagnosis import worker_limits

    assert model.case is not None
    limits = worker_limits(isolated=True)
    return tried(model, model.case, sized or as_fitted(model), None, budget_s=budget_s, limits=limits)


@pytest.mark.parametrize(
    ("offset", "gain_error"), [(3.0, 0.02), (None, 0.02), (3.0, None), (-7.5, 0.1), (None, None)]
)
def test_the_simulation_answers_with_the_effects_as_they_are_set(
    model: ModelFile, offset: float | None, gain_error: float | None
) -> None:
    sized = (
        Sized(on=offset is not None, values={"offset": offset or 0.0}),
        Sized(on=gain_error is not None, values={"gain_error": gain_error or 0.0}),
    )
    answer = trial(model, *sized)
    assert [row.run for row in answer.beside] == ["r0.csv", "r1.csv"]
    left = []
    for row, first in zip(answer.beside, (10, 11), strict=True):
        load = np.arange(first, 400, 10.0)
        # Within a stage effects act in the order in which the file has them.
        expected = (1.25 * load + (offset or 0.0)) * (1 + (gain_error or 0.0))
        assert np.allclose(row.simulated, expected, rtol=1e-12, atol=0.0)
        assert np.isnan(row.recorded).sum() == (load == 51).sum()
        left.append(row.simulated - 1.3 * load)
    kept = np.concatenate(left)[np.concatenate([np.arange(10, 400, 10), np.arange(11, 400, 10)]) != 51]
    assert answer.rmse["F"] == pytest.approx(np.sqrt(np.mean(kept**2)), rel=1e-12)
    assert (answer.has_time, answer.beside[0].x[:2].tolist()) == (False, [0.0, 1.0])


def outputs(model: ModelFile) -> np.ndarray:
    """Return what `toolkit simulate` says of a model on the inputs of the first recording."""
    assert model.case is not None
    ((_, text),), _ = simulate_model(model, [model.case.with_name("r0.csv")], None)
    return np.array([float(row["F"]) for row in csv.DictReader(io.StringIO(text))])


def test_what_is_kept_is_what_was_seen(model: ModelFile, tmp_path: Path) -> None:
    offset, gain = as_fitted(model)
    sized = (replace(offset, on=False), replace(gain, values={"gain_error": 0.05}))
    folder = tmp_path / "home" / "models" / "model-1"
    folder.mkdir(parents=True)
    (folder / "model.toml").write_text(kept_model(model, sized, folder))
    kept = read_model(folder / "model.toml")
    assert (kept.verdict, kept.complete, kept.recordings) == (BY_HAND, False, model.recordings)
    assert [(effect.label, dict(effect.standard_errors)) for effect in kept.effects] == [
        ("sensitivity_error on F", {})
    ]
    assert kept.parameters == model.parameters
    assert np.array_equal(outputs(kept), trial(model, *sized).beside[0].simulated)
    # It can be sized again: the case is found from where the model lies.
    assert trial(kept).rmse == trial(model, *sized).rmse


def test_what_nobody_changed_is_kept_as_the_diagnosis_wrote_it(model: ModelFile, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "model.toml").write_text(kept_model(model, as_fitted(model), tmp_path / "kept"))
    kept = read_model(tmp_path / "kept" / "model.toml")
    for name in ("title", "verdict", "complete", "case_sha256", "recordings", "parameters", "channels"):
        assert getattr(kept, name) == getattr(model, name), name
    assert [(e.applied, e.standard_errors) for e in kept.effects] == [
        (e.applied, e.standard_errors) for e in model.effects
    ]
    assert np.array_equal(outputs(kept), outputs(model))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300])
def test_a_size_that_no_effect_can_have_is_refused(model: ModelFile, value: float) -> None:
    with pytest.raises(ConfigError) as caught:
        trial(model, as_fitted(model)[0], Sized(values={"gain_error": value}))
    assert (caught.value.rule, "gain_error" in str(caught.value.where)) == ("wrong-value", True)


def test_a_recording_that_changed_since_is_refused(model: ModelFile) -> None:
    assert model.case is not None
    (model.case.with_name("r1.csv")).write_text("L,F\n1,2\n3,4\n")
    with pytest.raises(ConfigError, match="not those that the model was fitted to") as caught:
        trial(model)
    assert caught.value.got == "r1.csv"


def test_code_that_does_not_answer_is_ended(model: ModelFile) -> None:
    assert model.case is not None
    slow = "import time\n" + SIMULATOR.replace("    return", "    time.sleep(60)\n    return")
    model.case.with_name("sim.py").write_text(slow)
    text = model.path.read_text()
    sim = sha256_file(model.case.with_name("sim.py"))
    model.path.write_text(re.sub(r'(sha256\]\npath = )"\w+"', rf'\1"{sim}"', text))
    with pytest.raises(FitError, match="no usable output") as caught:
        trial(read_model(model.path), budget_s=2.0)
    assert "within 2 s" in str(caught.value.got)


def test_a_model_knows_where_its_case_lay(model: ModelFile, tmp_path: Path) -> None:
    assert model.case is not None
    assert model.case.resolve() == tmp_path / "case" / "case.toml"
    text = model.path.read_text().replace('case = "../case/case.toml"\n', "")
    model.path.write_text(text)
    assert read_model(model.path).case is None
