"""All rows at once: the exact motion, from a guess that knows nothing of it; what turns is marched along."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators import ode, trajectory
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.forces import Forces, ForcesTogether
from toolkit.diagnosis.simulators.integrate import RTOL
from toolkit.diagnosis.simulators.marching import march
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows, enough
from toolkit.diagnosis.simulators.trajectory import Guesses, Path, recursion, trajectories

T = np.linspace(0.0, 10.0, 201)
NONE = Forces((), 0)


def run_of(t, **columns):
    return Run(name=f"{len(t)}.csv", t=t, columns=columns, conditions={}, declared={}, simulated={})


def flow_of(rhs, runs, p, *, states=2, drivers=()):
    sets = len(next(iter(p.values())))
    forces = ForcesTogether([NONE] * sets, states, runs)
    return RowFlow(rhs, Rows(runs, drivers), p, forces, np.full((states, sets), 1e-9))


def swinging(t, x, u, p):
    return np.stack([x[1], -p["k"] * x[0]])


def wide(t, x, u, p):
    return np.stack([x[1], -p["k"] * np.sin(x[0])])


def driven(t, x, u, p):
    return u["u"][None] * p["k"]


def shaken(t, x, u, p):
    return (p["k"] * np.cos(p["k"] * t))[None]


def explosive(t, x, u, p):
    return p["k"] * x * x


def solved(flow, starts):
    """Return the states; ``starts`` (states, sets, runs)."""
    rows = flow.rows
    guess = np.zeros((*starts.shape[:2], len(rows.t)))
    for i, at in enumerate(rows.slices):
        guess[:, :, at] = starts[:, :, i : i + 1]
    steps = np.ones(len(rows.t) - 1, dtype=np.intp)
    everyone = np.ones(starts.shape[1], dtype=bool)
    return trajectories(flow, Path(guess, steps, None), np.full(len(starts), 20.0), everyone)


def test_every_set_swings_at_its_own_frequency_in_every_run():
    k = np.array([1.0, 4.0, 9.0])
    runs = [run_of(T), run_of(T[:101])]
    starts = np.zeros((2, 3, 2))
    starts[0] = [[1.0, 2.0], [1.0, 0.5], [2.0, 1.0]]
    path, reached = solved(flow_of(swinging, runs, {"k": k}), starts)
    assert reached.all()
    # x = x0 cos(sqrt(k) t)
    exact = np.concatenate(
        [starts[0, :, i, None] * np.cos(np.sqrt(k)[:, None] * run.t) for i, run in enumerate(runs)], axis=1
    )
    np.testing.assert_allclose(path.x[0], exact, atol=3e-5)


def test_energy_of_a_wide_pendulum_is_kept_over_many_swings():
    t, sets = np.linspace(0.0, 60.0, 3001), 8
    flow = flow_of(wide, [run_of(t)], {"k": np.ones(sets)})
    path, reached = solved(flow, np.tile(np.array([2.5, 0.0]).reshape(2, 1, 1), (1, sets, 1)))
    assert reached.all()
    angle, rate = path.x[:, 0]
    np.testing.assert_allclose(rate**2 / 2 - np.cos(angle), -np.cos(2.5), atol=1e-5)


def test_the_input_is_linear_between_rows():
    # x' = u with u = t: x = t^2/2, exact at any distance of the rows
    t = np.array([0.0, 0.3, 1.0, 1.1, 4.0])
    flow = flow_of(
        driven,
        [run_of(t, u=t)],
        {"k": np.ones(1)},
        states=1,
        drivers=("u",),
    )
    path, _ = solved(flow, np.zeros((1, 1, 1)))
    np.testing.assert_allclose(path.x[0, 0], t**2 / 2, rtol=1e-12, atol=1e-12)


def test_a_set_that_runs_off_is_said_and_the_others_are_as_alone():
    # x' = k x^2 from 1: 1/(1 - k t), without value at t = 1/k
    flow = flow_of(explosive, [run_of(T)], {"k": np.array([0.05, 1.0])}, states=1)
    with np.errstate(all="ignore"):
        path, reached = solved(flow, np.ones((1, 2, 1)))
    assert reached.tolist() == [True, False]
    np.testing.assert_allclose(path.x[0, 0], 1 / (1 - 0.05 * T), rtol=1e-5)


def test_a_set_that_asks_for_too_short_steps_is_not_waited_for():
    # x' = k cos(k t) from 0: sin(k t), eighty turns of it from row to row
    flow = flow_of(shaken, [run_of(T)], {"k": np.array([1.0, 1e4])}, states=1)
    path, reached = solved(flow, np.zeros((1, 2, 1)))
    assert reached.tolist() == [True, False]
    np.testing.assert_allclose(path.x[0, 0], np.sin(T), atol=1e-6)


def test_marching_and_a_guess_lead_to_the_same_motion():
    k = np.array([1.0, 30.0])
    flow = flow_of(swinging, [run_of(T)], {"k": k})
    starts = np.array([[1.0, 1.0], [0.0, 0.0]])[:, :, None]
    path, _ = solved(flow, starts)
    marched, reached = march(flow, starts, np.arange(2))
    assert reached.all()
    np.testing.assert_allclose(marched[0], np.cos(np.sqrt(k)[:, None] * T), atol=300 * RTOL)
    np.testing.assert_allclose(marched, path.x, atol=300 * RTOL)


@pytest.mark.parametrize("sets", [1, 3])
def test_a_recursion_in_blocks_is_the_recursion(sets):
    rng = np.random.default_rng(2)
    slopes, added = rng.normal(size=(37, sets, 2, 2)), rng.normal(size=(2, 3, 37))
    d, rows = np.zeros((2, 3)), []
    for k in range(37):
        d = np.stack([slopes[k, min(s, sets - 1)] @ d[:, s] for s in range(3)], axis=1) + added[:, :, k]
        rows.append(d)
    np.testing.assert_allclose(recursion(slopes, added), np.stack(rows, axis=2), rtol=1e-9)


RELAXING = """
def rhs(t, x, u, p):
    return [(u["F"] - x[0]) / p["tau"]]
def outputs(x, u, p):
    return {"X": x[0]}
def initial(p):
    return [0.0]
"""


def test_parameters_that_make_an_equation_stiff_do_not_slow_all_that_come_after(tmp_path, monkeypatch):
    text = case_text(
        "ode", states=["x"], force_terms={"x": "N/s"}, parameters={"tau": (1.0, "s", 0.1)},
        inputs={"F": "N"}, outputs={"X": "N"}, runs=1,
    )  # fmt: skip
    t = np.arange(0.0, 20.0, 0.1)
    frame = pd.DataFrame({"t": t, "F": np.sin(t), "X": np.sin(t)})
    case = read_case(write_case(tmp_path, text, simulator=RELAXING, r0__csv=frame))
    model, row_by_row = model_of(case, None), []

    def integrate(*arguments):
        row_by_row.append(arguments)
        return ode_integrate(*arguments)

    ode_integrate = ode.integrate
    monkeypatch.setattr(ode, "integrate", integrate)
    for i in range(4):
        model.simulate(case.runs[0], {"tau": 1e-7 * (1 + i)}, ())  # steps of a thousandth of a row
    assert row_by_row
    for i in range(30):
        row_by_row.clear()
        model.simulate(case.runs[0], {"tau": 1.0 + 0.01 * i}, ())
    assert not row_by_row


def test_a_simulation_near_a_known_one_comes_to_rest_once(tmp_path, monkeypatch):
    text = case_text(
        "ode", states=["x"], force_terms={"x": "N/s"}, parameters={"tau": (10.0, "s", 0.1)},
        inputs={"F": "N"}, outputs={"X": "N"}, runs=1,
    )  # fmt: skip
    t = np.arange(0.0, 20.0, 0.1)
    frame = pd.DataFrame({"t": t, "F": np.sin(t), "X": np.sin(t)})
    case = read_case(write_case(tmp_path, text, simulator=RELAXING, r0__csv=frame))
    model, begun = model_of(case, None), []

    def converged(flow, x, *rest):
        begun.append(x.shape[2])
        return trajectory_converged(flow, x, *rest)

    def begins(tau):
        begun.clear()
        model.simulate(case.runs[0], {"tau": tau}, ())
        return list(begun)

    trajectory_converged = trajectory._converged
    monkeypatch.setattr(trajectory, "_converged", converged)
    for tau in (1.0, 0.5):
        begins(tau)
    quick = begins(0.3)
    assert len(quick) > 1
    assert begins(0.301) == [quick[-1]]


def test_fewer_steps_do_where_the_error_of_the_fifth_power_of_their_length_allows_it():
    # of four steps: half as many leave 32 times the error, a quarter 1024 times
    errors = np.array([[0.9, 1 / 100, 1 / 10_000], [0.9, 1 / 1000, 0.0]])
    assert enough(np.array([4, 4, 4]), errors).tolist() == [4, 2, 1]


def test_terms_that_miss_wait_ever_longer_and_others_do_not():
    guesses, tried = Guesses(), []
    for _ in range(64):
        tried.append(guesses.are_tried(("corner",)))
        if tried[-1]:
            guesses.led(("corner",), on=False)
    assert [i for i, each in enumerate(tried) if each] == [0, 1, 2, 11, 28, 61]
    assert guesses.are_tried(("smooth",))
    guesses.led(("smooth",), on=True)
    assert guesses.are_tried(("smooth",))


def test_what_the_bare_equation_missed_its_terms_are_tried_once():
    guesses = Guesses()
    for _ in range(3):
        guesses.led((), on=False)
    assert guesses.are_tried(("term",))
    guesses.led(("term",), on=False)
    assert not guesses.are_tried(("term",))
