"""Before nothing is said: noise is the same in every run, and no law foretells it."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

HEAD = """schema = 1
title = "Tanks and plates"
[simulation]
kind = "ode"
path = "sim.py"
states = {states}
{parameters}
[recording]
time = "t"
[recording.channels]
t = {{ unit = "s", role = "time" }}
{channels}
"""
RUNS = "".join(f'[[recording.run]]\nfile = "r{k}.csv"\nh0 = {12 + 3 * k}\n' for k in range(3))
TANK = """
import numpy as np
def rhs(t, x, u, p):
    return [(u["q"] - p["k"] * np.sqrt(np.maximum(x[0], 0.0))) / 60.0]
def outputs(x, u, p):
    return {"h": x[0]}
def initial(p, run):
    return [run["h0"]]
"""
PLATES = """
def rhs(t, x, u, p):
    return [(u["P"] - p["G1"] * (x[0] - 20.0)) / p["C1"], (u["Q"] - p["G2"] * (x[1] - 20.0)) / p["C2"]]
def outputs(x, u, p):
    return {"T1": x[0], "T2": x[1]}
def initial(p):
    return [20.0, 20.0]
"""


def parameter(name, value, sd):
    return f'[simulation.parameters.{name}]\nvalue = {value}\nunit = "1"\nsd = {sd}\n'


def case_of(folder, simulator, states, parameters, channels, frames):
    text = HEAD.format(states=states, parameters=parameters, channels=channels) + RUNS
    files = {f"r{k}__csv": pd.DataFrame(frame) for k, frame in enumerate(frames)}
    return read_case(write_case(folder, text, simulator=simulator, **files))


def marched(rate, x, t):
    """Return the states of an equation by Heun's method, ten steps a row."""
    rows = [np.array(x, float)]
    for a, b in itertools.pairwise(t):
        x, h = rows[-1], (b - a) / 10
        for k in range(10):
            first = rate(a + k * h, x)
            x = x + h / 2 * (first + rate(a + (k + 1) * h, x + h * first))
        rows.append(x)
    return np.array(rows).T


def coloured(phi, rng, n):
    return np.sqrt(1 - phi**2) * lfilter([1], [1, -phi], rng.standard_normal(n + 2000))[2000:]


def stepped(rng, t, every, low, high):
    knots = np.arange(0, t[-1] + 2 * every, every)
    return np.interp(t, knots, rng.uniform(low, high, len(knots)))


def tank(folder, noise):
    t, frames = np.arange(0, 660.0, 3), []
    for k in range(3):
        rng = np.random.default_rng([3, k])
        q = stepped(rng, t, 150, 4, 16)

        def rate(at, x, q=q):
            return (np.interp(at, t, q) - 2.0 * np.sqrt(np.maximum(x, 0))) / 60

        (h,) = marched(rate, [12 + 3 * k], t)
        frames.append({"t": t, "q": q, "h": h + noise(rng, h)})
    channels = 'q = { unit = "l/min", role = "input" }\nh = { unit = "cm", role = "output" }'
    return case_of(folder, TANK, '["h"]', parameter("k", 2.0, 0.1), channels, frames)


def plates(folder, noise, *, exchange):
    t, frames = np.arange(0, 2400.0, 15), []
    for k in range(3):
        rng = np.random.default_rng([5, k])
        P, Q = stepped(rng, t, 450, 0, 60), stepped(rng, t, 375, 0, 40)

        def rate(at, x, P=P, Q=Q):
            flow = exchange * (x[0] - x[1])
            return np.array(
                [
                    (np.interp(at, t, P) - 1.5 * (x[0] - 20) - flow) / 400,
                    (np.interp(at, t, Q) - (x[1] - 20) + flow) / 300,
                ]
            )

        T1, T2 = marched(rate, [20, 20], t)
        frames.append({"t": t, "P": P, "Q": Q, "T1": T1 + noise(rng, T1), "T2": T2 + noise(rng, T2)})
    channels = "\n".join(
        f'{name} = {{ unit = "{unit}", role = "{role}" }}'
        for name, unit, role in (
            ("P", "W", "input"),
            ("Q", "W", "input"),
            ("T1", "degC", "output"),
            ("T2", "degC", "output"),
        )
    )
    free = [("G1", 1.5, 0.05), ("G2", 1.0, 0.04), ("C1", 400, 10), ("C2", 300, 8)]
    return case_of(
        folder, PLATES, '["T1", "T2"]', "".join(parameter(*each) for each in free), channels, frames
    )


@pytest.mark.campaign(
    "two laws of two states, the longest search: unseen runs choose a law in every run (test_unseen_runs)"
)
def test_a_law_that_foretells_unseen_runs_is_learned_before_nothing_is_said(tmp_path):
    case = plates(tmp_path, lambda rng, T: rng.normal(0, 0.08, len(T)), exchange=0.06)
    answer = diagnose(case, None, limits=None).diagnosis
    assert (answer.verdict, answer.effects) == ("unknown", ())
    assert {law.place.channel for law in answer.laws} == {"T1", "T2"}
    assert {"T1", "T2"} in [set(law.variables) for law in answer.laws if law.place.channel == "T1"]
    for output in answer.fit.held_out:
        assert output.with_laws_rmse == pytest.approx(0.08, rel=0.15)


LESS = pytest.mark.campaign("noise of less colour, which asks less than that of every run")


@pytest.mark.parametrize("phi", [*(pytest.param(phi, marks=LESS) for phi in (0.9, 0.97)), 0.99])
def test_coloured_noise_of_all_runs_alike_is_nothing(tmp_path, phi):
    case = tank(tmp_path, lambda rng, h: 0.15 * coloured(phi, rng, len(h)))
    assert diagnose(case, None, limits=None).diagnosis.verdict == "nothing"
