"""What coloured noise may not swallow: a large rest, and one that follows what was recorded."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.noise_floor import LARGE, LONG, hidden_in_noise
from toolkit.diagnosis.search.unexplained import BEYOND_REPEATS, _beyond_noise
from toolkit.diagnosis.simulators.build_simulator import model_of

N = 600


def coloured(phi, sd, rng):
    return sd * math.sqrt(1 - phi**2) * lfilter([1], [1, -phi], rng.standard_normal(N + 500))[500:]


def case_of(folder, rest, *, runs=3, sd=None):
    """Return a load cell under a wandering load whose runs leave ``rest(load, rng)``."""
    text, frames = cell_case(0.01), {}
    if sd is not None:
        text = text.replace('role = "output"', f'role = "output", sd = {sd}')
    for k in range(runs):
        rng = np.random.default_rng([7, k])
        t = np.arange(N) * 0.1
        L = 50 + 10 * np.sin(0.11 * t + k) + 7 * np.sin(0.043 * t * (1 + k) + 2 * k)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + rest(L, rng)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=CELL, **{"r1__csv": None, **frames}))


def beyond_repeats(folder, rest):
    """Return whether a run and its repeat leave more than they differ by; ``rest(load, seed)`` of each."""
    text, frames = cell_case(0.01), {}
    t = np.arange(N) * 0.1
    L = 50 + 10 * np.sin(0.11 * t) + 7 * np.sin(0.043 * t)
    for k, condition in enumerate(("", 'repeat_of = "r0.csv"')):
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + rest(L, k)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n{condition}\n'
    case = read_case(write_case(folder, text, simulator=CELL, **frames))
    problem = problem_of(case, model_of(case, None, None))
    return _beyond_noise(problem, fit(problem), "F")


def test_what_repeats_have_in_common_is_no_noise(tmp_path):
    # A bend that both runs have, three times as large as what they differ by.
    found = beyond_repeats(
        tmp_path, lambda L, k: 0.03 * (L - 50) ** 2 + np.random.default_rng(k).normal(0, 1.0, N)
    )
    assert found is not None
    assert (found.variables, found.reason, found.is_too_large) == ((), BEYOND_REPEATS, True)


@pytest.mark.parametrize("phi", [0.0, 0.95])
def test_what_repeats_differ_by_is_noise_of_any_colour_beside_zeros_that_move(tmp_path, phi):
    assert (
        beyond_repeats(tmp_path, lambda _, k: 3.0 * k + coloured(phi, 0.5, np.random.default_rng(k))) is None
    )


def hidden(case, *, beside=()):
    problem = problem_of(case, model_of(case, None, None))
    found = [candidate.active for candidate in candidates(problem) if candidate.name in beside]
    base = fit(problem, [replace(active, values={"offset": 1.0}) for active in found])
    return hidden_in_noise(problem, folds_of(problem, base), base, seed=1)


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.99])
def test_noise_of_any_colour_that_is_small_hides_nothing(tmp_path, phi):
    assert hidden(case_of(tmp_path, lambda _, rng: coloured(phi, 0.3, rng))) == ()


def test_a_rest_above_a_tenth_of_the_spread_is_never_nothing(tmp_path):
    case = case_of(tmp_path, lambda _, rng: coloured(0.98, 2.5, rng))
    (found,) = hidden(case)
    assert (found.variables, found.reason, found.rest) == ((), LARGE, True)


@pytest.mark.campaign("a whole diagnosis: that such a rest is told is held in every run")
def test_the_noise_of_a_large_rest_has_its_size(tmp_path):
    case = case_of(tmp_path, lambda _, rng: coloured(0.98, 2.5, rng))
    answer = diagnose(case, None).diagnosis
    assert (answer.verdict, answer.remaining, answer.effects) == ("unknown", "unknown", ())
    noise = answer.fit.held_out[0].noise
    assert noise.process_sd > noise.sensor_sd
    assert noise.total_sd == pytest.approx(2.5, rel=0.25)


def test_white_noise_of_a_weak_signal_is_no_structure_beside_what_was_found(tmp_path):
    case = case_of(tmp_path, lambda _, rng: rng.normal(4.0, 2.5, N))
    assert hidden(case, beside=("zero_offset",)) == ()
    assert LARGE in {found.reason for found in hidden(case)}


def test_of_rows_in_no_order_no_difference_shows_the_sensor(tmp_path):
    # The load is another one at every row: what it leaves is as quick as any noise.
    text, rng = cell_case(0.01) + '[[recording.run]]\nfile = "r0.csv"\n', np.random.default_rng(3)
    load = rng.uniform(30, 70, N)
    table = pd.DataFrame({"t": np.arange(N) * 0.1, "L": load, "F": load + 4 * np.sign(np.sin(5 * load))})
    case = read_case(write_case(tmp_path, text, simulator=CELL, r0__csv=table, r1__csv=None))
    assert LARGE in {found.reason for found in hidden(case)}


def test_a_noise_of_that_size_that_a_certificate_states_hides_nothing(tmp_path):
    assert hidden(case_of(tmp_path, lambda _, rng: rng.normal(0, 2.5, N), sd=2.5)) == ()


def test_a_coloured_rest_that_follows_the_load_is_no_noise(tmp_path):
    # A band of loads in which the cell reads more, below a tenth of the spread.
    bump = lambda L: 1.5 * np.exp(-(((L - 48) / 4) ** 2))  # noqa: E731
    found = hidden(case_of(tmp_path, lambda L, rng: bump(L) + coloured(0.9, 0.05, rng)))
    assert [one.variables for one in found] in ([("L",)], [("F",)])
    assert not found[0].rest


def test_of_a_constant_the_spread_is_its_noise(tmp_path):
    text = cell_case(0.01) + '[[recording.run]]\nfile = "r0.csv"\n'
    rng = np.random.default_rng(3)
    table = pd.DataFrame({"t": np.arange(N) * 0.1, "L": np.full(N, 9.0), "F": 9 + coloured(0.5, 0.02, rng)})
    case = read_case(write_case(tmp_path, text, simulator=CELL, r0__csv=table, r1__csv=None))
    assert hidden(case) == ()


@pytest.mark.parametrize(("size", "reasons"), [(0.5, [LONG]), (0.05, [])])
def test_what_no_state_has_made_wander_as_long_as_the_runs_is_no_noise(tmp_path, size, reasons):
    """A sensor of 0.01 N under a simulation without a state, off by 5 % of the spread in a way of each run.

    Half a per cent is what simulations are off by now and then.
    """
    slow = np.sin(np.pi * np.arange(N) / N)

    def rest(_, rng):
        zero, bend = rng.uniform(-1, 1, 2)
        return size * (zero + bend * slow) + rng.normal(0, 0.01, N)

    assert [found.reason for found in hidden(case_of(tmp_path, rest))] == reasons


CONSTANT = case_text(
    "python", title="A filter", parameters={"level": (2.0, "1", 0.01)}, outputs={"y": "1"}, runs=1,
)  # fmt: skip
STILL = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"y": [p["level"]] * len(inputs)})
"""


@pytest.mark.parametrize(("phi", "verdict"), [(0.0, "nothing"), (0.95, "unknown")])
def test_a_rest_that_wanders_as_long_as_the_recording_is_not_known_to_be_noise(tmp_path, phi, verdict):
    # noise behind two lags in a row, fifty readings of it
    wander = lfilter([1], [1, -phi], coloured(phi, 1.0, np.random.default_rng(1)))[-50:]
    y = 2.0 + 0.0005 * (wander - wander.mean()) / wander.std()
    frame = pd.DataFrame({"t": 0.1 * np.arange(50), "y": y})
    case = read_case(write_case(tmp_path, CONSTANT, simulator=STILL, r0__csv=frame, r1__csv=None))
    assert (LONG in {each.reason for each in hidden(case)}) is (verdict == "unknown")
    answer = diagnose(case, None).diagnosis
    assert (answer.verdict, answer.effects) == (verdict, ())


COASTING = case_text(
    "ode",
    title="A car that coasts",
    parameters={"drag": (0.05, "1/s", 0.02)},
    outputs={"v": "m/s"},
    runs=3,
    states=["v"],
)
SLOWED = """
def initial(p):
    return [12.0]
def rhs(t, x, u, p):
    return [-p["drag"] * x[0]]
def outputs(x, u, p):
    return {"v": x[0]}
"""


@pytest.mark.parametrize(("scatter", "reasons"), [(0.06, [LONG]), (0.0, [])])
def test_an_arc_as_long_as_every_run_is_not_known_to_be_noise(tmp_path, scatter, reasons):
    """Coast-downs under another wind each time leave arcs of both signs, far above the sensor."""
    t = np.arange(200) * 0.1
    frames = {}
    for run, wind in enumerate((-1, 0.2, 1)):
        rng = np.random.default_rng(run)
        v = 12 * np.exp(-0.05 * (1 + scatter * wind) * t) + rng.normal(0, 0.01, t.size)
        frames[f"r{run}__csv"] = pd.DataFrame({"t": t, "v": v})
    case = read_case(write_case(tmp_path, COASTING, simulator=SLOWED, **frames))
    assert [found.reason for found in hidden(case)] == reasons
