"""Formulas of laws: what they compute, and what they refuse to read."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.effects.formula import formula
from toolkit.errors import ConfigError

T = np.linspace(0.0, 20.0, 2001)


def test_arithmetic_is_that_of_numpy():
    x, z = np.linspace(-2, 2, 9), np.linspace(1, 3, 9)
    law = formula("a*tanh(([x] - c)/s) - [z]**2/4 + max([x], 0)*pi")
    values = {"a": 3.0, "c": 0.5, "s": 0.2}
    expected = 3 * np.tanh((x - 0.5) / 0.2) - z**2 / 4 + np.maximum(x, 0) * np.pi
    np.testing.assert_allclose(law({"x": x, "z": z}, values), expected, rtol=1e-15)
    assert law.signals == ("x", "z")
    assert law.parameters == ("a", "c", "s")


def test_a_signal_may_have_any_name():
    law = formula("a*[Belt force, left (N)]")
    assert law.signals == ("Belt force, left (N)",)
    assert law({"Belt force, left (N)": 2.0}, {"a": 3.0}) == 6.0
    assert law.plain() == "a*Belt force, left (N)"


def test_a_lag_answers_a_step_by_its_exponential():
    step = np.where(T >= 1.0, 1.0, 0.0)
    answered = formula("lag([x], tau)")({"x": step}, {"tau": 2.0}, T)
    np.testing.assert_allclose(answered[T >= 1.0], 1 - np.exp(-(T[T >= 1.0] - 1) / 2), atol=0.005)


def test_a_mode_has_the_gain_of_its_transfer_function():
    """At a sine of frequency f the gain is 1/|1 - r^2 + 2iDr| with r = f/f0, once it has settled."""
    f, f0, damping = 1.1, 1.3, 0.1
    answered = formula("mode([x], frequency, damping)")(
        {"x": np.sin(2 * np.pi * f * T)}, {"frequency": f0, "damping": damping}, T
    )
    r = f / f0
    gain = 1 / abs(1 - r**2 + 2j * damping * r)
    assert np.ptp(answered[T > 12]) / 2 == pytest.approx(gain, rel=0.01)


def test_a_loop_turns_round_within_its_reach():
    """A triangle of amplitude 1: after a reversal the stop operator goes from end to end."""
    x = 1 - np.abs(np.mod(T, 4.0) - 2.0)
    looped = formula("loop([x], reach)")({"x": x}, {"reach": 0.1}, T)
    assert looped.max() == pytest.approx(1.0)
    assert looped.min() == pytest.approx(-1.0)
    rising, falling = np.gradient(x, T) > 0.5, np.gradient(x, T) < -0.5
    later = T > 4.5
    np.testing.assert_allclose(looped[later & rising & (x > -0.7)], 1.0, atol=1e-9)
    np.testing.assert_allclose(looped[later & falling & (x < 0.7)], -1.0, atol=1e-9)


def test_a_spline_goes_through_its_points_and_on_as_it_ends():
    curve = formula("spline([x], 0, a1, 1, a2, 2, a3)")
    values = {"a1": 1.0, "a2": 3.0, "a3": 2.0}
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    y = curve({"x": x}, values)
    np.testing.assert_allclose(y[:3], [1.0, 3.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(y[3:], 2.0)


def test_splines_of_several_sets_are_those_of_each_set_alone():
    curve = formula("spline([x], 0, a1, 1, a2, 2, a3)")
    x = np.array([0.2, 0.7, 1.6, 1.1])
    sets = [{"a1": 1.0, "a2": 3.0, "a3": 2.0}, {"a1": -1.0, "a2": 0.0, "a3": 5.0}]
    of = np.array([0, 1, 1, 0])
    values = {name: np.array([sets[k][name] for k in of]) for name in sets[0]}
    alone = [float(curve({"x": at}, sets[k])) for at, k in zip(x, of, strict=True)]
    np.testing.assert_array_equal(curve({"x": x}, values), alone)


def test_a_curve_that_an_equation_asks_at_every_step_is_drawn_once(monkeypatch):
    import scipy.interpolate

    drawn, spline = [], scipy.interpolate.CubicSpline
    monkeypatch.setattr(
        scipy.interpolate, "CubicSpline", lambda *given, **how: drawn.append(1) or spline(*given, **how)
    )
    curve, x = formula("spline([x], 0, a1, 1, a2, 2, a3)"), np.array([0.2, 0.7, 1.6, 1.1])
    one = {"a1": 0.11, "a2": 0.22, "a3": 0.33}
    several = {name: np.full(4, value) for name, value in one.items()}
    for values in (one, several):
        first = curve({"x": x}, values)
        np.testing.assert_array_equal(curve({"x": x}, values), first)
    assert len(drawn) == 2
    several["a2"] = several["a2"] + 1.0
    assert curve({"x": x}, several)[1] > first[1]


def test_a_pulse_is_there_between_its_ends_and_half_at_them():
    values = {"a": 2.0}
    there = formula("a*pulse([t], 1, 3, 0.05)")({"t": np.array([0.0, 1.0, 2.0, 3.0, 4.0])}, values)
    np.testing.assert_allclose(there, [0, 1, 2, 1, 0], atol=1e-9)


def test_a_way_is_the_integral_of_a_speed():
    t = np.linspace(0, 2, 201)
    way = formula("a*way([v])")({"v": 3 * t**2}, {"a": 1.0}, t)
    np.testing.assert_allclose(way, t**3, atol=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "[x].__class__", "(lambda: 1)()", "open('/etc/passwd')",
        "{y for y in (1, 2)}", "'a'*9", "9**9**9", "2**[x]", "[x]**99", "a if a else 1", "a, b", "f'{a}'",
        "a := 3", "exp(x=1)", "a[0]", "a and 1", "__0", "1e5j*a", "", "a +", "True*a", "*a", "max(*[x])",
        "(" * 500 + "a" + ")" * 500, "a*" * 1500 + "a", "a\n\nb", "lambda: a", "await a", "b'9'*9",
    ],
)  # fmt: skip
def test_what_is_no_formula_of_a_law_is_refused(text):
    with pytest.raises(ConfigError) as caught:
        formula(text)({"x": 1.0}, {"a": 1.0})
    assert caught.value.rule == "law-formula"


@pytest.mark.parametrize("frequency", [0.0, 1e-9, 1e-5])
def test_a_vibration_without_end_stands_still(frequency):
    t = np.arange(400) * 0.05
    x = np.sin(t) + 3.0
    moved = formula("mode([x], frequency, damping)")({"x": x}, {"frequency": frequency, "damping": 0.3}, t)
    np.testing.assert_allclose(moved, 3.0, atol=0.02)  # as it stood at the first row
