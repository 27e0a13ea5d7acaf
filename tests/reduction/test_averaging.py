"""Averaging: which rows, and how sure their mean is."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from toolkit.machine import load_machine
from toolkit.recording.model import Recording, Series
from toolkit.reduction.averaging import free_radius_m, means, turning, window
from toolkit.reduction.blocks import Block

M15 = load_machine("m15")
BLOCK = Block(start=0, stop=400, mean_FZ=1000.0)
RADIUS = 0.306


def recording(**series: tuple[str, np.ndarray]) -> Recording:
    return Recording(
        path=Path("x"),
        sha256="",
        machine=M15,
        series=tuple(
            Series(symbol=k, header=k, unit=u, role="covariate", values=v) for k, (u, v) in series.items()
        ),
        simulated=False,
        format="xlsx",
    )


@pytest.mark.parametrize(
    ("size", "radius"),
    [("205/55R16", 0.31595), ("265/35 ZR 18", 0.32135), ("LT245/75R17", 0.39965), ("335/65R22.5", 0.5035)],
)
def test_free_radius_by_the_size_code(size: str, radius: float) -> None:
    # rim in inches / 2 + width x aspect, by hand
    assert free_radius_m(size) == pytest.approx(radius, abs=1e-9)


def test_the_machines_own_files_are_averaged_whole() -> None:
    rows = recording(FZ=("lbf", np.ones(400)))
    found = window(rows, BLOCK, machine=M15, rolling_radius_m=RADIUS)
    assert found.rows == slice(0, 400)
    assert found.revolutions is None
    assert not found.short


def test_a_tire_angle_counts_revolutions() -> None:
    # 100 rows a revolution: 2.5 revolutions discarded are 250 rows, one averaged are 100.
    angle = np.arange(400) * 3.6
    found = window(recording(TIRE_ANGLE=("deg", angle)), BLOCK, machine=M15, rolling_radius_m=None)
    assert found.rows == slice(250, 350)
    assert found.revolutions == pytest.approx(0.99)


def test_a_tire_angle_that_wraps() -> None:
    angle = (np.arange(400) * 3.6) % 360
    found = window(recording(TIRE_ANGLE=("deg", angle)), BLOCK, machine=M15, rolling_radius_m=None)
    assert found.rows == slice(250, 350)


def test_a_time_channel_counts_by_speed_and_radius() -> None:
    # physics.md: a 205/55R16 on this drum turns once in 0.90 s; 100 Hz gives 90 rows a revolution.
    time = np.arange(400) * 0.01
    found = window(recording(t=("s", time)), BLOCK, machine=M15, rolling_radius_m=RADIUS)
    assert found.rows.start == pytest.approx(2.5 * 0.9035 * 100, abs=1)
    assert found.rows.stop - found.rows.start == pytest.approx(90, abs=1)


def test_a_short_block_gives_its_last_revolution_and_says_so() -> None:
    angle = np.arange(200) * 3.6
    found = window(
        recording(TIRE_ANGLE=("deg", angle)),
        dataclasses.replace(BLOCK, stop=200),
        machine=M15,
        rolling_radius_m=None,
    )
    assert found.short
    assert found.rows.stop == 200
    assert found.revolutions == pytest.approx(1.0, abs=0.02)


def test_a_sample_rate_counts_only_where_the_machine_records_continuously() -> None:
    rows = recording(FZ=("lbf", np.ones(400)))
    with_rate = dataclasses.replace(M15, sample_rate_Hz=100.0)
    assert window(rows, BLOCK, machine=with_rate, rolling_radius_m=RADIUS).revolutions is None
    continuous = dataclasses.replace(
        with_rate, protocol=dataclasses.replace(M15.protocol, acquisition="continuous")
    )
    assert window(rows, BLOCK, machine=continuous, rolling_radius_m=RADIUS).rows.start > 200


def test_mean_of_independent_rows() -> None:
    rows = np.random.default_rng(3).normal(5.0, 2.0, (400, 100))
    found = means(rows)
    errors = np.array([one.value - 5.0 for one in found])
    stated = np.sqrt(np.mean([one.u**2 for one in found]))
    # 400 means of 100 rows scatter by 0.2; the scatter is known to 1/sqrt(800) = 3.5 %.
    assert np.std(errors) == pytest.approx(0.2, rel=0.12)
    assert stated == pytest.approx(0.2, rel=0.12)


def test_correlated_rows_are_less_sure_than_they_look() -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(size=(400, 400))
    rows = np.empty_like(noise)
    rows[:, 0] = noise[:, 0] / np.sqrt(1 - 0.8**2)
    for i in range(1, 400):
        rows[:, i] = 0.8 * rows[:, i - 1] + noise[:, i]
    found = means(rows)
    # AR(1) with 0.8: the variance of the mean is (1 + 0.8) / (1 - 0.8) = 9 times that of white rows.
    true = np.std([one.value for one in found])
    stated = np.sqrt(np.mean([one.u**2 for one in found]))
    assert true == pytest.approx(3 * (1 / 0.6) / 20, rel=0.12)
    assert stated == pytest.approx(true, rel=0.15)


def test_one_row_and_constant_rows() -> None:
    (single,) = means(np.array([[3.0]]))
    assert (single.value, single.sd, single.u) == (3.0, 0.0, 0.0)
    (constant,) = means(np.full((1, 50), 3.0))
    assert (constant.value, constant.u) == (3.0, 0.0)


def test_what_the_rows_follow_is_no_error_of_their_mean() -> None:
    """A swing of the load and of the tire's own turn, over one turn, on rows of noise 2."""
    rng = np.random.default_rng(6)
    phase = 2 * np.pi * np.arange(100) / 100
    load = 4000.0 + 30.0 * np.cos(phase / 4 + 0.3)
    swing = 1.5 * (load - load.mean()) + 40.0 * np.cos(phase + 1.0) + 10.0 * np.sin(2 * phase)
    rows = rng.normal(5.0, 2.0, (400, 100)) + swing
    explained = np.vstack([load, turning(100, 1.0)])
    found, bare = means(rows, explained=explained), means(rows)
    assert [one.value for one in found] == [one.value for one in bare]
    assert [one.sd for one in found] == [one.sd for one in bare]
    stated = np.sqrt(np.mean([one.u**2 for one in found]))
    assert stated == pytest.approx(0.2, rel=0.12)  # 2 / sqrt(100)
    assert np.mean([one.u for one in bare]) > 20 * stated


def test_a_turn_that_is_not_whole_explains_nothing() -> None:
    assert turning(100, None).shape == turning(100, 0.6).shape == turning(100, 1.1).shape == (0, 100)
    assert turning(100, 2.0).shape == (4, 100)
    np.testing.assert_allclose(turning(100, 2.0).mean(axis=1), 0.0, atol=1e-15)


@pytest.mark.parametrize("counter", ["back", "still"])
def test_a_clock_that_does_not_run_counts_no_revolutions(counter: str) -> None:
    time = np.arange(400) * 0.01
    time = np.full(400, 5.0) if counter == "still" else np.where(np.arange(400) > 0, time - 3.0, time)
    found = window(recording(t=("s", time)), BLOCK, machine=M15, rolling_radius_m=RADIUS)
    assert (found.rows, found.revolutions, found.short) == (slice(0, 400), None, False)


def test_where_a_shaft_stands_still_the_clock_counts() -> None:
    rows = recording(TIRE_ANGLE=("deg", np.full(400, 12.0)), t=("s", np.arange(400) * 0.01))
    found = window(rows, BLOCK, machine=M15, rolling_radius_m=RADIUS)
    assert found.rows.start == pytest.approx(2.5 * 0.9035 * 100, abs=1)


def test_the_jitter_of_an_encoder_is_no_turn_backwards() -> None:
    angle = np.arange(400) * 3.6 + np.where(np.arange(400) % 2, 4.0, 0.0)
    found = window(recording(TIRE_ANGLE=("deg", angle)), BLOCK, machine=M15, rolling_radius_m=None)
    assert found.rows.start == pytest.approx(250, abs=2)
