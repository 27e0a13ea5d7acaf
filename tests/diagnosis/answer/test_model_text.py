"""What was found goes back into use: the model file of every kind of simulation, read, run, and refused."""

import dataclasses
import functools
import io
import math
import shutil

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import HEAD, SIMULATOR, TWO, carriage, write_case
from tests.diagnosis.tire_case import plain, python_tire, toml
from tests.golden.cases import BALL, BALL_CASE, TIRE_FILE
from toolkit.diagnosis.answer.model_text import MODEL, model_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.forward import simulate_model
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.simulator import Following
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError, ToolkitError
from toolkit.simulation.model_file import read_model

DRAG = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}


def fallen(seed):
    # m v' = -g - k v|v|: v = -w tanh(g t/w), h = -w^2/g ln cosh(g t/w), w = sqrt(g/k)
    t = np.linspace(0, 1.5, 60)
    w = np.sqrt(9.81 / 0.2)
    h = -(w**2) / 9.81 * np.log(np.cosh(9.81 * t / w))
    return pd.DataFrame({"t": t, "h": h + np.random.default_rng(seed).normal(0, 0.005, 60)})


def drag_python(folder):
    return write_case(folder, HEAD + TWO, **DRAG)


def drag_ode(folder):
    return write_case(folder, BALL_CASE + TWO, simulator=BALL, r0__csv=fallen(0), r1__csv=fallen(1))


def offset_machine(folder):
    frames = {f"r{i}__csv": own_tire(i, offset=0.3) for i in range(2)}
    text = toml('kind = "machine"\nmachine = "m15"\ntire = "tire.tir"', axes="machine", mu="LMUY")
    return write_case(folder, text, simulator=None, tire__tir=TIRE_FILE, **frames)


def own_tire(seed, *, offset=0.0):
    """The tire of the file by its equations written out (Pacejka 2012, 4.3.2), machine axes."""
    rng = np.random.default_rng(seed)
    t = np.arange(150) * 0.1
    SA = 6 * np.sin(2 * np.pi * t / 7.5 + seed)
    FZ = np.where(t < 7, 3000.0, 5000.0) + 200 * np.sin(t)
    slip = np.tan(np.deg2rad(-(SA - offset)))  # ISO-W
    D = FZ * (1.0 - 0.1 * (FZ / 4000 - 1))
    B = -15 * 4000 * np.sin(2 * np.arctan(FZ / (1.8 * 4000))) / (1.3 * D)
    FY = D * np.sin(1.3 * np.arctan(B * slip))
    trail = 0.1 * FZ * 0.3 / 4000 * np.cos(1.1 * np.arctan(8 * slip)) * np.cos(np.arctan(slip))
    shown = {"FY": -FY + rng.normal(0, 8, 150), "MZ": trail * FY + rng.normal(0, 0.4, 150)}
    return pd.DataFrame({"t": t, "SA": SA, "FZ": FZ, **shown})


def shift_columns(folder):
    # another program's columns beside the recording, which is late by a first-order filter of 0.3 s
    frames = {}
    for i in range(2):
        rng = np.random.default_rng(i)
        t = np.arange(200) * 0.1
        x = np.cumsum(rng.normal(size=200)) + 5 * np.sin(t)
        y, tau = [x[0]], 0.3
        for k in range(1, 200):  # exact for an input that is linear between rows
            slope, decay = (x[k] - x[k - 1]) / 0.1, np.exp(-0.1 / tau)
            y.append(x[k] - slope * tau + (y[-1] - x[k - 1] + slope * tau) * decay)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": t, "Y": np.array(y) + rng.normal(0, 0.05, 200), "S": x})
    head = """schema = 1
title = "Another program"
[simulation]
kind = "columns"
simulated = { Y = "S" }
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
Y = { unit = "N", role = "output" }
"""
    return write_case(folder, head + TWO, simulator=None, **frames)


def written(case, folder):
    """Return a case's answer and the model file that was written into a folder."""
    read = read_case(case)
    found = diagnose(read, None)
    folder.mkdir(parents=True, exist_ok=True)
    text = model_text(read, found.search, found.diagnosis, folder)
    assert text is not None
    (folder / MODEL).write_text(text, encoding="utf-8")
    return found.diagnosis, folder / MODEL


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """Return of a kind its case in a folder of its own, the answer and its model; diagnosed once, to read."""

    @functools.cache
    def of(kind):
        folder = tmp_path_factory.mktemp(kind)
        case = KINDS[kind][0](folder)
        return case, *written(case, folder / "answer")

    return of


@pytest.fixture(scope="module")
def once(answered):
    case, found, _ = answered("python")
    return case.parent, found


@pytest.fixture
def drag(once, tmp_path):
    """A folder of its own with the case of the drag and its answer's model; the answer."""
    shutil.copytree(once[0], tmp_path, dirs_exist_ok=True)
    return once[1]


KINDS = {
    "python": (drag_python, "quadratic_drag"),
    "ode": (drag_ode, "quadratic_drag"),
    "machine": (offset_machine, "steer_offset"),
    "columns": (shift_columns, "filter_lag"),
}


EQUATION = pytest.mark.campaign(
    "an equation, the slowest kind: the other kinds go back into use in every run"
)


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=[EQUATION] * (kind == "ode")) for kind in KINDS])
def test_a_model_with_what_was_found_misses_nothing_on_the_same_recordings(answered, kind):
    name = KINDS[kind][1]
    case, found, path = answered(kind)
    (effect,) = found.effects
    assert name in (effect.name, *effect.equivalent_to)
    again = diagnose(read_case(case, model=path), None).diagnosis
    assert (again.verdict, again.effects) == ("nothing", ())
    # what the first answer ends with is what the second begins with
    for before, after in zip(found.fit.held_out, again.fit.held_out, strict=True):
        assert after.nominal_rmse < 1.1 * before.noise_floor
    own = [one for one in again.nominal_parameters if one.name.startswith(effect.name)]
    assert len(own) == len(effect.parameters)
    assert all(abs(one.shift_in_sd or 0.0) < 1 for one in own)
    assert [one.level for one in again.findings if one.rule == "case-model"] == ["note"]


def test_small_forces_act_beside_what_a_model_has_in_it(answered):
    case, _, path = answered("ode")
    read = read_case(case, model=path)
    model = model_of(read, None)
    run, p = read.runs[0], {one.name: one.value for one in model.parameters}
    linear = model.capability.motion.pushed(run, p, (), "v", lambda seen: np.ones((len(seen["v"]), 1)))["h"][
        :, 0
    ]
    push = AppliedEffect(effect=effects()["constant_force"], channel="v", values={"force": 1e-3})
    moved = (model.simulate(run, p, (push,))["h"] - model.simulate(run, p, ())["h"]) / 1e-3
    # the drag holds back: less than the t^2/2 of a body without it
    assert moved[-1] < 0.9 * run.t[-1] ** 2 / 2
    np.testing.assert_allclose(linear, moved, atol=0.01 * moved[-1])


def test_an_equation_is_led_along_its_recording_with_the_effects_that_it_has(answered):
    case, _, path = answered("ode")
    whole, bare = read_case(case, model=path), read_case(case)
    (effect,) = whole.effects

    def errors(case, active):
        model = model_of(case, None)
        p = {parameter.name: parameter.value for parameter in model.parameters}
        sensor = {output.name: 0.05 for output in model.outputs}
        asked = Following(steps=dict.fromkeys(p, 1e-3), sensor=sensor, unread={})
        made, answers = model.capability.motion.followed(case.runs, p, active, asked)
        assert answers.shape[2] == len(p)
        return made.errors

    of_model = errors(whole, ())
    assert np.allclose(of_model, errors(bare, (effect.applied,)), equal_nan=True)
    assert not np.allclose(of_model, errors(bare, ()), equal_nan=True)


@pytest.mark.campaign(
    "a whole diagnosis by a model: that a model acts beside its simulation is held in every run"
)
def test_a_models_effects_are_in_its_motion_once(tmp_path):
    # The pattern of a small force is read over the position: that of the fall with its drag, once.
    text = BALL_CASE.replace('kind = "ode"', 'kind = "python"')
    text = "".join(
        line for line in text.splitlines(keepends=True) if not line.startswith(("states", "force_terms"))
    )
    simulator = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"h": -p["g"] * inputs["t"] ** 2 / 2})
"""
    frames = {f"r{i}__csv": fallen(i) for i in range(2)}
    case = write_case(tmp_path / "case", text + TWO, simulator=simulator, **frames)
    found, path = written(case, tmp_path / "answer")
    assert [one.name for one in found.effects] == ["quadratic_drag"]
    read = read_case(case, model=path)
    model = model_of(read, None)
    run, p = read.runs[0], {one.name: one.value for one in model.parameters}
    seen = []
    model.capability.motion.pushed(
        run,
        p,
        (),
        "h",
        lambda signals: seen.append(signals["position"]) or np.ones((len(signals["position"]), 1)),
    )
    w = np.sqrt(9.81 / 0.2)
    np.testing.assert_allclose(seen[0], -(w**2) / 9.81 * np.log(np.cosh(9.81 * run.t / w)), atol=0.03)


def test_a_model_file_says_what_it_rests_on(tmp_path, drag):
    model = read_model(tmp_path / "answer" / MODEL)
    read = read_case(tmp_path / "CASE.toml")
    assert model.case_sha256 == read.sha256
    assert dict(model.recordings) == {run.name: run.sha256 for run in read.runs}
    assert [len(one) for _, one in model.recordings] == [64, 64]
    (effect,) = model.effects
    applied, told = effect.applied, drag.effects[0].parameters[0]
    assert (applied.values, applied.units) == ({"drag": told.value}, {"drag": told.unit})  # noqa: PD011
    assert applied.key == drag.effects[0].key
    # a 95 % interval of some 160 rows reaches 1.97 to 1.98 standard uncertainties, the form's share in them
    uncertainty = math.hypot(effect.standard_errors["drag"], applied.form_uncertainty(applied.searched[0]))
    assert (told.ci95[1] - told.value) / uncertainty == pytest.approx(1.975, abs=0.01)
    assert model.file("path").resolve() == (tmp_path / "sim.py").resolve()


def test_a_case_names_a_model_in_place_of_its_simulation(tmp_path, drag):
    case, path = tmp_path / "CASE.toml", tmp_path / "answer" / MODEL
    head = HEAD[: HEAD.index("[simulation]")]
    rest = HEAD[HEAD.index("[recording]") :]
    (tmp_path / "next.toml").write_text(head + '[simulation]\nmodel = "answer/model.toml"\n' + rest + TWO)
    read = read_case(tmp_path / "next.toml")
    assert [one.name for one in read.parameters] == ["mass", "c"]
    assert read.parameters[0].value == read_model(path).parameters[0].value
    assert [one.applied.effect.name for one in read.effects] == ["quadratic_drag"]
    assert read.sha256 != read_case(case).sha256


def test_a_model_stands_in_the_place_of_a_tire_file(tmp_path, once, answered):
    shutil.copytree(answered("machine")[0].parent, tmp_path, dirs_exist_ok=True)
    case = tmp_path / answered("machine")[0].name
    text = case.read_text().replace('tire = "tire.tir"', 'tire = "answer/model.toml"')
    (tmp_path / "next.toml").write_text(
        text.replace('[simulation.parameters.LMUY]\nvalue = 1.0\nunit = "1"\nsd = 0.05\n', "")
    )
    read = read_case(tmp_path / "next.toml")
    assert read.simulation.tire.name == "tire.tir"
    assert [one.name for one in read.parameters] == ["LMUY"]
    assert len(read.effects) == 1
    shutil.copytree(once[0], tmp_path / "drag")
    (tmp_path / "last.toml").write_text(case.read_text().replace("tire.tir", "drag/answer/model.toml"))
    with pytest.raises(ConfigError, match="no tire") as caught:
        read_case(tmp_path / "last.toml")
    assert caught.value.rule == "model-file"


def test_a_sign_is_that_of_the_axes_in_which_the_model_is_used(tmp_path):
    # +0.3 deg in ISO-W: the same model on the same motion, recorded in SAE, is 0.3 deg the other way
    _, path = written(python_tire(tmp_path / "iso", "ISO-W", offset=0.3), tmp_path / "iso" / "answer")
    model = read_model(path)
    (effect,) = model.effects
    (value,) = effect.applied.values.values()  # noqa: PD011
    angle = value * (1 if effect.applied.effect.name == "steer_offset" else -1)
    assert angle == pytest.approx(0.3, abs=0.005)
    SA = np.array([-2.0, 0.0, 3.0])
    frame = pd.DataFrame({"t": [0.0, 1.0, 2.0], "SA": SA, "FZ": [3000.0, 4000.0, 5000.0]})
    frame.to_csv(tmp_path / "in.csv", index=False)
    ((_, text),), _ = simulate_model(model, [tmp_path / "in.csv"], None)
    made = pd.read_csv(io.StringIO(text))
    # ISO-W turns SA and FY of the formula that the simulator has in SAE
    expected = -plain(-(SA - 0.3), frame["FZ"].to_numpy())["FY"]
    np.testing.assert_allclose(made["FY"], expected, atol=10.0)


def test_a_model_is_run_forward_on_inputs_alone(tmp_path, drag):
    path = tmp_path / "answer" / MODEL
    ahead = carriage(seed=9, coulomb=0.0, drag=800.0, noise=0.0)
    ahead.drop(columns="F").to_csv(tmp_path / "ahead.csv", index=False)
    files, notes = simulate_model(read_model(path), [tmp_path / "ahead.csv"], None)
    ((name, text),) = files
    assert name == "ahead.csv"
    made = pd.read_csv(io.StringIO(text))
    assert list(made.columns) == ["t", "F"]
    # 2 N of noise over 160 rows and three parameters: 0.3 N each; five of them
    assert np.abs(made["F"] - ahead["F"]).max() < 1.5
    assert [one.rule for one in notes] == ["case-model"]


def test_an_effect_of_some_runs_acts_by_their_condition(tmp_path, drag):
    model = read_model(tmp_path / "answer" / MODEL)
    (effect,) = model.effects
    confined = dataclasses.replace(
        effect.applied, runs=frozenset({"r0.csv"}), condition=("surface", ("steel",))
    )
    model = dataclasses.replace(model, effects=(dataclasses.replace(effect, applied=confined),))
    frame = carriage(seed=9).drop(columns="F")
    frame.to_csv(tmp_path / "in.csv", index=False)
    made = {}
    for key, given in {"steel": {"surface": "steel"}, "other": {"surface": "sand"}, "none": {}}.items():
        ((_, text),), _ = simulate_model(model, [tmp_path / "in.csv"], None, conditions=given)
        made[key] = pd.read_csv(io.StringIO(text))
    np.testing.assert_array_equal(made["other"]["F"], made["none"]["F"])
    size = effect.applied.values["drag"]  # noqa: PD011
    np.testing.assert_allclose(
        made["steel"]["F"] - made["other"]["F"], size * frame["v"] * frame["v"].abs(), rtol=1e-9, atol=1e-9
    )


def test_an_answer_that_names_nothing_has_no_model(tmp_path):
    clean = {f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)}
    read = read_case(write_case(tmp_path, HEAD + TWO, **clean))
    found = diagnose(read, None)
    assert found.diagnosis.verdict == "nothing"
    assert model_text(read, found.search, found.diagnosis, tmp_path) is None


def test_what_is_found_on_top_of_a_model_is_written_with_it(tmp_path, drag):
    # drag first; then the same carriage with a dry friction that came later
    path = tmp_path / "answer" / MODEL
    later = {f"r{i}__csv": carriage(seed=i + 20, coulomb=30.0, drag=800.0) for i in range(2)}
    read = read_case(write_case(tmp_path / "later", HEAD + TWO, **later), model=path)
    found = diagnose(read, None)
    text = model_text(read, found.search, found.diagnosis, tmp_path)
    (tmp_path / "second.toml").write_text(text)
    made = {one.applied.effect.name: one for one in read_model(tmp_path / "second.toml").effects}
    assert set(made) == {"quadratic_drag", "coulomb_friction"}
    assert made["coulomb_friction"].applied.values["coulomb"] == pytest.approx(30.0, abs=2.0)  # noqa: PD011


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (("content = ", "contents = "), "model-file"),
        (("schema = 1", "schema = 2"), "model-file"),
        (("value = 807", "valu = 807"), None),
        (('unit = "N/(m/s)^2"', 'unit = "furlong/(m/s)^2"'), None),
        (('kind = "python"', 'kind = "pyton"'), "model-file"),
        (('name = "quadratic_drag"', 'name = "quadratic_dragg"'), "unknown-effect"),
        (("[effect.parameters.drag]", "[effect.parameters.drug]"), None),
        (("standard_error = 14", "standard_error = -13"), "model-file"),
        (('channel = "F"', 'channel = "G"'), "model-place"),
        (('axes = "machine"', 'axes = "mechine"'), "model-file"),
        (('verdict = "named"', "verdict = 3"), "model-file"),
    ],
)
def test_a_model_file_that_was_changed_by_hand_is_told(tmp_path, drag, change, rule):
    case, path = tmp_path / "CASE.toml", tmp_path / "answer" / MODEL
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(ToolkitError) as caught:
        diagnose(read_case(case, model=path), None)
    error = caught.value
    assert error.where
    assert error.next_step
    if rule:
        assert error.rule == rule


def test_a_simulator_that_changed_since_the_fit_is_refused(tmp_path, drag):
    case, path = tmp_path / "CASE.toml", tmp_path / "answer" / MODEL
    (tmp_path / "sim.py").write_text(SIMULATOR + "\n# another version\n")
    with pytest.raises(ConfigError, match="not the one that was fitted") as caught:
        read_case(case, model=path)
    assert caught.value.rule == "model-changed"
    (tmp_path / "sim.py").unlink()
    with pytest.raises(ConfigError) as caught:
        read_case(case, model=path)
    assert caught.value.rule == "no-file"


def test_a_recording_without_the_models_channel_is_told(tmp_path, drag):
    path = tmp_path / "answer" / MODEL
    renamed = HEAD.replace('F = { unit = "N"', 'P = { unit = "N"')
    runs = {name: one.rename(columns={"F": "P"}) for name, one in DRAG.items()}
    other = write_case(tmp_path / "other", renamed + TWO, **runs)
    with pytest.raises(ConfigError) as caught:
        diagnose(read_case(other, model=path), None)
    assert caught.value.rule in ("model-place", "simulator")
