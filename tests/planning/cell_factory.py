"""A single force cell of known truth: its session on disk, and what a plan knows of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.calibration.control.calibrate import rehearse
from toolkit.calibration.registry.registry import Registry
from toolkit.planning.knowledge import Knowledge

FULL, SPAN = 50_000.0, 2.0  # N, mV/V
NOISE, ZERO, GAIN = 2e-5, 3e-5, 5e-5  # of full scale: readings, and the runs' zeros and gains


def readings(rng: np.random.Generator, loads: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Return indications [mV/V] of loads [N]; every run has a zero and a gain of its own."""
    zero, gain = (rng.normal(0, size, int(run.max()) + 1)[run] for size in (ZERO, GAIN))
    share = loads / FULL
    return np.asarray(SPAN * (share * (1 + gain) + zero + rng.normal(0, NOISE, len(loads))))


def session(folder: Path, *, levels: int = 11, runs: int = 3, seed: int = 1) -> Path:
    """Write a session from zero to full scale and back in steps, in several runs."""
    up = np.linspace(0, FULL, levels)
    one = np.concatenate([up, up[-2::-1]])
    loads, run = np.tile(one, runs), np.repeat(np.arange(runs), len(one))
    way = np.tile(np.repeat(["up", "down"], [levels, levels - 1]), runs)
    shown = readings(np.random.default_rng(seed), loads, run)
    rows = zip(run.tolist(), way.tolist(), shown.tolist(), loads.tolist(), strict=True)
    lines = [f"{r + 1},{w},{y:.7f},{x:g}" for r, w, y, x in rows]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "loads.csv").write_text("\n".join(["run,direction,S [mV/V],FZ [N]", *lines]) + "\n")
    (folder / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "cell50"\ndate = 2026-03-02\noperator = "first person"\n'
        'temperature = { value = 21.5, unit = "degC" }\n'
        'indications = ["S"]\nloads = ["FZ"]\ndata = "loads.csv"\nzero = "included"\nmodel = "linear"\n'
    )
    return folder / "SESSION.toml"


def knowledge(folder: Path, **settings: int) -> Knowledge:
    """Return what a plan knows of the cell."""
    candidate = rehearse(session(folder / "session", **settings), Registry(folder / "calibrations"))
    found = candidate.fit.session
    return Knowledge.of(candidate.record, found.table, found.check)


def fixtures(*, sign: float = 1.0, both: bool = False, limit: float | None = None) -> str:
    """Return a stack of ten weights up to full scale, as a file of fixtures."""
    weights = ", ".join(f"{weight:g}" for weight in np.linspace(FULL / 10, FULL, 10))
    return (
        'schema = 1\ninstrument = "cell50"\n'
        + ("" if limit is None else f'[limit]\nFZ = {{ value = {limit}, unit = "N" }}\n')
        + f'[[fixture]]\nname = "stack"\nper_newton = {{ FZ = {sign} }}\n'
        f'weights = {{ value = [{weights}], unit = "N" }}\nboth = {str(both).lower()}\n'
    )
