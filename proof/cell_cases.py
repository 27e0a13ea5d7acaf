"""The same drum test as the machine writes it: three load cells, with the record of a session of their own.

Three cells at the corners of a triangle carry lateral force, aligning and overturning moment. The session's
loads are written here; the record is whatever the public command makes of them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from proof import specs, tire_cases
from proof.instruments import preisach
from proof.model import Array, Channel, Effects, EffectSpec, Noise, Params, Run, Scenario

CELLS = ("D51", "D52", "E5")
LBF, LBF_FT = 4.4482216152605, 1.3558179483314004
CELL_EFFECTS = (
    "channel_swap", "channel_sign", "sensitivity_error", "zero_offset", "zero_drift", "thermal_drift",
    "hysteresis", "nonlinearity",
)  # fmt: skip


def geometry(rng: np.random.Generator) -> Array:
    """Return FY [lbf], MZ and MX [lbf·ft] per indicated lbf of D51, D52, E5.

    The levers are the drawing's, the sensitivities within 2 %.
    """
    half, radius = 0.0866 / 0.3048, 0.1 / 0.3048
    levers = np.array([[1.0, 1.0, 1.0], [-half, half, 0.0], [radius / 2, radius / 2, -radius]])
    return levers * rng.uniform(0.98, 1.02, 3)


def disturbed(
    name: str, p: Mapping[str, Any], cells: dict[str, Array], run: Run, kelvin: Array
) -> dict[str, Array]:
    """Return the cells' indications [lbf] after one effect of a cell."""
    out = dict(cells)
    at = p["channel"]
    y = cells[at]
    if name == "channel_swap":
        out[at], out[p["with"]] = cells[p["with"]], y
    elif name == "channel_sign":
        out[at] = -y
    elif name == "sensitivity_error":
        out[at] = y * (1 + p["gain_error"])
    elif name == "zero_offset":
        out[at] = y + p["offset"]
    elif name == "zero_drift":
        out[at] = y + p["rate"] * run.rows / 60
    elif name == "thermal_drift":
        out[at] = y + p["coefficient"] * (kelvin - 23.0)
    elif name == "hysteresis":
        out[at] = y + p["width"] * preisach(y, p["full_scale"])
    elif name == "nonlinearity":
        out[at] = y + p["full_scale"] * p["quadratic"] * (y / p["full_scale"]) ** 2
    else:
        raise KeyError(name)
    return out


def _specs(rng: np.random.Generator, full: float) -> dict[str, EffectSpec]:
    sign = lambda: float(rng.choice([-1.0, 1.0]))  # noqa: E731
    spec, same = specs.spec, specs.same
    scale = {"full_scale": full}
    return specs.table([
        spec("channel_swap", {"channel": "D51", "with": "D52"}, "", channel="D51"),
        spec("channel_sign", {"channel": "E5"}, "", channel="E5"),
        *specs.on("D52", [
            spec("sensitivity_error", {"channel": "D52", "gain_error": 0.03 * sign()}, "gain_error",
                 reported=same("gain_error")),
            spec("thermal_drift", {"channel": "D52", "coefficient": 2.0 * sign()}, "coefficient",
                 reported=same("coefficient")),
        ]),
        *specs.on("E5", [
            spec("zero_offset", {"channel": "E5", "offset": 6.0 * sign()}, "offset", reported=same("offset")),
            spec("zero_drift", {"channel": "E5", "rate": 2.0 * sign()}, "rate", reported=same("rate")),
        ]),
        *specs.on("D51", [
            # The loop's height within the range that a cell happens to see is not worked out here.
            spec("hysteresis", {"channel": "D51", "width": 12.0} | scale, "width"),
            spec("nonlinearity", {"channel": "D51", "quadratic": 0.02 * sign()} | scale, "quadratic"),
        ]),
    ])  # fmt: skip


def session_files(rng: np.random.Generator, matrix: Array, *, date: str = "2026-03-02") -> dict[str, str]:
    """Return SESSION.toml with its loads and check loads: combined loads on the true cells."""
    back = np.linalg.inv(matrix)

    def rows(n: int) -> pd.DataFrame:
        loads = np.column_stack(
            [rng.uniform(-1500, 1500, n), rng.uniform(-120, 120, n), rng.uniform(-250, 250, n)]
        )
        cells = loads @ back.T + rng.normal(0, 0.05, (n, 3))
        names = [f"{c} [lbf]" for c in CELLS] + ["FY [lbf]", "MZ [lbf*ft]"]
        return pd.DataFrame(np.column_stack([cells, loads[:, :2]]), columns=pd.Index(names))

    data = rows(60)
    data["run"] = np.repeat([1, 2, 3], 20)
    data["direction"] = np.where(np.arange(60) % 20 < 10, "up", "down")
    text = """schema = 1
instrument = "m15"
date = DATE
operator = "bench"
temperature = { value = 21.0, unit = "degC" }
indications = ["D51", "D52", "E5"]
loads = ["FY", "MZ"]
data = "loads.csv"
check = "check.csv"
zero = "included"

[reference]
standard = "reference loads of the bench"
certificate = "none"

[reference.uncertainty]
FY = { U = 0.1, k = 2, unit = "lbf" }
MZ = { U = 0.02, k = 2, unit = "lbf*ft" }
"""
    return {
        "SESSION.toml": text.replace("DATE", date),
        "loads.csv": data.to_csv(index=False, float_format="%.6f"),
        "check.csv": rows(9).to_csv(index=False, float_format="%.6f"),
    }


def build(rng: np.random.Generator, needs: frozenset[str]) -> Scenario:
    """Return a drum test whose recording has the cells' indications in lbf."""
    made = tire_cases.build(rng, kind="machine", needs=needs, cells=True)
    matrix = geometry(rng)
    back = np.linalg.inv(matrix)
    peak = max(float(np.abs(made.truth(r, made.true_parameters(), {})["FY"]).max()) for r in made.runs) / LBF

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        of_cells = {k: v for k, v in e.items() if v.get("channel") in CELLS}
        fine = made.truth(run, p, {k: v for k, v in e.items() if k not in of_cells})
        fy, mz = fine["FY"] / LBF, fine["MZ"] / LBF_FT
        fz = np.interp(run.rows, run.fine["t"], run.fine["FZ"]) / LBF
        # the overturning moment of a tire on its hub, as Figure 4.4 shows it
        mx = (28.9 + 0.229 * fy - 0.0035 * fz) / 0.3048
        cells = dict(zip(CELLS, back @ np.vstack([fy, mz, mx]), strict=True))
        kelvin = np.interp(run.rows, run.fine["t"], run.fine["T_AMBIENT"])
        for name, q in of_cells.items():
            cells = disturbed(name, q, cells, run, kelvin)
        fy, mz, mx = matrix @ np.vstack([cells[c] for c in CELLS])
        return {"FY": fy * LBF, "MZ": mz * LBF_FT, "MX": mx * LBF_FT}

    def written(y: dict[str, Array]) -> dict[str, Array]:
        loads = np.vstack([y["FY"] / LBF, y["MZ"] / LBF_FT, y["MX"] / LBF_FT])
        return dict(zip(CELLS, back @ loads, strict=True))

    sd = made.noise["FY"].sd
    channels = {k: v for k, v in made.channels.items() if k not in ("FY", "MZ")}
    channels |= {c: Channel(unit="lbf", role="output") for c in CELLS}
    tire_level = {k: v for k, v in made.effects.items() if v.channel is None}
    return dataclasses.replace(
        made, family="tire-cells", simulation=dict(made.simulation) | {"calibration": "record.json"},
        channels=channels, truth=truth, written=written, sessions=(session_files(rng, matrix),),
        noise=dict(made.noise) | {"MX": Noise(sd=0.02 * sd, ar=made.noise["FY"].ar)},
        effects=tire_level | _specs(rng, peak * math.sqrt(0.5)),
    )  # fmt: skip
