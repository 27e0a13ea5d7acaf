"""What is told of a refit: parameters at the end of their priors, rows that it makes worse."""

import numpy as np
import pandas as pd

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

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
    text = cell_case(10.0, 'T = { unit = "K", role = "covariate" }\n').replace("gain", "warm")
    text = text.replace("value = 1.0", "value = 0.0").replace('unit = "1"', 'unit = "N/K"')
    findings, answer = told(tmp_path, text, WARM, [table(0, warmth=0.01), table(1, warmth=20.0)])
    (output,) = answer.held_out
    assert output.refitted_rmse > 2 * output.nominal_rmse
    assert "the simulation as declared by" in findings["refit-worse"].message


def test_a_refit_within_its_priors_is_not_talked_of(tmp_path):
    findings, _ = told(tmp_path, cell_case(0.01), CELL, [table(k).drop(columns="T") for k in range(2)])
    assert not {"parameter-at-bound", "refit-worse"} & set(findings)
