"""Read a whole test back from its .xlsx file."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections import deque
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, cast, get_type_hints

from toolkit.calibration.records.use import UNSIGNED, CalibrationUse
from toolkit.channels import Rotation
from toolkit.characteristics.catalogue import by_name
from toolkit.characteristics.characterise import lacking_row
from toolkit.characteristics.groups import Direction, DirectionFit, group, sweeps_at
from toolkit.characteristics.model import Characteristics, Point, Row, in_order
from toolkit.characteristics.sweep_fit import SweepFit
from toolkit.errors import RecordingError
from toolkit.estimate import Estimate
from toolkit.findings import Finding, Level
from toolkit.machine import TypeB
from toolkit.pipeline import TestResult
from toolkit.recording.model import TestInfo
from toolkit.recording.safe_open import check_workbook
from toolkit.reduction.model import Condition, HubLoad, ReducedTest, Tare
from toolkit.testfile.layout import (
    CONDITION_FIELDS,
    DIGEST,
    FIRST_SCHEMA,
    HUB,
    KIND,
    LATER_SHEETS,
    SCHEMA,
    SHEETS,
    SWEEPS,
    CellsHash,
    content_hash,
    header,
    number,
    optional,
)
from toolkit.tires.model import CurveFit, Parameter

Cells = dict[str, Any]


def read_test_file(path: Path) -> TestResult:
    """Read a whole test.

    Raises
    ------
    RecordingError
        the file is no test file, of a newer schema, of a form from before 1.0.0 that has no reader
        (``older-test-file``), or was changed after it was written
    """
    from python_calamine import CalamineError

    try:
        return _read(path)
    except CalamineError as error:
        raise _broken(path, str(error), "cells as a worksheet has them") from error


def _read(path: Path) -> TestResult:
    book, formulas = _open(path)
    names = [name for name in (*SHEETS, SWEEPS) if name in book.sheet_names and name != "raw"]
    tables = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in names}
    sheets = {name: _rows(table) for name, table in tables.items()}
    items = {str(row.get("item")): row.get("value") for row in sheets.get("provenance", ())}
    lacking = [name for name in SHEETS if name not in book.sheet_names]
    if lacking == list(LATER_SHEETS) and items.get("kind") == KIND:
        raise RecordingError(
            "the reduced test has a form from before toolkit 1.0.0 that is read no more",
            where=path,
            got=f"no sheets {', '.join(lacking)}; written by toolkit {items.get('code_version')}",
            expected="a reduced test of toolkit 1.0.0 or later, or of the last builds of 0.1.0",
            next_step="process the recordings again; the sheet raw of the file holds them",
            rule="older-test-file",
        )
    if lacking:
        raise _broken(path, f"no sheet {lacking[0]}", "the sheets of a reduced test")
    if items.get("kind") != KIND or items.get("schema") not in (FIRST_SCHEMA, SCHEMA):
        kind = f"{items.get('kind')}, schema {items.get('schema')}"
        raise _broken(path, kind, f"{KIND}, schema {FIRST_SCHEMA} or {SCHEMA}")
    try:
        result = _result(sheets, items)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise _broken(path, f"{type(error).__name__}: {error}", "the layout of a reduced test") from error
    hashes = [_cells(book, tables)] if items["schema"] == SCHEMA else list(_hashes(result))
    if formulas or str(items[DIGEST]) not in hashes:
        if _rounded(tables):
            raise RecordingError(
                "the reduced test was saved again by a program that rounds numbers",
                where=path,
                got=f"no number of more than {_KEPT} digits, as LibreOffice Calc saves them",
                expected=f"the file as it was written, {str(items[DIGEST])[:16]}...",
                next_step="use the file that 'toolkit process' wrote, or process the recordings again: "
                "whether anything else was changed, nobody can tell",
                rule="test-file-changed",
            )
        raise RecordingError(
            "the reduced test was changed after it was written",
            where=path,
            got=f"a formula in {formulas[0]}" if formulas else f"content hash {hashes[0][:16]}...",
            expected=f"{str(items[DIGEST])[:16]}...",
            next_step="process the recordings again; a reduced test is never edited by hand",
            rule="test-file-changed",
        )
    return result


_KEPT = 15
"""Significant digits that LibreOffice Calc saves of a number; a double has up to 17."""


def _rounded(tables: dict[str, list[list[Any]]]) -> bool:
    """Tell whether no number of a workbook has more digits than a program keeps that rounds them."""
    cells = (cell for rows in tables.values() for row in rows for cell in row)
    return all(float(f"{cell:.{_KEPT}g}") == cell for cell in cells if isinstance(cell, float))


def _cells(book: Any, tables: dict[str, list[list[Any]]]) -> str:
    """Return the hash of all cells of all sheets; ``tables`` are those that have been read already."""
    cells = CellsHash()
    for name in book.sheet_names:
        rows = tables.get(name) or book.get_sheet_by_name(name).iter_rows()
        deque(cells.rows(name, rows), maxlen=0)
    return cells.hexdigest()


def _hashes(result: TestResult) -> Iterator[str]:
    """Yield the hashes by which a file of schema 1 holds: its last one, and without intervals its first."""
    yield content_hash(result)
    fits = [fit for entry in result.characteristics.fits for fit in (entry.FY, entry.MZ) if fit is not None]
    if all(parameter.interval95 is None for fit in fits for parameter in fit.parameters):
        yield content_hash(result, before_intervals=True)


_FORMULA = re.compile(rb"<(?:[\w.-]+:)?f[\s/>]")


def _open(path: Path) -> tuple[Any, list[str]]:
    """Return the workbook and its members with a formula: it shows another value when it is opened next."""
    from python_calamine import CalamineWorkbook

    gated = check_workbook(path)
    formulas = [name for name, xml in gated.members.items() if b"sheetData" in xml and _FORMULA.search(xml)]
    return CalamineWorkbook.from_filelike(BytesIO(gated.data)), formulas


def _broken(path: Path, actual: str, expected: str) -> RecordingError:
    return RecordingError(
        "the file is no reduced test",
        where=path,
        got=actual,
        expected=expected,
        next_step="give the folder of the test, or a file made by 'toolkit process --out'",
        rule="not-a-test-file",
    )


def _rows(table: list[list[Any]]) -> list[Cells]:
    if not table:
        return []
    head = [str(text) for text in table[0]]
    return [dict(zip(head, row, strict=True)) for row in table[1:]]


def _result(sheets: dict[str, list[Cells]], items: Cells) -> TestResult:
    reduced = ReducedTest(
        info=TestInfo(
            **{
                field.name: _as(_hints(TestInfo)[field.name], items[f"info.{field.name}"])
                for field in dataclasses.fields(TestInfo)
            }
        ),
        calibration=CalibrationUse(
            id=items["calibration.id"],
            sha256=items["calibration.sha256"],
            unverified=bool(items["calibration.unverified"]),
            draft_reasons=_numbered(items, "calibration.draft_reason"),
            since=_numbered(items, "calibration.since"),
            signature=str(items.get("calibration.signature", UNSIGNED)),
        ),
        conditions=tuple(_condition(row) for row in sheets["reduced"]),
        tare=Tare(
            source=items["tare.source"],
            values=tuple(
                (key.removeprefix("tare.values."), number(value))
                for key, value in items.items()
                if key.startswith("tare.values.")
            ),
            unit=items["tare.unit"],
            u=tuple(
                (key.removeprefix("tare.u."), number(value))
                for key, value in items.items()
                if key.startswith("tare.u.")
            ),
        ),
        averaging=items["averaging"],
        findings=_findings(sheets["findings"]),
        code_version=items["code_version"],
        axes=items["axes"],
        protocol=items["protocol"],
        machine_title=items.get("machine_title", ""),
        stated=_stated(items),
        definition="\n".join(_numbered(items, "definition")),
    )
    return TestResult(reduced=reduced, characteristics=_characteristics(sheets, reduced))


def _stated(items: Cells) -> tuple[TypeB, ...]:
    cellses: dict[str, Cells] = {}
    for key, value in items.items():
        if key.startswith("stated."):
            _, symbol, name = key.split(".")
            cellses.setdefault(symbol, {})[name] = value
    return tuple(
        TypeB(
            symbol=symbol,
            u=number(cellse["u"]),
            relative=number(cellse["relative"]),
            effect=number(cellse["effect"]),
            source=str(cellse["source"]),
            common=cellse["common"],
        )
        for symbol, cellse in cellses.items()
    )


@functools.cache
def _hints(cls: type) -> dict[str, str]:
    """Return the annotations of a class as texts; resolved for each row they took a fifth of the reading."""
    return {name: str(kind) for name, kind in get_type_hints(cls).items()}


def _as(kind: str, value: Any) -> Any:
    """Return a cell as the type of its field; an empty cell is None."""
    if value in ("", None):
        return None
    if "bool" in kind:
        return bool(value)
    if "float" in kind:
        return float(value)
    return int(value) if "int" in kind else str(value)


def _condition(row: Cells) -> Condition:
    hints = _hints(Condition)
    conditions = {name: _as(hints[name], row[header(name)]) for name in CONDITION_FIELDS}
    cells = tuple(number(value) for key, value in row.items() if key.startswith("indication_"))
    hub = tuple(
        HubLoad(load=load, value=number(row[name]), u=number(row[header(f"u_{HUB}{load}")]))
        for name in row
        if name.startswith(HUB) and (load := name.removeprefix(HUB).partition(" ")[0])
    )
    return Condition(**conditions, indications=cells, hub=hub)


def _findings(rows: list[Cells]) -> tuple[Finding, ...]:
    return tuple(
        Finding(
            level=cast("Level", row["level"]), rule=row["rule"], where=row["where"], message=row["message"]
        )
        for row in rows
    )


def _numbered(items: Cells, name: str) -> tuple[str, ...]:
    return tuple(str(value) for key, value in items.items() if key.startswith(f"{name}."))


def _estimate(value: Any, u: Any, dof: Any, unit: Any) -> Estimate | None:
    if value in ("", None):
        return None
    return Estimate(value=number(value), u=number(u), dof=number(dof), unit=str(unit))


def _interval(row: Cells) -> tuple[float | None, float | None] | None:
    # Files of earlier versions have no such columns.
    low, high = optional(row.get("low_95")), optional(row.get("high_95"))
    return None if low is None and high is None else (low, high)


def _fit(row: Cells, parameters: list[Cells], covariances: dict[tuple[str, str], float]) -> CurveFit:
    hints = _hints(CurveFit)
    cells: Cells = {}
    for field in dataclasses.fields(CurveFit):
        if field.name in row:
            value = row[field.name]
            is_list = "tuple" in hints[field.name]
            cells[field.name] = tuple(str(value).split()) if is_list else _as(hints[field.name], value)
    cells["message"] = cells["message"] or ""
    names = [str(parameter["parameter"]) for parameter in parameters]
    return CurveFit(
        **cells,
        parameters=tuple(
            Parameter(
                name=str(parameter["parameter"]),
                value=number(parameter["value"]),
                unit=str(parameter["unit"]),
                standard_error=optional(parameter["standard_error"]),
                dof=optional(parameter["dof"]),
                interval95=_interval(parameter),
            )
            for parameter in parameters
        ),
        covariance=tuple(tuple(covariances[a, b] for b in names) for a in names) if covariances else (),
        slope_at_zero=_estimate(*(row[f"slope_at_zero {p}"] for p in ("value", "u", "dof", "unit"))),
        value_at_zero=_estimate(*(row[f"value_at_zero {p}"] for p in ("value", "u", "dof", "unit"))),
    )


def _characteristics(sheets: dict[str, list[Cells]], reduced: ReducedTest) -> Characteristics:
    covariances: dict[int, dict[tuple[str, str], float]] = {}
    for row in sheets["fit_covariance"]:
        covariances.setdefault(int(row["fit"]), {})[row["parameter"], row["with"]] = number(row["covariance"])
    parameters: dict[int, list[Cells]] = {}
    for row in sheets["fit_parameters"]:
        parameters.setdefault(int(row["fit"]), []).append(row)
    fits = {
        (row["rotation"], number(row["group_load_N"]), row["channel"]): _fit(
            row, parameters.get(index, []), covariances.get(index, {})
        )
        for index, row in enumerate(sheets["fits"])
    }
    described = sheets["characteristics"]
    fitted = tuple(
        DirectionFit(
            rotation=cast("Rotation", cells["rotation"]),
            load_N=number(cells["load_N"]),
            FY=fits.get((cells["rotation"], number(cells["load_N"]), "FY")),
            MZ=fits.get((cells["rotation"], number(cells["load_N"]), "MZ")),
        )
        for cells in described
        if cells["name"] == "group"
    )
    listed = group(reduced)
    groups = {(entry.load_N, entry.rotation): entry for entry in listed}
    sweeps = tuple(_sweep(cells) for cells in sheets.get(SWEEPS, ()))
    directions = [
        Direction(
            group=groups[fit.load_N, fit.rotation],
            fit=fit,
            sweeps=sweeps_at(groups[fit.load_N, fit.rotation], listed, sweeps),
        )
        for fit in fitted
        if (fit.load_N, fit.rotation) in groups
    ]
    budgets = _budgets(sheets["budgets"])
    rows = [
        _row(cells, budgets, directions)
        for cells in (*described, *sheets["at_angles"])
        if cells["name"] != "group"
    ]
    return Characteristics(
        fits=fitted,
        rows=in_order(rows, fitted),
        findings=_findings(sheets["characteristic_findings"]),
        points=tuple(
            Point(
                file=str(r["file"]),
                first_row=int(r["first_row"]),
                u_FY=number(r["u_FY [N]"]),
                u_MZ=number(r["u_MZ [N*m]"]),
            )
            for r in sheets["points"]
        ),
        sweeps=sweeps,
    )


def _sweep(cells: Cells) -> SweepFit:
    hints = _hints(SweepFit)
    texts = {name: _as(hints[name], cells[name]) for name in hints}
    return SweepFit(**(texts | {"file_sha256": str(cells["file_sha256"])}))


_Budgets = dict[tuple[float, str, str], list[tuple[str, float]]]


def _row(cells: Cells, budgets: _Budgets, directions: Sequence[Direction]) -> Row:
    load, rotation, name = number(cells["load_N"]), str(cells["rotation"]), str(cells["name"])
    SA = number(cells["SA_rad"]) if "SA_rad" in cells else None
    estimate = _estimate(cells["value"], cells["u"], cells["dof"], cells["unit"])
    if estimate is None:
        at_load = [direction for direction in directions if direction.group.load_N == load]
        return lacking_row(by_name()[name], (load, rotation, SA), at_load)
    return Row(
        name=by_name()[name].name,
        load_N=load,
        rotation=rotation,
        SA_rad=SA,
        estimate=estimate,
        sources=() if SA is not None else tuple(budgets.get((load, rotation, name), ())),
    )


def _budgets(rows: list[Cells]) -> _Budgets:
    sources: _Budgets = {}
    for cells in rows:
        lines = sources.setdefault((number(cells["load_N"]), str(cells["rotation"]), str(cells["name"])), [])
        if cells["source"] not in ("", None):
            lines.append((str(cells["source"]), number(cells["u"])))
    return sources
