"""A maker's table as rows: its curves are fitted and read as those of a test are.

A table has one direction of rotation, so it gives stiffness, FY and MZ at slip angles, and no conicity and no
plysteer. Its uncertainty is that of the fit alone: it states nothing else.

A table may also hold characteristics against load, as the source document's figures 6.6 to 6.11 compare them:

    FZ [N],conicity [N],U_conicity [N],plysteer [N],secant_cornering [N/deg]

One row a load; any name of the catalogue that is compared, each with its unit, and optionally its expanded
uncertainty (k = 2) as ``U_<name>``. SAE axes that follow the travel; conicity and plysteer by symmetry.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from toolkit.channels import signs
from toolkit.characteristics.catalogue import compared, of_scope
from toolkit.characteristics.characterise import at_angles
from toolkit.characteristics.characteristic import BOTH
from toolkit.characteristics.groups import CHANNELS, Direction, DirectionFit, Group
from toolkit.characteristics.model import Row
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.shared_errors import SharedErrors
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.errors import CellError, ColumnError, FitError, UnreadableError
from toolkit.findings import Finding
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.machine import TypeB
from toolkit.recording.csvfile import Line, pointed, read_lines
from toolkit.recording.table import shown
from toolkit.reduction.model import Condition
from toolkit.reduction.selection import of_one_condition
from toolkit.spelling import nearest
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.model import Curve, CurveFit
from toolkit.tires.plausibility import demand_possible
from toolkit.tires.table import TireTable, read_table
from toolkit.tires.table_fit import (
    axes_findings,
    condition_findings,
    fit_findings,
    repeat_findings,
    table_curves,
)
from toolkit.units import from_si, split_header, unit

# The characteristics that a maker can state against load, by name, with their SI unit.
_STATED = {declared.name: declared for declared in compared() if declared.scope != "angle"}
_NAMES = {name: declared.unit for name, declared in _STATED.items()}


def is_characteristics_table(path: Path) -> bool:
    """Tell whether a CSV file's header has FZ and a characteristic, and no slip angle."""
    head = next(iter(_lines(path)), (0, []))[1]
    names = {split_header(cell, _is_name)[0] for cell in head}
    # A misspelt name still tells which kind of table was meant, and the error then names the right columns.
    near = any(difflib.get_close_matches(name, _NAMES, n=1, cutoff=0.8) for name in names)
    return "SA" not in names and near


def maker_characteristics(path: Path, *, identity: str) -> tuple[Row, ...]:
    """Return a table's rows in SI.

    Raises
    ------
    UnreadableError
        no text, no rows
    ColumnError
        a column is unknown, doubled, missing, or without a unit; a load stands twice
    CellError
        a cell that is no finite number, a negative uncertainty, a value that no tire has; an empty one is a
        value that the maker does not give
    """
    lines = _lines(path)
    head = lines[0][1] if lines else []
    columns = [_column(cell, path) for cell in head]
    names = [name for name, _ in columns]
    for name in names:
        if names.count(name) > 1:
            _refuse(path, "doubled-column", f"the column {name} stands twice", ", ".join(head), f"one {name}")
    for name in names:
        if name.startswith("U_") and name.removeprefix("U_") not in names:
            _refuse(
                path, "missing-column", f"{name} has no value beside it", ", ".join(head),
                f"a column {name.removeprefix('U_')}",
            )  # fmt: skip
    if "FZ" not in names:
        _refuse(path, "missing-column", "the table has no column FZ", ", ".join(head), "FZ [N]")
    rows: list[Row] = []
    loads: set[float] = set()
    for number, cells in lines[1:]:
        if len(cells) != len(head):
            raise CellError(
                f"row {number} has another number of cells than the header", where=f"{path}, row {number}",
                got=len(cells), expected=len(head), next_step="mend that row; decimals take a point",
                rule="ragged-row",
            )  # fmt: skip
        values = {
            name: _number(cell, factor, f"{path}, row {number}, column {name}", needed=name == "FZ")
            for (name, factor), cell in zip(columns, cells, strict=True)
        }
        for name, value in values.items():
            if value is not None:
                demand_possible(
                    value,
                    "N" if name == "FZ" else _NAMES[name.removeprefix("U_")],
                    where=f"{path}, row {number}, column {name}",
                    U=name.startswith("U_"),
                )
        load = abs(values["FZ"] or 0.0)
        if load in loads or load <= 0:
            fault = f"row {number}: the load {'stands twice' if load else 'is zero'}"
            _refuse(path, "doubled-load", fault, f"{load:g} N", "each load once, above zero")
        loads.add(load)
        rows += _rows_of(values, load, identity)
    if not rows:
        raise UnreadableError(
            "the table has no data", where=path, got="a header and no values", expected="one row a load",
            next_step="add the rows", rule="no-data",
        )  # fmt: skip
    return tuple(rows)


def _rows_of(values: dict[str, float | None], load: float, identity: str) -> list[Row]:
    rows = []
    for name, si in _NAMES.items():
        value = values.get(name)
        if value is None:
            continue
        U = values.get(f"U_{name}")
        parts = (
            ()
            if not U
            else (Part(source="maker's statement", key=f"maker/{identity}/{name}/{load:.9g}", u=U / 2),)
        )
        rows.append(
            Row.of(
                name,
                Uncertain(value=value, unit=si, parts=parts),
                load_N=load,
                rotation=BOTH if _STATED[name].scope == "load" else "forward",
            )
        )
    return rows


def _lines(path: Path) -> list[Line]:
    lines, separator = read_lines(read_input(path, TABLE_FILE), _is_header, where=path)
    return [*lines[:1], *pointed(lines[1:], separator, where=path)]


def _is_header(header: str) -> bool:
    return _is_name(split_header(header, _is_name)[0])


def _is_name(name: str) -> bool:
    return name == "FZ" or name.removeprefix("U_") in _NAMES


def _column(cell: str, path: Path) -> tuple[str, float]:
    name, stated_unit = split_header(cell, _is_name)
    bare = name.removeprefix("U_")
    if not _is_name(name):
        near = nearest(bare, ["FZ", *_NAMES])
        _refuse(
            path, "unknown-column", f"unknown column {name!r}", repr(cell),
            f"{near} [unit]" if near else ", ".join(["FZ", *_NAMES]),
        )  # fmt: skip
    if stated_unit is None:
        _refuse(
            path, "unknown-unit", f"the column {name} has no unit", repr(cell), f"'{name} [unit]', e.g. [N]"
        )
    where = f"{path}, column {cell.strip()!r}"
    expected_unit = unit("N" if name == "FZ" else _NAMES[bare])
    stated = unit(stated_unit, where=where)
    # An angle has no dimension of its own: N and N/deg are told apart by what they are per.
    if stated.dimension != expected_unit.dimension or ("/" in stated.text) != ("/" in expected_unit.text):
        _refuse(
            path, "unit-dimension", f"the unit of {name} is of another kind", stated_unit, expected_unit.text
        )
    return name, stated.factor / expected_unit.factor


def _number(cell: str, factor: float, where: str, *, needed: bool) -> float | None:
    text = cell.strip()
    if not text and not needed:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CellError(
            "no number", where=where, got=shown(text) if text else "an empty cell",
            expected="a finite number with a decimal point", next_step="mend that cell",
            rule="text-cell" if text else "empty-cell",
        )  # fmt: skip
    return value * factor


def _refuse(path: Path, rule: str, problem: str, actual: str, expected: str) -> NoReturn:
    raise ColumnError(
        problem, where=path, got=actual, expected=expected, next_step="mend the table", rule=rule
    )


def maker_rows(
    path: Path, *, axes: str, angles_rad: Sequence[float], identity: str
) -> tuple[tuple[Row, ...], tuple[Finding, ...]]:
    """Return a table's characteristics in SAE axes, FY and MZ at the slip angles given.

    Raises
    ------
    FitError
        not one curve of the table can be fitted, or the table has rows that a test has not
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
        *condition_findings(table),
        *(
            replace(finding, where=f"{path.name}, {finding.where}")
            for finding in (*warnings, *axes_findings(sae, fits))
        ),
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
    for symbol, si_unit in (("SA", "rad"), ("FZ", "N"), ("FY", "N"), ("MZ", "N*m")):
        values = table.get(symbol)
        if values is not None:
            worst = int(np.argmax(np.abs(values)))
            where = f"{table.path}, column {symbol}, the value number {worst + 1}"
            demand_possible(float(values[worst]), si_unit, where=where)


def _check_one_condition(table: TireTable) -> None:
    # A test rolls freely and upright, at one pressure and speed: no other rows can be held against it.
    selection = of_one_condition(dict(table.columns), (), rows=len(table["SA"]))
    if departs := (*selection.apart, *selection.stands):
        raise FitError(
            "the table has rows at other conditions than a test has",
            where=table.path,
            got="; ".join(departs),
            expected="one condition, the test's: freely rolling, upright, one pressure and speed",
            next_step="keep the rows of the test's conditions in a table of their own",
            rule="table-varies",
        )


def maker_conditions(path: Path, *, axes: str) -> tuple[tuple[str, str | None], ...]:
    """Return the pressure and the speed that a table of forces has, as a test states its own."""
    table = read_table(path, axes=axes)
    stated = (("pressure", "P", "kPa", 1), ("speed", "V", "km/h", 2))
    medians = {name: None if (column := table.get(name)) is None else np.median(np.abs(column))
               for _, name, _, _ in stated}  # fmt: skip
    return tuple(
        (what, None if (si := medians[name]) is None else f"{float(from_si(si, unit)):.{digits}f} {unit}")
        for what, name, unit, digits in stated
    )
