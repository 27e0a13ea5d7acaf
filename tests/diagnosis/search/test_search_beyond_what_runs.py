"""A candidate that the simulation cannot run with goes alone; the search goes on with the others."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.search import forward_step, search, superfluous
from toolkit.errors import FitError

GAIN = 1.2
STOPPED = """
def rhs(t, x, u, p):
    if abs(x[0]) > {stop}:
        raise ValueError("beyond the stop")
    return [(u["U"] - x[0]) / p["tau"]]
def outputs(x, u, p):
    return {{"Y": x[0]}}
def initial(p):
    return [0.0]
"""
CASE = case_text(
    "ode", states=["v"], parameters={"tau": (2.0, "s", 0.1)}, inputs={"U": "1"}, outputs={"Y": "1"},
)  # fmt: skip


def lagging(seed):
    """A first-order lag of 2 s behind a piecewise linear input, in its own closed form; its largest value."""
    rng = np.random.default_rng(seed)
    t = np.arange(60) * 0.5
    u = np.sin(0.4 * t + seed) + 0.5 * np.sin(1.1 * t)
    x = np.zeros(60)
    for k in range(59):  # x = u - 2 b + c exp(-s/2) of an interval with u = a + b s
        b = (u[k + 1] - u[k]) / 0.5
        x[k + 1] = u[k + 1] - 2 * b + (x[k] - u[k] + 2 * b) * np.exp(-0.25)
    shown = GAIN * (x + rng.normal(0, 0.02, 60))
    return pd.DataFrame({"t": t, "U": u, "Y": shown}), np.abs(x).max()


@pytest.mark.campaign("an equation that stops by itself: a candidate that cannot run goes alone in every run")
def test_an_equation_that_stops_within_the_reach_of_a_rival_is_diagnosed(tmp_path):
    # The channel shows too much; a force that would explain it drives the equation past its stop.
    made = [lagging(seed) for seed in range(2)]
    stop = 1.02 * max(largest for _, largest in made)
    frames = {f"r{i}__csv": frame for i, (frame, _) in enumerate(made)}
    case = write_case(tmp_path / "case", CASE + TWO, simulator=STOPPED.format(stop=stop), **frames)
    answer = diagnose(read_case(case), None).diagnosis
    assert answer.verdict in ("named", "equivalent")
    (one,) = answer.effects
    assert (one.name, one.channel) == ("sensitivity_error", "Y")
    low, high = one.parameters[0].ci95
    assert low < GAIN - 1 < high


def refused():
    raise FitError(
        "no",
        where="here",
        got="beyond the stop",
        expected="a run",
        next_step="mend it",
        rule="simulator",
    )


def names(folder, **files):
    case = read_case(write_case(folder, HEAD + TWO, **files))
    return [one.name for one in diagnose(case, None).diagnosis.effects]


@pytest.mark.campaign("a second whole search: an effect without which nothing runs is kept in every run")
def test_a_fold_that_cannot_run_takes_its_candidate_away_and_no_other(tmp_path, monkeypatch):
    # Dry friction is there; without it the next best is a friction of another kind, or nothing.
    whole, asked = search.hold_out, []

    def without_friction(problem, folds, active, made):
        asked.append([one.effect.name for one in active])
        return refused() if "coulomb_friction" in asked[-1] else whole(problem, folds, active, made)

    for module in (search, superfluous, forward_step):
        monkeypatch.setattr(module, "hold_out", without_friction)
    found = names(tmp_path)
    assert ["coulomb_friction"] in asked
    assert asked.index(["coulomb_friction"]) > 0  # after the simulation without effects
    assert "coulomb_friction" not in found


OTHER = pytest.mark.campaign("the other call that may refuse: fits of unseen rows do in every run")


@pytest.mark.parametrize("cannot", [pytest.param("fit", marks=OTHER), "hold_out"])
def test_an_effect_without_which_nothing_runs_is_kept(tmp_path, monkeypatch, cannot):
    # Friction and a zero: once both are there, the simulation with one of them alone can no longer be run.
    whole, there, left = getattr(search, cannot), set(), []

    def only_together(problem, *given, **more):
        active = next((one for one in given if isinstance(one, tuple)), ())
        here = frozenset(one.effect.name for one in active)
        if here and any(here < each for each in there):
            left.append(here)
            refused()
        made = whole(problem, *given, **more)
        there.add(here)
        return made

    frames = {f"r{i}__csv": carriage(seed=i).assign(F=lambda df: df["F"] + 15) for i in range(2)}
    for module in (search, superfluous, forward_step):
        monkeypatch.setattr(module, cannot, only_together)
    found = diagnose(read_case(write_case(tmp_path, HEAD + TWO, **frames)), None).diagnosis.effects
    classes = [{effect.name, *effect.equivalent_to} for effect in found]
    # What was put in: friction, and a zero of F, which no recording here tells from a constant force.
    assert len(classes) == 2
    assert any("coulomb_friction" in members for members in classes)
    assert any("zero_offset" in members for members in classes)
    assert left
