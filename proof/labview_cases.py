"""Files as the machine's own program writes them: cells beside the FY and MZ that it computed from them.

One file a slip angle, loads ascending, no time. What can be wrong is the program's: a sign, a swap, a unit.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd

from proof import cell_cases, specs
from proof import tire_steady as steady
from proof.model import Array, Channel, Effects, Noise, Params, Run, Scenario

HEADER = ("FZ load", "D52 (Filtered)", "D51 (Filtered)", "E5 (Filtered)", "SA (Filtered)", "Fy", "Mz")
COLUMNS = ("FZ", "D52", "D51", "E5", "SA", "FY", "MZ")
LOADS = (250.0, 567.0, 833.0, 1101.0, 1372.0)
ANGLES = (0.0, 1.0, -1.0, -2.0, 4.0, -6.0)
DIGITS = {"FY": 4, "MZ": 5}
_BORN = (2026, 3, 2, 0, 0, 0)


def write_xlsx(df: pd.DataFrame, path: Path) -> None:
    """Write a recording in the columns of the machine's program, the same bytes for the same numbers."""
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(list(HEADER))
    for row in df[list(COLUMNS)].itertuples(index=False):
        sheet.append([float(x) for x in row])
    raw = io.BytesIO()
    book.save(raw)
    with zipfile.ZipFile(raw) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "docProps/core.xml":
                data = re.sub(rb"\d{4}-\d\d-\d\dT[\d:]+Z", b"2026-03-02T00:00:00Z", data)
            new.writestr(zipfile.ZipInfo(name, _BORN), data, zipfile.ZIP_DEFLATED)


def _runs(rng: np.random.Generator, rows: int) -> list[Run]:
    out = []
    for i, angle in enumerate((*ANGLES, 8.0)):
        n = rows * len(LOADS)
        load = np.repeat(LOADS, rows) * rng.uniform(0.98, 1.02) + rng.normal(0, 0.6, n)
        sa = np.full(n, angle - 0.3) + rng.normal(0, 2e-4, n)
        name = f"run{i + 1:02d}.xlsx" if i < len(ANGLES) else "more01.csv"
        t = np.arange(n, dtype=float)
        turned = {"rotation": "reverse" if i % 3 == 2 else "forward"}
        out.append(Run(name=name, fine={"t": t, "SA": sa, "FZ": load}, rows=t, conditions=turned))
    return out


def _fitted(session: Mapping[str, str]) -> Array:
    """Return the coefficients (D51, D52, E5, zero x FY, MZ) of a session's loads."""
    bench = pd.read_csv(io.StringIO(session["loads.csv"]))
    terms = np.column_stack([bench[[f"{c} [lbf]" for c in cell_cases.CELLS]], np.ones(len(bench))])
    return np.linalg.lstsq(terms, bench[["FY [lbf]", "MZ [lbf*ft]"]].to_numpy(), rcond=None)[0]


def build(rng: np.random.Generator, needs: frozenset[str]) -> Scenario:
    """Return recordings of a steady test; the record of a session is what the program should have used.

    An older session of the same machine, before two of its cells were exchanged, stands in the registry too.
    A wrong calibration is that older record; where `needs` has "sign", a record with the sign of E5 wrong.
    """
    tire = steady.draw_magic_formula(rng, pressure=False)
    matrix = cell_cases.geometry(rng)
    back = np.linalg.inv(matrix)
    exchanged = 1 + rng.uniform(0.004, 0.04, 3) * rng.choice([-1.0, 1.0], 3) * rng.permutation([1, 1, 0])
    old = cell_cases.session_files(rng, matrix * exchanged, date="2025-02-11")
    session = cell_cases.session_files(rng, matrix)
    fitted, other = _fitted(session), _fitted(old)
    if "sign" in needs:
        other = fitted * np.array([[1.0], [1.0], [-1.0], [1.0]])
    runs = _runs(rng, 12)
    tares = {run.name: np.repeat(rng.uniform(-1, 1, len(LOADS)), 12) for run in runs}

    def cells_of(run: Run) -> Array:
        sign = -1.0 if run.conditions["rotation"] == "reverse" else 1.0
        fz = run.fine["FZ"]
        fy, mz = tire.forces(np.radians(run.fine["SA"]), fz * cell_cases.LBF, steady.Scales())
        fy, mz = sign * fy / cell_cases.LBF, mz / cell_cases.LBF_FT
        mx = (28.9 + 0.229 * fy - 0.0035 * fz) / 0.3048
        return np.round(back @ np.vstack([fy, mz, mx]), 5)

    def inputs(run: Run) -> pd.DataFrame:
        cells = dict(zip(cell_cases.CELLS, cells_of(run), strict=True))
        return pd.DataFrame({"t": run.rows, "FZ": run.fine["FZ"], "SA": run.fine["SA"], **cells})

    def computed(cells: Array, by: Array = fitted) -> dict[str, Array]:
        fy, mz = by[:3].T @ cells + by[3][:, None]
        return {"FY": fy, "MZ": mz}

    def nominal(df: pd.DataFrame, _run: Run, _p: Params) -> dict[str, Array]:
        return computed(df[list(cell_cases.CELLS)].to_numpy().T)

    def truth(run: Run, _p: Params, e: Effects) -> dict[str, Array]:
        cells = cells_of(run)
        if "channel_sign" in e:
            cells = cells * np.array([[1.0], [1.0], [-1.0]])
        if "channel_swap" in e:
            cells = cells[[1, 0, 2]]
        out = computed(cells, other if "wrong_calibration" in e else fitted)
        if "hidden_tare" in e:  # the program took another zero at every load, of FY alone
            out["FY"] = out["FY"] + e["hidden_tare"]["spread"] * tares[run.name]
        if "unit_error" in e:
            out["MZ"] = out["MZ"] * e["unit_error"]["factor"]
        return {k: np.round(y, DIGITS[k]) for k, y in out.items()}

    unit = {"FZ": "lbf", "D51": "lbf", "D52": "lbf", "E5": "lbf", "SA": "deg"}
    channels = {k: Channel(unit=v, role="input") for k, v in unit.items()}
    channels |= {"FY": Channel(unit="lbf", role="output"), "MZ": Channel(unit="lbf*ft", role="output")}
    rows = [
        specs.spec("channel_sign", {"channel": "E5"}, "", channel="E5"),
        specs.spec("channel_swap", {"channel": "D51", "with": "D52"}, "", channel="D51"),
        specs.spec("wrong_calibration", {}, ""),
        specs.spec("hidden_tare", {"spread": float(np.exp(rng.uniform(np.log(0.05), np.log(2))))}, ""),
        specs.spec("unit_error", {"channel": "MZ", "factor": cell_cases.LBF_FT}, "", channel="MZ"),
    ]
    return Scenario(
        family="labview", kind="machine", title="A steady test as the machine's program wrote it",
        simulation={"kind": "machine", "machine": "m15", "calibration": "record.json"}, files={},
        parameters=(),
        channels=channels, outputs=("FY", "MZ"), runs=tuple(runs[:-1]), predict=tuple(runs[-1:]),
        noise={k: Noise(sd=10.0**-d / 12**0.5) for k, d in DIGITS.items()}, inputs=inputs, nominal=nominal,
        truth=truth, effects=specs.table(rows), axes="machine", sessions=(old, session),
        timeless=True,
    )  # fmt: skip
