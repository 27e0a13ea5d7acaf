"""Small cases as an outsider writes them: a carriage with dry friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tests.diagnosis.case_text import case_text
from tests.golden.cases import CARRIAGE_CASE as HEAD

SIMULATOR = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": p["mass"] * inputs["a"] + p["c"] * inputs["v"]})
"""
ONE = '[[recording.run]]\nfile = "r0.csv"\n'
TWO = ONE + '[[recording.run]]\nfile = "r1.csv"\n'


def carriage(
    *, seed: int = 0, rows: int = 80, coulomb: float = 20.0, drag: float = 0.0, noise: float = 2.0
) -> pd.DataFrame:
    """Return mass 95 kg, 200 N s/m, a dry friction and a drag, driven by two sines."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * 0.1
    v = 0.2 * np.sin(1.3 * t + seed) + 0.1 * np.sin(3.1 * t)
    a = 0.26 * np.cos(1.3 * t + seed) + 0.31 * np.cos(3.1 * t)
    force = 95 * a + 200 * v + coulomb * np.sign(v) + drag * v * np.abs(v) + rng.normal(0, noise, rows)
    return pd.DataFrame({"t": t, "v": v, "a": a, "F": force})


def write_case(
    folder: Path, toml: str | bytes = HEAD + TWO, *, simulator: str | None = SIMULATOR, **files: object
) -> Path:
    """Write a case, its simulator, two runs and further files (name with ``__`` for the dot)."""
    folder.mkdir(parents=True, exist_ok=True)
    given = {"r0__csv": carriage(seed=0), "r1__csv": carriage(seed=1), **files}
    for name, content in given.items():
        path = folder / name.replace("__", ".")
        if isinstance(content, pd.DataFrame):
            content.to_csv(path, index=False)
        elif isinstance(content, bytes):
            path.write_bytes(content)
        elif content is not None:
            path.write_text(str(content), encoding="utf-8")
    if simulator is not None:
        (folder / "sim.py").write_text(simulator, encoding="utf-8")
    case = folder / "CASE.toml"
    case.write_bytes(toml if isinstance(toml, bytes) else toml.encode())
    return case


CELL = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["gain"] * inputs["L"]})
"""


def cell_case(gain_sd: float, **covariates: str) -> str:
    """A load cell F under a known load L, its gain known to ``gain_sd``; without its runs."""
    others = {name: {"unit": unit, "role": "covariate"} for name, unit in covariates.items()}
    gain = {"gain": (1.0, "1", gain_sd)}
    return case_text("python", parameters=gain, inputs={"L": "N"}, others=others, outputs={"F": "N"})
