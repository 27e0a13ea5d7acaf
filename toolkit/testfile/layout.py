"""How results lie in sheets: one dataclass a row, one field a column, headers with units."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from toolkit.calibration.records.use import UNSIGNED
from toolkit.characteristics.model import Characteristics, answer_lists
from toolkit.estimate import Estimate
from toolkit.reduction.model import Condition

if TYPE_CHECKING:
    from toolkit.pipeline import TestResult

SCHEMA = 2
FIRST_SCHEMA = 1
"""Of the files whose hash covers what is read back and no other cell."""
DIGEST = "content_sha256"
KIND = "toolkit reduced test"

SHEETS = (
    "provenance",
    "reduced",
    "fits",
    "fit_parameters",
    "fit_covariance",
    "characteristics",
    "at_angles",
    "points",
    "budgets",
    "characteristic_findings",
    "findings",
    "raw",
)

SWEEPS = "sweeps"
"""The sheet that only a test with recordings in time has."""

LATER_SHEETS = ("at_angles", "points", "budgets")
"""What the files of the first builds, before 1.0.0, had not yet."""

_UNITS = {"SA": "rad", "FX": "N", "FZ": "N", "FY": "N", "MX": "N*m", "MY": "N*m", "MZ": "N*m"}
HUB = "hub_"

_SEVERAL = ("indications", "hub")  # of one column each: the cells, the loads of the hub
CONDITION_FIELDS: tuple[str, ...] = tuple(
    field.name for field in dataclasses.fields(Condition) if field.name not in _SEVERAL
)
"""The fields of a condition that are one column of the sheet ``reduced``."""


def header(field: str) -> str:
    """Return a condition's column header: ``u_FY`` -> ``u_FY [N]``.

    >>> header("step_SA"), header("rotation")
    ('step_SA [rad]', 'rotation')
    """
    for symbol, unit in _UNITS.items():
        if symbol in field.split("_"):
            return f"{field} [{unit}]"
    return field


def cell(value: Any) -> Any:
    """Return a value as a cell: numbers as numbers, infinite and missing ones as words."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def number(value: Any) -> float:
    """Return a cell as a float; the inverse of `cell`."""
    return float(value)


def optional(value: Any) -> float | None:
    """Return a cell as a float or None where it is empty."""
    return None if value in ("", None) else float(value)


def content_hash(result: TestResult, *, before_intervals: bool = False) -> str:
    """Return the SHA-256 by which a file of schema 1 holds: of a result's canonical JSON.

    ``before_intervals``: as the first files had it, whose parameters have no intervals of 95 %.
    """
    content = {
        "reduced": dataclasses.asdict(result.reduced),
        "characteristics": _characteristics(result.characteristics),
    }
    if before_intervals:
        for fit in content["characteristics"]["fits"]:
            for parameter in (*_parameters(fit["FY"]), *_parameters(fit["MZ"])):
                del parameter["interval95"]
    for condition in content["reduced"][
        "conditions"
    ]:  # nor has a test of a hub that measures FY and MZ alone
        if not condition["hub"]:
            del condition["hub"]
    for name in ("rows", "borrowed"):  # a file keeps the uncertainty of a tare, not what told it
        del content["reduced"]["tare"][name]
    for name in ("stated", "machine_title", "definition"):  # a file from before there were any keeps its hash
        if not content["reduced"][name]:
            del content["reduced"][name]
    for name in ("draft_reasons", "since"):  # and one of a record in force has the hash of before too
        if not content["reduced"]["calibration"][name]:
            del content["reduced"]["calibration"][name]
    if result.reduced.calibration.signature == UNSIGNED:  # nor do unsigned decisions change it
        del content["reduced"]["calibration"]["signature"]
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


class CellsHash:
    """The SHA-256 of every cell of a workbook: rows are entered sheet by sheet, from the first row on.

    What a program that saves a workbook unchanged may change is no part of it: the order of the sheets, empty
    cells, the form of a number. The value beside ``content_sha256``, the hash itself, counts as empty.
    """

    def __init__(self) -> None:
        self._sheets: dict[str, Any] = {}

    def rows(self, sheet: str, rows: Iterable[Sequence[Any]]) -> Iterator[Sequence[Any]]:
        """Yield the rows of a sheet as they are and enter each."""
        digest = self._sheets[sheet] = hashlib.sha256()
        for at, row in enumerate(rows):
            values = [_plain(value) for value in row]
            if values[:1] == [DIGEST]:
                values[1:2] = [""]
            while values and values[-1] == "":
                values.pop()
            if values:
                digest.update(repr((at, values)).encode())
            yield row

    def hexdigest(self) -> str:
        """Return the hash of all sheets by their names."""
        sheets = sorted((name, digest.hexdigest()) for name, digest in self._sheets.items())
        return hashlib.sha256(repr(sheets).encode()).hexdigest()


def _plain(value: Any) -> Any:
    if value is None:
        return ""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value) + 0.0 if math.isfinite(value) else str(float(value))
    return value if isinstance(value, (bool, str)) else str(value)


def _parameters(fit: dict[str, Any] | None) -> Sequence[dict[str, Any]]:
    return () if fit is None else fit["parameters"]


# The lists of the first files stand in their hash even where they are empty; later ones only with a value.
_FIRST_LISTS = ("stiffness", "pull", "at_angles")


def _characteristics(characteristics: Characteristics) -> dict[str, Any]:
    """Return characteristics in the form that is hashed: lists of entries by characteristic, and budgets."""
    lists = answer_lists(characteristics.rows)
    return {
        "fits": [dataclasses.asdict(fit) for fit in characteristics.fits],
        "findings": [dataclasses.asdict(finding) for finding in characteristics.findings],
        "points": [dataclasses.asdict(point) for point in characteristics.points],
        **(
            {SWEEPS: [dataclasses.asdict(s) for s in characteristics.sweeps]}
            if characteristics.sweeps
            else {}
        ),
        "budgets": [
            {
                "load_N": row.load_N,
                "rotation": row.rotation,
                "name": row.name,
                "unit": row.estimate.unit,
                "sources": row.sources,
            }
            for row in characteristics.rows
            if row.estimate is not None and row.SA_rad is None
        ],
        **{
            name: [
                {key: dataclasses.asdict(v) if isinstance(v, Estimate) else v for key, v in entry.items()}
                for entry in entries
            ]
            for name, entries in lists.items()
            if name in _FIRST_LISTS
            or any(isinstance(v, Estimate) for entry in entries for v in entry.values())
        },
    }
