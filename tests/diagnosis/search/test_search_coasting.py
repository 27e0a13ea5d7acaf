"""Wheels that coast: large losses, and what else a slightly wrong law of them leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import HeldOut, folds_of, hold_out
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.search import proposals as along
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.forward_step import Rival, Step
from toolkit.diagnosis.search.in_place import foretold_best
from toolkit.diagnosis.search.superfluous import pruned, told_from_none
from toolkit.diagnosis.search.superfluous import without as remaining
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.facts import Values

COASTING = case_text(
    "ode",
    title="A wheel that coasts",
    parameters={"bearing": (0.03, "N/kg", 0.01, [0.0, 0.1]), "v0": (22.0, "m/s", 3.0)},
    outputs={"v": "m/s"},
    states=["s", "v"],
    force_terms={"v": "N/kg"},
)
COASTING_SIMULATOR = """
def initial(p):
    return [0.0, p["v0"]]
def rhs(t, x, u, p):
    return [x[1], -p["bearing"] if x[1] > 0 else 0.0]
def outputs(x, u, p):
    return {"v": x[1]}
"""


def coasting(folder: Path, wave: float = 0.0, *, runs: int = 3, rows: int = 200) -> tuple[Problem, float]:
    """Return wheels with drag and a wave over the way [N/kg], and the longest way that one rolls [m]."""
    toml, frames, ways, t = COASTING, {}, [], np.arange(rows) * 0.75
    for run in range(runs):

        def rate(_: float, y: np.ndarray) -> list[float]:
            return [y[1], -0.004 - 0.0022 * max(y[1], 0.0) ** 2 - wave * np.sin(y[0] / 80)]

        rng = np.random.default_rng(run)
        solved = solve_ivp(rate, (0, t[-1]), [0.0, 22.0], t_eval=t, method="LSODA", rtol=1e-9)
        ways.append(float(solved.y[0][-1]))
        frames[f"r{run}__csv"] = pd.DataFrame({"t": t, "v": solved.y[1] + rng.normal(0, 0.002, t.size)})
        toml += f'[[recording.run]]\nfile = "r{run}.csv"\n'
    case = read_case(write_case(folder, toml, simulator=COASTING_SIMULATOR, **frames))
    return problem_of(case, model_of(case, None, None)), max(ways)


@pytest.mark.campaign("proposals to wheels that coast: proposals to a driven body are held in every run")
def test_what_rolls_out_is_periodic_by_the_way_that_it_rolled_and_not_by_the_simulations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, way = coasting(tmp_path)
    seen: list[float] = []

    class View(along._FollowedView):
        @property
        def way(self) -> tuple[float, float]:
            seen.append(super().way[0])
            return super().way

    monkeypatch.setattr(along, "_FollowedView", View)
    found = along.proposals(problem, fit(problem))
    assert found.scored
    assert abs(max(seen) / way - 1) < 0.1
    assert CaseView(problem, "v", None).way[0] > 1.5 * way


def fitted(problem: Problem, **values: Values) -> tuple[Fit, HeldOut, Fit, list[Step]]:
    """Return a joint fit of some effects on the speed, its unseen rows, the fit of none, and their steps."""
    listed = {candidate.name: candidate.active for candidate in candidates(problem)}
    active = tuple(
        replace(listed[name], values=dict(listed[name].values) | dict(sizes))
        for name, sizes in values.items()
    )
    refitted, made = fit(problem), fit(problem, active)
    folds = folds_of(problem, refitted)
    steps = [Step(active=each, p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=()) for each in made.active]
    return made, hold_out(problem, folds, made.active, made), refitted, steps[::-1]


def names(steps: Sequence[Step]) -> list[str]:
    return [step.active.effect.name for step in steps]


def test_what_the_form_of_a_drag_may_leave_is_dropped_beside_it(tmp_path: Path) -> None:
    """A slow wave over the way takes what is left, less than a thousandth of what the drag took.

    Though it was found last; and it is told as what stands in the place of the drag, so much worse.
    """
    problem, _ = coasting(tmp_path, wave=0.002)
    made, unseen, refitted, steps = fitted(
        problem,
        quadratic_drag={"drag": 0.0022},
        periodic_ripple={"amplitude": 0.002, "period": 160 * np.pi, "phase": 0.0},
    )
    folds = folds_of(problem, made)
    without = hold_out(problem, folds_of(problem, refitted), (), refitted)
    steps.reverse()
    _, kept_unseen, kept = pruned(problem, folds, made, unseen, without, steps)
    assert names(steps) == ["quadratic_drag", "periodic_ripple"]
    assert unseen.total > kept_unseen.total + 1.5  # the score alone would have kept it
    assert names(kept) == ["quadratic_drag"]
    (wave,) = (rival for rival in kept[0].rivals if rival.active.effect.name == "periodic_ripple")
    assert wave.difference < -100


@pytest.mark.campaign(
    "three more fits of wheels that coast: what is dropped beside the drag is held in every run"
)
def test_an_effect_stays_where_the_likelihood_falls_without_it_whatever_the_curvature(tmp_path: Path) -> None:
    problem, _ = coasting(tmp_path, wave=0.05)
    made, unseen, _, steps = fitted(
        problem,
        quadratic_drag={"drag": 0.0022},
        periodic_ripple={"amplitude": 0.05, "period": 160 * np.pi, "phase": 0.0},
    )
    folds = folds_of(problem, made)
    wide = replace(made, covariance=made.covariance * 1e9)
    told, _, kept = told_from_none(problem, folds, wide, unseen, steps, trust=1.0)
    assert names(kept) == ["periodic_ripple", "quadratic_drag"]
    # Its standard deviation is the one at which a normal likelihood falls as far from the size to none.
    drag = dict(made.active[0].values)["drag"]
    bare = fit(problem, remaining(made.active, made.active[0]), start=made.p)
    lost = made.log_posterior - bare.log_posterior
    at = len(problem.free)
    assert 0.5 * drag**2 / told.covariance[at, at] == pytest.approx(lost, rel=1e-6)


@pytest.mark.parametrize("chosen", ["viscous_damping", "quadratic_drag"])
def test_what_foretells_unseen_rows_better_stands_in_the_place_of_the_better_fit(
    tmp_path: Path, chosen: str
) -> None:
    """Beside a slow wave that stays, the fit alone may prefer the wrong law of a drag by a little."""
    problem, _ = coasting(tmp_path, wave=0.05, runs=2, rows=60)
    sizes: dict[str, Values] = {"viscous_damping": {"viscous": 0.02}, "quadratic_drag": {"drag": 0.0022}}
    (other,) = (name for name in sizes if name != chosen)
    made, unseen, _, steps = fitted(problem, **{chosen: sizes[chosen]})
    rival, *_ = fitted(problem, **{other: sizes[other]})
    behind = Rival(active=rival.active[0], difference=-3.9)
    best, foretold, kept = foretold_best(
        problem, folds_of(problem, made), made, unseen, [replace(steps[0], rivals=(behind,))]
    )
    assert names(kept) == ["quadratic_drag"]
    ((name, difference),) = ((each.active.effect.name, each.difference) for each in kept[0].rivals)
    assert (name, difference) == ("viscous_damping", 3.9 if chosen == "viscous_damping" else -3.9)
    assert foretold.total >= unseen.total
    assert [each.effect.name for each in best.active] == names(kept)
