"""A law beside an effect: a name stays where the law mends its form, and goes where the law outdoes it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from tests.golden.cases import columns_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit, sizes_off
from toolkit.diagnosis.fit.folds import HeldOut, hold_out
from toolkit.diagnosis.law.learn import learned
from toolkit.diagnosis.law.rivals import outdone, without_imitations, without_untested
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.search.time_budget import TimeBudget


def test_a_leak_of_the_load_keeps_its_name_where_the_law_acts_behind_the_filter(tmp_path: Path) -> None:
    """A pull in proportion to the load stands beside a late force: crosstalk is thought of before the lag.

    The law a*FZ behind it fits better; it is the same leak, and the answer is no worse for its name.
    """
    files = columns_tire(pull=120.0, lag=0.2)
    # The moment has no part in it.
    for moment in (', MZ = "MZ_sim"', 'MZ = { unit = "N*m", role = "output" }\n'):
        assert moment in files["CASE.toml"]
        files["CASE.toml"] = files["CASE.toml"].replace(moment, "")
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    answer = diagnose(read_case(tmp_path / "CASE.toml"), None).diagnosis
    classes = [{effect.name, *effect.equivalent_to} for effect in answer.effects]
    assert {"channel_delay"} in classes
    assert any({"crosstalk", "conicity"} <= each for each in classes)
    force = answer.fit.held_out[0]
    assert force.augmented_rmse < 0.05 * force.refitted_rmse


DIVIDER = """schema = 1
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters.C]
value = 220.0
unit = "nF"
sd = 20.0
[recording.channels]
f = { unit = "Hz", role = "input" }
R = { unit = "ohm", role = "input" }
gain = { unit = "1", role = "output" }
"""
GAIN = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    x = 1e9 / (2 * np.pi * inputs["f"] * p["C"])
    return pd.DataFrame({"gain": inputs["R"] / np.hypot(inputs["R"], x)})
"""


@pytest.fixture(scope="module")
def beside_a_cell(tmp_path_factory: pytest.TempPathFactory) -> Search:
    """Return a search of a resistor and a capacitor that has put a cell's law into its answer.

    48 ohm in series are missing, which no known effect is: the gain of small resistors falls short.
    """
    rng, text = np.random.default_rng(5), DIVIDER
    files: dict[str, object] = {"r0__csv": None, "r1__csv": None}
    f = np.geomspace(300, 20000, 14)
    for k, R in enumerate((22.0, 47.0, 100.0, 150.0, 220.0, 330.0, 510.0)):
        gain = R / np.hypot(R + 48, 1e9 / (2 * math.pi * f * 212)) + rng.normal(0, 0.003, len(f))
        files[f"r{k}__csv"] = pd.DataFrame({"f": f, "R": R, "gain": gain})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    folder = tmp_path_factory.mktemp("divider")
    result = diagnose(read_case(write_case(folder, text, simulator=GAIN, **files)), None)
    assert (result.diagnosis.verdict, result.diagnosis.effects) == ("unknown", ())
    assert result.diagnosis.laws[0].variables == ("R",)
    found = result.search
    assert found is not None
    problem = found.problem
    cell = next(each for each in candidates(problem) if each.name == "nonlinearity")
    active = replace(cell.active, values=dict(cell.starts[0].values))
    made = fit(problem, (active,), start=found.refitted.p)
    step = Step(active=made.active[0], p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=())
    held_out = hold_out(problem, found.folds, made.active, made)
    return replace(found, steps=(step,), augmented=made, held_augmented=held_out)


def test_no_name_stands_beside_a_law_that_outdoes_it(beside_a_cell: Search) -> None:
    budget = TimeBudget(600.0, lambda _: None, alarm=False)
    found = beside_a_cell
    laws = learned(found, withdrawn=False, budget=budget)
    assert outdone(found, laws)
    # Where the budget ended before it was asked whether the name is needed, it is not given.
    late = without_untested(found, replace(laws, complete=False))
    assert late.steps == ()
    assert late.augmented is late.refitted
    assert late.scored == found.scored  # it is among those that were tried
    # Where the laws leave it no size of its own, it goes, whatever its score.
    idle = replace(laws.fit, covariance=1e6 * laws.fit.covariance)
    worse = replace(laws, fit=idle, held_out=replace(laws.held_out, scores=(1e3, *laws.held_out.scores)))
    dropped, alone = without_imitations(found, worse, budget)
    assert dropped.steps == ()
    assert all(applied.effect.name != "nonlinearity" for applied in alone.fit.active)
    # What a search that was cut short has not seen outdoes nothing; nor does a law that takes less than twice
    # what the effect took.
    assert without_untested(found, laws) is found
    bare, named = (
        {name: found.problem.observed[name] - held.simulated[name] for name in found.problem.names}
        for held in (found.held_refitted, found.held_augmented)
    )
    left = named["gain"] ** 2 - 1.9 * max(np.mean(bare["gain"] ** 2 - named["gain"] ** 2), 0.0)
    assert left.mean() > 0
    away = np.full(found.problem.rows, math.sqrt(left.mean()))
    less = HeldOut(scores=(), simulated={"gain": found.problem.observed["gain"] - away}, fits=())
    assert not outdone(found, replace(laws, held_out=less))


def test_sizes_are_told_from_none_together(beside_a_cell: Search) -> None:
    """Square and cube of one sign pull on the same gain: each may be none, and both together are not."""
    made, at = beside_a_cell.augmented, len(beside_a_cell.augmented.p)
    own = [at, at + 1]
    off = np.array([0.1, 0.1])
    sd, r = 0.08, 0.5
    covariance = np.array(made.covariance)
    covariance[np.ix_(own, own)] = [[sd**2, r * sd**2], [r * sd**2, sd**2]]
    (found,) = made.active
    applied = replace(found, values=dict(found.values) | {"quadratic": 0.1, "cubic": 0.1})
    away, places = sizes_off(replace(made, covariance=covariance), applied)
    assert places == own
    # By hand: 2 x^2 / (sd^2 (1 + r)), that is 2.08; against 3.84 of one alone it would be 1.56 each.
    assert math.isclose(away, 2 * off[0] ** 2 / (sd**2 * (1 + r)), rel_tol=1e-9)
