"""The calibration record: an immutable value, its canonical JSON and its SHA-256.

The hash covers ``content``: data hashes, terms, settings, coefficients, covariance, units, polarity,
degrees of freedom and ranges. Software versions stand beside it. Floats are written as the shortest
decimal that reads back to the same double, so that a record is the same bytes for ever.
"""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from toolkit.calibration.issued import issued_text
from toolkit.calibration.records.scatter import MODELS, UNTOLD, RunScatter
from toolkit.calibration.terms import term_matrix
from toolkit.errors import RecordError
from toolkit.files import parse_json, sha256_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from toolkit.arrays import Array

Zero = Literal["included", "tared", "run"]
ZEROS: tuple[Zero, ...] = ("included", "tared", "run")
Kind = Literal["fit", "legacy"]
SCHEMA = 1
DEFAULT_TOLERANCE = 1e-3  # of the largest load: what check loads may be off by where nothing is stated
ROUNDING = "equal-readings-1"  # readings of equal size share their rounding (`fit.rounding`)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFile:
    """A file that lies beside the record and belongs to it: ``role`` is loads, check, session or source."""

    role: str
    file: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Indication:
    """One load cell's output: its unit, the range of the fitted data in it, its serial number.

    ``column_unit`` is the unit of the stored data where they were converted to ``unit`` by the cell's
    excitation or scale (`session.bridge`); None: the data are in ``unit``. ``step`` is the step of the
    readings, in ``unit``, that counts as the resolution where none is stated (`fit.rounding`).
    """

    name: str
    unit: str
    minimum: float | None = None
    maximum: float | None = None
    serial: str | None = None
    column_unit: str | None = None
    step: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadFit:
    """One load's equation, in the session's own units: load = sum of coefficient times term.

    ``terms``, ``coefficients`` (full precision), ``issued`` (the digits an acquisition program is given)
    and ``polarity`` (-1, 0, +1) stand in the same order, the intercept last. ``covariance`` is a square of
    the same order, empty for a legacy import, whose ``dof`` and ``residual_sd`` are None.
    ``tolerance`` is that of the check loads, ``minimum`` and ``maximum`` the range of the fitted loads.
    ``scatter`` is what the covariance was made of where the session's runs tell it (`records.scatter`); None:
    the covariance takes every row for independent, as that of one run alone and of records made before.
    ``reference_u`` is the largest standard uncertainty that the session states row by row of the reference
    load where the fit does not weigh by it; None where it states none. ``rounding`` names the model by which
    the covariance holds the stated resolution of the indications; None: it does not, as none is stated or in
    records made before.
    """

    load: str
    unit: str
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    issued: tuple[float, ...]
    polarity: tuple[int, ...]
    covariance: tuple[tuple[float, ...], ...] = ()
    method: str = "none"
    n: int | None = None
    dof: int | None = None
    residual_sd: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    tolerance: float | None = None
    scatter: RunScatter | None = None
    reference_u: float | None = None
    rounding: str | None = None

    @property
    def largest(self) -> float:
        """Largest absolute load of the fitted data; NaN where there is none."""
        if self.minimum is None or self.maximum is None:
            return float("nan")
        return max(abs(self.minimum), abs(self.maximum))

    @property
    def check_tolerance(self) -> float:
        """Tolerance of the check loads: as stated, else a part of the largest load; NaN without a range."""
        return self.tolerance or DEFAULT_TOLERANCE * self.largest

    @property
    def interval(self) -> tuple[float, float]:
        """The calibrated interval: from the smallest fitted load to the largest, and zero in it."""
        return min(self.minimum or 0.0, 0.0), max(self.maximum or 0.0, 0.0)

    def at(self, columns: Mapping[str, Array]) -> Array:
        """Return the load (rows,) at indications by name (rows,), both in the record's units."""
        return np.asarray(term_matrix(self.terms, columns) @ np.asarray(self.coefficients))

    @property
    def issued_texts(self) -> tuple[str, ...]:
        """Issued coefficients in the digits of their issue."""
        return tuple(issued_text(value, self.method) for value in self.issued)

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Standard errors of the coefficients; empty for a legacy import."""
        return tuple(row[i] ** 0.5 for i, row in enumerate(self.covariance))

    @property
    def covariance_model(self) -> str:
        """By what the covariance was made: the scatter's model, independent rows, stated uncertainties."""
        if self.scatter is not None:
            return self.scatter.model
        if not self.covariance:
            return "none"
        return "independent rows" if self.method == "ols" else "stated uncertainties"

    @property
    def scatter_words(self) -> str | None:
        """The scatter in a line; None where nothing tells it."""
        s = self.scatter
        if s is None:
            return None
        between = f"between {s.groups} {s.factor}s" if s.groups > 1 else f"of another {s.factor}, as stated:"
        if s.model == UNTOLD:
            between = f"of another {s.factor}, at most:"
        elif s.groups < 2 and not (s.zero or s.gain):
            return f"scatter within a {s.factor} {s.within:.3g} {self.unit}; one tells nothing of the next"
        text = f"scatter within a {s.factor} {s.within:.3g}, {between} zero {s.zero:.3g}, gain {s.gain:.3g}"
        correlated = f", correlated by {s.correlation:.2f} from row to row" if s.correlation else ""
        return f"{text} {self.unit} at full scale{correlated}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Golden:
    """Input and output pairs computed apart from the coefficients, in exact rational arithmetic.

    ``inputs`` are rows of indications in the record's order; ``outputs`` one row of values a load.
    """

    inputs: tuple[tuple[float, ...], ...] = ()
    outputs: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationRecord:
    """A calibration as it was fitted or imported. Never edited: a correction is a new record."""

    id: str
    instrument: str
    kind: Kind
    date: str
    entered_by: str
    zero: Zero
    cells: tuple[Indication, ...]
    loads: tuple[LoadFit, ...]
    golden: Golden
    data: tuple[DataFile, ...]
    settings: str
    inputs_sha256: str
    sha256: str = ""
    software: tuple[tuple[str, str], ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the record reproduces from its own data; False for a legacy import."""
        return self.kind == "fit"

    @property
    def indications(self) -> tuple[str, ...]:
        """Names of the indications."""
        return tuple(cell.name for cell in self.cells)

    @property
    def indication_units(self) -> tuple[str, ...]:
        """Units of the indications, in the same order."""
        return tuple(cell.unit for cell in self.cells)

    @property
    def units(self) -> dict[str, str]:
        """Units of the indications by their names."""
        return {cell.name: cell.unit for cell in self.cells}

    def load(self, name: str) -> LoadFit:
        """Return one load's equation.

        Raises
        ------
        RecordError
            the record has no such load
        """
        for entry in self.loads:
            if entry.load == name:
                return entry
        raise RecordError(
            f"record {self.id} has no load {name}",
            where=self.id,
            got=name,
            expected=", ".join(load.load for load in self.loads),
            next_step="use one of those loads, or calibrate with a session that has it",
            rule="load",
        )

    def data_file(self, role: str) -> DataFile | None:
        """Return the file of a role, None where the record has none."""
        return next((part for part in self.data if part.role == role), None)


_BREAK = re.compile(r"\n *")
_CANONICAL = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def canonical(value: Any) -> str:
    """Return canonical JSON: sorted keys, no white space, shortest exact floats.

    >>> canonical({"b": 0.1, "a": [1, None]})
    '{"a":[1,null],"b":0.1}'
    """
    return _CANONICAL.encode(value)


def content_of(record: CalibrationRecord) -> dict[str, Any]:
    """Return what the hash covers, as JSON values."""
    return {
        "id": record.id,
        "instrument": record.instrument,
        "kind": record.kind,
        "date": record.date,
        "entered_by": record.entered_by,
        "zero": record.zero,
        "cells": [_cell_content(cell) for cell in record.cells],
        "loads": [_load_content(load) for load in record.loads],
        "golden": {"inputs": record.golden.inputs, "outputs": record.golden.outputs},
        "data": [{"role": d.role, "file": d.file, "sha256": d.sha256} for d in record.data],
        "settings": json.loads(record.settings),
        "inputs_sha256": record.inputs_sha256,
    }


_LOAD_KEYS = (
    "load unit terms coefficients issued polarity covariance method n dof residual_sd minimum "
    "maximum tolerance"
).split()


def _cell_content(cell: Indication) -> dict[str, Any]:
    content: dict[str, Any] = {
        "name": cell.name, "unit": cell.unit, "minimum": cell.minimum, "maximum": cell.maximum,
        "serial": cell.serial,
    }  # fmt: skip
    # Only where it says something: records of data that needed no conversion keep their hash.
    further = {"column_unit": cell.column_unit, "step": cell.step}
    return content | {key: value for key, value in further.items() if value is not None}


def _load_content(load: LoadFit) -> dict[str, Any]:
    content = {key: getattr(load, key) for key in _LOAD_KEYS}
    # As with cells: records made without it keep their hash.
    if load.scatter is not None:
        content["scatter"] = asdict(load.scatter)
    if load.reference_u is not None:
        content["reference_u"] = load.reference_u
    if load.rounding is not None:
        content["rounding"] = load.rounding
    return content


def _scatter(entry: Any) -> RunScatter | None:
    if entry is None:
        return None
    scatter = RunScatter(**entry)
    _floats((scatter.within, scatter.zero, scatter.gain, scatter.correlation))
    if scatter.model not in MODELS:
        raise ValueError(f"the scatter's model is not known: {scatter.model}")
    for count in (scatter.groups, scatter.dof):
        _optional(count, int)
    return scatter


def _rounding(model: Any) -> str | None:
    if model not in (None, ROUNDING):
        raise ValueError(f"the model of rounding is not known: {model}")
    return model if model is None else str(model)


def content_hash(content: dict[str, Any]) -> str:
    """Return the SHA-256 of a record's content."""
    return sha256_bytes(canonical(content).encode())


def to_bytes(record: CalibrationRecord) -> bytes:
    """Return the record's file: content, hash and software versions as indented JSON."""
    document = {
        "schema": SCHEMA,
        "sha256": record.sha256,
        "content": content_of(record),
        "software": dict(record.software),
    }
    return (
        json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    ).encode()


def sealed(record: CalibrationRecord) -> CalibrationRecord:
    """Return the record with its hash computed."""
    import dataclasses

    return dataclasses.replace(record, sha256=content_hash(content_of(record)))


def _check_schema(document: dict[str, Any], where: object) -> None:
    """Refuse a record of a later release by its schema, before anything else of it is read."""
    schema = document["schema"]
    if isinstance(schema, int) and schema > SCHEMA:
        raise RecordError(
            "a calibration record is of a later version of the toolkit",
            where=where,
            got=f"schema {schema}, written by toolkit {document['software']['toolkit']}",
            expected=f"schema {SCHEMA}",
            next_step="update the toolkit; the record is not damaged, and is never converted back",
            rule="newer-schema",
        )


def from_bytes(data: bytes, *, where: object) -> CalibrationRecord:
    """Read a record's file and check its hash.

    Raises
    ------
    RecordError
        ``unreadable``: not a record; ``hash``: its content is not what the hash was taken of;
        ``newer-schema``: a later version of the toolkit wrote it
    """
    try:
        text = data.decode("utf-8")
        document = parse_json(text)
        _check_schema(document, where)
        content = document["content"]
        stated = {SCHEMA: document["sha256"]}[document["schema"]]
        actual = _hash_as_written(text)
        if actual != stated:
            actual = content_hash(content)
        record = _from_content(content, str(stated), tuple(sorted(document["software"].items())))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RecordError(
            "a calibration record cannot be read",
            where=where,
            got=f"{type(error).__name__}: {error}",
            expected=f"a record of schema {SCHEMA}",
            next_step="restore the file from a backup; 'toolkit calibration verify' lists every bad file",
            rule="unreadable",
        ) from error
    if actual != stated:
        raise RecordError(
            f"the content of record {record.id} was changed",
            where=where,
            got=f"sha256 {actual}",
            expected=f"sha256 {stated}",
            next_step="restore the file from a backup; a correction is a new record",
            rule="hash",
        )
    return record


def _hash_as_written(text: str) -> str | None:
    """Return the hash of the content from the file's own text, without its line breaks and indents.

    That is the canonical text wherever the file was written by `to_bytes` and no text in it holds a quote or
    begins with a colon: what is taken away stands between the JSON's tokens, and a change of anything else
    changes the hash. None where the file is written in another way.
    """
    start, end = text.find('{\n "content": {\n'), text.find('\n },\n "schema": ')
    if start != 0 or end < 0 or '\\"' in text or ' ": ' in text:
        return None
    content = _BREAK.sub("", text[len('{\n "content": ') : end + len("\n }")])
    return sha256_bytes(content.replace('": ', '":').encode())


def _floats(values: Any) -> tuple[float, ...]:
    if set(map(type, values)) - {float}:
        raise TypeError("a number that is no float")
    return tuple(values)


def _optional(value: Any, kind: type) -> Any:
    if value is not None and type(value) is not kind:
        raise TypeError(f"{value!r} is no {kind.__name__}")
    return value


def _from_content(
    content: dict[str, Any], sha256: str, software: tuple[tuple[str, str], ...]
) -> CalibrationRecord:
    loads = []
    for entry in content["loads"]:
        load = LoadFit(
            **{
                **entry,
                "terms": tuple(entry["terms"]),
                "coefficients": _floats(entry["coefficients"]),
                "issued": _floats(entry["issued"]),
                "polarity": tuple(entry["polarity"]),
                "covariance": tuple(_floats(row) for row in entry["covariance"]),
                "n": _optional(entry["n"], int),
                "dof": _optional(entry["dof"], int),
                "residual_sd": _optional(entry["residual_sd"], float),
                "scatter": _scatter(entry.get("scatter")),
                "reference_u": _optional(entry.get("reference_u"), float),
                "rounding": _rounding(entry.get("rounding")),
            }
        )
        if not len(load.terms) == len(load.coefficients) == len(load.issued) == len(load.polarity):
            raise ValueError(f"{load.load}: terms and coefficients differ in number")
        loads.append(load)
    golden = content["golden"]
    if content["kind"] not in ("fit", "legacy") or content["zero"] not in ZEROS:
        raise ValueError("kind or zero is not known")
    return CalibrationRecord(
        id=content["id"],
        instrument=content["instrument"],
        kind=cast("Kind", content["kind"]),
        date=content["date"],
        entered_by=content["entered_by"],
        zero=cast("Zero", content["zero"]),
        cells=tuple(
            Indication(**{**cell, "step": _optional(cell.get("step"), float)}) for cell in content["cells"]
        ),
        loads=tuple(loads),
        golden=Golden(
            inputs=tuple(_floats(row) for row in golden["inputs"]),
            outputs=tuple(_floats(row) for row in golden["outputs"]),
        ),
        data=tuple(DataFile(**entry) for entry in content["data"]),
        settings=canonical(content["settings"]),
        inputs_sha256=content["inputs_sha256"],
        sha256=sha256,
        software=software,
    )
