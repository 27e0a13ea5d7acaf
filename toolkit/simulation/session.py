"""The reference-load session of the virtual machine: the cells under known loads, one after another.

FY, MZ and MX are varied each by itself and together, with both signs, up and down, in several runs, so
that the three cells' outputs are far from collinear. The check loads stand apart from the fit's loads, have
full rank and move every term of every equation.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.simulation.cells import CELLS, LOADS, outputs
from toolkit.simulation.plan import Plan
from toolkit.units import from_si

INDICATION_UNIT = "mV/V"  # of the fit, whatever the files hold
LOAD_UNITS = {"FY": "lbf", "MZ": "lbf*ft", "MX": "lbf*ft"}
DECIMALS = {"mV/V": 6, "mV": 5, "count": 0}
BRIDGE_OHM, SHUNT_OHM = 350.0, 87150.0
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

    ``indications`` (rows, 3) in the plan's ``output`` unit and ``loads`` (rows, 3) as the reference states
    them; ``run`` (rows,). ``zeros`` are (when, output of each cell), in the order in which they were read;
    the shunt's are among them. They are empty where the plan asks for none.
    """

    plan: Plan
    indications: Array
    loads: Array
    run: tuple[int, ...]
    direction: tuple[str, ...]
    check_indications: Array
    check_loads: Array
    zeros: tuple[tuple[str, tuple[float, ...]], ...] = ()


def schedule() -> tuple[Point, ...]:
    """Return the points of one run.

    >>> points = schedule()
    >>> len(points) >= 30, {point.direction for point in points} == {"up", "down"}
    (True, True)
    """
    points = [Point(shares=(0.0, 0.0, 0.0), direction="up")]
    for axis, sign in itertools.product(range(3), (1.0, -1.0)):
        for level, direction in ((0.25, "up"), (0.5, "up"), (0.75, "up"), (1.0, "up"), (0.5, "down")):
            shares = [0.0, 0.0, 0.0]
            shares[axis] = sign * level
            points.append(Point(shares=(shares[0], shares[1], shares[2]), direction=direction))
    for FY, MZ, MX in itertools.product((1.0, -1.0), repeat=3):
        # A lateral force and an overturning moment of opposite signs load E5 most: its capacity limits.
        share = 1.0 if FY == MX else 0.6
        for level, direction in ((0.5, "up"), (1.0, "up"), (0.5, "down")):
            scale = share * level
            points.append(Point(shares=(FY * scale, MZ * scale, MX * scale), direction=direction))
    points.append(Point(shares=(0.0, 0.0, 0.0), direction="down"))
    return tuple(points)


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
        zeros=_zeros(plan) if plan.session.readings else (),
    )


def reference_sd(plan: Plan) -> dict[str, float]:
    """Return the standard deviation of each reference load, in the unit of the session's files."""
    truth = plan.session
    si = {"FY": truth.reference_FY_N, "MZ": truth.reference_MZ_Nm, "MX": truth.reference_MX_Nm}
    return {load: float(from_si(si[load], LOAD_UNITS[load])) for load in LOADS}


def _measure(plan: Plan, shares: Array, rng: np.random.Generator) -> tuple[Array, Array]:
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
    return recorded(plan, bridge), stated


def recorded(plan: Plan, bridge: Array) -> Array:
    """Return bridge outputs [V/V] as the plan's files hold them: rounded mV/V, mV, or whole counts."""
    output = plan.session.output
    if output == "count":
        return np.round(bridge / plan.session.count_V_V)
    ratio = from_si(bridge, INDICATION_UNIT)
    return np.round(ratio * (plan.session.excitation_V if output == "mV" else 1.0), DECIMALS[output])


def shunt_step() -> float:
    """Return the step [V/V] of a resistor across one arm of a full bridge: R / (4 R_s + 2 R).

    From the divider of that arm: its resistance falls to R R_s / (R + R_s), the other divider stays at 1/2.

    >>> round(1e3 * shunt_step(), 4)  # mV/V: half the rated output of a 2 mV/V cell
    1.002
    """
    return BRIDGE_OHM / (4 * SHUNT_OHM + 2 * BRIDGE_OHM)


def _zeros(plan: Plan) -> tuple[tuple[str, tuple[float, ...]], ...]:
    # A stream of its own: the readings change no row of the session.
    rng = np.random.default_rng([plan.seed, 1])
    noise = np.array([cell.noise_V_V for cell in plan.cells.all]) / _AVERAGED
    drift = plan.session.zero_drift_V_V
    readings = []
    for when, level in (("before", 0.0), ("shunt", shunt_step()), ("after", drift)):
        values = recorded(plan, level + rng.standard_normal(len(CELLS)) * noise) + 0.0
        readings.append((when, tuple(values.tolist())))
    return tuple(readings)


def loads_csv(session: VirtualSession) -> str:
    """Return the reference-load data as CSV."""
    rows = [
        ",".join([*cells, str(run), direction])
        for cells, run, direction in zip(
            _cells(session, session.indications, session.loads), session.run, session.direction, strict=True
        )
    ]
    return "\n".join([",".join([*_header(session), "run", "direction"]), *rows]) + "\n"


def check_csv(session: VirtualSession) -> str:
    """Return the check loads as CSV."""
    rows = [",".join(cells) for cells in _cells(session, session.check_indications, session.check_loads)]
    return "\n".join([",".join(_header(session)), *rows]) + "\n"


def _header(session: VirtualSession) -> list[str]:
    output = session.plan.session.output
    return [f"{name} [{output}]" for name in CELLS] + [f"{x} [{LOAD_UNITS[x]}]" for x in LOADS]


def _cells(session: VirtualSession, indications: Array, loads: Array) -> list[list[str]]:
    decimals = DECIMALS[session.plan.session.output]
    rows = []
    for row, reference in zip(indications.tolist(), loads.tolist(), strict=True):
        texts = [f"{value + 0.0:.{decimals}f}" for value in row]
        texts += [
            f"{value + 0.0:.{LOAD_DECIMALS[load]}f}" for value, load in zip(reference, LOADS, strict=True)
        ]
        rows.append(texts)
    return rows
