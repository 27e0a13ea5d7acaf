"""What a search takes up of runs that scatter: nothing by which unseen rows are the worse."""

from dataclasses import replace

import pytest

from tests.diagnosis.fit.test_run_scatter import case_of
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search import search
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect


@pytest.mark.parametrize("astray", [False, True])
def test_values_beside_a_scatter_are_taken_where_unseen_rows_are_none_the_worse(
    tmp_path, monkeypatch, astray
):
    case = case_of(tmp_path, 0, zero_sd=0.6, gain_sd=0.004)
    problem = problem_of(case, model_of(case, None, None))
    made = fit(problem, (AppliedEffect(effect=effect("zero_drift"), channel="F", values={"rate": 0.5}),))
    folds = folds_of(problem, made)
    unseen = hold_out(problem, folds, made.active, made)
    if astray:
        far = {name: values + 50.0 for name, values in unseen.simulated.items()}
        monkeypatch.setattr(search, "held_out_beside_scatter", lambda *_: replace(unseen, simulated=far))
    steps = [Step(active=made.active[0], p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=())]
    base, held_out, kept, scatter = search._beside_scatter(problem, folds, made, unseen, steps)
    assert kept == steps
    assert (base is made, held_out is unseen, scatter == ()) == (astray, astray, astray)
