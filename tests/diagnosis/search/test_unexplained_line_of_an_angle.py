"""A line over a recorded angle keeps its number per turn; one of time keeps its frequency."""

from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.policy import STRUCTURE
from toolkit.diagnosis.search.unexplained import narrowest_line

T = np.arange(0, 10, 0.01)


def line(rest, *speeds, wrapped=False, turning=True):
    """Return the line of runs at some speeds [turns/s] that waver; ``rest(t, turns)`` is what each leaves."""
    courses = [speed * (T + 0.1 * np.sin(0.9 * T)) for speed in speeds]
    noise = np.random.default_rng(4).normal(0, 0.5, (len(speeds), len(T)))
    rests = [rest(T, course) + noise[k] for k, course in enumerate(courses)]
    if not turning:
        courses = [0.3 * np.sin(course) for course in courses]
    angles = [360 * (course % 1 if wrapped else course) for course in courses]
    rows = len(T)
    problem = Of(
        case=Of(has_time=True, drivers=(Of(name="load", unit="N"), Of(name="angle", unit="deg"))),
        runs=[Of(t=T, rows=rows, columns={"angle": angle, "load": T}) for angle in angles],
        slices=[slice(k * rows, (k + 1) * rows) for k in range(len(speeds))],
        kept={"y": np.ones(rows * len(speeds), dtype=bool)},
    )
    return narrowest_line(problem, "y", np.concatenate(rests))


@pytest.mark.parametrize("speeds", [(2.0, 2.0), (2.0, 2.6)])
@pytest.mark.parametrize("wrapped", [False, True])
def test_a_ripple_of_the_shaft_is_told_per_turn(speeds, wrapped):
    found = line(lambda _, turns: np.sin(2 * np.pi * 4 * turns), *speeds, wrapped=wrapped)
    assert (found.angle, found.told[-8:]) == ("angle", "per turn")
    assert found.frequency == pytest.approx(4, abs=found.width)
    assert found.p_value < STRUCTURE.line


def test_a_hum_stays_one_of_time_while_the_shaft_turns_unevenly():
    found = line(lambda t, _: np.sin(2 * np.pi * 7.3 * t), 2.0, 2.6)
    assert (found.angle, found.told) == ("", f"{found.frequency:.4g} Hz")
    assert found.frequency == pytest.approx(7.3, abs=found.width)


def test_an_angle_that_swings_has_no_turns():
    found = line(lambda t, _: np.sin(2 * np.pi * 7.3 * t), 2.0, turning=False)
    assert found.angle == ""
