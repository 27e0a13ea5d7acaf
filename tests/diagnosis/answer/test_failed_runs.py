"""Simulations that fail with an effect in them: told where no size of it could be simulated."""

from types import SimpleNamespace

import pytest

from toolkit.diagnosis.answer.failed_runs import FailedRuns
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import FitError

CASE = SimpleNamespace(path=SimpleNamespace(name="CASE.toml"))
RUN = SimpleNamespace(name="r0.csv")


def _simulate(run, p, active):
    sizes = [one.values["coulomb"] for one in active if one.effect.name == "coulomb_friction"]
    if any(size > 2 for size in sizes) or any(one.effect.name == "quadratic_drag" for one in active):
        raise FitError("no output", where="x", got="inf", expected="numbers", next_step="", rule="simulator")
    return {}


def _friction(size):
    return AppliedEffect(effect=effects()["coulomb_friction"], channel="v", values={"coulomb": size})


def test_an_effect_that_never_could_be_simulated_is_told_and_one_that_sometimes_could_is_not():
    failed = FailedRuns(_simulate)
    drag = AppliedEffect(effect=effects()["quadratic_drag"], channel="v", values={"drag": 1.0})
    for active in ([_friction(3.0)], [_friction(1.0), drag], [drag]):
        with pytest.raises(FitError):
            failed(RUN, {"m": 1.0}, active)
    failed(RUN, {"m": 1.0}, [_friction(1.0)])
    failed(RUN, {"m": 1.0}, [])
    (found,) = failed.findings(CASE)
    assert (found.rule, found.level) == ("effect-not-simulated", "note")
    assert "quadratic_drag on v" in found.message


def test_nothing_is_told_where_every_simulation_gave_numbers():
    failed = FailedRuns(_simulate)
    failed(RUN, {"m": 1.0}, [_friction(1.0)])
    assert failed.findings(CASE) == ()
