"""Are coefficients of a hub covered whose readings are rounded, and whose resolution nobody stated?

    python -m tests.campaigns.rounded_readings

Three cells read three loads that press on all of them; readings are rounded to a share of full scale, with
noise that is a share of the step. Sessions of the same loads have zeros drawn anew. Counted is how often
D51's coefficients lie within their 95 % interval.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.uncertainty.common_errors import standard_errors

CELLS, LOADS, LARGEST, FULL = ("D51", "D52", "E5"), ("FX", "FY", "MZ"), (6000.0, 6000.0, 400.0), 2.0
_RESPONSE = np.array([[1.8, 0.03, -0.02], [0.04, 1.5, 0.05], [-0.03, 0.02, 2.1]]) / np.array(LARGEST)
TRUTH = np.linalg.inv(_RESPONSE)


def session(
    folder: Path, *, seed: int, step: float, noise: float, digits: int = 8, stated: bool = False
) -> Path:
    """Write a session of three runs; cells' zeros are drawn, so that loads do not fall on steps alike."""
    rng = np.random.default_rng(seed)
    zero = rng.uniform(-0.01, 0.01, 3)
    stretch = 1 + rng.uniform(-0.02, 0.02)  # weights that are not quite those of the last session
    lines = ["run,direction," + ",".join(f"{cell} [mV/V]" for cell in CELLS) + ",FX [N],FY [N],MZ [N*m]"]
    shares = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
    for run in (1, 2, 3):
        for axis, largest in enumerate(LARGEST):
            for share in (0.0, *shares, *-shares):
                load = np.zeros(3)
                load[axis] = stretch * share * largest
                read = _RESPONSE @ load + zero + rng.normal(0, noise, 3)
                read = np.round(read / step) * step if step else read
                values = [f"{value:.{digits}f}" for value in read] + [f"{value:.6f}" for value in load]
                lines.append(f"{run},up," + ",".join(values))
    folder.mkdir(parents=True)
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    cells = "".join(
        f'[cells.{name}]\nresolution = {{ value = {step}, unit = "mV/V" }}\n' for name in CELLS if stated
    )
    (folder / "SESSION.toml").write_text(
        'instrument = "hub"\ndate = 2026-01-05\noperator = "A"\nzero = "included"\n'
        f"indications = {list(CELLS)}\nloads = {list(LOADS)}\n".replace("'", '"')
        + 'data = "loads.csv"\n' + cells
    )  # fmt: skip
    return folder / "SESSION.toml"


def covered(*, step: float, noise: float, stated: bool, draws: int = 60) -> tuple[int, int]:
    """Return how many of D51's intervals hold the truth, of how many."""
    inside = 0
    with tempfile.TemporaryDirectory() as name:
        for seed in range(draws):
            folder = Path(name) / str(seed)
            path = session(folder / "s", seed=seed, step=step, noise=noise, stated=stated)
            record = calibrate(path, Registry(folder / "r")).record
            for at, load in enumerate(LOADS):
                off = abs(record.load(load).coefficients[0] - TRUTH[at, 0])
                inside += off <= 1.96 * standard_errors(record, load)[0]
    return int(inside), draws * len(LOADS)


def main() -> None:
    """Print a row for each size of step and noise."""
    sys.stdout.write("| step, % of full scale | noise / step | stated | held | % |\n|---|---|---|---|---|\n")
    for share, noise in ((5e-4, 0.01), (5e-4, 0.3), (5e-4, 1.0), (5e-3, 0.01), (5e-6, 100.0)):
        step = share * FULL
        for stated in (False, True):
            held, of = covered(step=step, noise=noise * step, stated=stated)
            sys.stdout.write(
                f"| {100 * share:g} | {noise:g} | {stated} | {held} of {of} | {100 * held / of:.1f} |\n"
            )


if __name__ == "__main__":
    main()
