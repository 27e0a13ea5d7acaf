"""Terms that are so large that the simulation without them is another motion: the recording proposes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.in_place import best_in_place
from toolkit.diagnosis.search.proposals import Proposals, proposals
from toolkit.diagnosis.search.screen import Scored
from toolkit.diagnosis.simulators.build_simulator import model_of

HEAD = """schema = 1
title = "A driven body"
[simulation]
kind = "ode"
path = "sim.py"
states = ["x", "v"]
force_terms = {{ v = "N/kg" }}
[simulation.parameters.stiffness]
value = {stiffness}
unit = "1/s^2"
sd = 2.0
bounds = [0.0, 40.0]
[simulation.parameters.damping]
value = {damping}
unit = "1/s"
sd = {sd}
bounds = [0.0, 4.0]
[recording]
time = "t"
[recording.channels]
t = {{ unit = "s", role = "time" }}
u = {{ unit = "N/kg", role = "input" }}
x = {{ unit = "m", role = "output" }}
"""
SIMULATOR = """
def initial(p):
    return [0.0, 0.0]
def rhs(t, x, u, p):
    return [x[1], u["u"] - p["stiffness"] * x[0] - p["damping"] * x[1]]
def outputs(x, u, p):
    return {"x": x[0]}
"""
K3, COULOMB, FORCE = 30.0, 1.5, 0.6


def driven(
    folder: Path,
    *,
    stiffness: float,
    k3: float = 0.0,
    coulomb: float = 0.0,
    force: float = 0.0,
    late_s: float = 0.0,
    damping: tuple[float, float] = (0.9, 0.4),
) -> Problem:
    """Return two runs of a body of damping 0.8/s, integrated by a solver of scipy's and read late.

    ``damping`` is its prior: value and sd.
    """
    toml, frames, t = (
        HEAD.format(stiffness=stiffness, damping=damping[0], sd=damping[1]),
        {},
        np.arange(400) * 0.05,
    )
    for run in range(2):
        rng = np.random.default_rng(run)
        u = sum(rng.uniform(1.5, 2.5) * np.sin(w * t + rng.uniform(0, 6)) for w in (0.7, 1.9, 3.7, 5.1))

        def rate(at: float, y: np.ndarray, u: np.ndarray = u) -> list[float]:
            pull = np.interp(at, t, u) - stiffness * y[0] - k3 * y[0] ** 3 - 0.8 * y[1]
            return [y[1], pull - coulomb * np.tanh(y[1] / 1e-3) - force]

        solved = solve_ivp(rate, (0, t[-1]), [0.0, 0.0], t_eval=t, method="LSODA", rtol=1e-8, atol=1e-9)
        noise = rng.normal(0, 0.002, t.size)
        read = np.interp(t - late_s, t, solved.y[0]) + noise
        frames[f"r{run}__csv"] = pd.DataFrame({"t": t, "u": u, "x": read})
        toml += f'[[recording.run]]\nfile = "r{run}.csv"\n'
    case = read_case(write_case(folder, toml, simulator=SIMULATOR, **frames))
    return problem_of(case, model_of(case, None, None))


def proposed(problem: Problem) -> tuple[Fit, Proposals]:
    base = fit(problem)
    return base, proposals(problem, base)


def sizes(scored: Scored) -> dict[str, float]:
    return dict(scored.active.values)


def test_a_spring_that_hardens_is_proposed_with_its_size_and_the_parameters_beside_it(tmp_path: Path) -> None:
    base, found = proposed(driven(tmp_path, stiffness=12.0, k3=K3))
    first = found.scored[0]
    assert first.candidate.name == "cubic_stiffness"
    assert sizes(first)["k3"] == pytest.approx(K3, rel=0.1)
    assert first.p is not None
    assert first.p == pytest.approx((12.0, 0.8), abs=0.4)
    # The refit without it has gone elsewhere.
    assert abs(base.p[0] - 12.0) > 2.0
    assert found.p_of[id(first)] < 1e-12


def test_friction_beside_a_force_is_proposed_with_it(tmp_path: Path) -> None:
    """Without a spring a body that is pushed to one side leaves every simulation that lacks either."""
    _, found = proposed(driven(tmp_path, stiffness=0.0, coulomb=COULOMB, force=FORCE))
    both = {scored.candidate.name: sizes(scored) for scored in found.together}
    assert set(both) == {"coulomb_friction", "constant_force"}
    assert both["coulomb_friction"]["coulomb"] == pytest.approx(COULOMB, rel=0.1)
    assert abs(both["constant_force"]["force"]) == pytest.approx(FORCE, rel=0.15)


def test_a_simulation_that_lacks_nothing_is_proposed_nothing(tmp_path: Path) -> None:
    _, found = proposed(driven(tmp_path, stiffness=12.0))
    assert found.scored == ()
    assert found.together == ()
    # What holds, slides or runs against a limit takes no more than chance: it costs no free simulation.
    assert {"coulomb_friction", "overflow"} <= {key.name for key in found.hopeless}


@pytest.mark.campaign(
    "a whole diagnosis more: a late output asks the worker of an equation for proposals in every run"
)
def test_the_worker_answers_as_the_same_process_does(tmp_path: Path) -> None:
    """What is asked of an equation in its worker comes back as it was made."""
    problem = driven(tmp_path, stiffness=12.0, k3=K3)
    _, here = proposed(problem)
    answer = diagnose(problem.case, None).diagnosis
    assert [effect.name for effect in answer.effects] == ["cubic_stiffness"]
    low, high = answer.effects[0].parameters[0].ci95
    assert low < K3 < high
    assert answer.remaining == "nothing"
    assert sizes(here.scored[0])["k3"] == pytest.approx(K3, rel=0.1)


@pytest.mark.campaign(
    "a whole diagnosis: what is proposed to an equation, and a late channel, are held in every run"
)
def test_an_output_that_is_read_late_is_not_told_as_forces(tmp_path: Path) -> None:
    """Led along late readings, an equation seems to lack forces; a delay alone explains them."""
    problem = driven(tmp_path, stiffness=12.0, late_s=0.15)
    answer = diagnose(problem.case, None).diagnosis
    assert len(answer.effects) == 1
    effect = answer.effects[0]
    assert "channel_delay" in (effect.name, *effect.equivalent_to)


@pytest.mark.campaign(
    "a whole diagnosis more: a ball whose speed is far off its prior keeps its drag in every run"
)
def test_a_parameter_with_a_wrong_prior_does_not_withdraw_what_foretells_all_else(tmp_path: Path) -> None:
    """Three sd off with and without the spring: it is the prior that is wrong, and the spring stands."""
    problem = driven(tmp_path, stiffness=12.0, k3=K3, damping=(2.2, 0.4))
    answer = diagnose(problem.case, None).diagnosis
    assert "cubic_stiffness" in [effect.name for effect in answer.effects]
    shifts = {
        each.name: (each.after - each.before) / each.prior_sd
        for each in answer.nominal_parameters
        if each.prior_sd
    }
    assert shifts["damping"] < -3


PENDULUM = case_text(
    "ode", title="A bob on a thread", states=["angle", "rate"], force_terms={"rate": "1/s^2"},
    parameters={"length": (0.334, "m", 0.005)}, outputs={"angle": "rad"}, runs=1,
)  # fmt: skip
SWINGING = """
import math
def initial(p):
    return [0.9, 0.0]
def rhs(t, x, u, p):
    return [x[1], -9.81 * math.sin(x[0]) / p["length"]]
def outputs(x, u, p):
    return {"angle": x[0]}
"""
LENGTH, DRAG, ZERO = 0.332, 0.0105, 0.009
LOSSES = ("viscous_damping", "quadratic_drag", "coulomb_friction")


def filmed(folder: Path) -> Problem:
    """Return a bob that the air slows, filmed by a camera that is off by an angle and follows it badly."""
    rng, t = np.random.default_rng(5), np.arange(300) / 15
    solved = solve_ivp(
        lambda _, y: [y[1], -9.81 * np.sin(y[0]) / LENGTH - DRAG * y[1] * abs(y[1])],
        (0, t[-1]), [0.9, 0.0], t_eval=t, rtol=1e-9, atol=1e-10,
    )  # fmt: skip
    noise = np.zeros(t.size)
    for k in range(1, t.size):
        noise[k] = 0.5 * noise[k - 1] + rng.normal(0, 0.010)
    frame = pd.DataFrame({"t": t, "angle": solved.y[0] + ZERO + noise})
    case = read_case(write_case(folder, PENDULUM, simulator=SWINGING, r0__csv=frame, r1__csv=None))
    return problem_of(case, model_of(case, None, None))


@pytest.mark.campaign("a second loss: a spring, and friction beside a force, are proposed in every run")
def test_a_slow_loss_is_proposed_in_spite_of_noise_that_the_likeliest_following_takes_for_it(
    tmp_path: Path,
) -> None:
    problem = filmed(tmp_path)
    base, found = proposed(problem)
    sized = {scored.candidate.name: sizes(scored) for scored in (*found.scored, *found.together)}
    losses = [sized[name] for name in ("viscous_damping", "quadratic_drag") if name in sized]
    assert losses
    # A swing of amplitude A loses as much by 3 pi / (8 rate) of the viscous coefficient: 0.036 at 4 rad/s.
    for loss in losses:
        assert loss.get("drag", DRAG) == pytest.approx(DRAG, rel=0.3)
        assert loss.get("viscous", 0.036) == pytest.approx(0.036, rel=0.3)

    joint = fit(problem, [scored.active for scored in found.together], start=found.together[0].p)
    damping = next(each for each in joint.active if each.effect.name != "constant_force")
    # Of all that has a place there those that lose: the others take as long, and none comes near.
    listed = [each for each in candidates(problem) if each.name in LOSSES]
    instead, active, rivals = best_in_place(problem, joint, damping, listed)
    names = {active.effect.name, *(rival.active.effect.name for rival in rivals)}
    assert {"viscous_damping", "quadratic_drag"} <= names
    assert instead.log_posterior >= joint.log_posterior
    assert instead.log_posterior > base.log_posterior + 50
