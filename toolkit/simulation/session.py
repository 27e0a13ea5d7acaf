"""The reference-load session of the virtual machine: the cells under known loads, one after another.

FY, MZ and MX are varied each by itself and together, with both signs, up and down, in several runs, so
that the three cells' outputs are far from collinear. The check loads stand apart from the fit's loads, have
full rank and move every term of every equation.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.simulation.cells import CELLS, LOADS, outputs
from toolkit.simulation.plan import Plan
from toolkit.units import from_si

if TYPE_CHECKING:
    from numpy.typing import NDArray

INDICATION_UNIT = "mV/V"
LOAD_UNITS = {"FY": "lbf", "MZ": "lbf*ft", "MX": "lbf*ft"}
INDICATION_DECIMALS = 6
LOAD_DECIMALS = {"FY": 1, "MZ": 2, "MX": 1}  # what the reference's certificate prints
_AVERAGED = 10.0  # an indication is the mean of 100 samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Point:
    """One row: shares of the largest FY, MZ, MX, and whether the loads were rising."""

    shares: tuple[float, float, float]
    direction: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualSession:
    """A session's data in the units of its files.

    ``indications`` (rows, 3) mV/V and ``loads`` (rows, 3) as the reference states them; ``run`` (rows,).
    """

    plan: Plan
    indications: NDArray[np.float64]
    loads: NDArray[np.float64]
    run: tuple[int, ...]
    direction: tuple[str, ...]
    check_indications: NDArray[np.float64]
    check_loads: NDArray[np.float64]


def schedule() -> tuple[Point, ...]:
    """Return the points of one run.

    >>> points = schedule()
    >>> len(points) >= 30, {point.direction for point in points} == {"up", "down"}
    (True, True)
    """
    made = [Point(shares=(0.0, 0.0, 0.0), direction="up")]
    for axis, sign in itertools.product(range(3), (1.0, -1.0)):
        for level, direction in ((0.25, "up"), (0.5, "up"), (0.75, "up"), (1.0, "up"), (0.5, "down")):
            shares = [0.0, 0.0, 0.0]
            shares[axis] = sign * level
            made.append(Point(shares=(shares[0], shares[1], shares[2]), direction=direction))
    for FY, MZ, MX in itertools.product((1.0, -1.0), repeat=3):
        # A lateral force and an overturning moment of opposite signs load E5 most: its capacity limits.
        most = 1.0 if FY == MX else 0.6
        for level, direction in ((0.5, "up"), (1.0, "up"), (0.5, "down")):
            scale = most * level
            made.append(Point(shares=(FY * scale, MZ * scale, MX * scale), direction=direction))
    made.append(Point(shares=(0.0, 0.0, 0.0), direction="down"))
    return tuple(made)


CHECK = (
    (0.85, 0.0, 0.0), (-0.65, 0.0, 0.0), (0.0, 0.85, 0.0), (0.0, -0.65, 0.0), (0.0, 0.0, 0.85),
    (0.0, 0.0, -0.65), (0.7, 0.7, 0.7), (-0.7, 0.7, -0.7), (0.35, -0.7, -0.35), (-0.35, -0.35, 0.35),
)  # fmt: skip


def simulate_session(plan: Plan) -> VirtualSession:
    """Run a plan's session: true loads differ a little from the reference's, outputs carry noise."""
    rng = np.random.default_rng([plan.seed, 0])
    points = [(run, point) for run in range(1, plan.session.runs + 1) for point in schedule()]
    shares = np.array([point.shares for _, point in points])
    indications, loads = _measure(plan, shares, rng)
    check_indications, check_loads = _measure(plan, np.array(CHECK), rng)
    return VirtualSession(
        plan=plan,
        indications=indications,
        loads=loads,
        run=tuple(run for run, _ in points),
        direction=tuple(point.direction for _, point in points),
        check_indications=check_indications,
        check_loads=check_loads,
    )


def reference_sd(plan: Plan) -> dict[str, float]:
    """Return the standard deviation of each reference load, in the unit of the session's files."""
    truth = plan.session
    si = {"FY": truth.reference_FY_N, "MZ": truth.reference_MZ_Nm, "MX": truth.reference_MX_Nm}
    return {load: float(from_si(si[load], LOAD_UNITS[load])) for load in LOADS}


def _measure(
    plan: Plan, shares: NDArray[np.float64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    truth = plan.session
    largest = {"FY": truth.FY_N, "MZ": truth.MZ_Nm, "MX": truth.MX_Nm}
    stated = np.column_stack(
        [
            np.round(from_si(shares[:, i] * largest[load], LOAD_UNITS[load]), LOAD_DECIMALS[load])
            for i, load in enumerate(LOADS)
        ]
    )
    sd = reference_sd(plan)
    scale = np.array([1.0 / from_si(1.0, LOAD_UNITS[load]) for load in LOADS])
    true = (stated + rng.standard_normal(stated.shape) * np.array([sd[load] for load in LOADS])) * scale
    noise = np.array([cell.noise_V_V for cell in plan.cells.all]) / _AVERAGED
    bridge = outputs(plan.cells, loads=true, tared=True) + rng.standard_normal(true.shape) * noise
    return np.round(from_si(bridge, INDICATION_UNIT), INDICATION_DECIMALS), stated


def loads_csv(session: VirtualSession) -> str:
    """Return the reference-load data as CSV."""
    rows = [
        ",".join([*cells, str(run), direction])
        for cells, run, direction in zip(
            _cells(session.indications, session.loads), session.run, session.direction, strict=True
        )
    ]
    return "\n".join([",".join([*_header(), "run", "direction"]), *rows]) + "\n"


def check_csv(session: VirtualSession) -> str:
    """Return the check loads as CSV."""
    rows = [",".join(cells) for cells in _cells(session.check_indications, session.check_loads)]
    return "\n".join([",".join(_header()), *rows]) + "\n"


def _header() -> list[str]:
    return [f"{name} [{INDICATION_UNIT}]" for name in CELLS] + [f"{x} [{LOAD_UNITS[x]}]" for x in LOADS]


def _cells(indications: NDArray[np.float64], loads: NDArray[np.float64]) -> list[list[str]]:
    made = []
    for row, reference in zip(indications.tolist(), loads.tolist(), strict=True):
        texts = [f"{value + 0.0:.{INDICATION_DECIMALS}f}" for value in row]
        texts += [
            f"{value + 0.0:.{LOAD_DECIMALS[load]}f}" for value, load in zip(reference, LOADS, strict=True)
        ]
        made.append(texts)
    return made
