"""What is told of a refit: parameters at the end of their priors, rows that it makes worse."""

from pathlib import Path
from types import SimpleNamespace as Of

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.answer.answer import EffectEstimate
from toolkit.diagnosis.answer.refit_findings import confounded_findings
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect
from toolkit.effects.law import law_effect

WARM = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": inputs["L"] + p["warm"] * inputs["T"]})
"""


def told(folder, text, simulator, frames):
    runs = "".join(f'[[recording.run]]\nfile = "r{k}.csv"\n' for k in range(len(frames)))
    files = {f"r{k}__csv": frame for k, frame in enumerate(frames)}
    answer = diagnose(
        read_case(write_case(folder, text + runs, simulator=simulator, **files)), None
    ).diagnosis
    return {finding.rule: finding for finding in answer.findings}, answer


def table(k, *, gain=1.0, warmth=1.0):
    rng = np.random.default_rng(k)
    t = np.arange(80) * 0.1
    L = 20 + 10 * np.sin(0.9 * t + k)
    return pd.DataFrame({"t": t, "L": L, "T": warmth * np.cos(0.5 * t), "F": gain * L + rng.normal(0, 1, 80)})


def test_a_parameter_that_its_prior_holds_back_is_told(tmp_path):
    findings, answer = told(
        tmp_path, cell_case(0.01), CELL, [table(k, gain=1.06).drop(columns="T") for k in range(2)]
    )
    assert answer.nominal_parameters[0].name == "gain"
    assert "gain" in findings["parameter-at-bound"].where
    assert "+4.0 sd refitted" in findings["parameter-at-bound"].message


def test_a_refit_that_makes_unseen_rows_worse_is_told(tmp_path):
    # Next to no warmth in the first run: what is fitted there of its influence is noise, and prior.
    text = cell_case(10.0, T="K").replace("gain", "warm")
    text = text.replace("value = 1.0", "value = 0.0").replace('unit = "1"', 'unit = "N/K"')
    findings, answer = told(tmp_path, text, WARM, [table(0, warmth=0.01), table(1, warmth=20.0)])
    (output,) = answer.fit.held_out
    assert output.refitted_rmse > 2 * output.nominal_rmse
    assert "the simulation as declared by" in findings["refit-worse"].message


def test_a_refit_that_is_worse_than_standing_still_is_told(tmp_path):
    # Nothing depends on the warmth; a run with next to none of it leaves the influence where it was declared.
    text = cell_case(10.0, T="K").replace("gain", "warm")
    text = text.replace("value = 1.0", "value = 5.0").replace('unit = "1"', 'unit = "N/K"')
    frames = [table(0, gain=0.0, warmth=0.01), table(1, gain=0.0, warmth=20.0)]
    findings, answer = told(tmp_path, text, WARM.replace('inputs["L"] + ', ""), frames)
    (output,) = answer.fit.held_out
    spread = np.std(np.concatenate([frame["F"] for frame in frames]))
    assert spread < output.refitted_rmse < 1.04 * output.nominal_rmse
    assert f"stands still at its mean by {spread:.4g} N" in findings["refit-worse"].message


def test_a_refit_within_its_priors_is_not_talked_of(tmp_path):
    findings, _ = told(tmp_path, cell_case(0.01), CELL, [table(k).drop(columns="T") for k in range(2)])
    assert not {"parameter-at-bound", "refit-worse"} & set(findings)


@pytest.mark.parametrize(("beside", "predicts", "told"), [(3.0, True, 1), (5.7, True, 0), (3.0, False, 0)])
def test_a_size_that_a_law_moves_by_more_than_its_interval_is_confounded(beside, predicts, told):
    def friction(size):
        return AppliedEffect(effect=effect("coulomb_friction"), channel="F", values={"coulomb": size})

    law = AppliedEffect(effect=law_effect("law adds: a*[v]"), channel="F", values={"a": 1.0})
    size = EffectEstimate(name="coulomb", value=5.9, unit="N", ci95=(5.4, 6.4), runs=None)
    findings = confounded_findings(
        Of(path=Path("CASE.toml")),
        Of(augmented=Of(active=(friction(5.9),))),
        Of(listed=(Of(applied=law, predicts=predicts),), fit=Of(active=(friction(beside), law))),
        (Of(key=friction(5.9).key, parameters=(size,)),),
    )
    assert len(findings) == told
    for finding in findings:
        assert finding.rule == "size-confounded"
        assert "coulomb is 5.9 N, and 3 N beside the law" in finding.message
