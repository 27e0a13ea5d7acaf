"""The files of an audit as a Parquet table."""

from __future__ import annotations

import datetime as dt
import itertools
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from toolkit.errors import OutputError
from toolkit.publication import publication
from toolkit.recording.extras import needed
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT, refuse_original

SUFFIX = ".parquet"
_BATCH = 1024  # rows that are held at once


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

    ``files`` are plain `toolkit.audit.one_file.ArchivedFile` in the order in which they are written; days are
    dates, lists and tables are nested columns, what a file does not have is null. A name that is no UTF-8 has
    its odd bytes as ``\\xhh``. ``reports``: the files have the reports that rest on them.

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
