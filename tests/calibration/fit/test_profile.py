"""Scatter that grows with the indications: the profile of a point, and budgets of weighted rows by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.calibration.fit.test_readings import LEVELS
from toolkit.calibration.fit.profile import Profile, shown_profile
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.uncertainty.budget import calibration_budget


def test_a_profile_that_its_form_has_comes_back_exactly() -> None:
    x = np.linspace(-2, 2, 41)
    squares = 0.04 + 0.3 * np.abs(x) + 0.5 * x**2
    profile = Profile.of({"S": x}, squares, 1e-9)
    at = np.array([0.0, 0.33, -1.7])
    expected = 0.04 + 0.3 * np.abs(at) + 0.5 * at**2
    assert profile.at({"S": at}) == pytest.approx(expected, rel=1e-6)


def test_residuals_alike_show_no_profile_and_growing_ones_do() -> None:
    rng = np.random.default_rng(3)
    x = np.tile(np.linspace(-1, 1, 25), 6)
    told = sum(shown_profile({"S": x}, rng.normal(size=150)) is not None for _ in range(200))
    assert told <= 8  # at a risk of 1 %: more than 8 of 200 by chance once in ten thousand times
    sd = shown_profile({"S": x}, rng.normal(size=150) * (0.02 + np.abs(x)))
    assert sd is not None
    assert sd[x == 1.0][0] / sd[np.abs(x) < 1e-9][0] > 5


def test_repeatability_of_weighted_rows_follows_their_stated_uncertainty(tmp_path: Path) -> None:
    # Rows scatter by 0.02 N + 0.2 % of the load, as they state.
    rng = np.random.default_rng(5)
    lines = ["S [mV/V],F [N],u_F [N],run,direction"]
    for run in (1, 2, 3):
        for force in (*LEVELS, *(-level for level in LEVELS)):
            u = 0.02 + 0.002 * abs(force)
            lines.append(f"{0.002 * (force + rng.normal(0, u)):.9f},{force},{u},{run},up")
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "loads.csv").write_text("\n".join(lines) + "\n")
    path = tmp_path / "s" / "SESSION.toml"
    path.write_text(
        'instrument = "cell"\ndate = 2026-01-05\noperator = "A"\nindications = ["S"]\nloads = ["F"]\n'
        'data = "loads.csv"\nmethod = "wls"\n'
    )
    registry = Registry(tmp_path / "cal")
    record = calibrate(path, registry).record
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    for at, u in ((0.0, 0.02), (500.0, 1.02), (1000.0, 2.02)):
        component = calibration_budget(record, loads, None, "F", at).component("repeatability")
        assert component.u == pytest.approx(u, rel=0.25), at


@pytest.mark.parametrize("runs", [1, 3])
def test_coefficients_of_a_plain_fit_are_as_sure_as_rows_that_scatter_unlike_make_them(
    tmp_path: Path, runs: int
) -> None:
    """Rows scatter by 0.02 N + 0.4 % of the load and nothing states it: A diag(s^2) A^T with the drawn s.

    By one variance for all rows the slope of a line would be too sure by the root
    of sum(x^2 s^2) / (sum(x^2) mean(s^2)).
    """
    levels = np.array([*LEVELS, *(-level for level in LEVELS)], dtype=float)
    force = np.tile(np.repeat(levels, 10 // runs), runs)
    run = np.repeat(np.arange(1, runs + 1), len(force) // runs)
    s = 0.02 + 0.004 * np.abs(force)
    X = np.column_stack([0.002 * force, np.ones(len(force))])
    A = np.linalg.pinv(X)
    true = np.sqrt(np.diag((A * s**2) @ A.T))
    alike = np.sqrt(np.diag(A @ A.T) * np.mean(s**2))
    assert true[0] > 1.2 * alike[0]
    assert true[1] == pytest.approx(alike[1], rel=0.1)
    ratios = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        shown = 0.002 * (force + rng.normal(0, s))
        lines = ["S [mV/V],F [N],run,direction"]
        lines += [f"{x:.9f},{f},{r},up" for x, f, r in zip(shown, force, run, strict=True)]
        (tmp_path / f"{seed}").mkdir()
        (tmp_path / f"{seed}" / "loads.csv").write_text("\n".join(lines) + "\n")
        path = tmp_path / f"{seed}" / "SESSION.toml"
        path.write_text(
            'instrument = "cell"\ndate = 2026-01-05\noperator = "A"\nindications = ["S"]\nloads = ["F"]\n'
            'data = "loads.csv"\n'
        )
        registry = Registry(tmp_path / f"cal{seed}")
        calibrate(path, registry)
        (entry,) = registry.load("cell-r1").loads  # loaded: refitted from its rows by another algorithm
        ratios.append(np.array(entry.standard_errors)[0] / true[0])
    # The mean of eight estimates; three runs widen it by what their differences may hide.
    assert 0.9 < float(np.mean(ratios)) < 1.35
