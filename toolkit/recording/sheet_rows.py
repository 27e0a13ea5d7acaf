"""Rows of plain values in an .xlsx file, written straight into the sheets of a workbook that has their heads.

openpyxl builds an object and its elements for every cell, which takes ten times as long.
"""

from __future__ import annotations

import functools
import io
import re
import shutil
import zipfile
from collections.abc import Mapping, Sequence
from typing import IO

from toolkit.recording.cells import reference

_END = b"</sheetData>"
_MARKUP = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"})
_NO_TEXT = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_MOST = 32_767  # characters of a cell


def sheet_row(row: int, values: Sequence[float | str | None]) -> bytes:
    """Return the XML of a row (1-based): None is no cell, a text is one even where it begins like a formula.

    A number has 16 digits at most, and 17 where only so many read back as it is.

    Raises
    ------
    ValueError
        a text has a control character, which no worksheet can hold
    """
    cells = [
        _cell(f"{letters}{row}", value)
        for letters, value in zip(_letters(len(values)), values, strict=True)
        if value is not None
    ]
    return f'<row r="{row}">{"".join(cells)}</row>'.encode()


def _cell(place: str, value: float | str) -> str:
    if not isinstance(value, str):
        if isinstance(value, bool):
            return f'<c r="{place}" t="b"><v>{value:d}</v></c>'
        number = f"{value:.16g}"
        exact = number if float(number) == value else float.__repr__(value)
        return f'<c r="{place}" t="n"><v>{exact}</v></c>'
    if _NO_TEXT.search(value):
        raise ValueError(f"{value!r} has a control character, which no worksheet can hold")
    if not value:
        return f'<c r="{place}" t="inlineStr"></c>'
    text = value[:_MOST].translate(_MARKUP)
    space = ' xml:space="preserve"' if value != value.strip() else ""
    return f'<c r="{place}" t="inlineStr"><is><t{space}>{text}</t></is></c>'


@functools.lru_cache(maxsize=64)
def _letters(columns: int) -> tuple[str, ...]:
    return tuple(reference(1, column)[:-1] for column in range(1, columns + 1))


def filled(shell: bytes, bodies: Mapping[str, IO[bytes]]) -> bytes:
    """Return a workbook with rows below those of its sheets; ``bodies`` by member, such as ``sheet1.xml``."""
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(shell)) as source,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for info in source.infolist():
            content = source.read(info)
            body = bodies.get(info.filename.removeprefix("xl/worksheets/"))
            if body is None:
                target.writestr(info, content)
                continue
            head, end, tail = content.partition(_END)
            info.file_size = len(content) + body.tell()
            body.seek(0)
            with target.open(info, "w") as member:
                member.write(head)
                shutil.copyfileobj(body, member)
                member.write(end + tail)
    return stream.getvalue()
