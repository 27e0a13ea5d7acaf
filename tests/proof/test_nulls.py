"""A null is one: the declared simulation with its true parameters explains it to the noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.stats import chi2

from proof.catalogue import FAMILIES
from proof.draw import Drawn, draw_case
from proof.noise import whitened

SLOW = ("pendulum", "drive", "tank", "thermal", "tire-python", "tire-cells")
DRAWS = [(family, seed) for family in FAMILIES for seed in range(1 if family in SLOW else 3)]
DRAWS = [(family, seed) for family, seed in DRAWS if family != "labview"]
RARE = 1e-5
"""Two-sided probability below which a draw is not explained; of some sixty sums none may fall there."""


def null(family: str, seed: int) -> Drawn:
    """Return a null without spikes and lost samples, whose noise is then known to the letter."""
    for attempt in range(40):
        drawn = draw_case(1000 * seed + attempt, 0, "null", picked=(family, ()))
        noise = drawn.answer["noise"].values()
        if drawn.answer["lost"] == 0 and all(n["outliers"] == 0 for n in noise):
            return drawn
    raise AssertionError(f"{family}: no draw without spikes")


def innovations(drawn: Drawn) -> list[np.ndarray]:
    """Return what the declared simulation leaves, with the true parameters, in innovations of each run."""
    s = drawn.scenario
    p = s.true_parameters()
    out = []
    for run, measured in zip(s.runs, drawn.measured, strict=True):
        df = s.inputs(run)
        driven = {
            k: y for k, y in measured.items() if k in df
        }  # a measured load drives the tire, noise and all
        nominal = s.nominal(df.assign(**driven), run, p)
        out += [whitened(s.noise[k], measured[k] - nominal[k]) for k in s.outputs]
    return out


def explained(square: float, n: int) -> bool:
    return bool(RARE / 2 < chi2.cdf(square, n) < 1 - RARE / 2)


AGAIN = pytest.mark.campaign("further draws of a family, of which one is held in every run")
LONG = pytest.mark.campaign("families of stiff or long runs: the others stand for them in every run")


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        pytest.param(
            family,
            seed,
            marks=[AGAIN] * (seed > 0) + [LONG] * (family in ("pendulum", "drive", "thermal", "tire-python")),
        )
        for family, seed in DRAWS
    ],
)
def test_a_null_leaves_the_noise_and_nothing_slow(family: str, seed: int) -> None:
    drawn = null(family, seed)
    assert drawn.answer["effects"] == []
    rows = innovations(drawn)
    assert explained(sum(float(w @ w) for w in rows), sum(w.size for w in rows))
    # a model error is smooth: the slowest patterns of every run, where it would stand out of the noise
    slow = [dct(w[1:], norm="ortho")[:12] for w in rows]
    assert explained(sum(float(c @ c) for c in slow), sum(c.size for c in slow))


@pytest.mark.parametrize("seed", range(3))
def test_a_null_of_the_program_is_exact_to_its_last_digit(seed: int) -> None:
    drawn = draw_case(seed, 0, "null", picked=("labview", ()))
    s = drawn.scenario
    for run, measured in zip(s.runs, drawn.measured, strict=True):
        nominal = s.nominal(s.inputs(run), run, {})
        for k, digits in (("FY", 4), ("MZ", 5)):
            assert np.abs(measured[k] - nominal[k]).max() <= 0.5 * 10.0**-digits * (1 + 1e-6)


@pytest.mark.parametrize("family", ["tire-machine", "tire-python", "tire-columns", "beam-python"])
def test_the_parameters_of_a_null_are_within_their_priors(family: str) -> None:
    for seed in range(3):
        for p in FAMILIES[family].build(np.random.default_rng(seed), frozenset()).free():
            assert abs(p.true - p.declared) <= 2.0 * float(p.sd or 0.0)


def test_the_check_sees_a_drift_of_half_the_noise() -> None:
    draws = (null("beam-columns", seed) for seed in range(30))
    drawn = next(d for d in draws if not d.answer["noise"]["S"]["ar"])  # colour would hide it for longer
    sd = drawn.scenario.noise["S"].sd
    for measured in drawn.measured:  # a ramp from -a to a has an RMS of a over the root of three
        measured["S"] += 0.5 * sd * 3**0.5 * np.linspace(-1, 1, measured["S"].size)
    slow = [dct(w[1:], norm="ortho")[:12] for w in innovations(drawn)]
    assert not explained(sum(float(c @ c) for c in slow), sum(c.size for c in slow))
