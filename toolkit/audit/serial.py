"""A file's audit as plain JSON values, and back exactly; many of them as a Parquet table."""

from __future__ import annotations

import datetime as dt
import itertools
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from toolkit.audit.archive_findings import noted
from toolkit.audit.estimate import Coefficient, Equation, Estimate, Nearest
from toolkit.audit.model import NOT_IDENTIFIED, Identification, Repair, Segment, Sides, Skipped
from toolkit.audit.one_file import Change, FileAudit
from toolkit.errors import OutputError
from toolkit.publication import publication
from toolkit.recording.extras import needed
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT, refuse_original

_CHANGE = tuple(field.name for field in fields(Change))
SHAPE = 6
"""Of what is written here; results of another one are not used again."""
SUFFIX = ".parquet"
_BATCH = 1024  # rows that are held at once


def to_plain(file_audit: FileAudit) -> dict[str, Any]:
    """Return a file's audit under the keys of the answer; what it does not have is None or empty."""
    identification = file_audit.identification
    repair = None if identification is None else identification.repair
    return {
        "path": file_audit.path,
        "sha256": file_audit.sha256,
        "size": file_audit.size,
        "instrument": file_audit.instrument,
        "date": _day(file_audit.date),
        "test": file_audit.test,
        "rotation": file_audit.rotation,
        "to_SAE": dict(file_audit.to_SAE),
        "own_protocol": file_audit.own_protocol,
        "rows": file_audit.rows,
        "grade": file_audit.grade,
        "record": None if identification is None else identification.record,
        "variant": None if identification is None else identification.variant,
        "issued": None if identification is None else identification.issued,
        "candidates": [] if identification is None else list(identification.candidates),
        "segments": []
        if identification is None
        else [asdict(part) | {"candidates": list(part.candidates)} for part in identification.segments],
        "sides": None
        if identification is None or identification.sides is None
        else asdict(identification.sides),
        "in_force": None if identification is None else identification.in_force,
        "repair": None if repair is None else asdict(repair),
        "conditions": [_change(change) for change in file_audit.changes],
        "estimate": None if file_audit.estimate is None else _estimate(file_audit.estimate),
        "skipped": [] if identification is None else [asdict(record) for record in identification.skipped],
        "reason": file_audit.reason,
        "test_toml": file_audit.context,
        "units": dict(file_audit.units),
        "values_sha256": file_audit.values_sha256,
        "modified": _day(file_audit.modified),
        "notes": [{"rule": note.rule, "message": note.message} for note in file_audit.notes],
    }


def from_plain(plain: Mapping[str, Any]) -> FileAudit:
    """Return the audit that `to_plain` wrote.

    Raises
    ------
    KeyError, TypeError, ValueError
        it is not what this version writes
    """
    estimate = plain["estimate"]
    return FileAudit(
        path=plain["path"],
        sha256=plain["sha256"],
        size=plain["size"],
        instrument=plain["instrument"],
        date=_date(plain["date"]),
        rows=plain["rows"],
        identification=None if plain["grade"] in NOT_IDENTIFIED else _identification(plain),
        reason=plain["reason"],
        context=plain["test_toml"],
        test=plain["test"],
        rotation=plain["rotation"],
        to_SAE=tuple(plain["to_SAE"].items()),
        own_protocol=plain["own_protocol"],
        units=tuple(plain["units"].items()),
        values_sha256=plain["values_sha256"],
        modified=_date(plain["modified"]),
        changes=tuple(Change(**change) for change in plain["conditions"]),
        estimate=None if estimate is None else _estimated(estimate),
        notes=tuple(noted(note, plain["path"]) for note in plain["notes"]),
    )


def _day(day: dt.date | None) -> str | None:
    return None if day is None else day.isoformat()


def _date(text: str | None) -> dt.date | None:
    return None if text is None else dt.date.fromisoformat(text)


def _change(change: Change) -> dict[str, Any]:
    return {name: getattr(change, name) for name in _CHANGE}


def _estimate(estimate: Estimate) -> dict[str, Any]:
    return {
        "first_row": estimate.first_row,
        "last_row": estimate.last_row,
        "equations": {
            equation.load: {
                "unit": equation.unit,
                "linear": equation.linear,
                "rms": equation.rms,
                "max_abs": equation.max_abs,
                "coefficients": {
                    c.name: {"value": c.value, "low": c.low, "high": c.high} for c in equation.coefficients
                },
            }
            for equation in estimate.equations
        },
        "nearest": None if estimate.nearest is None else asdict(estimate.nearest),
    }


def _estimated(plain: Mapping[str, Any]) -> Estimate:
    return Estimate(
        first_row=plain["first_row"],
        last_row=plain["last_row"],
        equations=tuple(
            Equation(
                load=load,
                unit=equation["unit"],
                linear=equation["linear"],
                rms=equation["rms"],
                max_abs=equation["max_abs"],
                coefficients=tuple(
                    Coefficient(name=name, **c) for name, c in equation["coefficients"].items()
                ),
            )
            for load, equation in plain["equations"].items()
        ),
        nearest=None if plain["nearest"] is None else Nearest(**plain["nearest"]),
    )


def _identification(plain: Mapping[str, Any]) -> Identification:
    repair = plain["repair"]
    return Identification(
        grade=plain["grade"],
        record=plain["record"],
        variant=plain["variant"],
        issued=plain["issued"],
        candidates=tuple(plain["candidates"]),
        segments=tuple(
            Segment(**{**segment, "candidates": tuple(segment["candidates"])})
            for segment in plain["segments"]
        ),
        in_force=plain["in_force"],
        repair=None if repair is None else Repair(**repair),
        skipped=tuple(Skipped(**skipped) for skipped in plain["skipped"]),
        sides=None if plain["sides"] is None else Sides(**plain["sides"]),
    )


def check_parquet(target: Path) -> None:
    """Tell before hours of work whether the table can be written.

    Raises
    ------
    ConfigError
        ``missing-extra``: pyarrow is not installed
    OutputError
        ``output-name original``: not named .parquet, or a file that the toolkit did not make
    """
    needed("pyarrow.parquet", extra="parquet", to="write a Parquet table", where=target)
    refuse_original(target, suffix=SUFFIX)


def write_parquet(
    target: Path, files: Iterable[Mapping[str, Any]], *, known_at: dt.date, reports: bool = False
) -> None:
    """Write the results, whole or not at all.

    ``files`` are plain answers (`toolkit.audit.serial.to_plain`) in the order in which they are written;
    days are dates, lists and tables are nested columns, what a file does not have is null. A name that is no
    UTF-8 has its odd bytes as ``\\xhh``. ``reports``: the files have the reports that rest on them.

    Raises
    ------
    ConfigError, OutputError
        see `check_parquet`; or the file cannot be written
    """
    check_parquet(target)
    arrow: Any = needed("pyarrow", extra="parquet", to="write a Parquet table", where=target)
    parquet: Any = needed("pyarrow.parquet", extra="parquet", to="write a Parquet table", where=target)
    marks = {"generator": GENERATOR, "marks": OWN_OUTPUT, "schema": "1", "kind": "audit"}
    schema = _schema(arrow, reports=reports).with_metadata({**marks, "known_at": known_at.isoformat()})
    rows = iter(files)
    with publication(target.parent) as stage:
        try:
            with parquet.ParquetWriter(stage / target.name, schema) as writer:
                while batch := [_row(line, schema.names) for line in itertools.islice(rows, _BATCH)]:
                    writer.write_batch(arrow.RecordBatch.from_pylist(batch, schema=schema))
        except arrow.ArrowInvalid as error:
            raise OutputError(
                "a result does not fit the table", where=target, got=error, expected="the audit's own keys",
                next_step="use the JSON lines instead, and report this", rule="not-writable",
            ) from error  # fmt: skip


def _row(line: Mapping[str, Any], names: list[str]) -> dict[str, Any]:
    fields = {name: line[name] for name in names}
    fields["path"] = os.fsencode(line["path"]).decode("utf-8", "backslashreplace")
    for key in ("date", "modified"):
        fields[key] = None if line[key] is None else dt.date.fromisoformat(line[key])
    for key in ("to_SAE", "units"):
        fields[key] = list(line[key].items())
    estimate = line["estimate"]
    if estimate is not None:
        fields["estimate"] = {
            **estimate,
            "equations": [
                (load, {**equation, "coefficients": list(equation["coefficients"].items())})
                for load, equation in estimate["equations"].items()
            ],
        }
    return fields


def _schema(pa: Any, *, reports: bool) -> Any:
    text, number, integer, truth = pa.string(), pa.float64(), pa.int64(), pa.bool_()
    change = dict.fromkeys(("FY_max_abs_N", "MZ_max_abs_Nm"), number)
    segment = {"first_row": integer, "last_row": integer, "record": text, "variant": text, "grade": text,
               "candidates": pa.list_(text)}  # fmt: skip
    condition = {"first_row": integer, "last_row": integer, "SA_deg": number, "FZ_N": number, "FY_N": number,
                 "MZ_Nm": number, "FY_change_N": number, "MZ_change_Nm": number, "step_SA_deg": number,
                 "step_FZ_N": number}  # fmt: skip
    coefficient = {"value": number, "low": number, "high": number}
    equation = {"unit": text, "linear": truth, "rms": number, "max_abs": number,
                "coefficients": pa.map_(text, pa.struct(coefficient))}  # fmt: skip
    estimate = {"first_row": integer, "last_row": integer, "equations": pa.map_(text, pa.struct(equation)),
                "nearest": pa.struct({"record": text, **change})}  # fmt: skip
    sides = pa.struct(dict.fromkeys(("side", "reason", "grade"), text))
    columns = {
        "path": text, "sha256": text, "size": integer, "instrument": text, "date": pa.date32(), "test": text,
        "rotation": text, "to_SAE": pa.map_(text, pa.int8()), "own_protocol": truth, "rows": integer,
        "grade": text, "record": text, "variant": text, "issued": truth, "candidates": pa.list_(text),
        "segments": pa.list_(pa.struct(segment)), "in_force": text, "repair": pa.struct(change),
        "sides": sides, "conditions": pa.list_(pa.struct(condition)), "estimate": pa.struct(estimate),
        "skipped": pa.list_(pa.struct({"id": text, "reason": text})), "reason": text, "test_toml": text,
        "units": pa.map_(text, text), "values_sha256": text, "modified": pa.date32(),
        "notes": pa.list_(pa.struct({"rule": text, "message": text})),
    }  # fmt: skip
    if reports:
        columns["reports"] = pa.list_(text)
    return pa.schema(columns)
