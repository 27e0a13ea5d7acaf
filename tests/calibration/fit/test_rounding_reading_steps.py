"""A step that nobody states is seen in the readings, and digits that were only printed are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.campaigns.rounded_readings import FULL, covered, session
from toolkit.calibration.fit.rounding import reading_step
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry

RNG = np.random.default_rng(4)
READINGS = RNG.uniform(-2, 2, 60)


@pytest.mark.parametrize("step", [0.01, 0.001, 1 / 150, 2.5e-4])
@pytest.mark.parametrize("digits", [6, 12])
def test_the_step_of_rounded_readings_is_found(step: float, digits: int) -> None:
    found = reading_step(np.round(np.round(READINGS / step) * step, digits), None)
    assert found == pytest.approx(step, rel=1e-4)


def test_runs_may_have_zeros_of_their_own() -> None:
    run = np.repeat([1.0, 2.0, 3.0], 20)
    zeros = np.repeat(RNG.uniform(0, 1, 3), 20)
    found = reading_step(np.round(READINGS / 0.01) * 0.01 + zeros, run)
    assert found == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("readings", [READINGS, READINGS.astype(np.float32).astype(float), np.zeros(9)])
def test_readings_that_lie_anywhere_have_no_step(readings: np.ndarray) -> None:
    assert reading_step(readings, None) is None


def rules(folder: Path, *, step: float, noise: float, digits: int = 8) -> set[str]:
    candidate = calibrate(
        session(folder / "s", seed=3, step=step, noise=noise, digits=digits), Registry(folder / "r")
    )
    assert all((cell.step is not None) == (step > 0) for cell in candidate.record.cells)
    return {finding.rule for finding in candidate.findings}


def test_a_found_step_counts_as_the_resolution_and_is_told(tmp_path: Path) -> None:
    assert "resolution-found" in rules(tmp_path, step=5e-4 * FULL, noise=1e-5)


@pytest.mark.parametrize("digits", [4, 6, 8])
def test_printed_digits_below_the_scatter_are_no_step(tmp_path: Path, digits: int) -> None:
    assert "resolution-found" not in rules(tmp_path, step=0.0, noise=1e-3, digits=digits)


def test_a_record_with_a_found_step_loads_again_and_covers(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "r")
    record = calibrate(session(tmp_path / "s", seed=3, step=5e-4 * FULL, noise=1e-5), registry).record
    assert registry.load(record.id).cells == record.cells
    held, of = covered(step=5e-4 * FULL, noise=1e-5, stated=False, draws=20)
    assert held >= 0.88 * of
