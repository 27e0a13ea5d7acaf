"""A linear plant whose solution is exact: its states are followed, and a force that it has more is told."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2

from toolkit.diagnosis.simulators.following import Linear, follow

K, C, STEP, ROWS = 16.0, 0.4, 0.05, 400
SPREAD = np.array([1.0, 4.0])
NOISE = 0.01
SLICES = (slice(0, ROWS // 2), slice(ROWS // 2, ROWS))


def transition():
    """Return how (position, rate) and a force held over the interval make the next state: exact."""
    whole = expm(STEP * np.array([[0, 1, 0], [-K, -C, 1], [0, 0, 0]]))
    return whole[:2, :2], whole[:2, 2]


def plant(force):
    A, b = transition()
    x = np.zeros((2, ROWS))
    for rows in SLICES:
        for k in range(rows.start, rows.stop - 1):
            x[:, k + 1] = A @ x[:, k] + b * force[k]
    return x


def linear(drive):
    """Return the equation that knows the drive alone, about any states."""
    A, b = transition()
    entry = np.zeros((ROWS - 1, 2, 2))
    entry[:, :, 1] = b
    slopes = np.repeat(A[None], ROWS - 1, axis=0)
    slopes[SLICES[0].stop - 1] = 0.0

    def about(x):
        ends = A @ x[:, :-1] + b[:, None] * drive[:-1]
        ends[:, SLICES[0].stop - 1] = x[:, SLICES[1].start]
        shows = np.zeros((ROWS, 1, 2))
        shows[:, 0, 0] = 1.0
        return Linear(ends, slopes, entry, x[:1].copy(), shows)

    return about


def followed(recorded, drive):
    return follow(
        linear(drive), plant(drive), recorded, SLICES,
        spread=SPREAD, fastest=np.array([0.0, 10.0]), sensor=np.array([NOISE]),
    )  # fmt: skip


@pytest.fixture(scope="module")
def signals():
    t = np.arange(ROWS) * STEP
    drive = 3 * np.sin(2.1 * t) + 2 * np.sin(5.3 * t)
    more = 4.0 * np.sign(np.sin(0.9 * t))
    true = plant(drive + more)
    return drive, more, true, true[:1] + np.random.default_rng(1).normal(0, NOISE, (1, ROWS))


def test_the_states_are_the_plants_where_the_simulation_is_far_off(signals):
    drive, _, true, recorded = signals
    made = followed(recorded, drive)
    simulated = plant(drive)
    assert np.sqrt(np.mean((simulated[0] - true[0]) ** 2)) > 20 * NOISE
    assert np.sqrt(np.mean((made.states[0] - true[0]) ** 2)) < NOISE
    # A rate read off the positions of two neighbours is off by their noise; one that is followed by less.
    assert np.sqrt(np.mean((made.states[1] - true[1]) ** 2)) < NOISE / (np.sqrt(2) * STEP)


def test_least_squares_on_the_errors_gives_the_size_of_what_is_missing(signals):
    drive, more, _, recorded = signals
    made = followed(recorded, drive)
    added = made.entry[:, :, 1].T[:, None, :] * (more[:-1] / 4.0)
    added[:, :, SLICES[0].stop - 1] = 0.0
    answers = made.answers(added)[:, 0, 0]
    size = (answers @ made.errors[:, 0]) / (answers @ answers)
    assert size == pytest.approx(4.0, rel=0.02)
    left = made.errors[:, 0] - size * answers
    gain = ROWS * np.log((made.errors[:, 0] @ made.errors[:, 0]) / (left @ left))
    assert chi2.sf(gain, 1) < 1e-12


def test_an_output_that_reads_too_much_is_answered_as_such(signals):
    drive, _, _, _ = signals
    offset = 0.5
    recorded = plant(drive)[:1] + offset + np.random.default_rng(2).normal(0, NOISE, (1, ROWS))
    made = followed(recorded, drive)
    answers = made.answers(np.zeros((2, 1, ROWS - 1)), np.ones((ROWS, 1, 1)))[:, 0, 0]
    # Its states took the offset at first for a place: what tells the two apart is the spring.
    size = (answers @ made.errors[:, 0]) / (answers @ answers)
    assert size == pytest.approx(offset, abs=0.25)
    assert size > 0


def test_rows_that_were_not_read_have_no_error_and_do_no_harm(signals):
    drive, _, true, recorded = signals
    lost = recorded.copy()
    lost[0, 50:60] = np.nan
    made = followed(lost, drive)
    assert np.isnan(made.errors[50:60, 0]).all()
    assert np.isfinite(np.delete(made.errors[:, 0], np.arange(50, 60))).all()
    assert np.sqrt(np.mean((made.states[0, 60:] - true[0, 60:]) ** 2)) < NOISE


def test_nothing_flows_from_one_run_to_the_next(signals):
    drive, _, _, recorded = signals
    made = followed(recorded, drive)
    push = np.zeros((2, 1, ROWS - 1))
    push[:, :, 10] = SPREAD[:, None]
    answers = made.answers(push)[:, 0, 0]
    assert np.abs(answers[11:40]).max() > 0
    assert not answers[SLICES[1]].any()
