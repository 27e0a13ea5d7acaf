"""Simulators of others: what they may do, and what ends with their file, the run and what they gave."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.diagnosis.cases import HEAD, ONE, SIMULATOR, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.ode import OdeModel
from toolkit.diagnosis.simulators.python import PythonModel
from toolkit.errors import ConfigError, FitError

pytestmark = pytest.mark.usefixtures("case_worker")  # others' code may exit, read the terminal, or print

START = "import numpy as np\nimport pandas as pd\ndef simulate(inputs, p):\n    "


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("raise ValueError('no oil')", "ValueError: no oil"),
        ("raise SystemExit(0)", "SystemExit"),
        ("return inputs['V_drum']", "KeyError: 'V_drum'; inputs has t, v, a; p has mass, c"),
        ("return inputs['masss']", "did you mean p['mass']?"),
        ("return p['v']", "did you mean inputs['v']?"),
        ("return inputs.aa", "inputs has t, v, a; p has mass, c; did you mean inputs['a']?"),
        ("return None", "NoneType"),
        ("return {'F': inputs['v']}", "dict"),
        ("return pd.DataFrame({'F': inputs['v'][:-3]})", "77 rows for 80"),
        ("return pd.DataFrame({'f': inputs['v']})", "no column 'F'; it has f"),
        ("return pd.DataFrame({'F': inputs['v'] * np.nan})", "row 1"),
        ("return pd.DataFrame({'F': inputs['v'] / 0})", "no number"),
        ("return pd.DataFrame({'F': ['high'] * len(inputs)})", "no numbers"),
        ("return pd.DataFrame({'F': pd.array([None] * len(inputs), dtype='Int64')})", "no number"),
        ("return pd.DataFrame(np.ones((len(inputs), 2)), columns=['F', 'F'])", "several columns"),
        ("return pd.DataFrame({'F': np.random.normal(size=len(inputs))})", "second call"),
    ],
)
def test_output_that_cannot_be_used_is_told_with_file_and_run(tmp_path, body, said):
    case = read_case(write_case(tmp_path, simulator=START + body + "\n"))
    with pytest.raises(FitError) as caught:
        diagnose(case, None)
    assert said in str(caught.value.got)
    assert str(caught.value.where).endswith("sim.py, r0.csv")
    assert caught.value.rule == "simulator"


EQUATION = """
def rhs(t, x, u, p):
    return [{rate}]
def outputs(x, u, p):
    return {{"Y": {output}}}
def initial(p, run):
    return [{start}]
"""
LAG = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
parameters.T = { value = 2.5, unit = "s" }
[recording.channels]
t = { unit = "s", role = "time" }
U = { unit = "1", role = "input" }
Y = { unit = "1", role = "output" }
[[recording.run]]
file = "r0.csv"
T0 = { value = 20.0, unit = "degC" }
"""


def equation_case(folder, **parts):
    text = EQUATION.format(**{"rate": "(u['U'] - x[0]) / p['T']", "output": "x[0]", "start": "0.0"} | parts)
    table = "t,U,Y\n" + "".join(f"{0.1 * k:.1f},{k % 3},{k % 2}\n" for k in range(30))
    return read_case(write_case(folder, LAG, simulator=text, r0__csv=table))


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"rate": "u['UU'] / p['T']"}, "rhs: KeyError: 'UU'; p has T; u has U; did you mean u['U']?"),
        ({"output": "p['gain']"}, "outputs: KeyError: 'gain'; p has T; u has U"),
        ({"start": "run['speed']"}, "initial: KeyError: 'speed'; p has T; run has t, U, Y, file, T0"),
        ({"start": "[0.0]"}, "initial gives an array of shape (1, 1)"),
        ({"rate": "0.0, 0.0"}, "rhs gives 2 rates for 1 state"),
        ({"rate": "[0.0]"}, "rhs gives rates of shape (1, 1)"),
    ],
)
def test_a_name_that_an_equation_has_not_is_told_beside_those_that_it_has(tmp_path, parts, said):
    with pytest.raises(FitError) as caught:
        model_of(equation_case(tmp_path, **parts), None)
    assert said in caught.value.got


@pytest.mark.parametrize(("start", "count"), [("0.0", 1), ("0.0, 0.0", 2)])
def test_a_number_in_place_of_rates_is_told(tmp_path, start, count):
    case = equation_case(tmp_path, start=start)
    text = case.file().read_text().replace("[(u['U'] - x[0]) / p['T']]", "0.0 * p['T']")
    case.file().write_text(text)
    with pytest.raises(FitError) as caught:
        model_of(case, None)
    assert f"a number; expected a sequence of rates, one for each state ({count})" in caught.value.got


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def simulate(:\n", "SyntaxError"),
        ("import no_such_module_here\n", "ModuleNotFoundError"),
        ("raise SystemExit(0)\n", "SystemExit"),
        ("x = 1\n", "no functions"),
        ("def simulat(inputs, p): pass\n", "simulat"),
        ("simulate = 3\n", "no functions"),
    ],
)
def test_a_simulator_that_cannot_be_loaded_is_told(tmp_path, text, said):
    with pytest.raises(ConfigError) as caught:
        model_of(read_case(write_case(tmp_path, simulator=text)), None)
    assert said in str(caught.value.got)
    if text.startswith("def simulat("):
        assert "'simulat'" in str(caught.value.next_step)


def test_a_simulator_has_neighbours_dataclasses_and_its_own_file(tmp_path):
    (tmp_path / "plant_of_this_case.py").write_text("GAIN = 1.0\n")
    text = """from __future__ import annotations
import dataclasses, pathlib
import pandas as pd
from plant_of_this_case import GAIN
print("loaded")
@dataclasses.dataclass
class Plant:
    mass: float
def simulate(inputs, p):
    assert pathlib.Path(__file__).name == "sim.py"
    plant = Plant(p["mass"])
    inputs["v"] *= p["c"]
    inputs["a"] *= plant.mass
    return pd.DataFrame({"F": GAIN * inputs["a"] + inputs["v"], "other": "text"}).set_axis(inputs.index[::-1])
"""
    case = read_case(write_case(tmp_path, simulator=text))
    model = model_of(case, None)
    run = case.runs[0]
    before = run.columns["v"].copy()
    made = model.simulate(run, {"mass": 90.0, "c": 3.0}, ())
    np.testing.assert_allclose(made["F"], 90 * run.columns["a"] + 3 * run.columns["v"])
    np.testing.assert_array_equal(run.columns["v"], before)


def test_inputs_come_under_their_names_in_the_recordings_units_without_outputs(tmp_path):
    text = START + "assert list(inputs.columns) == ['t', 'v', 'a']\n"
    text += "    assert inputs['t'].iloc[1] == 0.1 * 60\n    return pd.DataFrame({'F': inputs['v']})\n"
    minutes = carriage().assign(t=lambda df: df["t"] * 60)
    case = read_case(
        write_case(tmp_path, HEAD.replace('"s"', '"min"') + ONE, simulator=text, r0__csv=minutes)
    )
    assert case.runs[0].t[1] == pytest.approx(360.0)
    model_of(case, None).simulate(case.runs[0], {}, ())


OTHER = pytest.mark.campaign("two other ways to the same input, of which one is closed in every run")


@pytest.mark.parametrize(
    "asking",
    [
        pytest.param("input()", marks=OTHER),
        pytest.param("sys.stdin.read()", marks=OTHER),
        "open(0, closefd=False).read()",
    ],
)
def test_a_simulator_that_asks_for_input_does_not_wait_for_it(tmp_path, asking):
    # A pipe that nobody writes into and nobody closes, as a terminal is.
    text = (
        "import sys\n"
        + START.replace("    ", f"    {asking}\n    ", 1)
        + "return inputs[['v']].set_axis(['F'], axis=1)\n"
    )
    case = write_case(tmp_path, simulator=text)
    run = f"""
import pathlib
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, running
case = read_case(pathlib.Path({str(case)!r}))
try:
    with running(case, WORKER_LIMITS) as code:
        made = model_of(case, None, code).simulate(case.runs[0], {{"mass": 94.0, "c": 210.0}}, ())
    print(len(made["F"]))
except Exception as error:
    print(error.got)
print("left:", input())
"""
    with subprocess.Popen(
        [sys.executable, "-c", run], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        said = process.stdout.readline()
        process.stdin.write("mine\n")
        process.stdin.flush()
        left = process.communicate(timeout=60)[0]
    assert ("EOF" in said) if asking == "input()" else said.strip() == "80"
    assert left.strip().splitlines()[-1] == "left: mine"


def test_the_same_question_is_asked_once(tmp_path):
    text = (
        START
        + "asked.append(p['mass'])\n    return pd.DataFrame({'F': inputs['v'] * p['mass']})\nasked = []\n"
    )
    case = read_case(write_case(tmp_path, simulator=text))
    model = model_of(case, None)
    assert isinstance(model, PythonModel)
    asked = model._called.__self__._function.__globals__["asked"]
    first = model.simulate(case.runs[0], {"mass": 1.0}, ())["F"]
    before = len(asked)
    again = model.simulate(case.runs[0], {"mass": 1.0}, ())["F"]
    assert len(asked) == before
    other = model.simulate(case.runs[0], {"mass": 2.0}, ())["F"]
    assert asked[before:].count(2.0) == len(asked) - before > 0
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(other, 2 * first)


def ode(folder, body, *, states='["h", "v"]', terms='{ v = "N/kg" }'):
    toml = f"""schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = {states}
force_terms = {terms}
[simulation.parameters.g]
value = 9.81
unit = "m/s^2"
[recording.channels]
t = {{ unit = "s", role = "time" }}
H = {{ unit = "m", role = "output" }}
[[recording.run]]
file = "r0.csv"
height = 20.0
"""
    table = carriage()[["t"]].assign(H=20.0)
    return read_case(write_case(folder, toml, simulator=body, r0__csv=table))


RHS = "def rhs(t, x, u, p):\n    return [x[1], -p['g']]\n"
OUTPUTS = "def outputs(x, u, p):\n    return {'H': x[0]}\n"
INITIAL = "def initial(p):\n    return [20.0, 1.0]\n"


def test_an_ode_is_integrated_freely_from_its_initial_state(tmp_path):
    case = ode(tmp_path, RHS + OUTPUTS + INITIAL)
    run = case.runs[0]
    made = model_of(case, None).simulate(run, {"g": 9.81}, ())["H"]
    np.testing.assert_allclose(made, 20 + run.t - 9.81 / 2 * run.t**2, rtol=1e-6, atol=1e-6)


def test_initial_may_ask_for_the_run(tmp_path):
    text = RHS + OUTPUTS + "def initial(p, run):\n    return [run['height'] + run['H'], 0.0]\n"
    case = ode(tmp_path, text)
    assert model_of(case, None).simulate(case.runs[0], {"g": 9.81}, ())["H"][0] == 40.0


def test_functions_of_one_file_share_its_state(tmp_path):
    text = "SEEN = []\ndef rhs(t, x, u, p):\n    SEEN.append(t)\n    return [0.0, 0.0]\n" + INITIAL
    text += "def outputs(x, u, p):\n    assert SEEN\n    return {'H': x[0]}\n"
    case = ode(tmp_path, text)
    assert model_of(case, None).simulate(case.runs[0], {"g": 9.81}, ())["H"][0] == 20.0


def test_a_body_in_free_fall_has_a_size_of_force(tmp_path):
    # Its acceleration is constant: the spread of the rate is nothing, its size is g.
    model = model_of(ode(tmp_path, RHS + OUTPUTS + INITIAL), None)
    assert isinstance(model, OdeModel)
    assert model.scale["v"][0] == pytest.approx(9.81, rel=1e-6)
    assert model.position_of("v") == "h"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("def rhs(t, x, u, p):\n    raise ValueError('stuck')\n" + OUTPUTS + INITIAL, "stuck"),
        ("def rhs(t, x, u, p):\n    return [1.0, 2.0, 3.0]\n" + OUTPUTS + INITIAL, "rhs"),
        ("def rhs(t, x, u, p):\n    return [float('nan'), 0.0]\n" + OUTPUTS + INITIAL, "ended early"),
        ("def rhs(t, x, u, p):\n    return [x[0]**2, 0.0]\n" + OUTPUTS + INITIAL, "ended early"),
        (RHS + "def outputs(x, u, p):\n    return {'X': x[0]}\n" + INITIAL, "no 'H'; it gives X"),
        (RHS + "def outputs(x, u, p):\n    return x[0]\n" + INITIAL, "not a dict"),
        (RHS + "def outputs(x, u, p):\n    return {'H': 'low'}\n" + INITIAL, "no number in output 'H'"),
        (RHS + "def outputs(x, u, p):\n    return {'H': '2.5'}\n" + INITIAL, "no number in output 'H'"),
        (RHS + "def outputs(x, u, p):\n    return {'H': 1e200}\n" + INITIAL, "no number in output 'H'"),
        (RHS + OUTPUTS + "def initial(p):\n    return p['h0']\n", "KeyError"),
    ],
)
def test_an_equation_that_cannot_be_integrated_is_told(tmp_path, body, said):
    case = ode(tmp_path, body)
    with pytest.raises(FitError) as caught:
        problem_of(case, model_of(case, None)).simulate([], ())
    assert said in str(caught.value.got)
    assert str(caught.value.where).endswith("sim.py, r0.csv")


@pytest.mark.parametrize(
    ("states", "terms", "said"),
    [('["h"]', "{}", "1 names, 2 initial"), ('["h", "v"]', '{ w = "N/kg" }', "w")],
)
def test_states_that_are_not_there_are_told(tmp_path, states, terms, said):
    with pytest.raises(ConfigError) as caught:
        model_of(ode(tmp_path, RHS + OUTPUTS + INITIAL, states=states, terms=terms), None)
    assert said in str(caught.value.got)


def columns(folder, *, simulated='{ F = "F_sim" }', parameters="", **files):
    toml = HEAD[: HEAD.index("[simulation]")] + f'[simulation]\nkind = "columns"\nsimulated = {simulated}\n'
    toml += parameters + HEAD[HEAD.index("[recording]") :] + TWO
    given = {f"r{i}__csv": carriage(seed=i).assign(F_sim=lambda df: df["F"] - 1) for i in range(2)}
    return read_case(write_case(folder, toml, simulator=None, **{**given, **files}))


def test_a_simulated_column_needs_no_channel_and_its_gaps_are_not_judged(tmp_path):
    holes = carriage(seed=0).assign(F_sim=lambda df: (df["F"] - 1).where(df.index != 4))
    case = columns(tmp_path, r0__csv=holes)
    problem = problem_of(case, model_of(case, None))
    made = problem.simulate([], ())["F"]
    assert np.isfinite(made).all()
    assert np.flatnonzero(~problem.kept["F"]).tolist() == [4]
    np.testing.assert_allclose((problem.observed["F"] - made)[problem.kept["F"]], 1.0)


def test_columns_that_do_not_fit_are_told(tmp_path):
    with pytest.raises(ConfigError, match="stands for no output") as caught:
        model_of(columns(tmp_path / "a", simulated='{ F = "F_sim", FF = "F_sim" }'), None)
    assert "'F'" in str(caught.value.next_step)
    wrong = '[simulation.parameters.mass]\nvalue = 1.0\nunit = "kg"\n'
    with pytest.raises(ConfigError, match="no such parameter"):
        model_of(columns(tmp_path / "b", parameters=wrong), None)


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("(inputs['v'] * 1j)", "no numbers in column 'F'"),
        ("inputs['v'].astype(str)", "no numbers in column 'F'"),
        ("pd.Series([2.5, '1'] * (len(inputs) // 2), dtype=object)", "no numbers in column 'F'"),
        ("pd.to_datetime(inputs['v'])", "no numbers in column 'F'"),
        ("np.full(len(inputs), 1e200)", "values beyond 1e+100 in column 'F'"),
    ],
)
def test_what_only_looks_like_a_number_is_refused(tmp_path, column, said):
    case = read_case(write_case(tmp_path, simulator=START + f"return pd.DataFrame({{'F': {column}}})\n"))
    with pytest.raises(FitError) as caught:
        diagnose(case, None)
    assert said in str(caught.value.got)


def test_a_simulator_leaves_our_output_and_folder_alone(tmp_path, capfd, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    says = "import os; os.chdir('/'); os.write(1, b'one'); os.system('echo two'); print('three')\n"
    case = read_case(write_case(tmp_path / "case", simulator=START + says + "    raise ValueError\n"))
    sys.stdout.write("before\n")
    with pytest.raises(FitError):
        diagnose(case, None)
    sys.stdout.write("after\n")
    assert capfd.readouterr().out == "before\nafter\n"
    assert Path.cwd() == tmp_path / "here"


def test_a_simulator_that_refuses_other_parameters_is_told_not_taken_for_a_fit(tmp_path):
    body = "if p['mass'] != 94.0: raise ValueError('only 94')\n    "
    case = read_case(write_case(tmp_path, simulator=START + body + SIMULATOR.splitlines()[-1].strip() + "\n"))
    (found,) = (one for one in diagnose(case, None).diagnosis.findings if one.rule == "simulator-refuses")
    assert found.level == "warning"
    assert "only 94" in found.message
    assert "r0.csv, mass = " in found.message
