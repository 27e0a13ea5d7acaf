"""Predictions: file names that stay in their folder, conditions that carry an effect on."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.predict import _spread_to, prediction_csv, prediction_names
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import FitError


def case(folder, more, conditions=("", "")):
    runs = "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n{said}\n' for i, said in enumerate(conditions))
    return read_case(write_case(folder, HEAD + runs + more, more__csv=carriage(seed=4)))


def test_names_stay_in_the_folder_and_apart(tmp_path):
    run = case(tmp_path, '[[recording.predict]]\nfile = "more.csv"\n').predict[0]
    given = [
        "more.csv",
        "sub/more.csv",
        "../more.csv",
        "/etc/more.csv",
        "a\\..\\b.csv",
        "book.xlsx",
        "book.csv",
    ]
    assert prediction_names([replace(run, name=name) for name in given]) == (
        "more.csv", "sub/more.csv", "more-2.csv", "etc/more.csv", "a/b.csv", "book.csv", "book-2.csv",
    )  # fmt: skip


def test_columns_are_time_and_three_variants_of_every_output(tmp_path):
    read = case(tmp_path, '[[recording.predict]]\nfile = "more.csv"\n')
    problem = problem_of(read, model_of(read, None))
    (tmp_path / "made.csv").write_text(prediction_csv(problem, read.predict[0], [None, None, None]))
    made = pd.read_csv(tmp_path / "made.csv")
    assert list(made.columns) == ["t", "F_nominal", "F_refitted", "F_augmented"]
    given = carriage(seed=4)
    np.testing.assert_array_equal(made["t"], given["t"])
    np.testing.assert_allclose(made["F_nominal"], 94 * given["a"] + 210 * given["v"])


@pytest.mark.parametrize(
    ("condition", "carried"), [('surface = "sand"', True), ('surface = "steel"', False), ("", False)]
)
def test_an_effect_of_some_runs_acts_where_the_condition_says_so(tmp_path, condition, carried):
    more = f'[[recording.predict]]\nfile = "more.csv"\n{condition}\n'
    read = case(tmp_path, more, ('surface = "steel"', 'surface = "sand"'))
    problem = problem_of(read, model_of(read, None))
    active = AppliedEffect(effect=effects()["surface_friction"], runs=frozenset(("r1.csv",)))
    assert _spread_to(problem, read.predict[0], active).acts_in(read.predict[0]) is carried


def test_inputs_that_the_simulator_cannot_take_end_before_the_search(tmp_path):
    text = "import pandas as pd\ndef simulate(inputs, p):\n    assert inputs['v'].max() < 5, 'too fast'\n"
    text += "    return pd.DataFrame({'F': inputs['v']})\n"
    fast = carriage(seed=4).drop(columns="F").assign(v=9.0)
    toml = HEAD + TWO + '[[recording.predict]]\nfile = "more.csv"\n'
    read = read_case(write_case(tmp_path, toml, simulator=text, more__csv=fast))
    with pytest.raises(FitError) as caught:
        diagnose(read, None)
    assert "too fast" in str(caught.value.got)
    assert str(caught.value.where).endswith("more.csv")
