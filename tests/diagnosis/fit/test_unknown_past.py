"""Runs that begin in the middle of motion: the first rows do not part effects that all others do not."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import TWO, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.unknown_past import past_gain
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect

SPRING = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["k"] * inputs["u"]})
"""
CASE = case_text(
    "python", parameters={"k": (50.0, "N", 0.5)}, inputs={"u": "1"}, outputs={"F": "N"},
)  # fmt: skip
LATE = 0.03


def sines(hertz, *, seed, filters):
    """Return a force of 50 N behind a filter, or late, recorded from the middle of sines (closed form)."""
    rng, t = np.random.default_rng(seed), np.arange(600) * 0.02
    u, F = np.zeros(len(t)), np.zeros(len(t))
    for k, f in enumerate(hertz):
        w, phase = 2 * np.pi * f, 0.3 + seed + 2.0 * k
        u += np.sin(w * t + phase)
        gain, lag = (1 / np.hypot(1, w * LATE), np.arctan(w * LATE)) if filters else (1.0, w * LATE)
        F += 50 * gain * np.sin(w * t + phase - lag)
    return pd.DataFrame({"t": t, "u": u, "F": F + rng.normal(0, 0.5, len(t))})


def case(folder, *hertz, filters):
    frames = {f"r{k}__csv": sines(hertz, seed=k, filters=filters) for k in range(2)}
    return read_case(write_case(folder, CASE + TWO, simulator=SPRING, **frames))


@pytest.mark.campaign("the converse of a delay at two rates, which has its name in every run")
def test_a_filter_at_one_rate_is_no_delay_alone(tmp_path):
    made = diagnose(case(tmp_path, 0.4, filters=True), None).diagnosis
    (one,) = made.effects
    assert made.verdict == "equivalent"
    assert {"channel_delay", "filter_lag"} <= {one.name, *one.equivalent_to}


def test_a_delay_at_two_rates_has_its_name_alone(tmp_path):
    made = diagnose(case(tmp_path, 0.4, 1.0, filters=False), None).diagnosis
    (one,) = made.effects
    assert (made.verdict, one.name, one.equivalent_to) == ("named", "channel_delay", ())


def test_only_what_remembers_gains_by_a_free_past_and_no_more_than_the_first_rows_hold(tmp_path):
    read = case(tmp_path, 0.4, filters=True)
    problem = problem_of(read, model_of(read, None))
    lag = AppliedEffect(effect=effect("filter_lag"), channel="F", values={"time_constant": LATE})
    zero = AppliedEffect(effect=effect("zero_offset"), channel="F", values={"offset": 0.0})
    made = fit(problem, (lag,))
    gained = past_gain(problem, made)
    # at rest on the first value a filter is off by LATE times the rate, and forgets it within LATE
    t = np.arange(600) * 0.02
    missed = sum(
        np.sum((50 * LATE * 2 * np.pi * 0.4 * np.cos(0.3 + seed) * np.exp(-t / LATE)) ** 2)
        for seed in range(2)
    )
    assert gained == pytest.approx(0.5 * missed / 0.5**2, rel=0.35)
    assert past_gain(problem, fit(problem, (zero,))) == 0.0
