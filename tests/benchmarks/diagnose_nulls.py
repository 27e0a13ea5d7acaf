"""False alarms of the diagnosis on clean recordings, and its processor time a recording.

A tire in four runs of 1 500 rows, two outputs, noise white, AR(0.9) or AR(0.99); nothing is left out but the
two parameters' true values, which lie within their priors. An alarm is a name or an *unknown*. `--pairs 7`
draws 203 recordings; the figure is printed with its exact 95 % interval.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import row
from tests.diagnosis.case_text import case_text

_COLOURS = (0.0, 0.9, 0.99)
_ROWS, _STEP = 1500, 0.02  # of a run; s

_SIMULATOR = """
import numpy as np, pandas as pd

def simulate(inputs, p):
    a, load = np.deg2rad(inputs["SA"].to_numpy()), inputs["FZ"].to_numpy()
    D = p["mu"] * load * (1 - 0.05 * (load - 4000) / 4000)
    B = p["K"] * np.sin(2 * np.arctan(load / 5000)) / (1.3 * D)
    FY = -D * np.sin(1.3 * np.arctan(B * a - 0.2 * (B * a - np.arctan(B * a))))
    return pd.DataFrame({"FY": FY, "MZ": -FY * 0.03 * np.cos(1.1 * np.arctan(6 * a))})
"""
_CASE = case_text(
    "python",
    parameters={"mu": (1.0, "1", 0.05), "K": (60000.0, "N/rad", 3000.0)},
    inputs={"SA": "deg", "FZ": "N", "V": "m/s"},
    outputs={"FY": "N", "MZ": "N*m"},
    axes="SAE",
)


def run(folder: Path, pairs: int) -> list[dict[str, object]]:
    """Return alarms and processor time of some thirty clean recordings a pair."""
    from scipy.stats import beta

    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose

    count, alarms = 29 * pairs, 0
    seconds: list[float] = []
    for i in range(count):
        path = draw(folder / f"null{i}", _COLOURS[i % len(_COLOURS)], seed=i)
        began = time.process_time()
        answer = diagnose(read_case(path), None).diagnosis
        seconds.append(time.process_time() - began)
        alarms += answer.verdict in ("named", "equivalent", "unknown")
    upper = float(beta.ppf(0.975, alarms + 1, count - alarms)) if alarms < count else 1.0
    what = f"diagnose: {alarms} alarms in {count} nulls (to {100 * upper:.1f} %)"
    return [row(what, seconds, "none: processor time of one, 6 000 rows", None, "2 %")]


def draw(folder: Path, phi: float, *, seed: int) -> Path:
    """Write one clean recording and its case, the noise AR(phi); return the case."""
    import pandas as pd
    from scipy.signal import lfilter

    folder.mkdir(parents=True)
    (folder / "sim.py").write_text(_SIMULATOR)
    space: dict[str, object] = {}
    exec(_SIMULATOR, space)  # noqa: S102  the text above
    rng = np.random.default_rng([20261121, seed])
    case = _CASE
    for k, (rate, speed) in enumerate(((2, 2.1), (4, 2.1), (2, 4.0), (6, 4.0))):
        t = np.arange(_ROWS) * _STEP
        table = pd.DataFrame({
            "t": t, "SA": 8 * np.sin(2 * np.pi * t * rate / 32),
            "FZ": 2000.0 + 1500 * (np.floor(t / 7.5) % 3), "V": speed,
        })  # fmt: skip
        made = space["simulate"](table, {"mu": 0.97, "K": 61000.0})  # type: ignore[operator]
        for name, sd in (("FY", 20.0), ("MZ", 1.0)):
            white = rng.normal(size=_ROWS + 500)
            table[name] = made[name] + sd * np.sqrt(1 - phi**2) * lfilter([1], [1, -phi], white)[500:]
        table.round(5).to_csv(folder / f"run{k}.csv", index=False)
        case += f'[[recording.run]]\nfile = "run{k}.csv"\n'
    path = folder / "case.toml"
    path.write_text(case)
    return path
