"""MAT-files, by scipy: columns with their headers, or a variable for each channel.

Two layouts are read, both of which state every unit:

- ``data`` (rows, channels) and ``headers``, one text a column as in a header row; or
- a vector for each channel, named by its symbol (``FZ``, ``SA``, ``D51`` ...), and a structure ``units``
  with a text for each of them. Variables that hold text are remarks.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import UnreadableError
from toolkit.machine import Machine
from toolkit.recording.formats.vectors import Vector, Vectors, one_table, quantum
from toolkit.recording.integrity.refuse import no_numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.recording.safe_open import Gated

DATA, HEADERS, UNITS = "data", "headers", "units"


def read_mat(gated: Gated, machine: Machine) -> Vectors:
    """Return the channels of a MAT-file that the gate unpacked.

    Raises
    ------
    UnreadableError
        rule ``unreadable not-numbers no-data``
    """
    from scipy.io import loadmat

    stream: Any = io.BytesIO(gated.members["mat"])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # such as two variables of one name
            contents = loadmat(stream, chars_as_strings=True)
    except Exception as error:
        raise UnreadableError(
            "the MAT-file cannot be read",
            where=gated.path,
            got=f"{type(error).__name__}: {error}"[:300],
            expected="a MAT-file of version 5 to 7",
            next_step="save it again with save(name, '-v7')",
            rule="unreadable",
        ) from error
    variables = {name: value for name, value in contents.items() if not name.startswith("__")}
    if DATA in variables and HEADERS in variables:
        vectors = _columns(variables, gated.path)
    else:
        vectors = _variables(variables, gated.path)
    return one_table([Vectors(where=str(gated.path), vectors=vectors)], machine, where=gated.path)


def _columns(variables: Mapping[str, Any], where: object) -> list[Vector]:
    table, headers = variables[DATA], _texts(variables[HEADERS], where)
    if table.dtype.kind not in "fiu" or table.ndim != 2 or table.shape[1] != len(headers):
        no_numbers(where, "the variable 'data' is no matrix with a column for each header",
                   f"{table.dtype} of shape {table.shape}, {len(headers)} headers")  # fmt: skip
    return [_vector(name, None, table[:, column]) for column, name in enumerate(headers)]


def _variables(variables: Mapping[str, Any], where: object) -> list[Vector]:
    units = _units(variables.get(UNITS), where)
    vectors = []
    for name, value in variables.items():
        if name == UNITS or value.dtype.kind == "U":
            continue
        if value.dtype.kind not in "fiu" or value.ndim != 2 or 1 not in value.shape:
            no_numbers(where, f"the variable {name!r} is no vector of numbers",
                       f"{value.dtype} of shape {value.shape}")  # fmt: skip
        vectors.append(_vector(name, units.get(name), value.reshape(-1)))
    return vectors


def _vector(name: str, unit: str | None, values: NDArray[Any]) -> Vector:
    return Vector(name=name, unit=unit, values=values, half=quantum(values, values) if len(values) else None)


def _texts(value: NDArray[Any], where: object) -> list[str]:
    # A cell of texts, or a matrix of characters that has one text a row.
    texts = [item if isinstance(item, str) else np.asarray(item).reshape(-1) for item in value.reshape(-1)]
    texts_of = []
    for cell_text in texts:
        text = (
            cell_text
            if isinstance(cell_text, str)
            else cell_text[0]
            if len(cell_text) == 1
            else ""
            if len(cell_text) == 0
            else None
        )
        if not isinstance(text, str):
            no_numbers(where, "the variable 'headers' is no list of texts", f"{value.dtype}")
        texts_of.append(text.strip())
    return texts_of


def _units(value: NDArray[Any] | None, where: object) -> dict[str, str]:
    if value is None:
        return {}
    if value.dtype.names is None or value.size != 1:
        no_numbers(
            where, "the variable 'units' is no structure of texts", f"{value.dtype.kind}, {value.size}"
        )
    content = value.reshape(-1)[0]
    return {
        name: _texts(np.asarray(content[name]), where)[0] for name in value.dtype.names if content[name].size
    }
