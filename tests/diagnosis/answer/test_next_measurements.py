"""What an answer advises where it has no name, and where it says that a mismatch is."""

from __future__ import annotations

from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.answer.locate import places
from toolkit.diagnosis.answer.next_measurements import apart, to_find_it


def found(*variables):
    drivers = tuple(Of(name=name) for name in ("SA", "FZ"))
    problem = Of(case=Of(drivers=drivers), model=Of(outputs=(Of(name="FY"),)))
    return Of(problem=problem, structure=tuple(Of(variables=(one,)) for one in variables))


@pytest.mark.parametrize(
    ("variable", "told"),
    [
        ("SA", "SA alone varied"),
        ("dSA/dt", "the rate of SA alone varied"),
        ("run", "from run to run: repeat one run unchanged"),
        ("time", "hold all inputs still"),
        ("time (a line at 1.55 Hz)", "swings at 1.55 Hz: record what turns"),
        ("more than its stated noise", "Vary one input alone"),
    ],
)
def test_the_advice_is_about_what_the_mismatch_depends_on(variable, told):
    (said,) = to_find_it(found(variable))
    assert told in said


def test_the_variable_that_a_mismatch_depends_on_stands_before_a_narrower_range():
    # What happens once, while the motion is fastest: a range of v holds it as narrowly as one of time does.
    t = np.linspace(0, 10, 400)
    v = np.where((t > 4) & (t < 5), 3 * np.sin(np.pi * (t - 4)), 0.3 * np.sin(7 * t))
    run = Of(columns={"v": v}, t=t, name="run01.csv", conditions={}, rows=len(t))
    case = Of(drivers=(Of(name="v", unit="m/s"),), channels=(), has_time=True)
    problem = Of(
        case=case, runs=(run,), slices=(slice(0, 400),), kept={"F": np.ones(400, bool)},
        model=Of(outputs=(Of(name="F", unit="N"),)),
    )  # fmt: skip
    signal = v * np.abs(v)
    first = [places(problem, "F", signal, np.cos(t), depends)[0].variable for depends in ((), ("time",))]
    assert first == ["v", "time"]


def test_a_measurement_names_the_effects_that_it_is_for():
    told = apart(Of(name="viscous_damping", equivalent_to=("quadratic_drag", "coulomb_friction")))
    # Both need what physics asks of a law of speed: three speeds, said once.
    assert told.count("three speeds") == 1
    assert "(viscous_damping, quadratic_drag)" in told
    assert told.endswith("(coulomb_friction)")
