"""What a step takes: of equals the likeliest, and what coloured noise of few rows only hints at."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import HEAD, TWO, write_case
from tests.diagnosis.tire_case import python_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import HeldOut, folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.policy import STEP, VERDICT
from toolkit.diagnosis.search import forward_step
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Joint, best_step, joint_fits, step_groups
from toolkit.diagnosis.search.screen import best_of
from toolkit.diagnosis.search.screen_step import look
from toolkit.diagnosis.simulators.build_simulator import model_of

COASTING = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"v": inputs["v0"] * np.exp(-p["c"] * inputs["t"])})
"""
CASE = case_text(
    "python", parameters={"c": (0.02, "1/s", 0.004)}, inputs={"v0": "m/s"}, outputs={"v": "m/s"},
)  # fmt: skip


def coasts(folder, *, force):
    """Return coasting runs under v' = -c v - force (closed form), with noise that wanders for minutes."""
    rng, text, frames = np.random.default_rng(3), CASE, {}
    for k in range(4):
        t, wander = np.arange(120) * 0.5, np.zeros(120)
        for i in range(1, 120):
            wander[i] = 0.99 * wander[i - 1] + rng.normal(0, 0.05)
        v = (8 + force / 0.02) * np.exp(-0.02 * t) - force / 0.02
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v0": 8.0, "v": v + wander + rng.normal(0, 0.03, 120)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=COASTING, **frames))


def carriage(folder, *, zero):
    """Return runs of a carriage of 94 kg whose force, up to 300 N, shows so much too much [N]."""
    frames = {}
    for k in range(2):
        rng, t = np.random.default_rng([1, k]), np.arange(300) * 0.02
        v, a = 0.5 * np.sin(2 * t + k) + 0.2 * np.sin(5 * t), np.cos(2 * t + k) + np.cos(5 * t)
        force = 94 * a + 210 * v + zero + rng.normal(0, 1, 300)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v": v, "a": a, "F": force})
    return read_case(write_case(folder, HEAD + TWO, **frames))


@pytest.mark.parametrize(
    ("zero", "names"),
    [(3.0, ("zero_offset", "constant_force")), (60.0, ("constant_force", "zero_offset"))],
)
def test_a_hundredth_of_the_range_is_a_sensors_zero_and_a_fifth_of_it_a_force(tmp_path, zero, names):
    (effect,) = diagnose(carriage(tmp_path, zero=zero), None).diagnosis.effects
    assert (effect.name, *effect.equivalent_to) == names


@pytest.mark.campaign("the likeliest of equals by its size is held by a carriage in every run")
def test_a_degree_is_a_zero_of_the_steering_and_no_plies_pull_as_far(tmp_path):
    case = read_case(python_tire(tmp_path, offset=1.0))
    (effect,) = diagnose(case, None).diagnosis.effects
    assert (effect.name, effect.equivalent_to) == ("steer_offset", ("plysteer",))


@pytest.mark.campaign("the likeliest of equals by its size is held by a carriage in every run")
def test_a_drift_that_takes_half_of_the_range_is_a_force(tmp_path):
    (effect,) = diagnose(coasts(tmp_path, force=0.12), None).diagnosis.effects
    assert (effect.name, effect.equivalent_to) == ("constant_force", ("zero_drift",))


@pytest.mark.campaign("a whole diagnosis of nothing: coloured noise of a tank is nothing in every run")
def test_noise_that_wanders_gets_no_name(tmp_path):
    assert not diagnose(coasts(tmp_path, force=0.0), None).diagnosis.effects


def test_what_few_rows_of_coloured_noise_hint_at_has_to_explain_most_of_unseen_runs(tmp_path):
    case = coasts(tmp_path, force=0.06)
    problem = problem_of(case, model_of(case, None, None))
    view = look(problem, fit(problem), candidates(problem), turn=0, seed=1)
    assert view.significant == ()
    assert "constant_force" in {trial.candidate.name for trial in view.hinted}
    assert step_groups((), view.hinted, frozenset(), STEP.first) == [
        (view.hinted[: STEP.refined], STEP.shown)
    ]
    assert step_groups((), (), frozenset(), STEP.first) == []


@pytest.fixture(scope="module")
def fitted_step(tmp_path_factory):
    """Runs under a force: their problem, its fit, the screen, the two best joint fits, and unseen rows."""
    case = coasts(tmp_path_factory.mktemp("force"), force=0.12)
    problem = problem_of(case, model_of(case, None, None))
    base = fit(problem)
    likely = [each for each in candidates(problem) if each.name in ("constant_force", "zero_drift")]
    view = look(problem, base, likely, turn=0, seed=1)
    two = joint_fits(problem, base, best_of(view.scored))[:2]
    return problem, base, view, two, hold_out(problem, folds_of(problem, base), (), base)


@pytest.mark.campaign(
    "a look at all effects and two joint fits: of equals the likeliest is taken in every run"
)
@pytest.mark.parametrize(("noise_alone", "place"), [(True, 0), (False, 1)])
def test_where_more_than_noise_is_left_the_effect_that_foretells_better_goes_before_the_better_fit(
    fitted_step, monkeypatch, noise_alone, place
):
    problem, base, view, two, before = fitted_step
    assert two[0].score - base.log_posterior < 2 * (two[1].score - base.log_posterior)
    totals = {two[0].fit: 100.0, two[1].fit: 110.0}

    def foretold(problem, folds, active, start):
        return HeldOut(scores=(totals[start],), simulated=dict(problem.observed), fits=())

    monkeypatch.setattr(forward_step, "hold_out", foretold)
    monkeypatch.setattr(forward_step, "leaves_more_than_noise", lambda *_: not noise_alone)
    nothing = HeldOut(scores=(0.0,), simulated=before.simulated, fits=())
    outcome = best_step(problem, folds_of(problem, base), base, nothing, two, view.p_of, STEP.first, before)
    assert outcome is not None
    step = outcome[2]
    assert step.active == two[place].fit.active[-1]
    # the better fit stays in the class, whichever goes first
    assert {rival.active for rival in step.rivals} == {two[1 - place].fit.active[-1]}
    assert (step.rivals[0].difference > -VERDICT.close) or place == 0


def test_a_candidate_is_held_out_once_however_often_it_stands_beside_others(fitted_step, monkeypatch):
    problem, base, view, two, before = fitted_step
    joint = tuple(Joint(scored=each.scored, fit=each.fit, score=each.score) for each in two)
    asked = []

    def refused(problem, folds, active, start):
        asked.append(start)
        return HeldOut(scores=(-1e3,), simulated=before.simulated, fits=())

    monkeypatch.setattr(forward_step, "hold_out", refused)
    for _ in range(3):
        folds = folds_of(problem, base)
        assert best_step(problem, folds, base, before, joint, view.p_of, STEP.first, before) is None
    assert asked == [each.fit for each in two]


def test_what_its_own_fit_refuses_is_held_out_never(fitted_step, monkeypatch):
    problem, base, view, two, before = fitted_step
    joint = (Joint(scored=two[0].scored, fit=two[0].fit, score=base.log_posterior),)
    monkeypatch.setattr(forward_step, "hold_out", lambda *_: pytest.fail("a fit for each fold in vain"))
    folds = folds_of(problem, base)
    assert best_step(problem, folds, base, before, joint, view.p_of, STEP.first, before) is None


@pytest.mark.parametrize(("off", "place"), [((0.0, 0.0), 0), ((4.0, 0.0), 1), ((4.0, 5.0), 0)])
def test_what_needs_a_parameter_that_nobody_believes_yields_to_what_needs_none(
    fitted_step, monkeypatch, off, place
):
    problem, base, _view, two, before = fitted_step
    farther = [
        Joint(scored=joint.scored, fit=replace(joint.fit, p=(0.02 + 0.004 * by,)), score=joint.score)
        for joint, by in zip(two, off, strict=True)
    ]

    def foretold(problem, folds, active, start):
        return HeldOut(scores=(100.0,), simulated=before.simulated, fits=())

    for name, value in (
        ("hold_out", foretold),
        ("matters", lambda *_: True),
        ("beyond_form", lambda *_: True),
    ):
        monkeypatch.setattr(forward_step, name, value)
    monkeypatch.setattr(forward_step, "leaves_more_than_noise", lambda *_: True)
    p_of = {id(joint.scored): 0.001 for joint in two}
    nothing = HeldOut(scores=(0.0,), simulated=before.simulated, fits=())
    taken = best_step(problem, (), base, nothing, farther, p_of, STEP.first, before)
    assert taken is not None
    assert taken[2].active.key == two[place].fit.active[-1].key
