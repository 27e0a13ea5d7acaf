"""Gates of size: loads, indications and tolerances that no calibration of this instrument can have.

A unit that slipped in every file of a session (kN written N, mV/V written V/V) is consistent in itself. What
gives it away is the size of things: the range against the last record's, against the machine's rated load,
and the output against what a strain-gauge bridge can give.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.calibration.registry.gates import GateResult
from toolkit.calibration.registry.response import largest_load, response, same_dimension
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, Indication
    from toolkit.machine.definition import Machine

# Between a session that stays at a twentieth of the range, which calibrates nothing, and a twentyfold
# overload, which no cell survives; the common slips are 9.81 (kgf), 304.8 (mm for ft) and 1000.
RANGE = 20.0
# Metal foil bridges give 1 to 4 mV/V at capacity, semiconductor bridges some ten times that.
BRIDGE_V_V = (1e-5, 0.1)
# A published lever of this field differs from its drawing's by 1.8 (47.8 mm against a half-side of 86.6 mm).
LEVER = 2.0
TOLERANCE = 0.1  # of the largest load: check loads within a tolerance above it check nothing


def plausible(
    new: CalibrationRecord, old: CalibrationRecord | None, machine: Machine | None
) -> tuple[GateResult, ...]:
    """Return the sizes that cannot be: rules ``range``, ``lever``, ``bridge-range``, ``check-tolerance``."""
    failed: list[GateResult] = [] if machine is None else _levers(new, machine)
    rated = {} if machine is None else dict(machine.rated_loads)
    for one in new.loads:
        size, si = largest_load(one), unit(one.unit).si
        if math.isnan(size):
            continue
        other = None if old is None else next((o for o in old.loads if o.load == one.load), None)
        if old is not None and other is not None and same_dimension(one.unit, other.unit):
            failed += _range(one.load, size, largest_load(other), si, f"in {old.id}")
        if machine is not None and one.load in rated:
            failed += _range(one.load, size, rated[one.load], si, f"as rated by machine {machine.name}")
        if one.tolerance is not None and one.tolerance > TOLERANCE * one.largest:
            message = (
                f"the check loads' tolerance of {one.tolerance:.4g} {one.unit} is "
                f"{100 * one.tolerance / one.largest:.3g} % of the largest load: is its unit right?"
            )
            failed.append(GateResult(rule="check-tolerance", where=one.load, message=message))
    bridges = [_largest(cell) for cell in new.cells if unit(cell.unit).dimension == "bridge_ratio"]
    strongest = max((size for size in bridges if not math.isnan(size)), default=math.nan)
    for cell in new.cells:
        size, read = _largest(cell), unit(cell.unit)
        if math.isnan(size):
            continue
        # Off its axis a cell may hardly move: too small is only what the strongest of them gives.
        if read.dimension == "bridge_ratio" and (size > BRIDGE_V_V[1] or strongest < BRIDGE_V_V[0]):
            message = (
                f"the largest output is {1e3 * size:.4g} mV/V, where a bridge gives {1e3 * BRIDGE_V_V[0]:g} "
                f"to {1e3 * BRIDGE_V_V[1]:g} mV/V: is its unit, excitation or scale right?"
            )
            failed.append(GateResult(rule="bridge-range", where=cell.name, message=message))
        before = None if old is None else next((c for c in old.cells if c.name == cell.name), None)
        if old is not None and before is not None and same_dimension(cell.unit, before.unit):
            failed += _range(cell.name, size, _largest(before), read.si, f"in {old.id}")
    return tuple(failed)


def _levers(new: CalibrationRecord, machine: Machine) -> list[GateResult]:
    """Hold the ratio of a cell's moment to its force against the machine's geometry [m].

    It needs no history: one of two units that slipped moves a lever by 4.45 (lbf, N), 305 or 1000.
    """
    loads = {one.load: one for one in new.loads}
    if "FY" not in loads:
        return []
    failed = []
    drawn = {name: abs(lever) for name, lever in machine.overturning_lever_m}
    pitch = machine.cell_pitch_diameter_m
    for cell in new.cells:
        stated = machine.cell(cell.name)
        limits = {
            "MX": (drawn[cell.name] / LEVER, drawn[cell.name] * LEVER) if drawn.get(cell.name) else None,
            "MZ": (pitch / RANGE, pitch) if stated is not None and stated.sign("MZ") else None,
        }
        force = abs(response(new, loads["FY"], cell).value)
        for load, between in limits.items():
            if load not in loads or between is None or force == 0:
                continue
            lever = abs(response(new, loads[load], cell).value) / force
            if not between[0] <= lever <= between[1]:
                message = (
                    f"its moment and its force make a lever of {1e3 * lever:.4g} mm, where machine "
                    f"{machine.name} has {1e3 * between[0]:.4g} to {1e3 * between[1]:.4g} mm: is the unit of "
                    f"{load} or of FY right?"
                )
                failed.append(GateResult(rule="lever", where=f"{load}, {cell.name}", message=message))
    return failed


def _range(name: str, size: float, other: float, si: str, where: str) -> list[GateResult]:
    if math.isnan(other) or not other > 0 or 1 / RANGE <= size / other <= RANGE:
        return []
    message = (
        f"the largest value is {size:.4g} {si} against {other:.4g} {si} {where}, a factor of "
        f"{size / other:.3g}: is the unit right?"
    )
    return [GateResult(rule="range", where=name, message=message)]


def _largest(cell: Indication) -> float:
    if cell.minimum is None or cell.maximum is None:
        return math.nan
    return max(abs(cell.minimum), abs(cell.maximum)) * unit(cell.unit).factor
