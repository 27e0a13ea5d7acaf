"""A tone is a line of a spectrum; noise that came through a resonance is none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.diagnosis.fit.noise import layout
from toolkit.diagnosis.policy import STRUCTURE
from toolkit.diagnosis.search.unexplained import beyond_its_past, strongest_line

RATE, ROWS, RUNS = 20.0, 240, 3  # 1/s, rows of a run, runs


def line(residual):
    t = np.arange(ROWS) / RATE
    problem = SimpleNamespace(
        case=SimpleNamespace(has_time=True),
        runs=[SimpleNamespace(t=t, rows=ROWS)] * RUNS,
        slices=[slice(k * ROWS, (k + 1) * ROWS) for k in range(RUNS)],
        kept={"y": np.ones(ROWS * RUNS, dtype=bool)},
        rows=ROWS * RUNS,
        floor={"y": 1e-9},
        layout=lambda _: layout([t] * RUNS, [np.ones(ROWS, dtype=bool)] * RUNS),
    )
    return problem, strongest_line(problem, "y", residual)


def through_resonance(rng, *, frequency, damping):
    """Return white noise after a vibration of that frequency [Hz] and damping ratio."""
    from scipy.signal import cont2discrete, lfilter

    w = 2 * np.pi * frequency
    b, a, _ = cont2discrete(([w * w], [1, 2 * damping * w, w * w]), 1 / RATE, method="zoh")
    return np.concatenate([lfilter(b.ravel(), a, rng.normal(size=ROWS + 200))[200:] for _ in range(RUNS)])


BETWEEN = pytest.mark.campaign("a damping between the least and the most that are held in every run")
DRAWS = pytest.mark.campaign("three times as many draws")


@pytest.mark.campaign("drawn noises of a resonance: what is a tone is told in every run")
@pytest.mark.parametrize(
    ("damping", "draws"),
    [
        (0.05, 20),
        pytest.param(0.05, 60, marks=DRAWS),
        pytest.param(0.1, 60, marks=BETWEEN),
        pytest.param(0.2, 60, marks=BETWEEN),
        (0.4, 60),
    ],
)
def test_noise_through_a_resonance_is_no_tone(damping, draws):
    called = 0
    for seed in range(draws):
        noise = through_resonance(np.random.default_rng(seed), frequency=0.9, damping=damping)
        problem, found = line(noise)
        called += (
            found.p_value < STRUCTURE.line and beyond_its_past(problem, "y", noise, found) < STRUCTURE.line
        )
    assert called == 0


@pytest.mark.parametrize("frequency", [0.9, 0.93, 3.11, 7.5])
@pytest.mark.parametrize("coloured", [False, True])
def test_a_tone_is_a_line_wherever_it_stands_between_the_frequencies(frequency, coloured):
    rng = np.random.default_rng(3)
    noise = through_resonance(rng, frequency=0.3, damping=0.7) if coloured else rng.normal(size=ROWS * RUNS)
    t = np.tile(np.arange(ROWS) / RATE, RUNS)
    residual = noise / np.std(noise) + 1.2 * np.sin(2 * np.pi * frequency * t + 0.4)
    problem, found = line(residual)
    assert beyond_its_past(problem, "y", residual, found) < STRUCTURE.line
    assert found.p_value < STRUCTURE.line
    assert found.frequency == pytest.approx(frequency, abs=RATE / ROWS)  # a line is as wide
