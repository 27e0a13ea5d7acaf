"""A bristle that slides is known from the way: the motion of a stiff solver, at the price of any other.

The reference integrates Dahl's equation as a third state by an implicit method (Radau, 1e-10). A slide from
speed v0 from an unbent bristle has the speed v^2 = v0^2 - 2 c (s - r (1 - exp(-s/r))) after the way s.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.simulators.forces import Forces, ForcesTogether
from toolkit.diagnosis.simulators.integrate import integrate
from toolkit.diagnosis.simulators.marching import march
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows
from toolkit.diagnosis.simulators.sliding_friction import Slide
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

COULOMB = 2.0
T = np.linspace(0.0, 4.0, 81)
ATOL = np.array([1e-8, 1e-8, 1e-7])


def pushed(reach, force=lambda t: 6.0 * np.sin(3.0 * t)):
    def rate(t, x):
        return np.stack([x[1], force(t) - COULOMB * x[2] - 0.5 * x[1], (x[1] - np.abs(x[1]) * x[2]) / reach])

    return rate


def slide(reach):
    return Slide(bend=2, velocity=1, way=0, reach=reach)


class Counted:
    def __init__(self, rate):
        self.rate, self.calls = rate, 0

    def __call__(self, t, x):
        self.calls += 1
        return self.rate(t, x)


LONGER = pytest.mark.campaign("longer bristles, which are less stiff")


@pytest.mark.parametrize("reach", [*(pytest.param(reach, marks=LONGER) for reach in (1e-2, 1e-3)), 1e-4])
def test_motion_that_turns_is_that_of_a_stiff_solver(reach):
    start = np.array([0.0, 0.3, 0.0])
    made = integrate(pushed(reach), T, start, ATOL, [slide(reach)])
    exact = solve_ivp(pushed(reach), (0, T[-1]), start, method="Radau", t_eval=T, rtol=1e-10, atol=1e-13).y
    # the local tolerance is 1e-6 of a state; over eighty rows it may add up
    np.testing.assert_allclose(made[:2], exact[:2], atol=2e-5)


def test_a_short_bristle_costs_no_more_than_a_long_one():
    calls = []
    for reach in (1e-2, 1e-6):
        rate = Counted(pushed(reach))
        integrate(rate, T, np.array([0.0, 0.3, 0.0]), ATOL, [slide(reach)])
        calls.append(rate.calls)
    # as a state, one ten thousand times as short takes ten thousand times as many steps
    assert calls[1] < 2 * calls[0]


def test_a_slide_loses_the_energy_of_its_friction():
    reach = 1e-3
    t = np.linspace(0.0, 0.4, 41)
    x, v, _ = integrate(
        lambda _, x: np.array([x[1], -COULOMB * x[2], (x[1] - abs(x[1]) * x[2]) / reach]),
        t, np.array([0.0, 1.0, 0.0]), ATOL, [slide(reach)],
    )  # fmt: skip
    np.testing.assert_allclose(v**2, 1 - 2 * COULOMB * (x - reach * (1 - np.exp(-x / reach))), atol=1e-5)


def test_columns_slide_and_turn_each_at_its_own_time():
    reaches, starts = np.array([1e-2, 1e-4, 1e-3]), np.array([[0.0, 0.0, 0.1], [0.3, -0.8, 0.05]])
    friction = [
        AppliedEffect(
            effect=effects()["coulomb_friction"],
            channel="v",
            values={"coulomb": COULOMB, "presliding": reach},
        )
        for reach in reaches.tolist()
    ]
    forces = [Forces.of([one], ("x", "v"), {1: 0}, {"x": (1.0, 1.0), "v": (1.0, 1.0)}) for one in friction]
    run = Run(name="", t=T, columns={}, conditions={}, declared={}, simulated={})

    def driven(t, x, u, p):
        return pushed(1.0)(t, np.stack([x[0], x[1], 0 * t]))[:2]

    everywhere = ForcesTogether(forces, 2, [run])
    flow = RowFlow(driven, Rows([run], ()), {"none": np.zeros(3)}, everywhere, np.tile(ATOL[:, None], 3))
    made, reached = march(flow, np.vstack([starts, np.zeros((1, 3))])[:, :, None], np.arange(3))
    assert reached.all()
    for k, reach in enumerate(reaches.tolist()):
        alone = integrate(pushed(reach), T, np.array([*starts[:, k], 0.0]), ATOL, [slide(reach)])
        np.testing.assert_allclose(made[:2, k], alone[:2], atol=2e-5)
