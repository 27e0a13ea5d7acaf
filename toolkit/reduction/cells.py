"""The cells' pattern: what three cells say together, held against what a wheel can do to them.

The cells measure three loads, FY, MZ and the overturning moment MX, and physics knows the third: the side
force acts at the road, a loaded radius below the hub, so that

    MX = lever FY + offset FZ + const,          lever between the bounds of `limits.LEVER`

With the force in cell i, f_i = (dFY/d indication_i) indication_i by the record, and its lever in the machine
definition, MX = sum lever_i f_i; without levers MX is the record's own. A hub that has
MX among its loads has it right-handed: the record's own, turned where z points down. The tire's own
overturning moment, its load times its lateral deflection, takes up to an eighth of the radius from the lever
and leaves a twentieth of MX beside the line. A cell that was turned round, exchanged or is dead breaks
this or another law; which single change of a cell puts all of them right is searched among the turns and the
exchanges of two.

Every single turn, exchange and dead cell is seen in a whole test. Not seen, because a tire could do it: all
cells or all loads wrong by one factor that stays within the bounds, one cell's sensitivity wrong by a third
or less (`tests/campaigns/physics_gate.py` shows each).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import seen_by_cells, signs
from toolkit.findings import Finding
from toolkit.reduction import limits
from toolkit.reduction.averaging import free_radius_m
from toolkit.reduction.physics import Departure, Readings, departures, longest_trail
from toolkit.units import si_scale

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.machine import Machine
    from toolkit.recording.model import TestInfo
    from toolkit.reduction.model import Condition, ReducedTest, Tare

_LEAST_FORCE = 0.3  # span of FY over the mean load from which a lever can be told
_REMAINDER = 0.15  # of the moment's span: what may be left of it beside lever and offset
_FEWEST = 5


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """The cells of a test: readings in SI, and each cell's part of FY, of MZ and of MX.

    ``indications`` (n, cells) minus ``tares`` (n, cells), in the record's units; ``per_FY`` [N],
    ``per_MZ`` and ``per_MX`` [N·m] (cells,) of one unit of indication, the last None where neither the
    machine names its levers nor the record holds MX; ``radius_m`` the tire's free radius; ``FY_sign`` and
    ``MZ_sign`` (n,) from machine axes.
    """

    names: tuple[str, ...]
    indications: Array
    per_FY: Array
    per_MZ: Array
    per_MX: Array | None
    radius_m: float | None
    tares: Array
    FY_sign: Array
    MZ_sign: Array


def physics_findings(
    conditions: Sequence[Condition],
    *,
    record: CalibrationRecord,
    machine: Machine,
    info: TestInfo,
    tares: Mapping[str, Tare],
    inclinations: Mapping[tuple[str, int], float],
) -> list[Finding]:
    """Return what no tire and no wheel can do in a test's corrected values, as findings of level error.

    ``tares`` are those of the files by their names, ``inclinations`` [rad] the means of a recorded
    inclination angle by file and first row of the average.
    """
    if not conditions:
        return []
    IA = np.array([inclinations.get((c.file, c.first_row), 0.0) for c in conditions])
    readings = _readings(conditions, info, IA)
    cells = _cells(conditions, record, machine, info, tares)
    broken = _departures(readings, cells)
    if not broken:
        return []
    cures = dict.fromkeys(text for text, changed in _changes(readings, cells) if not _departures(*changed))
    cure = f"all is possible with {' or '.join(cures)}" if cures else ""
    return [departure.finding(more=cure if index == 0 else "") for index, departure in enumerate(broken)]


def checked(reduced: ReducedTest) -> ReducedTest:
    """Return a reduced test with what no tire can do told, where it was reduced before there was a gate.

    Without the machine and the record, as a file of its own: the cells' pattern is left to the reduction. It
    does not hold the angle at which a tire leaned: of such a test friction alone bounds the side force.
    """
    if reduced.impossible or not reduced.conditions:
        return reduced
    leans = any(f.rule in ("one-condition", "other-conditions") for f in reduced.findings)
    IA = np.full(len(reduced.conditions), np.nan if leans else 0.0)
    broken = departures(_readings(reduced.conditions, reduced.info, IA))
    findings = tuple(departure.finding() for departure in broken)
    return dataclasses.replace(reduced, findings=(*findings, *reduced.findings)) if findings else reduced


def _departures(readings: Readings, cells: Cells) -> tuple[Departure, ...]:
    return (*departures(readings), *pattern(readings, cells))


def pattern(readings: Readings, cells: Cells) -> tuple[Departure, ...]:
    """Return where the overturning moment in the cells does not follow the side force."""
    if cells.per_MX is None or len(readings.FZ) < _FEWEST:
        return ()
    FY, MX = cells.indications @ cells.per_FY, cells.indications @ cells.per_MX
    FZ = readings.FZ
    if np.ptp(FY) < _LEAST_FORCE * FZ.mean():
        return ()
    design = np.column_stack([FY, FZ, np.ones(len(FY))])
    solution, *_ = np.linalg.lstsq(design, MX, rcond=None)
    lever = float(solution[0])
    residual = MX - design @ solution
    low, high = limits.LEVER.low, limits.LEVER.high
    if cells.radius_m is not None:
        low, high = (
            part * cells.radius_m for part in (limits.LEVER_PER_RADIUS.low, limits.LEVER_PER_RADIUS.high)
        )
    findings = []
    if not low <= lever <= high:
        findings.append(
            Departure(
                rule="impossible-cells",
                where=f"cells {', '.join(cells.names)}",
                message=f"the overturning moment in the cells follows the side force by {lever:.3f} m; a "
                f"wheel gives its loaded radius, {low:.2f} to {high:.2f} m",
                cause="two cells are exchanged, one is turned round, or one is dead",
            )
        )
    share = float(np.sqrt(np.mean(residual**2)) / np.ptp(MX)) if np.ptp(MX) > 0 else 0.0
    if share > _REMAINDER:
        worst = int(np.argmax(np.abs(residual)))
        findings.append(
            Departure(
                rule="impossible-cells",
                where=readings.place[worst],
                message=f"the overturning moment in the cells leaves the line of the side force by "
                f"{100 * share:.0f} % of its span (rms; at most {100 * _REMAINDER:g} %)",
                cause="a cell changed its sign, its place or its sensitivity during the test",
            )
        )
    return tuple(findings)


def _readings(conditions: Sequence[Condition], info: TestInfo, IA: Array) -> Readings:
    def column(name: str) -> Array:
        return np.array([getattr(c, name) for c in conditions], dtype=np.float64)

    none = np.zeros(len(conditions))
    return Readings(
        place=tuple(f"{c.file}, rows {c.first_row}-{c.last_row}" for c in conditions),
        FZ=column("FZ"), SA=column("SA"), FY=column("FY"), MZ=column("MZ"),
        reverse=np.array([c.rotation == "reverse" for c in conditions]),
        block=tuple((c.step_SA, c.step_FZ) for c in conditions),
        u_FY=column("u_FY_zero"), u_MZ=column("u_MZ_zero"), FX=none, IA=IA,
        trail_m=longest_trail(free_radius_m(info.tire_size)),
    )  # fmt: skip


def _cells(
    conditions: Sequence[Condition],
    record: CalibrationRecord,
    machine: Machine,
    info: TestInfo,
    tares: Mapping[str, Tare],
) -> Cells:
    per_FY, levers = _linear(record, "FY"), dict(machine.layout.overturning_lever_m)
    turns = [signs(machine.axes, "SAE", seen_by_cells(c.rotation, info.reversal)) for c in conditions]
    zeros = {
        name: [
            dict(tare.values).get(cell, 0.0) if tare.source != "none" else 0.0 for cell in record.indications
        ]
        for name, tare in tares.items()
    }
    return Cells(
        names=record.indications,
        indications=np.array([c.indications for c in conditions]),
        per_FY=per_FY,
        per_MZ=_linear(record, "MZ"),
        per_MX=_overturning(record, per_FY, levers, machine),
        radius_m=free_radius_m(info.tire_size),
        tares=np.array([zeros[c.file] for c in conditions]),
        FY_sign=np.array([float(turn["FY"]) for turn in turns]),
        MZ_sign=np.array([float(turn["MZ"]) for turn in turns]),
    )


def _overturning(
    record: CalibrationRecord, per_FY: Array, levers: Mapping[str, float], machine: Machine
) -> Array | None:
    # A right-handed MX about the spindle falls with FY by the loaded radius where z points down.
    if machine.hub is not None and "MX" in machine.hub.loads:
        return _linear(record, "MX") * (1.0 if machine.axes == "ISO-W" else -1.0)
    # By the drawing, which the record did not touch; else by the record's own fit.
    if set(record.indications) <= set(levers):
        return per_FY * [levers[name] for name in record.indications]
    return _linear(record, "MX") if any(load.load == "MX" for load in record.loads) else None


def _linear(record: CalibrationRecord, load: str) -> Array:
    fit = record.load(load)
    by_term = dict(zip(fit.terms, fit.coefficients, strict=True))
    return np.array([by_term.get(name, 0.0) for name in record.indications]) * si_scale(fit.unit)


def _changes(readings: Readings, cells: Cells) -> list[tuple[str, tuple[Readings, Cells]]]:
    """Return every single turn of a cell and exchange of two, in words, and the test with it undone."""
    n = len(cells.names)
    raw, changes = cells.indications + cells.tares, []
    for i in range(n):
        for when, tares in (("", np.zeros_like(raw)), (" after its tare", cells.tares)):
            if when and not tares[:, i].any():
                continue
            now = np.where(np.arange(n) == i, -(cells.indications + tares) - tares, cells.indications)
            changes.append((f"{cells.names[i]} turned round{when}", now))
    for i, j in itertools.combinations(range(n), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        changes.append((f"{cells.names[i]} and {cells.names[j]} exchanged", raw[:, order] - cells.tares))
    return [(text, _with(readings, cells, now)) for text, now in changes]


def _with(readings: Readings, cells: Cells, now: Array) -> tuple[Readings, Cells]:
    step = now - cells.indications
    changed = dataclasses.replace(
        readings,
        FY=readings.FY + cells.FY_sign * (step @ cells.per_FY),
        MZ=readings.MZ + cells.MZ_sign * (step @ cells.per_MZ),
    )
    return changed, dataclasses.replace(cells, indications=now)
