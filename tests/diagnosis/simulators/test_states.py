"""Which states of an equation an effect of a motion can act on: velocities, places, and no temperatures."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.case_code import running
from toolkit.diagnosis.simulators.simulator import Output
from toolkit.diagnosis.simulators.states import (
    declared_dimensions,
    dimensions,
    fitting,
    shown_alone,
    usual_step,
)
from toolkit.effects.catalogue import effects

FRICTION = ("coulomb_friction", "viscous_damping", "quadratic_drag")


def test_units_are_told_by_outputs_that_show_one_state_alone():
    t = np.linspace(0.0, 3.0, 40)
    x = np.array([np.sin(t), np.cos(2 * t), t, np.exp(-t)])
    shown = {"A": np.degrees(x[0]), "B": x[1] + 0.1 * x[2], "C": x[2] + 1.0, "D": -x[3]}
    outputs = [
        Output(name=n, unit=u, sd=None) for n, u in zip("ABCD", ("deg", "m", "m", "degC"), strict=True)
    ]
    assert dimensions(shown_alone(x, shown, outputs)) == {0: "angle", 3: "temperature"}


def test_a_state_that_stands_still_or_is_a_bare_number_tells_nothing():
    x = np.array([np.full(9, 20.0), np.arange(9.0)])
    outputs = [Output(name="T", unit="degC", sd=None), Output(name="N", unit="1", sd=None)]
    assert dimensions(shown_alone(x, {"T": x[0], "N": x[1]}, outputs)) == {}


@pytest.mark.parametrize("name", FRICTION)
@pytest.mark.parametrize(
    ("velocities", "known", "there"),
    [
        ({1: 0}, {0: "angle"}, [1]),  # a pendulum whose angle is recorded
        ({}, {2: "frequency"}, [2]),  # a motor's speed, with a current of which nothing is known
        ({}, {1: "temperature"}, []),  # warm bodies, not all of them recorded
        ({}, {1: "length", 2: "length"}, []),  # levels
        ({}, {}, [1, 2]),
    ],
)
def test_friction_and_drag_act_on_velocities(name, velocities, known, there):
    assert fitting(effects()[name].term, [1, 2], velocities, known) == there


@pytest.mark.parametrize(
    ("velocities", "known", "there"),
    [({1: 0}, {0: "length"}, [1]), ({}, {1: "length"}, [1]), ({}, {1: "temperature"}, []), ({}, {}, [1, 2])],
)
def test_a_cubic_stiffness_acts_on_places(velocities, known, there):
    assert fitting(effects()["cubic_stiffness"].term, [1, 2], velocities, known) == there


def test_a_ripple_needs_a_place_behind_the_velocity_and_a_constant_flow_nothing():
    assert fitting(effects()["periodic_ripple"].term, [1, 2], {1: 0}, {}) == [1]
    assert fitting(effects()["periodic_ripple"].term, [1, 2], {}, {1: "length"}) == []
    assert fitting(effects()["constant_force"].term, [1, 2], {}, {1: "temperature"}) == [1, 2]


@pytest.mark.parametrize(
    ("unit", "friction", "stiffness"),
    [
        ("N/kg", True, False),
        ("m/s^2", True, False),
        ("rad/s^2", True, False),
        ("1/s^2", True, False),
        ("N", True, False),
        ("lbf*ft", True, False),
        ("K/s", False, False),
        ("V/s", False, False),
        ("m^3/s", False, False),
        ("mm/s", False, True),
        ("rad/s", False, True),
    ],
)
def test_the_unit_of_a_missing_term_tells_what_its_state_is(unit, friction, stiffness):
    meanings = declared_dimensions({0: unit})
    assert bool(fitting(effects()["quadratic_drag"].term, [0], {}, meanings)) is friction
    assert bool(fitting(effects()["coulomb_friction"].term, [0], {}, meanings)) is friction
    assert bool(fitting(effects()["cubic_stiffness"].term, [0], {}, meanings)) is stiffness
    assert fitting(effects()["constant_force"].term, [0], {}, meanings) == [0]


def test_a_term_of_a_bare_number_may_be_of_anything():
    assert declared_dimensions({0: "1/s"}) == {}


SPRING = """
def initial(p):
    return [0.0, 0.0]
def rhs(t, x, u, p):
    return [x[1], (u["F"] - 6.0 * x[1] - p["k"] * x[0]) / 2.0]
def outputs(x, u, p):
    return {"x": 1000.0 * x[0]}
"""
IN_MILLIMETRES = case_text(
    "ode", parameters={"k": (800.0, "N/m", 16.0)}, inputs={"F": "N"}, outputs={"x": "mm"}, runs=2,
    states=["x", "v"], force_terms={"v": "N/kg"},
)  # fmt: skip


@pytest.mark.parametrize(
    ("factor", "units"),
    [(1000.0, ("N/kg", "m/s", "m")), (1.0, ("N/kg", "m/s", "mm")), (-1e6, ("N/kg", "m/s", "km"))],
)
def test_a_state_that_an_output_of_its_name_shows_in_another_unit_keeps_its_own(tmp_path, factor, units):
    """A spring in metres that shows millimetres; or one in kilometres, the other way round."""
    t = np.arange(50) * 0.01
    frame = pd.DataFrame({"t": t, "F": 60.0 * np.sin(9.0 * t), "x": np.zeros(50)})
    spring = SPRING.replace("1000.0", str(factor))
    case = read_case(write_case(tmp_path, IN_MILLIMETRES, simulator=spring, r0__csv=frame, r1__csv=frame))
    with running(case, None):
        assert model_of(case, None, None).capability.motion.units("v") == units


def test_the_usual_step_is_that_of_the_motion_however_many_rows_stand_still():
    # A way of 2 at 0.02 from row to row, and a carriage that creeps by 1e-6 for nine times as many rows.
    moving, resting = np.arange(101) * 0.02, 2.0 + np.arange(900) * 1e-6
    assert usual_step([np.concatenate([moving, resting])]) == pytest.approx(0.02)
    assert usual_step([resting, moving]) == pytest.approx(0.02)


def test_half_of_a_way_is_made_in_shorter_steps_than_the_usual_one():
    # x = t^2: half of the way to t = 1 is made by t = 1/sqrt(2), where dx/dt = 2 t.
    t = np.linspace(0.0, 1.0, 2001)
    assert usual_step([t**2]) == pytest.approx(np.sqrt(2.0) * (t[1] - t[0]), rel=1e-3)


def test_what_never_moves_has_no_usual_step():
    assert usual_step([np.full(5, 3.0), np.ones(1)]) == usual_step([]) == 0.0
