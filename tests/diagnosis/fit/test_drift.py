"""An integrating plant that is driven open loop is told as drift-limited, and judged by its rates."""

import importlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.drift import judged_by_rates
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.forward_step import drifts_faster
from toolkit.diagnosis.simulators.build_simulator import model_of

CASE = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["position", "speed"]
force_terms = {{ speed = "N/kg" }}
[simulation.parameters]
mass = {{ value = 5.0, unit = "kg", sd = 0.5, bounds = [1.0, 20.0] }}
viscous = {{ value = 4.0, unit = "N*s/m", sd = 2.0, bounds = [0.0, 40.0] }}
[recording]
time = "t"
[recording.channels]
t = {{ unit = "s", role = "time" }}
{pull}
position = {{ unit = "m", role = "output" }}
{runs}
"""
PULL = 'pull = { unit = "N", role = "input" }'
SIMULATOR = """
def initial(p, run):
    return [0.0, %s]
def rhs(t, x, u, p):
    return [x[1], (%s - %s * x[0] - p["viscous"] * x[1]) / p["mass"]]
def outputs(x, u, p):
    return {"position": x[0]}
"""
T = np.arange(0.0, 5.0, 0.05)


def runs(count, seed=1, dry=0.0, zero=0.0):
    """Draw runs of a cart of 5 kg and 4 N s/m under a pull that changes at random, by Euler steps of 1 ms.

    ``dry`` is its dry friction [N], ``zero`` the standard deviation of a steady force of each run [N].
    """
    rng = np.random.default_rng(seed)
    tables = {}
    for k in range(count):
        levels = rng.choice([-12.0, -8.0, 8.0, 12.0], size=6)
        pull = levels[(T // 0.9).astype(int)]
        unknown = zero * rng.normal()
        position, speed, shown = 0.0, 0.0, []
        for before, after_it in zip(pull, np.append(pull[1:], pull[-1]), strict=True):
            shown.append(position)
            for step in range(50):
                drive = before + (after_it - before) * step / 50 + unknown - 4.0 * speed
                slip = np.sign(speed) * dry if abs(speed) > 1e-6 else np.clip(drive, -dry, dry)
                after = speed + (drive - slip) / 5.0 * 1e-3
                speed = 0.0 if after * speed < 0 and abs(drive) <= dry else after
                position += speed * 1e-3
        noisy = np.array(shown) + rng.normal(0, 1e-4, T.size)
        tables[f"r{k}__csv"] = pd.DataFrame({"t": T, "pull": pull, "position": noisy})
    return tables


def written(folder, tables, spring=0.0, *, driven=True):
    listed = "\n".join(f'[[recording.run]]\nfile = "{name.replace("__", ".")}"' for name in tables)
    text = CASE.format(runs=listed, pull=PULL if driven else "")
    if not driven:
        tables = {name: table.drop(columns="pull") for name, table in tables.items()}
    simulator = SIMULATOR % ("0.0" if driven else "1.0", 'u["pull"]' if driven else "0.0", spring)
    return read_case(write_case(folder, text, simulator=simulator, **tables))


@pytest.mark.parametrize(
    ("spring", "driven", "drifts"), [(0.0, True, True), (40.0, True, False), (0.0, False, False)]
)
def test_only_a_driven_plant_that_nothing_leads_back_drifts(tmp_path, spring, driven, drifts):
    case = written(tmp_path, runs(2, zero=0.3), spring, driven=driven)
    problem = problem_of(case, model_of(case, None))
    assert bool(judged_by_rates(problem, fit(problem)).rates) is drifts


@pytest.mark.filterwarnings("error")
def test_a_run_whose_position_was_not_read_says_nothing_of_drift(tmp_path):
    tables = runs(3, zero=0.3)
    tables["r1__csv"]["position"] = np.nan
    case = written(tmp_path, tables)
    problem = problem_of(case, model_of(case, None))
    assert judged_by_rates(problem, fit(problem)).rates


def test_a_rate_is_the_slope_of_what_was_recorded(tmp_path):
    case = written(tmp_path, runs(2, zero=0.3))
    problem = problem_of(case, model_of(case, None))
    problem = judged_by_rates(problem, fit(problem))
    steady = np.concatenate([0.3 * run.t for run in problem.runs])
    assert problem.judged("position", steady) == pytest.approx(0.3)


@pytest.fixture(scope="module")
def drifting(tmp_path_factory):
    """Two runs with a little dry friction, each with a steady force of its own that nobody simulates."""
    case = written(tmp_path_factory.mktemp("cart"), runs(2, dry=0.5, zero=0.6))
    return diagnose(case, None).diagnosis


@pytest.mark.campaign("a whole diagnosis: which plant drifts, and what its rates say, is held in every run")
def test_a_drifting_plant_is_told_and_its_errors_are_those_of_its_rates(drifting):
    told = [finding for finding in drifting.findings if finding.rule == "drift-limited"]
    assert [finding.where for finding in told] == ["CASE.toml: position"]
    assert drifting.fit.held_out[0].unit == "m/s"


def test_what_prediction_errors_show_is_not_nothing_where_free_simulation_cannot_confirm_it(drifting):
    """From row to row the friction shows; each run's own force carries its position away all the same."""
    assert drifting.verdict == "unknown"
    assert (("speed",), "from row to row") in [(by.variables, by.reason) for by in drifting.depends_on]


def test_where_positions_are_the_sum_of_what_came_before_the_squares_of_rates_are_made_least(
    tmp_path, monkeypatch
):
    """Where the specification test trusts least squares, they are those of what counts: of the rates."""
    monkeypatch.setattr(
        importlib.import_module("toolkit.diagnosis.fit.fit"), "_absorbs", lambda *_, **__: True
    )
    case = written(tmp_path, runs(2, zero=0.3))
    problem = problem_of(case, model_of(case, None))
    by_positions = fit(problem)
    drifting = judged_by_rates(problem, by_positions)
    by_rates = fit(drifting)
    assert by_positions.plain
    assert by_rates.plain

    def squares(made, of):
        return float(np.sum(of.judged("position", made.residual["position"]) ** 2))

    assert squares(by_positions, problem) < squares(by_rates, problem)
    assert squares(by_rates, drifting) < squares(by_positions, drifting)


def test_a_rate_stands_in_the_row_at_which_it_ends(tmp_path):
    case = written(tmp_path, runs(2, zero=0.3))
    problem = problem_of(case, model_of(case, None))
    apart = replace(problem, rates={"position": 4})
    rows = np.arange(problem.rows, dtype=float)
    at = apart.judged_at("position")
    assert at.tolist() == [*range(4, T.size), *range(T.size + 4, 2 * T.size)]
    assert len(apart.judged("position", rows)) == len(at)
    assert problem.judged_at("position").tolist() == list(range(2 * T.size))


def test_least_squares_of_rates_tell_the_parameters_within_their_interval(tmp_path):
    """A cart whose steady forces nobody simulates: coloured noise may take them, and its mass is 5 kg."""
    case = written(tmp_path, runs(3, seed=4, zero=0.3))
    problem = problem_of(case, model_of(case, None))
    made = fit(judged_by_rates(problem, fit(problem)), plain=True)
    for k, true in enumerate((5.0, 4.0)):
        assert abs(made.p[k] - true) < 3 * np.sqrt(made.covariance[k, k])


def test_what_leaves_larger_rates_than_before_explains_the_noise_and_not_the_motion(tmp_path):
    """A likelihood of next rows may rise beside it; of outputs that do not drift it is not asked."""
    case = written(tmp_path, runs(2, zero=0.3))
    problem = problem_of(case, model_of(case, None))
    before = fit(problem)
    larger = replace(before, residual={"position": 1.01 * before.residual["position"]})
    drifts = judged_by_rates(problem, before)
    assert drifts_faster(drifts, before, larger)
    assert not drifts_faster(drifts, larger, before)
    assert not drifts_faster(problem, before, larger)


@pytest.mark.campaign("fits of dry friction take a minute; the suite holds how a drifting plant is fitted")
def test_dry_friction_of_a_cart_is_named_though_its_position_drifts(tmp_path):
    answer = diagnose(written(tmp_path, runs(2, dry=2.0, zero=0.3)), None).diagnosis
    (friction,) = [effect for effect in answer.effects if effect.key.name == "coulomb_friction"]
    (size,) = [each for each in friction.parameters if each.name == "coulomb"]
    low, high = size.ci95
    assert low < 2.0 / 5.0 < high
