"""Dry friction in an equation: a body under it slides, comes to rest and stays, as Coulomb's law says.

The bristle's work is known: over a way x from rest the friction is coulomb (1 - exp(-x/presliding)), so that
a slide from speed v0 ends where v0^2/2 = coulomb (way - presliding); the bristle then swings the body back.
"""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

COULOMB, REACH = 0.5, 1e-3  # N/kg, m
SIMULATOR = """
def rhs(t, x, u, p):
    return [x[1], u["F"]]
def outputs(x, u, p):
    return {"X": x[0], "V": x[1]}
def initial(p):
    return [0.0, p["v0"]]
"""
CASE = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["x", "v"]
[simulation.parameters.v0]
value = 0.0
unit = "m/s"
[recording.channels]
t = { unit = "s", role = "time" }
F = { unit = "N/kg", role = "input" }
X = { unit = "m", role = "output" }
V = { unit = "m/s", role = "output" }
[[recording.run]]
file = "r0.csv"
"""


def slid(folder, force, v0, seconds=4.0, row=0.02):
    t = np.arange(0, seconds, row)
    table = pd.DataFrame({"t": t, "F": np.full(len(t), force), "X": 0.0, "V": 0.0})
    case = read_case(write_case(folder, CASE, simulator=SIMULATOR, r0__csv=table))
    dry = AppliedEffect(
        effect=effects()["coulomb_friction"], channel="v", values={"coulomb": COULOMB, "presliding": REACH}
    )
    made = model_of(case, None).simulate(case.runs[0], {"v0": v0}, (dry,))
    return t, made["X"], made["V"]


def test_a_body_slides_as_far_as_its_energy_reaches_and_stays_there(tmp_path):
    t, x, _ = slid(tmp_path, 0.0, 1.0)
    way = 1.0**2 / (2 * COULOMB) + REACH
    assert x.max() == pytest.approx(way, abs=0.05 * REACH)
    after = x[t > 1.0 / COULOMB + 0.2]
    assert np.ptp(after) <= 2 * REACH
    assert abs(after - way).max() <= 3 * REACH


def test_while_it_slides_the_friction_has_one_size(tmp_path):
    t, _, v = slid(tmp_path, 0.0, 1.0, 1.5)
    sliding = t > 0.05  # by then it has gone fifty presliding distances
    np.testing.assert_allclose(np.gradient(v, t)[sliding][1:-1], -COULOMB, rtol=1e-4)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_less_than_the_friction_only_bends_the_bristle(tmp_path, share):
    # Put on at once, the force swings the body u presliding distances far, where its work is the bristle's:
    # share u = u - (1 - exp(-u)).
    u = brentq(lambda u: (1 - share) * u + np.expm1(-u), 1e-3, 50)
    _, x, v = slid(tmp_path, share * COULOMB, 0.0, 0.4, row=5e-4)
    first = int(np.argmax(v < 0))
    assert x[first] == pytest.approx(u * REACH, rel=1e-3)


def test_more_than_the_friction_pulls_it_along(tmp_path):
    t, _, v = slid(tmp_path, 1.5 * COULOMB, 0.0)
    assert np.gradient(v, t)[t > 1][:-1] == pytest.approx(0.5 * COULOMB, rel=1e-3)


TORSION = """
def rhs(t, x, u, p):
    return [x[1], u["M"] / p["J"] - p["k"] / p["J"] * x[0] - p["c"] / p["J"] * x[1]]
def outputs(x, u, p):
    return {"th": x[0]}
def initial(p):
    return [0.0, 0.0]
"""
TORSION_CASE = case_text(
    "ode", states=["th", "om"], force_terms={"om": "rad/s^2"},
    parameters={"J": (0.5, "kg*m^2"), "k": (20.0, "N*m/rad", 1.0), "c": (0.3, "N*m*s/rad", 0.1)},
    inputs={"M": "N*m"}, outputs={"th": ("rad", 0.004)},
)  # fmt: skip


@pytest.mark.campaign("a whole diagnosis: friction that a unit leaves out is named in every run")
def test_friction_that_a_refitted_damping_hides_is_found(tmp_path):
    # A torsion pendulum, driven below and above its resonance. By steps of a thousandth of a period, the
    # torque of 0.24 rad/s^2 against the motion, on a body that never rests.
    frames, text = {}, TORSION_CASE
    for i in range(2):
        t = np.arange(0, 7, 0.04)
        fine = np.linspace(0, t[-1], 60 * (t.size - 1) + 1)
        torque = np.interp(fine, t, 1.5 * np.sin(2.2 * t + i) + 0.9 * np.sin(7.1 * t + 2 * i))
        th, om, path = 0.0, 0.0, []
        h = fine[1]
        for m in torque:
            path.append(th)
            om += h * (m / 0.5 - 20.6 / 0.5 * th - 0.34 / 0.5 * om - 0.24 * np.tanh(om / 2e-3))
            th += h * om
        noise = np.random.default_rng(i).normal(0, 0.004, t.size)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": t, "M": torque[::60], "th": np.array(path)[::60] + noise})
        text += f'[[recording.run]]\nfile = "r{i}.csv"\n'
    made = diagnose(read_case(write_case(tmp_path, text, simulator=TORSION, **frames)), None).diagnosis
    (one,) = made.effects
    assert one.name == "coulomb_friction"
    low, high = one.parameters[0].ci95
    assert low - (high - low) / 2 < 0.24 < high + (high - low) / 2
    assert made.fit.held_out[0].augmented_rmse == pytest.approx(0.004, rel=0.1)
