"""Calibration sessions of known truth, one for each way in which a session can be fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CELLS = ("D51", "D52", "E5")
LOADS = ("FY", "MZ", "MX")
UNITS = {"FY": "lbf", "MZ": "lbf*ft", "MX": "lbf*ft", "D51": "mV/V", "D52": "mV/V", "E5": "mV/V"}
# Rows: D51, D52, E5 in mV/V per 100 units of FY, MZ, MX. A plausible hub, not a measured one.
SENSITIVITY = np.array([[0.20, 0.30, 0.10], [0.25, -0.30, 0.15], [0.10, 0.05, -0.30]]) / 100
ZERO = np.array([0.012, -0.008, 0.02])
FULL_SCALE = np.array([500.0, 100.0, 150.0])
_UNCERTAINTY = "\n[reference.uncertainty]\n" + "".join(
    f'{load} = {{ U = {U}, k = 2, unit = "{unit}" }}\n'
    for load, U, unit in (("FY", 0.4, "N"), ("MZ", 0.02, "N*m"), ("MX", 0.02, "lbf*ft"))
)
_CELLS_KNOWN = "".join(
    f"[cells.{name}]\n{key} = 1e-5\n" for name, key in (("D51", "u"), ("D52", "resolution"), ("E5", "u"))
)


def hub_rows(rows: int, seed: int, *, zero: Array = ZERO, bend: float = 0.0) -> Array:
    """Return (rows, 6): three indications [mV/V] with noise and a quadratic share, then FY, MZ, MX."""
    rng = np.random.default_rng(seed)
    loads = rng.uniform(-1, 1, (rows, 3)) * FULL_SCALE
    strain = loads @ SENSITIVITY.T
    return np.column_stack([strain + bend * strain**2 + zero + rng.normal(0, 2e-5, (rows, 3)), loads])


def _text(names: list[str], values: Array, *, runs: bool, separator: str = ",", decimal: str = ".") -> str:
    lines = [separator.join(names + (["run", "direction"] if runs else []))]
    for number, row in enumerate(values.tolist()):
        cells = [repr(round(value, 7)).replace(".", decimal) for value in row]
        if runs:
            cells += [str(number // 20 + 1), "up" if number % 20 < 10 else "down"]
        lines.append(separator.join(cells))
    return "\n".join(lines) + "\n"


def _polarity() -> str:
    """Return a reading of 80 % of each load alone, of known direction."""
    readings = []
    for at, load in enumerate(LOADS):
        value = 0.8 * FULL_SCALE[at]
        cells = 1.001 * SENSITIVITY[:, at] * value + ZERO
        inner = ", ".join(
            f'{name} = {{ value = {cell:.7f}, unit = "mV/V" }}'
            for name, cell in zip(CELLS, cells, strict=True)
        )
        readings.append(
            f'{{ load = "{load}", value = {{ value = {value}, unit = "{UNITS[load]}" }}, '
            f"indications = {{ {inner} }} }}"
        )
    return f"[{', '.join(readings)}]"


def hub_session(
    *, settings: str = "", tables: str = "", rows: Array | None = None, check: Array | None = None,
    newtons: bool = False, decimal: str = ".", weighted: bool = False,
) -> dict[str, str]:  # fmt: skip
    """Return the files of a three-axis session.

    ``newtons``: in kN and kN*m, with ``decimal``; ``weighted``: with the standard uncertainty of each load.
    """
    values = hub_rows(60, 1) if rows is None else rows
    checks = hub_rows(9, 2) if check is None else check
    units = dict(UNITS)
    separator = ";" if decimal == "," else ","
    if newtons:
        scale = np.array([1, 1, 1, 4.4482216152605e-3, 1.3558179483314e-3, 1.3558179483314e-3])
        values, checks = values * scale, checks * scale
        units |= {"FY": "kN", "MZ": "kN*m", "MX": "kN*m"}
    names = [f"{name} [{units[name]}]" for name in (*CELLS, *LOADS)]
    if weighted:
        u = 0.01 + 2e-4 * np.abs(values[:, 3:])
        loads = _text(
            [*names, *(f"u_{load} [{units[load]}]" for load in LOADS)], np.hstack([values, u]), runs=True
        )
    else:
        loads = _text(names, values, runs=True, separator=separator, decimal=decimal)
    head = (
        'schema = 1\ninstrument = "hub"\ndate = 2026-01-05\noperator = "operator one"\n'
        'temperature = { value = 20.0, unit = "degC" }\nindications = ["D51", "D52", "E5"]\n'
        f'loads = ["FY", "MZ", "MX"]\ndata = "loads.csv"\ncheck = "check.csv"\npolarity = {_polarity()}\n'
    )
    return {
        "SESSION.toml": head + settings + tables,
        "loads.csv": loads,
        "check.csv": _text(names, checks, runs=False, separator=separator, decimal=decimal),
    }


def _own_zeros(values: Array) -> Array:
    """Return rows whose run of twenty has a zero of its own."""
    moved = values.copy()
    moved[:, :3] += np.array([[0.0, 0.1, -0.2], [0.3, -0.1, 0.05], [-0.2, 0.2, 0.1]])[np.arange(60) // 20]
    return moved


def _tared(rows: int, seed: int) -> Array:
    values = hub_rows(rows, seed, zero=np.zeros(3))
    values[::10, 3:] = 0.0
    values[::10, :3] = np.random.default_rng(seed + 100).normal(0, 2e-5, values[::10, :3].shape)
    return values


def balance_session() -> dict[str, str]:
    """Return a two-axis balance with tares in its three runs (AIAA R-091 form)."""
    full = np.array([1000.0, 600.0])
    # Per unit of full scale, in mV/V: linear, |F|, F^2, F|F|, product, zero.
    truth = np.array([
        [1.20, 0.05, 0.004, 0.001, 0.006, -0.003, 0.002, 0.001, 0.005, 0.010],
        [-0.04, 0.90, 0.001, -0.002, 0.003, 0.008, -0.001, 0.003, -0.004, -0.020],
    ])  # fmt: skip

    def responses(loads: Array) -> Array:
        x, y = (loads / full).T
        columns = [x, y, abs(x), abs(y), x**2, y**2, x * abs(x), y * abs(y), x * y, np.ones(len(x))]
        return np.column_stack(columns) @ truth.T

    rng = np.random.default_rng(5)
    loads = rng.uniform(-1, 1, (90, 2)) * full
    run = np.arange(90) * 3 // 90
    tares = np.array([[12.0, -3.0], [-5.0, 8.0], [-1.0, 20.0]])
    read = responses(loads + tares[run]) + rng.normal(0, 2e-5, (90, 2))
    lines = ["A [mV/V],B [mV/V],FX [N],FY [N],run,direction"]
    lines += [
        f"{a:.7f},{b:.7f},{x:.5f},{y:.5f},{number + 1},{'up' if at % 30 < 15 else 'down'}"
        for at, ((a, b), (x, y), number) in enumerate(
            zip(read.tolist(), loads.tolist(), run.tolist(), strict=True)
        )
    ]
    session = (
        'schema = 1\ninstrument = "balance"\ndate = 2026-01-05\noperator = "operator one"\n'
        'temperature = { value = 20.0, unit = "degC" }\nindications = ["A", "B"]\nloads = ["FX", "FY"]\n'
        'data = "loads.csv"\nmodel = "balance"\n'
    )
    return {"SESSION.toml": session, "loads.csv": "\n".join(lines) + "\n"}


def standard_session() -> dict[str, str]:
    """Return a force transducer at three mountings, up and down: ISO 376 and ASTM E74 apply."""
    force = 1000.0 * np.arange(1, 9)
    lines = ["S [mV/V],F [N],run,direction,rotation [deg]"]
    for number, angle in enumerate((0, 0, 120, 240), start=1):
        for direction, forces in (("up", force), ("down", force[::-1])):
            for value in forces:
                share = value / 8000
                read = 2 * share * (1 + 2e-4 * share + 1e-5 * (angle / 120 - 1))
                read += (direction == "down") * 4e-4 * share * (1 - share) + 1e-6 * ((number * value) % 7 - 3)
                lines.append(f"{read:.6f},{value},{number},{direction},{angle}")
    session = """schema = 1
instrument = "cell"
date = 2026-01-05
operator = "operator one"
temperature = { value = 20.0, unit = "degC" }
indications = ["S"]
loads = ["F"]
data = "loads.csv"
model = "polynomial"
degree = 2
[reference.uncertainty]
F = { U = 0.01, k = 2, unit = "%" }
[cells.S]
serial = "S-1"
resolution = 1e-6
[standard]
preloads = 3
[[creep]]
load = { value = 8000, unit = "N" }
seconds = 300
value = { S = 2.0002 }
[[creep]]
load = { value = 8000, unit = "N" }
seconds = 30
value = { S = 2.0 }
"""
    return {"SESSION.toml": session, "loads.csv": "\n".join(lines) + "\n"}


def packaged_session(files: dict[str, str]) -> dict[str, str]:
    """Return the packaged session of the virtual machine from its stored files."""
    session = files["session.toml"]
    for name in ("loads", "check"):
        session = session.replace(f"{name}_simulated.csv", f"{name}.csv")
    return {"SESSION.toml": session, "loads.csv": files["loads.csv"], "check.csv": files["check.csv"]}


SESSIONS: dict[str, dict[str, str]] = {
    "ols": hub_session(),
    "polynomial": hub_session(
        settings='model = "polynomial"\ndegree = 2\n',
        rows=hub_rows(120, 3, bend=0.01),
        check=hub_rows(9, 7, bend=0.01),
    ),
    "wls": hub_session(settings='method = "wls"\n', weighted=True),
    "gls": hub_session(
        settings='method = "gls"\n', tables='[reference]\nshared_group = "run"' + _UNCERTAINTY
    ),
    "odr": hub_session(settings='method = "odr"\n', tables=_UNCERTAINTY + _CELLS_KNOWN),
    "tared": hub_session(settings='zero = "tared"\n', rows=_tared(60, 4), check=_tared(9, 5)),
    "zero-run": hub_session(
        settings='zero = "run"\n',
        rows=_own_zeros(hub_rows(60, 1)),
        check=np.vstack([np.zeros((1, 6)), hub_rows(9, 2) - np.array([*ZERO, 0, 0, 0])]),
    ),
    "between-runs": hub_session(tables="[between_runs.FY]\nzero = 2.0\ngain = 3.0\nunit = 'N'\n"),
    "kilonewton-comma": hub_session(newtons=True, decimal=","),
    "budget": hub_session(
        tables='[reference]\nstandard = "deadweight 7"\ncertificate = "C-77"' + _UNCERTAINTY + _CELLS_KNOWN
    ),
    "as-found": hub_session(settings='phase = "as_found"\n', rows=hub_rows(60, 6)),
    "balance": balance_session(),
    "standard": standard_session(),
}
"""Files of each session by the name of its kind."""
