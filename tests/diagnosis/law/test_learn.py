"""Laws of what has no name, learned from cases in which they are concealed; the truth is in the generator."""

from __future__ import annotations

import json
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import typer
from typer.testing import CliRunner, Result

from tests.diagnosis.case_text import case_text
from toolkit.cli import diagnose, simulate
from toolkit.declared import json_value
from toolkit.diagnosis.answer.reader import read_answer
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose as diagnose_case
from toolkit.diagnosis.law.learn import _is_told_from_none
from toolkit.diagnosis.search import search, time_budget
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import law_effect

SIMULATOR = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": p["k"] * inputs["x"] + p["c"] * inputs["v"]})
"""
T = {"T": {"unit": "degC", "role": "covariate"}}


def head(others: dict[str, dict[str, str]]) -> str:
    return case_text(
        "python", title="A spring and a damper", function="simulate",
        parameters={"k": (100.0, "N/m", 5.0), "c": (20.0, "N*s/m", 2.0)}, inputs={"x": "m", "v": "m/s"},
        outputs={"F": "N"}, others=others,
    )  # fmt: skip


def run(*words: object) -> Result:
    app = typer.Typer()
    app.command("diagnose")(diagnose.command)
    app.command("simulate")(simulate.command)
    return CliRunner().invoke(app, [str(word) for word in words], standalone_mode=False)


Hidden = Callable[[pd.DataFrame, int], np.ndarray]


def recorded(hidden: Hidden, seed: int) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    t = np.arange(250) * 0.1
    phase = rng.uniform(0, 6, 3)
    x = np.sin(1.1 * t + phase[0]) + 0.5 * np.sin(2.7 * t + phase[1])
    table = pd.DataFrame({"t": t, "x": x, "v": np.gradient(x, t)})
    table["T"] = 25 + 8 * np.sin(0.2 * t + phase[2]) + 3 * rng.normal()
    table["F"] = 103 * table.x + 19 * table.v
    table["F"] = hidden(table, seed) + rng.normal(0, 1.0, len(t))
    return table


def written(folder: Path, hidden: Hidden, others: dict[str, dict[str, str]]) -> Path:
    """Write a case of three runs with what is concealed in them."""
    (folder / "sim.py").write_text(SIMULATOR)
    runs = "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n' for i in range(3))
    (folder / "case.toml").write_text(head(others) + runs + '[[recording.predict]]\nfile = "r1.csv"\n')
    for i in range(3):
        recorded(hidden, i).to_csv(folder / f"r{i}.csv", index=False)
    return folder / "case.toml"


def diagnosed(folder: Path, hidden: Hidden) -> dict:
    outcome = run("diagnose", written(folder, hidden, T), "--out", folder / "out", "--json")
    return json.loads(outcome.output)


@pytest.fixture
def learned(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Hidden], dict]:
    """Learn laws where no effect has a name: the search of names, half of the time, is other tests'."""
    monkeypatch.setattr(search, "candidates", lambda _: ())
    return lambda hidden: json_value(diagnose_case(read_case(written(tmp_path, hidden, {})), None).diagnosis)


def estimates(law: dict) -> dict[str, tuple[float, float, float]]:
    return {each["name"]: (each["value"], *each["ci95"]) for each in law["parameters"]}


NAMES = pytest.mark.campaign(
    "the search of names before it, half of the time: what it leaves is other tests'"
)


@pytest.mark.parametrize("names", [False, pytest.param(True, marks=NAMES)])
def test_a_factor_over_a_covariate_is_learned_and_goes_into_the_model(tmp_path, monkeypatch, names):
    if not names:
        monkeypatch.setattr(search, "candidates", lambda _: ())
    answer = diagnosed(tmp_path, lambda r, _: r.F * (1 + 0.15 * np.exp(-(((r["T"] - 28) / 3) ** 2))))
    assert answer["verdict"] == "unknown"
    (law,) = answer["laws"]
    assert law["place"] == {"kind": "output", "channel": "F"}
    assert (law["form"], law["acts"], law["variables"]) == ("static", "multiplies", ["T"])
    for name, truth in (("a", 0.15), ("c", 28.0), ("w", 3.0)):
        value, low, high = estimates(law)[name]
        assert low < truth < high
        assert high - low < 0.1 * truth
        assert low < value < high
    assert law["evidence"]["held_out_log_score_gain"] > 100
    (fit,) = answer["fit"]["held_out"]
    # The noise that was put in is 1 N: nothing but it is left on rows that no fit has seen.
    assert fit["with_laws_rmse"] == pytest.approx(1.0, abs=0.05)
    assert fit["refitted_rmse"] > 2.5
    band = law["curve"]["band95"]
    truth = 0.15 * np.exp(-(((np.array(law["curve"]["x"]) - 28) / 3) ** 2))
    inside = (np.array(band[0]) <= truth + 1e-4) & (truth - 1e-4 <= np.array(band[1]))
    assert inside.mean() > 0.8

    # The mean of the factor had stood in the stiffness: beside the law it is that of the spring alone.
    beside = {each["name"]: each["with_laws"] for each in answer["nominal_parameters"]}
    model = tomllib.loads((tmp_path / "out/model.toml").read_text())["simulation"]["parameters"]
    assert beside == {name: each["value"] for name, each in model.items()}
    assert beside["k"] == pytest.approx(103, rel=0.005)
    (alone,) = (each["after"] for each in answer["nominal_parameters"] if each["name"] == "k")
    assert alone > 1.02 * beside["k"]

    # What the model file says of the same inputs is what the diagnosis predicts, and another tool reads both.
    assert answer["model"] == "model.toml"
    simulated = run(
        "simulate", tmp_path / "out/model.toml", "--inputs", tmp_path / "r1.csv", "--out", tmp_path / "sim"
    )
    assert simulated.exit_code == 0, simulated.output
    predicted = pd.read_csv(tmp_path / "out/predictions/r1.csv")
    assert len(predicted) == 250
    again = pd.read_csv(tmp_path / "sim/r1.csv")
    np.testing.assert_allclose(again.F, predicted.F_augmented, rtol=1e-9)
    page = (tmp_path / "out/diagnosis.html").read_text()
    assert "called by no name" in page
    assert "with the laws" in page
    read, _ = read_answer(tmp_path / "out")
    written = json.loads((tmp_path / "out/diagnosis.json").read_text())
    assert json_value(read)["laws"] == written["laws"]

    # The model takes the law up: nothing of it is left to be found.
    settled = run(
        "diagnose", tmp_path / "case.toml", "--model", tmp_path / "out/model.toml",
        "--out", tmp_path / "second", "--json",
    )  # fmt: skip
    assert json.loads(settled.output)["verdict"] == "nothing"


@pytest.mark.campaign("another form of law: a factor over a covariate and an event are learned in every run")
def test_a_product_of_two_signals_is_learned(learned):
    answer = learned(lambda r, _: r.F + 12 * r.x * r.v)
    (law,) = answer["laws"]
    assert law["variables"] == ["x", "v"]
    assert law["formula"] == "a*x*v"
    value, low, high = estimates(law)["a"]
    assert low < 12 < high
    assert law["parameters"][0]["unit"] == "N*s/m^2"
    assert value == pytest.approx(12, rel=0.02)


@pytest.mark.campaign("another form of law: a factor over a covariate and an event are learned in every run")
def test_a_vibration_that_the_force_drives_is_learned(learned):
    from scipy.signal import lsim

    def rung(r: pd.DataFrame, _: int) -> np.ndarray:
        w = 2 * np.pi * 1.3
        forced = r.F.to_numpy() - r.F[0]
        _, y, _ = lsim(([w * w], [1, 2 * 0.04 * w, w * w]), forced, r.t.to_numpy())
        return r.F + 0.15 * (y + r.F[0])

    answer = learned(rung)
    law = answer["laws"][0]
    assert law["form"] == "mode"
    assert law["variables"] == ["F"]
    frequency, *_ = estimates(law)["frequency"]
    assert frequency == pytest.approx(1.3, rel=0.03)
    assert law["memory_s"] == pytest.approx(1 / (2 * np.pi * 1.3 * 0.04), rel=0.35)


def test_an_event_of_one_run_is_told_and_predicts_nothing(learned):
    """The only thing wrong is 10 N for 5 s in one of three runs: coloured noise must not take it up."""
    answer = learned(lambda r, i: r.F + 10 * ((r.t > 12) & (r.t < 17) & (i == 1)))
    assert answer["verdict"] == "unknown"
    (law,) = answer["laws"]
    assert law["form"] == "event"
    assert law["evidence"]["held_out_log_score_gain"] is None
    assert law["parameters"][0]["runs"] == ["r1.csv"]
    assert law["parameters"][0]["value"] == pytest.approx(10, rel=0.05)
    assert answer["depends_on"][0]["variables"] == ["time"]
    assert "from 12" in answer["depends_on"][0]["reason"]


@pytest.mark.campaign(
    "another form of law: the fit of a tone is held in every run (test_trial_unlocked_tone)"
)
def test_a_tone_without_a_phase_of_its_own_predicts_nothing(learned):
    answer = learned(lambda r, i: r.F + 6 * np.sin(2 * np.pi * 3.3 * r.t + 1.7 * i))
    law = answer["laws"][0]
    assert (law["form"], law["variables"]) == ("tone", ["time"])
    values = {each["name"]: each["value"] for each in law["parameters"]}
    assert values["frequency"] == pytest.approx(3.3, abs=0.04)  # one line of a run of 25 s
    assert values["a"] == pytest.approx(6, rel=0.05)
    assert values["phase"] is None


@pytest.mark.campaign("a whole search of nothing: noise has no law in every run (test_unseen_runs)")
def test_of_noise_no_law_is_learned(tmp_path):
    answer = diagnosed(tmp_path, lambda r, _: r.F)
    assert answer["verdict"] == "nothing"
    assert answer["laws"] == []
    assert answer["fit"]["held_out"][0]["with_laws_rmse"] is None


PAIRS = pytest.mark.campaign(
    "half of the time is left, and pairs are begun: that of laws is theirs in every run"
)


@pytest.mark.parametrize(
    ("spent", "skipped"),
    [pytest.param(0.5, (), marks=PAIRS), (0.8, ("step 1: pairs of candidates",))],
)
def test_laws_are_learned_though_the_time_of_pairs_is_over(monkeypatch, tmp_path, spent, skipped):
    """What explains the most here is a law, and pairs before it may be as dear as all single effects."""
    begun: list[float] = []

    def tell(step: str) -> None:
        if step == "step 1: unseen runs":
            begun.append(spent * 600.0)

    def pairs(*arguments: object) -> None:
        assert callable(arguments[-1])
        arguments[-1]()

    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + sum(begun))
    monkeypatch.setattr(time_budget, "time", clock)
    monkeypatch.setattr(search, "candidates", lambda _: ())
    monkeypatch.setattr(search, "best_pair", pairs)
    path = written(tmp_path, lambda r, _: r.F * (1 + 0.15 * np.exp(-(((r["T"] - 28) / 3) ** 2))), T)
    answer = diagnose_case(read_case(path), None, budget_s=600.0, tell=tell).diagnosis
    assert (answer.skipped, answer.complete) == (skipped, not skipped)
    assert [(law.form, law.variables) for law in answer.laws] == [("static", ("T",))]


@pytest.mark.parametrize(
    ("sizes", "sd", "correlation", "trust", "is_law"),
    [
        ((0.1, 0.0), 0.048, 0.0, 1.0, False),  # 2.1 sd of one of two: chi-squared 4.3 of two has 11 %
        (
            (0.1, 0.1),
            0.08,
            -0.9,
            1.0,
            True,
        ),  # 1.25 sd each, which pull in opposite ways: 2 x^2 / (sd^2 (1 + r))
        ((0.1, 0.1), 0.08, -0.9, 0.3, True),
        ((0.1, 0.1), 0.08, -0.3, 1.0, False),  # 4.5
        ((0.1, 0.1), 0.05, 0.0, 1.0, True),  # 8.0 of 5.99
        ((0.1, 0.1), 0.05, 0.0, 0.5, False),  # the noise is known from few rows
    ],
)
def test_the_sizes_of_a_law_are_told_from_none_together(sizes, sd, correlation, trust, is_law):
    applied = AppliedEffect(
        effect=law_effect("law adds: a1*[x] + a2*[x]**2"),
        channel="F",
        values=dict(zip(("a1", "a2"), sizes, strict=True)),
    )
    covariance = sd**2 * np.array([[1.0, correlation], [correlation, 1.0]])
    refit = SimpleNamespace(p=np.zeros(0), active=(applied,), covariance=covariance)
    assert _is_told_from_none(refit, trust) is is_law
