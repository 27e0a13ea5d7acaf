"""Values of a test that no tire and no wheel can give: flagged without any registry."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.files import read_toml
from toolkit.qualification.gates.bench import Act, Bench, Demonstration
from toolkit.qualification.gates.virtual_hub import CELLS, PER_INDICATION
from toolkit.qualification.numbers import damaged, numbers
from toolkit.reduction.cells import Cells, pattern
from toolkit.reduction.physics import Departure, Readings, departures, of_sizes
from toolkit.units import si_scale

FIGURE = "figure_4_4.toml"
_LOADS = (1200.0, 3000.0, 5000.0)  # N
_ANGLES = np.radians([-8.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0])
_FRICTION, _STIFFNESS, _TRAIL, _RADIUS = 0.9, 12.0, 0.03, 0.28  # 1, 1/rad, m, m: a common car tire


def demonstrations(folder: Path) -> tuple[Demonstration, ...]:
    """Return the demonstrations; ``folder`` has the packaged rows of Figure 4.4."""
    return (
        _shown(
            "Figure 4.4, its ten rows as stored", "impossible-force",
            lambda: _figure(folder, stored=True),
        ),
        _shown("Figure 4.4, its ten rows corrected", "", lambda: _figure(folder, stored=False)),
        _shown("virtual tire as it should be", "", lambda: departures(_sweep())),
        _shown(
            "side force in lbf named N", "implausible-friction",
            lambda: departures(_sweep(FY=1 / si_scale("lbf"))),
        ),
        _shown(
            "wheel load in lbf named N", "impossible-force impossible-slope",
            lambda: departures(_sweep(FZ=1 / si_scale("lbf"))),
        ),
        _shown("side force of the wrong sign", "impossible-slope", lambda: departures(_sweep(FY=-1.0))),
        _shown(
            "aligning moment in lbf·in named lbf·ft", "impossible-moment impossible-slope",
            lambda: departures(_sweep(MZ=12.0)),
        ),
        _shown(
            "reversed run that is not named as such", "impossible-reversal impossible-slope",
            lambda: departures(_sweep(reverse=-1.0)),
        ),
        _shown("cells of a wheel as they should be", "", lambda: _cells((0, 1, 2))),
        _shown("D51 and E5 exchanged between calibration and test", "impossible-cells",
               lambda: _cells((2, 1, 0))),
    )  # fmt: skip


def _shown(name: str, rules: str, values: Callable[[], tuple[Departure, ...]]) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        del bench  # values are judged without a registry
        return lambda: [(value.rule, f"{value.where}: {value.message}") for value in values()]

    return Demonstration(name=name, stage="values of a test", rules=tuple(rules.split()), prepare=prepare)


def _figure(folder: Path, *, stored: bool) -> tuple[Departure, ...]:
    path = folder / FIGURE
    document = read_toml(path)
    try:
        data = {name: numbers(values, path) for name, values in document["data"].items()}
        if not stored:
            terms = [data.get(name, np.ones(1)) for name in document["corrected"]["terms"]]
            for load in ("FY", "MZ"):
                pairs = zip(numbers(document["corrected"][load], path), terms, strict=True)
                data[load] = sum((c * term for c, term in pairs), start=np.zeros(1))
        readings = of_sizes(
            [f"row {number}" for number in range(1, len(data["FZ"]) + 1)],
            FZ=data["FZ"] * si_scale("lbf"), SA=np.radians(data["SA"]), FY=data["FY"] * si_scale("lbf"),
            MZ=data["MZ"] * si_scale("lbf*ft"),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise damaged(path, repr(error)) from error
    rows = np.arange(len(readings.FZ))
    # Each row by itself: one possible row among ten must not hide behind the others.
    by_row = [departures(readings.part(rows == row)) for row in rows]
    rules = [frozenset(finding.rule for finding in row) for row in by_row]
    if len(set(rules)) != 1:
        raise ValueError(f"the rows do not agree: {rules}")
    return departures(readings)


def _sweep(FZ: float = 1.0, FY: float = 1.0, MZ: float = 1.0, reverse: float = 1.0) -> Readings:
    """Return a virtual tire at each angle and load, forward and reverse, its values times the factors."""
    SA, load, direction = (
        grid.ravel() for grid in np.meshgrid(_ANGLES, np.array(_LOADS), [0.0, 1.0], indexing="ij")
    )
    side, moment = _tire(SA, load)
    turn = np.where(direction > 0, reverse, 1.0)
    none = np.zeros(len(SA))
    return Readings(
        place=tuple(f"{a:+.0f} deg, {b:.0f} N" for a, b in zip(np.degrees(SA), load, strict=True)),
        FZ=FZ * load, SA=SA, FY=FY * turn * side, MZ=MZ * turn * moment, reverse=direction > 0,
        block=tuple(zip(SA.tolist(), load.tolist(), strict=True)), u_FY=none, u_MZ=none, FX=none, IA=none,
    )  # fmt: skip


def _tire(SA: Array, FZ: Array) -> tuple[Array, ...]:
    side = -_FRICTION * FZ * np.tanh(_STIFFNESS / _FRICTION * SA)
    return side, -_TRAIL * (1.0 - np.abs(SA) / np.radians(15.0)) * side


def _cells(order: tuple[int, int, int]) -> tuple[Departure, ...]:
    """Judge the cells' pattern of the virtual tire, the cells connected in an order."""
    readings = _sweep()
    wheel = np.vstack([readings.FY, readings.MZ, _RADIUS * readings.FY])
    indications = np.asarray(np.linalg.solve(PER_INDICATION, wheel).T, dtype=np.float64)
    ones_column = np.ones(len(readings.FZ))
    cells = Cells(
        names=CELLS, indications=indications[:, order], per_FY=PER_INDICATION[0], per_MZ=PER_INDICATION[1],
        per_MX=PER_INDICATION[2], radius_m=None, tares=np.zeros_like(indications), FY_sign=ones_column,
        MZ_sign=ones_column,
    )  # fmt: skip
    return pattern(readings, cells)
