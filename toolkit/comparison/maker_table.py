"""A maker's TABLE.csv as rows: its curves are fitted and read as those of a test are.

A table has one direction of rotation, so it gives stiffness, FY and MZ at slip angles, and no conicity and no
plysteer. Its uncertainty is that of the fit alone: it states nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.channels import signs
from toolkit.characteristics.catalogue import of_scope
from toolkit.characteristics.groups import CHANNELS, Direction, DirectionFit, Group
from toolkit.characteristics.model import Row
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.rows import at_angles
from toolkit.characteristics.shared_errors import SharedErrors
from toolkit.errors import FitError
from toolkit.findings import Finding
from toolkit.machine import TypeB
from toolkit.reduction.model import Condition
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.model import Curve
from toolkit.tires.plausibility import demand_possible
from toolkit.tires.table import TireTable, read_table
from toolkit.tires.table_fit import axes_findings, fit_findings, repeat_findings, table_curves
from toolkit.units import from_si

if TYPE_CHECKING:
    from toolkit.tires.model import CurveFit

# What a table may vary that a free-rolling, upright test does not.
_ONE_VALUE = {"IA": ("deg", 0.1), "P": ("kPa", 5.0), "V": ("km/h", 5.0), "KAPPA": ("1", 0.005)}


def maker_rows(
    path: Path, *, axes: str, angles_rad: Sequence[float], identity: str
) -> tuple[tuple[Row, ...], tuple[Finding, ...]]:
    """Return a table's characteristics in SAE axes, FY and MZ at the slip angles given.

    Raises
    ------
    FitError
        not one curve of the table can be fitted, or the table varies camber, pressure or speed
    CellError
        a value that no tire has, as of a wrong unit
    ToolkitError
        whatever `read_table` refuses
    """
    table = read_table(path, axes=axes)
    _check_possible(table)
    _check_one_condition(table)
    curves = [_in_sae(curve) for curve in table_curves(table)]
    problems = [why_not(curve) for curve in curves]
    good = [curve for curve, problem in zip(curves, problems, strict=True) if problem is None]
    if not good:
        first = next(problem for problem in problems if problem is not None)
        raise FitError(
            first.what, where=path, got=first.got, expected=first.expected, next_step=first.next_step,
            rule=first.rule,
        )  # fmt: skip
    fits = fit_curves(good)
    findings = [
        Finding(
            rule=problem.rule or "not-fitted",
            where=f"{path.name}, {problem.where}",
            message=f"{problem.what}: {problem.got}",
        )
        for problem in problems
        if problem is not None
    ]
    by_load: dict[float, dict[str, tuple[Curve, CurveFit]]] = {}
    for curve, fit in zip(good, fits, strict=True):
        by_load.setdefault(curve.load_N or 0.0, {})[curve.channel] = (curve, fit)
    rows = []
    for load, channels in sorted(by_load.items()):
        reader = Reader(_direction(load, channels, path), shared=_nothing_shared(identity), stepped=False)
        rows += _rows(reader, load, angles_rad)
    sae = TireTable(path=path, axes="SAE", columns=())
    # Which parameters a curve leaves open is of no interest here: values and slopes are read off it.
    warnings = [finding for finding in fit_findings(list(fits)) if finding.level != "note"]
    findings += [
        replace(finding, where=f"{path.name}, {finding.where}")
        for finding in (*warnings, *axes_findings(sae, fits))
    ]
    findings += (*repeat_findings(table), *table.mark_findings)
    return tuple(rows), tuple(findings)


def _rows(reader: Reader, load: float, angles_rad: Sequence[float]) -> list[Row]:
    rows = []
    for channel in CHANNELS:
        for declared in of_scope("direction"):
            number = declared.read(declared, reader) if declared.channel == channel else None
            if number is not None:
                rows.append(Row.of(declared.name, number, load_N=load, rotation="forward"))
        at_angle = [declared for declared in of_scope("angle") if declared.channel == channel]
        for (declared, _, _, angle), number in at_angles(reader, angles_rad, at_angle).items():
            if number is not None:
                rows.append(Row.of(declared.name, number, load_N=load, rotation="forward", SA_rad=angle))
    return rows


def _in_sae(curve: Curve) -> Curve:
    turn = signs(curve.axes, "SAE")
    return Curve(
        SA=curve.SA * turn["SA"],
        y=curve.y * turn[curve.channel],
        channel=curve.channel,
        load_N=curve.load_N,
        axes="SAE",
    )


def _direction(load: float, channels: dict[str, tuple[Curve, CurveFit]], path: Path) -> Direction:
    """Return a load of the table as the direction of a test: one condition a row."""
    curve = next(iter(channels.values()))[0]
    order = np.argsort(curve.SA, kind="stable")
    y = {name: curve.y[order] for name, (curve, _) in channels.items()}
    zeros = np.zeros(len(order))
    conditions = tuple(
        Condition(
            file=path.name, file_sha256="", rotation="forward", first_row=i + 1, last_row=i + 1,
            step_SA=None, step_FZ=load, SA=SA, FZ=load, FY=FY, MZ=MZ, sd_SA=0.0, sd_FZ=0.0, u_FY=0.0,
            u_MZ=0.0, indications=(), FY_file=None, MZ_file=None, FZ_common=load, FY_common=FY, MZ_common=MZ,
            u_FY_common=0.0, u_MZ_common=0.0, u_FY_zero=0.0, u_MZ_zero=0.0, used=True, calibration_sha256="",
        )
        for i, (SA, FY, MZ) in enumerate(
            zip(*(a.tolist() for a in (curve.SA[order], y.get("FY", zeros), y.get("MZ", zeros))), strict=True)
        )
    )  # fmt: skip
    fits = {name: fit for name, (_, fit) in channels.items()}
    return Direction(
        group=Group(load_N=load, rotation="forward", conditions=conditions),
        fit=DirectionFit(rotation="forward", load_N=load, FY=fits.get("FY"), MZ=fits.get("MZ")),
    )


def _nothing_shared(identity: str) -> SharedErrors:
    def none(symbol: str) -> TypeB:
        return TypeB(symbol=symbol, u=0.0, relative=0.0, source="a maker's table states none")

    return SharedErrors(
        record=None,
        machine_axes="SAE",
        tared=True,
        SA=none("SA"),
        SA_scale=none("SA_scale"),
        FZ=none("FZ"),
        P=none("P"),
        zero=none("zero"),
        test=identity,
    )


def _check_possible(table: TireTable) -> None:
    for symbol, unit in (("SA", "rad"), ("FZ", "N"), ("FY", "N"), ("MZ", "N*m")):
        values = table.get(symbol)
        if values is not None:
            worst = int(np.argmax(np.abs(values)))
            where = f"{table.path}, column {symbol}, the value number {worst + 1}"
            demand_possible(float(values[worst]), unit, where=where)


def _check_one_condition(table: TireTable) -> None:
    for symbol, (unit, room) in _ONE_VALUE.items():
        values = table.get(symbol)
        if values is None:
            continue
        shown = from_si(values, unit)
        if float(np.ptp(shown)) > 2 * room:
            raise FitError(
                f"the table varies {symbol}: a test is compared at one",
                where=table.path,
                got=f"{float(shown.min()):.4g} to {float(shown.max()):.4g} {unit}",
                expected=f"one {symbol}, the test's",
                next_step="keep the rows of the test's conditions in a table of their own",
                rule="table-varies",
            )
