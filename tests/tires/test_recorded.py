"""Recorded quantities: the program gives what numpy gives, and a decision by a number is refused."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.tires.recorded import NotRecordedError, as_array, may_differ_from_zero, record


def test_a_program_replays_what_numpy_computes() -> None:
    def function(q):
        x, y = q["x"], q["y"]
        folded = np.where(x < 0, -np.sqrt(np.abs(x)), x**2)
        return {"a": folded * np.clip(y, -1, 1), "b": np.hypot(x, 3.0) + np.copysign(1.0, y)}

    x, y = np.linspace(-2, 2, 41), np.linspace(3, -3, 41)
    program = record(function, ["x", "y", "unused"])
    replayed, computed = program.replay({"x": x, "y": y}), function({"x": x, "y": y})
    np.testing.assert_array_equal(replayed["a"], computed["a"])
    np.testing.assert_array_equal(replayed["b"], computed["b"])
    assert program.quantities == ("x", "y")


def test_equal_steps_stand_once_and_unneeded_ones_not_at_all() -> None:
    def function(q):
        np.exp(q["x"])
        return {"a": np.sin(q["x"]) + np.sin(q["x"])}

    program = record(function, ["x"])
    assert [step.operation for step in program.steps] == ["quantity", "sin", "add"]


def test_the_sign_of_zero_is_kept() -> None:
    program = record(
        lambda q: {"a": np.copysign(1.0, -0.0) + 0.0 * q["x"], "b": np.copysign(q["x"], -0.0)}, ["x"]
    )
    assert float(program.replay({"x": 2.0})["b"]) == -2.0


def test_sums_along_an_inner_axis_are_steps() -> None:
    nodes = np.array([0.1, 0.4, 0.5])
    program = record(lambda q: {"a": (q["x"][..., None] * nodes).sum(axis=-1)}, ["x"])
    assert float(program.replay({"x": 3.0})["a"]) == pytest.approx(3.0, rel=1e-15)


@pytest.mark.parametrize("decide", [bool, float, np.asarray, list, len])
def test_a_number_that_is_not_known_is_refused_by_the_names_it_depends_on(decide) -> None:
    with pytest.raises(NotRecordedError) as caught:
        record(lambda q: {"a": q["y"] if decide(q["x"] + 1) else 0.0}, ["x", "y"])
    assert caught.value.quantities == {"x"}


def test_a_function_that_is_not_recorded_is_named() -> None:
    with pytest.raises(NotRecordedError, match="interp"):
        record(lambda q: {"a": np.interp(q["x"], [0, 1], [0, 1])}, ["x"])


def test_plain_numbers_pass_as_arrays() -> None:
    assert as_array([1, 2], np.float64).dtype == np.float64
    assert may_differ_from_zero(np.array([0.0, 1.0]))
    assert not may_differ_from_zero(0.0)
