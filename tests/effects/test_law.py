"""A law as an effect: by its name alone, on an output or in an equation."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.diagnosis.simulators.forces import Forces
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect
from toolkit.effects.forward import through, tire_forces
from toolkit.effects.law import conversion, law_effect, law_name
from toolkit.effects.signals import Setting, TireForces, drive
from toolkit.errors import ConfigError

T = np.arange(5.0)


def _setting(**channels: np.ndarray) -> Setting:
    return Setting(t=T, elapsed_s=T, channels=channels)


def _through(name: str, y: np.ndarray, values: dict[str, float], **channels: np.ndarray) -> np.ndarray:
    applied = AppliedEffect(effect=effect(name), channel="F", values=values)
    return through({"F": y}, [applied], _setting(**channels))["F"]


def test_a_law_adds_and_multiplies():
    y, x = np.array([1.0, 2, 3, 4, 5]), np.array([0.0, 1, 0, -1, 2])
    np.testing.assert_allclose(_through("law adds: a*[x]**2", y, {"a": 3.0}, x=x), y + 3 * x**2)
    np.testing.assert_allclose(_through("law multiplies: a*[x]", y, {"a": 0.1}, x=x), y * (1 + 0.1 * x))
    np.testing.assert_allclose(_through("law adds: a*[itself]*[time]", y, {"a": 2.0}), y + 2 * y * T)


def test_signals_are_in_the_units_of_the_recording():
    """20 degC stand as 293.15 K in a setting; a law over the recorded temperature sees 20."""
    kelvin = np.full(5, 293.15)
    values = {"a": 1.0, **conversion("T", 1.0, 273.15)}
    np.testing.assert_allclose(_through("law adds: a*[T]", np.zeros(5), values, T=kelvin), 20.0)


def test_a_law_in_an_equation_is_taken_from_the_rate():
    law = AppliedEffect(
        effect=law_effect(law_name("enters", "a*[itself]*[position]**2*[F]")), channel="v", values={"a": 5.0}
    )
    forces = Forces.of([law], ["x", "v"], {1: 0}, {"v": (1.0, 1.0)}, ["F"])
    rate = np.zeros((2, 2))
    states = np.array([[3.0, 1.0], [2.0, 2.0]])
    forces.add(states, rate, 2, {"F": np.array([7.0, 10.0]), "time": np.zeros(2)})
    np.testing.assert_allclose(rate, [[0, 0], [-5 * 2 * 9 * 7, -5 * 2 * 1 * 10]])


def test_a_law_that_reads_what_an_equation_does_not_have_is_refused():
    law = AppliedEffect(effect=law_effect("law enters: a*[q]"), channel="v", values={"a": 5.0})
    with pytest.raises(ConfigError, match="does not have") as caught:
        Forces.of([law], ["x", "v"], {1: 0}, {"v": (1.0, 1.0)}, ["F"])
    assert (caught.value.rule, caught.value.got, caught.value.expected) == (
        "model-place",
        "q",
        "x, v, F, time",
    )


def test_an_amplitude_can_be_off_and_a_width_is_positive():
    parameters = {p.name: p for p in law_effect("law adds: a*tanh(([x] - c)/s)").parameters}
    assert parameters["a"].off == 0.0
    assert parameters["c"].off is None
    assert parameters["s"].bounds[0] == 0.0


@pytest.mark.parametrize(
    "name",
    ["law adds: open(a)", "law takes: a", "law ", "law enters: a*loop([itself], reach)"],
)
def test_what_is_no_law_is_refused(name):
    with pytest.raises(ConfigError) as caught:
        effect(name)
    assert caught.value.rule == "law-formula"


def test_a_law_without_its_channel_says_which_one_is_missing():
    with pytest.raises(ConfigError, match="not recorded") as caught:
        _through("law adds: a*[x]", np.zeros(5), {"a": 1.0})
    assert caught.value.expected == "x"


@pytest.mark.parametrize("friction", [0.8, 1.0, 1.3])
def test_a_law_of_friction_is_a_brush_on_another_road(friction):
    """FY and MZ of a brush depend on mu as the similarity has it (Pacejka 2012, 3.2 and 4.2.1)."""
    slip, load, stiffness = np.linspace(-0.2, 0.2, 5), 4000.0, 60e3

    def brush(slip, mu):
        x = np.minimum(np.abs(stiffness * slip / (3 * mu * load)), 1.0)
        grip, stuck = mu * load * np.sign(slip), (1 - x) ** 3
        return TireForces(FY=-grip * (1 - stuck), MZ=0.05 * grip * x * stuck)

    applied = AppliedEffect(effect=effect("law scales friction: a*[T]"), values={"a": 0.1})
    forces = tire_forces(
        drive(T, slip, np.full(5, load)),
        lambda alpha, _: brush(alpha, 1.0),
        [applied],
        _setting(T=np.full(5, 10 * (friction - 1))),
    )
    there = brush(slip, friction)
    np.testing.assert_allclose(forces.FY, there.FY, rtol=1e-12)
    np.testing.assert_allclose(forces.MZ, there.MZ, rtol=1e-12)


def test_what_drives_a_tire_is_scaled_by_no_output():
    with pytest.raises(ConfigError, match="scales stiffness") as caught:
        law_effect("law scales stiffness: a*[itself]")
    assert caught.value.rule == "law-formula"
