"""Files of a tire's flat-belt test as the field exchanges them: channels by name, each with its unit.

- MAT: a vector for each channel and a structure ``channel`` with the lists ``name`` and ``units``, as the
  Tire Test Consortium hands its rounds out;
- text: a line of names, a line of units below it, then rows of numbers, as the Calspan Tire Research Facility
  writes them with tabs; or the units beside the names (`toolkit.units`). Lines above the names are a title.

What is no quantity of a tire table (radii, temperatures of the tread, normalised forces) is passed over.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.channels import CHANNELS, Axes
from toolkit.errors import CellError, ColumnError, UnreadableError
from toolkit.files import reads_as_number
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.recording.csvfile import decimal_sign, decode
from toolkit.recording.formats.vectors import read_by_library
from toolkit.recording.safe_open import gate
from toolkit.recording.sniff import sniff
from toolkit.units import split_header, unit

CHANNEL = "channel"
_SYMBOLS = {
    "ET": "t",
    "SL": "KAPPA",
    **{name: name for name in ("V", "SA", "IA", "P", "FX", "FY", "FZ", "MX", "MZ")},
}
"""Name in the file -> symbol: SL is the slip ratio by the effective radius, 0 for a freely rolling wheel."""
_NEEDED = ("ET", "SA", "FZ", "FY")
_TITLE = 10  # lines that may stand above the names
_SEPARATORS = "\t,;"
_POINTS_FOR_COMMAS = str.maketrans(",.", ".,")  # a point may stand between thousands: no number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldFile:
    """A file's channels in SI: ``columns`` by symbol (rows,), signs as written, FZ too.

    ``axes`` follow from the sign of FZ: a load is negative where z points down (SAE J670), and positive in
    ISO 8855. ``passed`` names the channels that are not used.
    """

    path: Path
    axes: Axes
    columns: Mapping[str, Array]
    passed: tuple[str, ...]

    @property
    def rows(self) -> int:
        """Number of samples."""
        return len(self.columns["SA"])


def is_field_file(path: Path) -> bool:
    """Tell by its content whether a file is one of these; False for what cannot be read."""
    if not path.is_file():
        return False
    data = read_input(path, TABLE_FILE)
    kind = sniff(data).id
    return kind == "mat" or (
        kind in ("text", "utf-16") and _header(_text(data, path).splitlines()) is not None
    )


def read_field_file(path: Path) -> FieldFile:
    """Read a file whole or not at all.

    Raises
    ------
    UnreadableError
        ``unreadable no-data``: it is no such file; and what the gate of recordings refuses
    ColumnError
        ``missing-column unknown-unit``: a channel is missing, or has a unit that is not known
    CellError
        ``nan-cell text-cell ragged-row``: no number stands in a number's place
    """
    data = read_input(path, TABLE_FILE)
    gated = gate(path, data)
    channels = _of_mat(gated.members["mat"], path) if gated.kind == "mat" else _of_text(data, path)
    missing = [name for name in _NEEDED if name not in channels]
    if missing:
        raise ColumnError(
            f"the file has no channel {', '.join(missing)}", where=path, got=", ".join(channels)[:300],
            expected=", ".join(_NEEDED), next_step="export it with these channels", rule="missing-column",
        )  # fmt: skip
    columns = {_SYMBOLS[name]: _in_si(name, *channels[name], path) for name in _SYMBOLS if name in channels}
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1 or not min(lengths.values()):
        raise UnreadableError(
            "the channels differ in length, or are empty", where=path,
            got=", ".join(f"{name} {length}" for name, length in lengths.items()), expected="one length",
            next_step="export the file again", rule="no-data",
        )  # fmt: skip
    return FieldFile(
        path=path,
        axes="SAE" if float(np.median(columns["FZ"])) < 0 else "ISO-W",
        columns=columns,
        passed=tuple(name for name in channels if name not in _SYMBOLS),
    )


def _of_mat(data: bytes, path: Path) -> dict[str, tuple[NDArray[Any], str]]:
    from scipy.io import loadmat

    stream: Any = io.BytesIO(data)
    with read_by_library(
        "the MAT-file holds no test in the consortium's form", where=path,
        expected="a vector for each channel, and a structure 'channel' with the lists 'name' and 'units'",
        next_step="save it again with save(name, '-v7')",
    ):  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            variables = loadmat(stream, chars_as_strings=True)
        channel = variables[CHANNEL].reshape(-1)[0]
        names, units = (_texts(channel[key]) for key in ("name", "units"))
        return {
            name: (np.asarray(variables[name], dtype=np.float64).reshape(-1), text)
            for name, text in zip(names, units, strict=True)
            if name in variables
        }


def _texts(cells: NDArray[Any]) -> list[str]:
    return [str(np.asarray(cell).reshape(-1)[0]).strip() for cell in cells.reshape(-1)]


class _Header(NamedTuple):
    names: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    rows_from: int  # the line of the first row, from 0


def _header(lines: Sequence[str]) -> _Header | None:
    """Return what the line of names says, None where there is none with units beside or below the names."""
    for at in range(min(_TITLE, len(lines) - 1)):
        for separator in _SEPARATORS:
            parted = [split_header(cell, _SYMBOLS.__contains__) for cell in _cells(lines[at], separator)]
            names, units = zip(*parted, strict=True)
            if not set(_NEEDED) <= set(names):
                continue
            if all(text is not None for name, text in parted if name in _NEEDED):
                return _Header(names, tuple(text or "" for text in units), separator, at + 1)
            below = [_cells(line, separator) for line in lines[at + 1 : at + 3]]
            if not any(units) and list(map(len, below)) == [len(names)] * 2:
                return _Header(names, tuple(below[0]), separator, at + 2)
    return None


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in line.rstrip(separator).split(separator)]


def _text(data: bytes, path: Path) -> str:
    try:
        return decode(data, where=path)
    except UnreadableError:
        return data.decode("latin-1")  # a title in another code page: names and numbers are the same bytes


def _of_text(data: bytes, path: Path) -> dict[str, tuple[NDArray[Any], str]]:
    lines = _text(data, path).splitlines()
    header = _header(lines)
    if header is None:
        raise UnreadableError(
            "the file is no tire test with names and units", where=path,
            got=lines[0][:100] if lines else "nothing",
            expected="a line of names (ET SA FZ FY ...) with units beside or below, then rows of numbers",
            next_step="check the path", rule="unreadable",
        )  # fmt: skip
    names, units, separator, rows_from = header
    rows = []
    cells_below = (cell for line in lines[rows_from:] for cell in _cells(line, separator))
    has_commas = decimal_sign(cells_below, separator, where=path) == ","
    for number, line in enumerate(lines[rows_from:], start=rows_from + 1):
        if not line.strip():
            continue
        cells = _cells(line, separator)
        if len(cells) != len(names):
            raise _cell(path, number, "the row", f"{len(cells)} cells", f"{len(names)} cells", "ragged-row")
        try:
            pointed = [cell.translate(_POINTS_FOR_COMMAS) for cell in cells] if has_commas else cells
            rows.append(list(map(float, pointed)))
        except ValueError:
            bad = next(at for at, cell in enumerate(pointed) if not reads_as_number(cell))
            raise _cell(path, number, names[bad], repr(cells[bad]), "a number", "text-cell") from None
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    return {name: (values[:, at], text) for at, (name, text) in enumerate(zip(names, units, strict=True))}


def _cell(path: Path, line: int, name: str, actual: str, expected: str, rule: str) -> CellError:
    return CellError(
        f"line {line}, {name}: no number", where=f"{path}, line {line}, {name}", got=actual,
        expected=expected,
        next_step="export the file again, or mend a copy of it", rule=rule,
    )  # fmt: skip


def _in_si(name: str, values: Array, text: str, path: Path) -> Array:
    channel, where = CHANNELS[_SYMBOLS[name]], f"{path}, channel {name}"
    stated = unit(text, where=where)
    if stated.dimension != channel.dimension:
        raise ColumnError(
            f"channel {name} has a unit of another kind", where=where, got=f"{text} ({stated.dimension})",
            expected=f"a unit of {channel.dimension}", next_step="correct the unit in a copy of the file",
            rule="unit-dimension",
        )  # fmt: skip
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise _cell(path, int(bad[0]) + 1, name, str(values[bad[0]]), "a finite number", "nan-cell")
    return values * stated.factor + stated.offset
