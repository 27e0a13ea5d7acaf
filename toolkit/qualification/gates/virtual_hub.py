"""A calibration session of a virtual hub: exact by the machine's drawing, its scatter a fixed sequence.

Three cells carry the side force, FY = f51 + f52 + f5, MX = sum of lever times force with the levers of the
drawing, MZ = ARM (f52 - f51). Every fault of a demonstration is a departure from this one session.
"""

from __future__ import annotations

import datetime as dt
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.machine.default import SIMULATED_MACHINE

RIG = "rig"  # an instrument that no machine definition knows
HUB = SIMULATED_MACHINE  # one that has a packaged machine definition
CELLS = ("D51", "D52", "E5")
LOADS = ("FY", "MZ", "MX")
UNITS = MappingProxyType({**dict.fromkeys(CELLS, "mV/V"), "FY": "N", "MZ": "N*m", "MX": "N*m"})
LARGEST = (6000.0, 250.0, 300.0)  # N, N·m, N·m
FIRST, SECOND = dt.date(2020, 3, 2), dt.date(2020, 6, 1)
RUNS = 3

_ARM = 0.048  # m, as published for such a hub; the drawing's own half-side is 0.0866 m
_CAPACITY = 1600.0  # N per mV/V
_FORCES = np.array([[1.0, 1.0, 1.0], [-_ARM, _ARM, 0.0], [0.05, 0.05, -0.10]])
PER_INDICATION = _FORCES * _CAPACITY
"""Loads (rows FY, MZ, MX) [N, N·m, N·m] of 1 mV/V in each cell (columns)."""
_SCATTER = 2e-5  # mV/V


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """The session, and what is done to it.

    ``factors`` and ``offsets`` change columns of both tables, ``check_factors`` those of the check loads
    alone. ``units`` replace what the headers say, and nothing else: a slip. ``reading`` is +1 for polarity
    readings as they should be, -1 for readings of the opposite direction, 0 for none. ``serials`` name the
    cells, ``tolerance`` is that of the check loads, as TOML, ``text`` is added at the end of SESSION.toml.
    """

    instrument: str = RIG
    day: dt.date = SECOND
    factors: Mapping[str, float] = field(default_factory=dict)
    offsets: Mapping[str, float] = field(default_factory=dict)
    check_factors: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    reading: int = 0
    serials: Mapping[str, str] = field(default_factory=dict)
    zero_rows: bool = True
    tolerance: str = ""
    text: str = ""

    def write(self, folder: Path) -> Path:
        """Write SESSION.toml with its tables; return it."""
        folder.mkdir(parents=True)
        steps = _steps(self.zero_rows)
        run = np.repeat(np.arange(1, RUNS + 1), len(steps))
        self._table(folder / "loads.csv", np.tile(steps, (RUNS, 1)), {}, run)
        self._table(folder / "check.csv", 0.7 * steps[1 - self.zero_rows :][::3], self.check_factors)
        path = folder / "SESSION.toml"
        path.write_text(self._toml(), encoding="utf-8")
        return path

    def _table(
        self, path: Path, loads: Array, more: Mapping[str, float],
        run: NDArray[np.int_] | None = None
    ) -> None:  # fmt: skip
        names = (*CELLS, *LOADS)
        rows = np.column_stack([_cells(loads, start=0 if run is not None else 1000), loads])
        for at, name in enumerate(names):
            rows[:, at] *= self.factors.get(name, 1.0) * more.get(name, 1.0)
            rows[:, at] += self.offsets.get(name, 0.0)
        header = [f"{name} [{self.units.get(name, UNITS[name])}]" for name in names]
        lines = [",".join([*header, *(() if run is None else ("run", "direction"))])]
        for at, row in enumerate(rows.tolist()):
            lines.append(",".join([*map(repr, row), *(() if run is None else (str(run[at]), "up"))]))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def _toml(self) -> str:
        cells = "".join(
            f'[cells.{name}]\nserial = "{self.serials.get(name, f"QUALIFY-{name}")}"\n' for name in CELLS
        )
        return (
            f'schema = 1\ninstrument = "{self.instrument}"\ndate = {self.day.isoformat()}\n'
            'operator = "virtual operator"\ntemperature = { value = 21.0, unit = "degC" }\n'
            'indications = ["D51", "D52", "E5"]\nloads = ["FY", "MZ", "MX"]\ndata = "loads.csv"\n'
            f'check = {{ file = "check.csv"{self._tolerance()} }}\nzero = "tared"\n'
            f"{self._readings()}{cells}{self.text}"
        )

    def _tolerance(self) -> str:
        return f", tolerance = {self.tolerance}" if self.tolerance else ""

    def _readings(self) -> str:
        if not self.reading:
            return ""
        entries = []
        for load, row in zip(LOADS, 0.45 * np.diag(LARGEST), strict=True):
            values = zip(CELLS, self.reading * _cells(row[np.newaxis], start=2000)[0], strict=True)
            inner = ", ".join(f'{name} = {{ value = {value:.6f}, unit = "mV/V" }}' for name, value in values)
            applied = f'{{ value = {float(row.max())!r}, unit = "{UNITS[load]}" }}'
            entries.append(f'{{ load = "{load}", value = {applied}, indications = {{ {inner} }} }}')
        return f"polarity = [{', '.join(entries)}]\n"


def _steps(zero: bool) -> Array:
    """Return the loads of one run (rows, 3): no load, each load by itself, and all of them together."""
    alone = [share * row for row in np.diag(LARGEST) for share in (-1.0, -0.5, 0.5, 1.0)]
    together = [0.6 * np.array(LARGEST) * turns for turns in itertools.product((-1, 1), repeat=3)]
    return np.array([*([np.zeros(3)] if zero else []), *alone, *together])


def _cells(loads: Array, start: int) -> Array:
    """Return indications (rows, 3) [mV/V] of loads, with a scatter of equal steps modulo the golden ratio."""
    exact = np.linalg.solve(PER_INDICATION, loads.T).T
    at = np.arange(start, start + exact.size)
    scatter = 2.0 * ((at * (5**0.5 - 1) / 2) % 1.0) - 1.0
    return np.round(exact + _SCATTER * scatter.reshape(exact.shape), 7)
