"""A late output of an equation shows what the equation did between two rows, not a curve through the rows.

An equation with feed-through, dx/dt = -x/T + u and y = K (u - x), its input linear between rows: x has a
closed form in every interval, and y has a corner at each row.
"""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

# An interval is at most 0.64 T long, so that straight lines over its quarters are off by 0.64^2 / 128, 0.3 %,
# of what decays in it: c (h/4)^2 / (8 T^2).
T, K, ROW = 2.5, 40.0, 1.0  # s, gain, s from row to row
SIMULATOR = """
def rhs(t, x, u, p):
    return [-x[0] / p["T"] + u["U"]]
def outputs(x, u, p):
    return {"Y": p["K"] * (u["U"] - x[0])}
def initial(p):
    return [0.4]
"""
CASE = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
[simulation.parameters.T]
value = 2.5
unit = "s"
[simulation.parameters.K]
value = 40.0
unit = "1"
[recording.channels]
t = { unit = "s", role = "time" }
U = { unit = "1", role = "input" }
Y = { unit = "1", role = "output" }
[[recording.run]]
file = "r0.csv"
"""


def inputs(irregular):
    rng = np.random.default_rng(4)
    t = np.arange(60) * ROW
    if irregular:
        t[1:-1] += rng.uniform(-0.3, 0.3, 58) * ROW
    return t, np.sin(0.4 * t) + rng.normal(0, 0.3, 60)


def exact(t, u, at):
    """y at any time: x' = -x/T + u of an interval with u = a + b s is T a - T^2 b + T b s + c exp(-s/T)."""
    x = np.empty(len(t))
    x[0] = 0.4
    h, b = np.diff(t), np.diff(u) / np.diff(t)

    def on(k, s):
        straight = T * u[k] - T**2 * b[k]
        return straight + T * b[k] * s + (x[k] - straight) * np.exp(-s / T)

    for k in range(len(h)):
        x[k + 1] = on(k, h[k])
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(h) - 1)
    return K * (u[k] + b[k] * (at - t[k]) - on(k, at - t[k]))


def made(folder, t, u, effect=None, **values):
    table = pd.DataFrame({"t": t, "U": u, "Y": 0.0})
    case = read_case(write_case(folder, CASE, simulator=SIMULATOR, r0__csv=table))
    active = () if effect is None else (AppliedEffect(effect=effects()[effect], channel="Y", values=values),)
    return model_of(case, None).simulate(case.runs[0], {"T": T, "K": K}, active)["Y"]


@pytest.mark.parametrize("irregular", [False, True])
def test_without_an_effect_the_equation_follows_its_closed_form(tmp_path, irregular):
    t, u = inputs(irregular)
    np.testing.assert_allclose(made(tmp_path, t, u), exact(t, u, t), atol=1e-4 * K)


@pytest.mark.parametrize("irregular", [False, True])
@pytest.mark.parametrize("rows", [0.1, 0.5, 1.5, 3.0])
def test_a_late_output_is_the_equations_own_between_its_rows(tmp_path, rows, irregular):
    t, u = inputs(irregular)
    wanted = exact(t, u, np.maximum(t - rows * ROW, t[0]))
    late = made(tmp_path, t, u, "channel_delay", delay=rows * ROW)
    change = np.abs(np.diff(exact(t, u, t))).max()
    assert np.abs(late - wanted).max() < 0.01 * change


@pytest.mark.parametrize("irregular", [False, True])
@pytest.mark.parametrize("rows", [0.1, 0.5, 1.5, 3.0])
def test_a_filter_smooths_the_equations_own_between_its_rows(tmp_path, rows, irregular):
    t, u = inputs(irregular)
    fine, tau = np.interp(np.arange(59 * 400 + 1) / 400, np.arange(60), t), rows * ROW
    y = exact(t, u, fine)
    z = np.empty(len(fine))
    z[0] = y[0]
    for k, h in enumerate(np.diff(fine)):  # trapezoidal, 400 steps a row
        z[k + 1] = ((tau - h / 2) * z[k] + h / 2 * (y[k] + y[k + 1])) / (tau + h / 2)
    smoothed = made(tmp_path, t, u, "filter_lag", time_constant=tau)
    assert np.abs(smoothed - z[::400]).max() < 0.01 * np.abs(np.diff(exact(t, u, t))).max()


def test_no_delay_is_the_output_itself_and_a_whole_row_is_the_row_before(tmp_path):
    t, u = inputs(irregular=False)
    plain = made(tmp_path, t, u)
    np.testing.assert_allclose(made(tmp_path, t, u, "channel_delay", delay=0.0), plain, atol=1e-4 * K)
    late = made(tmp_path, t, u, "channel_delay", delay=ROW)
    np.testing.assert_allclose(late[1:], plain[:-1], atol=1e-4 * K)
    assert late[0] == pytest.approx(plain[0], abs=1e-4 * K)
