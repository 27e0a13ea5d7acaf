"""Sizes and distances against a general optimiser and the noise's covariance written out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.optimize import least_squares

from proof.draw import draw_case
from proof.model import Noise, Scenario


def covariance(noise: Noise, n: int) -> np.ndarray:
    """Return the covariance of `n` rows of the noise, its correlations by the Yule-Walker equations."""
    a = noise.ar
    rho = np.ones(n)
    if len(a) == 0:
        rho[1:] = 0.0
    elif len(a) == 1:
        rho = a[0] ** np.arange(n)
    else:
        rho[1] = a[0] / (1 - a[1])
        for k in range(2, n):
            rho[k] = a[0] * rho[k - 1] + a[1] * rho[k - 2]
    return noise.sd**2 * toeplitz(rho)


def independent(s: Scenario, there: list[dict[str, np.ndarray]]) -> tuple[float, float]:
    """Return size and distance of outputs without noise, the declared simulation refitted within priors."""
    p = s.true_parameters()
    free = s.free()
    bare = [s.truth(run, p, {}) for run in s.runs]
    tables = [s.inputs(run) for run in s.runs]
    middle = [s.nominal(df, run, p) for df, run in zip(tables, s.runs, strict=True)]
    rows_of = {(k, m["t"].size) for m in tables for k in s.outputs}
    # the inverse of the covariance's triangle makes innovations of a run's rows
    white = {(k, n): np.linalg.inv(np.linalg.cholesky(covariance(s.noise[k], n))) for k, n in rows_of}

    def left(d: np.ndarray) -> list[dict[str, np.ndarray]]:
        q = p | {one.name: one.true + x * float(one.sd or 0.0) for one, x in zip(free, d, strict=True)}
        found = [s.nominal(df, run, q) for df, run in zip(tables, s.runs, strict=True)]
        return [
            {k: (t[k] - b[k]) - (f[k] - m[k]) for k in s.outputs}
            for t, b, f, m in zip(there, bare, found, middle, strict=True)
        ]

    def innovations(d: np.ndarray) -> np.ndarray:
        return np.concatenate([white[k, r[k].size] @ r[k] for r in left(d) for k in s.outputs])

    d = np.zeros(len(free))
    if free:
        d = least_squares(lambda x: np.concatenate([innovations(x), x]), d, bounds=(-3.0, 3.0)).x
    rows = left(d)
    size = max(
        float(np.sqrt(np.mean(np.concatenate([r[k] for r in rows]) ** 2))) / s.noise[k].sd for k in s.outputs
    )
    return size, float(np.linalg.norm(innovations(d)))


@pytest.mark.parametrize(
    ("family", "name"),
    [
        ("beam-python", "nonlinearity"),
        ("beam-columns", "thermal_drift"),
        ("drive-force", "quadratic_drag"),
        ("drive-force", "coulomb_friction"),
        ("tire-machine", "steer_compliance"),
        ("tire-columns", "relaxation"),
    ],
)
def test_size_and_distance_are_what_another_computation_finds(family: str, name: str) -> None:
    drawn = draw_case(31, 2, "single", compare=False, picked=(family, (name,)))
    s = drawn.scenario
    there = [s.truth(run, s.true_parameters(), drawn.effects) for run in s.runs]
    size, distance = independent(s, there)
    # the generator takes the parameters' influence as linear and the first rows of a run as uncorrelated
    assert drawn.answer["size"] == pytest.approx(size, rel=0.05)
    assert drawn.answer["distance"] == pytest.approx(distance, rel=0.05)
