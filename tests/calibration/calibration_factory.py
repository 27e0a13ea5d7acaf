"""Sessions of known truth: three cells to FY, MZ and MX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Rows: D51, D52, E5 in mV/V per 100 units of FY, MZ, MX. A plausible hub, not a measured one.
SENSITIVITY = np.array([[0.20, 0.30, 0.10], [0.25, -0.30, 0.15], [0.10, 0.05, -0.30]]) / 100
ZERO = np.array([0.012, -0.008, 0.02])
CELLS = ("D51", "D52", "E5")
LOADS = ("FY", "MZ", "MX")
UNITS = {"FY": "lbf", "MZ": "lbf*ft", "MX": "lbf*ft"}


def polarity_text(share: float = 0.8) -> str:
    """Return readings of one load each of known direction, a share of full scale, read to 0.1 %."""
    readings = []
    for at, (load, largest) in enumerate(zip(LOADS, (500.0, 100.0, 150.0), strict=True)):
        value = share * largest
        cells = zip(CELLS, (1.001 * SENSITIVITY[:, at] * value + ZERO).tolist(), strict=True)
        inner = ", ".join(f'{name} = {{ value = {one:.7f}, unit = "mV/V" }}' for name, one in cells)
        readings.append(
            f'{{ load = "{load}", value = {{ value = {value}, unit = "{UNITS[load]}" }}, '
            f"indications = {{ {inner} }} }}"
        )
    return f"[{', '.join(readings)}]"


def csv_text(names: list[str], values: NDArray[np.float64], *, runs: bool, digits: int = 7) -> str:
    header = names + (["run", "direction"] if runs else [])
    lines = [",".join(header)]
    for number, row in enumerate(values.tolist()):
        cells = [repr(round(value, digits)) for value in row]
        if runs:
            cells += [str(number // 20 + 1), "up" if number % 20 < 10 else "down"]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def hub_data(rows: int, seed: int, noise: float = 2e-5) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    loads = rng.uniform(-1, 1, (rows, 3)) * [500.0, 100.0, 150.0]
    cells = (
        loads @ SENSITIVITY.T + ZERO + rng.normal(0, noise, (rows, 3))
        if noise
        else loads @ SENSITIVITY.T + ZERO
    )
    return np.column_stack([cells, loads])


def session_text(**changes: str) -> str:
    entries = {
        "schema": "1",
        "instrument": '"hub"',
        "date": "2026-01-05",
        "operator": '"operator one"',
        "temperature": '{ value = 20.0, unit = "degC" }',
        "indications": '["D51", "D52", "E5"]',
        "loads": '["FY", "MZ", "MX"]',
        "data": '"loads.csv"',
        "check": '"check.csv"',
    } | changes
    # A reading names loads and cells: a session of others states its own.
    if not {"loads", "indications"} & changes.keys():
        entries.setdefault("polarity", polarity_text())
    return "\n".join(f"{key} = {value}" for key, value in entries.items() if value != "-") + "\n"


def write_session(
    place: Path,
    values: NDArray[np.float64] | None = None,
    *,
    check_rows: NDArray[np.float64] | None = None,
    tail: str = "",
    name: str = "session",
    digits: int = 7,
    **changes: str,
) -> Path:
    """Write a hub session: ``values`` replaces its rows, other keywords entries of SESSION.toml."""
    folder = place / name
    folder.mkdir(exist_ok=True)
    names = [f"{c} [mV/V]" for c in CELLS] + [f"{n} [{UNITS[n]}]" for n in LOADS]
    values = hub_data(60, 1) if values is None else values
    check = hub_data(9, 2) if check_rows is None else check_rows
    (folder / "loads.csv").write_text(csv_text(names, values, runs=True, digits=digits))
    (folder / "check.csv").write_text(csv_text(names, check, runs=False, digits=digits))
    path = folder / "SESSION.toml"
    path.write_text(session_text(**changes) + tail)
    return path
