"""Members of a class: fitted in each other's place, apart by what a run would show."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.planning.class_factory import DELAY, answer, found, problem, write_case
from toolkit.diagnosis.fit.noise import Autoregression
from toolkit.diagnosis.policy import VERDICT
from toolkit.errors import ConfigError
from toolkit.planning.members import (
    Member,
    Predicted,
    class_of,
    completed,
    denser,
    evidence_a_second,
    expected_log_evidence,
    members_of,
    predict,
)


def gaussian(mean: np.ndarray, spread: np.ndarray) -> Predicted:
    return Predicted(outputs={"F": mean}, spread={"F": spread}, between={"F": np.zeros((len(mean), 0))})


def member(sd: float) -> Member:
    fit: Any = SimpleNamespace(noise={"F": Autoregression(reflection=(), sd=sd)})
    return Member(label="", fit=fit)


RUN: Any = SimpleNamespace(t=np.arange(6.0), rows=6)


def test_the_expected_log_evidence_is_the_divergence_of_two_gaussians() -> None:
    # Kullback and Leibler's divergence with full covariance matrices, by its definition.
    rng = np.random.default_rng(3)
    means, spreads = rng.normal(size=(2, 6)), [rng.normal(size=(6, 2)), rng.normal(size=(6, 3))]
    sd = 0.7
    S = [sd**2 * np.eye(6) + W @ W.T for W in spreads]
    gap = means[0] - means[1]
    inverse = np.linalg.inv(S[1])
    expected = 0.5 * (
        np.trace(inverse @ S[0]) - 6 + gap @ inverse @ gap + np.log(np.linalg.det(S[1]) / np.linalg.det(S[0]))
    )
    true, other = (gaussian(mean, W) for mean, W in zip(means, spreads, strict=True))
    assert expected_log_evidence(RUN, [member(sd)], true, other) == pytest.approx(expected, rel=1e-9)


def test_what_a_parameter_may_absorb_does_not_part() -> None:
    shift = np.ones(6)
    still, free = gaussian(np.zeros(6), np.zeros((6, 1))), gaussian(shift, 100 * shift[:, None])
    bound = gaussian(shift, np.zeros((6, 1)))
    assert expected_log_evidence(RUN, [member(0.1)], still, bound) == pytest.approx(300.0)
    # The width of the open parameter costs its logarithm, and no more.
    assert expected_log_evidence(RUN, [member(0.1)], still, free) < 10


def test_the_noise_counts_under_which_two_are_less_apart() -> None:
    a, b = gaussian(np.zeros(6), np.zeros((6, 0))), gaussian(np.ones(6), np.zeros((6, 0)))
    assert expected_log_evidence(RUN, [member(0.1), member(1.0)], a, b) == pytest.approx(3.0)


def test_denser_rows_tell_no_more_of_what_is_slow() -> None:
    """A step of one noise's size, of 6 rows and of 60 in the same time: as much evidence by either."""
    known = dataclasses.replace(member(1.0), step_s=1.0)
    dense: Any = SimpleNamespace(t=np.arange(60) / 10, rows=60)
    for run in (RUN, dense):
        a, b = (gaussian(np.full(run.rows, level), np.zeros((run.rows, 0))) for level in (0.0, 1.0))
        assert expected_log_evidence(run, [known], a, b) == pytest.approx(3.0)


def test_members_are_fitted_in_each_others_place(tmp_path: Path) -> None:
    posed = problem(write_case(tmp_path))
    effect = found("channel_delay", "filter_lag")
    members = members_of(posed, (effect,), effect)
    assert {m.label for m in members} == {"channel_delay on F", "filter_lag on F"}
    delay = next(m for m in members if m.label.startswith("channel_delay"))
    assert delay.fit.active[-1].values["delay"] == pytest.approx(DELAY, abs=0.002)


def test_an_answer_without_a_class_is_refused() -> None:
    with pytest.raises(ConfigError) as error:
        class_of(answer("0" * 64, found("relaxation")), "diagnosis.json")
    assert error.value.rule == "plan-next"


def test_a_class_of_which_one_member_can_be_fitted_is_refused(tmp_path: Path) -> None:
    posed = problem(write_case(tmp_path))
    effect = found("channel_delay", "conicity")  # there is no tire here
    with pytest.raises(ConfigError) as error:
        members_of(posed, (effect,), effect)
    assert error.value.rule == "plan-next"


def test_what_rows_leave_open_is_evidence_for_neither() -> None:
    pattern = np.sin(np.arange(40.0))
    run: Any = SimpleNamespace(t=np.arange(40.0), rows=40)
    open_to_one = Predicted(
        outputs={"F": 5 * pattern}, spread={"F": np.zeros((40, 0))}, between={"F": 3 * pattern[:, None]}
    )
    nothing = gaussian(np.zeros(40), np.zeros((40, 0)))
    both = (member(1.0), member(1.0))
    free = expected_log_evidence(run, both, gaussian(5 * pattern, np.zeros((40, 0))), nothing)
    assert free == pytest.approx(12.5 * float(pattern @ pattern))
    for pair in ((open_to_one, nothing), (nothing, open_to_one)):
        assert 0 < expected_log_evidence(run, both, *pair) < 0.5 * (5 / 3) ** 2


def test_a_run_of_which_the_rows_mislead_a_fit_parts_nothing() -> None:
    # Members are 5 patterns apart, and what comes is 3 further off the true one: it lies nearer to the other.
    pattern = np.sin(np.arange(40.0))
    run: Any = SimpleNamespace(t=np.arange(40.0), rows=40)
    none, square = np.zeros((40, 0)), float(pattern @ pattern)
    true, rival = (
        Predicted(outputs={"F": mean}, spread={"F": none}, between={"F": 9 * pattern[:, None]})
        for mean in (5 * pattern, 0 * pattern)
    )
    expected = expected_log_evidence(run, (member(1.0), member(1.0)), true, rival)
    assert expected == pytest.approx(0.5 * (2**2 - 3**2) * square)


def test_a_run_in_which_derivatives_say_nothing_of_a_members_parameters_parts_nothing(tmp_path: Path) -> None:
    """A delay that is known to 0.1 s: of a slow sine that is a shift, of a fast one it may be whole waves."""
    posed = problem(write_case(tmp_path))
    effect = found("channel_delay", "filter_lag")
    members = members_of(posed, (effect,), effect)
    late = next(m for m in members if m.label.startswith("channel_delay"))
    open_delay = np.diag([0.1**2, 0.1**2])
    wide = dataclasses.replace(late, fit=dataclasses.replace(late.fit, covariance=open_delay))
    recorded = posed.runs[0]
    said = {}
    for hertz in (0.2, 4.0):
        u = np.sin(2 * np.pi * hertz * recorded.t) * np.minimum(recorded.t, 1.0)
        run = dataclasses.replace(recorded, columns={**recorded.columns, "u": u})
        predicted = predict(posed, wide, run)
        assert predicted is not None
        whole = completed(posed, wide, run, predicted, ())
        assert whole is not None
        said[hertz] = run, whole
    assert said[0.2][1].lost == 0
    run, whole = said[4.0]
    # Of two waves that are out of step half the sum of squares of their difference is lost.
    waves = 0.5 * run.rows * (102 / late.fit.noise["F"].marginal_sd) ** 2
    assert 0.1 * waves < whole.lost < 2 * waves
    apart = gaussian(whole.outputs["F"] + 50.0, np.zeros((run.rows, 0)))
    followed = dataclasses.replace(whole, lost=0.0)
    for true, rival in ((whole, apart), (apart, whole)):
        held = expected_log_evidence(
            run, (late, late), *(followed if p is whole else p for p in (true, rival))
        )
        # Neither what the true member's own fit may miss is expected, nor what the rival's may find.
        assert held > 3
        assert expected_log_evidence(run, (late, late), true, rival) == 0


def test_of_a_run_whose_fits_may_end_anywhere_nothing_is_expected() -> None:
    """A pendulum over the top: 3.5 million apart, of which fits may miss 0.8 million: not 2.7 million."""
    none, both = np.zeros((6, 0)), (member(1.0), member(1.0))
    apart = np.full(6, np.sqrt(2 * 3.5e6 / 6))
    for missed, expected in ((0.8e6, 0.0), (VERDICT.close + 0.1, 0.0), (2.0, 3.5e6 - 2.0)):
        near, far = gaussian(np.zeros(6), none), gaussian(apart, none)
        for true, rival in (
            (near, dataclasses.replace(far, lost=missed)), (dataclasses.replace(near, lost=missed), far),
        ):  # fmt: skip
            assert expected_log_evidence(RUN, both, true, rival) == pytest.approx(expected)
    # Of rows that are made again as much again is missed.
    twice = expected_log_evidence(RUN, both, near, dataclasses.replace(far, lost=2.0), times=2)
    assert twice == 0


def test_a_run_that_is_made_again_is_its_rows_one_below_the_other() -> None:
    rng = np.random.default_rng(5)
    true, rival = (
        gaussian(rng.normal(size=6), rng.normal(size=(6, count))) for count in (1, 2)
    )  # fmt: skip
    thrice: Any = SimpleNamespace(t=np.arange(18.0), rows=18)

    def stacked(predicted: Predicted) -> Predicted:
        return gaussian(np.tile(predicted.outputs["F"], 3), np.tile(predicted.spread["F"], (3, 1)))

    both = (member(0.7), member(0.9))
    once = expected_log_evidence(thrice, both, stacked(true), stacked(rival))
    assert expected_log_evidence(RUN, both, true, rival, times=3) == pytest.approx(once)


def test_no_row_tells_more_than_the_one_in_which_two_are_furthest_apart() -> None:
    none = np.zeros((6, 0))
    true, rival = gaussian(np.array([0.0, 1, 0, -3, 0, 0]), none), gaussian(np.zeros(6), none)
    told = evidence_a_second(RUN, (member(1.5), member(2.0)), true, rival)
    assert told == pytest.approx(0.5 * (3 / 2.0) ** 2)
    assert 6 * told >= expected_log_evidence(RUN, (member(1.5), member(2.0)), true, rival)


def test_a_denser_run_has_its_rows_and_one_between_each_two(tmp_path: Path) -> None:
    run = problem(write_case(tmp_path)).runs[0]
    straight, smooth = denser(run, ["u"])
    for dense in (straight, smooth):
        np.testing.assert_array_equal(dense.t[::2], run.t)
        np.testing.assert_allclose(dense.columns["u"][::2], run.columns["u"], atol=1e-12)
    middle = (run.columns["u"][1:] + run.columns["u"][:-1]) / 2
    np.testing.assert_allclose(straight.columns["u"][1::2], middle)
    # Beyond the corner at 1 s: of a sine of amplitude 2 the chord lies h²/8 of its curvature inside.
    least = 2.0 * (2 * np.pi * 0.2) ** 2 * 0.02**2 / 8
    assert np.abs(smooth.columns["u"][1::2] - middle)[60:].max() == pytest.approx(least, rel=0.15)
