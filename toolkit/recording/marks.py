"""The marks by which the toolkit knows its own files again, whatever they are called.

A *recording* that the toolkit wrote (the virtual machine's files, the packaged example) is read like any
other; a *result* that it wrote (reduced test, report, truth of a simulation) never is. Both carry marks in
the keywords of their core properties; a JSON result has ``"generator": "toolkit"`` at its top level.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from pathlib import Path
from typing import Any

from toolkit.errors import OutputError, UnreadableError
from toolkit.inputs import RECORDING_FILE, read_regular
from toolkit.recording.archive import read_members
from toolkit.recording.sniff import sniff

GENERATOR = "toolkit"
"""Creator in the properties of every file that the toolkit writes, and ``generator`` of its JSON."""

OWN_OUTPUT = "toolkit-output"
"""Keyword of a result (.xlsx, .docx, PDF) that must never be read as a recording."""

RECORDING = "toolkit-recording"
"""Keyword of a recording that the toolkit wrote."""

SIMULATED = "simulated"
"""Keyword of everything that comes from the virtual machine."""

STAMP = dt.datetime(2000, 1, 1, tzinfo=dt.UTC)
"""When a recording that the toolkit wrote was saved, by its properties: the same file on every run."""

_HEAD = 4096
_KEYWORDS = re.compile(rb"<(?:\w+:)?keywords[^<>]{0,500}>([^<]{0,4000})<")
_BETWEEN = re.compile(r"[;,\s]+")

_MODIFIED = re.compile(rb"<(?:\w+:)?modified[^<>]{0,200}>([0-9]{4}-[0-9]{2}-[0-9]{2})")


def recording_keywords(*, machine: str, simulated: bool) -> str:
    """Return the keywords of a recording that the toolkit writes.

    >>> recording_keywords(machine="m15-virtual", simulated=True)
    'toolkit-recording; machine=m15-virtual; simulated'
    """
    return "; ".join([RECORDING, f"machine={machine}", *([SIMULATED] if simulated else [])])


def output_keywords(*, simulated: bool) -> str:
    """Return the keywords of a result that the toolkit writes.

    >>> output_keywords(simulated=False)
    'toolkit-output'
    """
    return "; ".join([OWN_OUTPUT, *([SIMULATED] if simulated else [])])


def mark_workbook(book: Any, *, simulated: bool, machine: str, word: str | None = None) -> None:
    """Mark an openpyxl workbook as a result of the toolkit, before it is saved; ``word`` such as DRAFT."""
    book.properties.creator = GENERATOR
    marks = "".join(f"{word_mark}: " for word_mark in (word, "SIMULATED" if simulated else None) if word_mark)
    book.properties.title = f"{marks}tire test on {machine}"
    book.properties.keywords = output_keywords(simulated=simulated)


def keywords_of(core_xml: bytes) -> tuple[str, ...]:
    """Return the keywords in ``docProps/core.xml``; empty where there are none.

    >>> keywords_of(b"<cp:keywords>toolkit-recording; simulated</cp:keywords>")
    ('toolkit-recording', 'simulated')

    LibreOffice Calc sets them apart by blanks when it saves a file again:

    >>> keywords_of(b"<cp:keywords>toolkit-recording simulated</cp:keywords>")
    ('toolkit-recording', 'simulated')
    """
    match = _KEYWORDS.search(core_xml)
    text = match.group(1).decode("utf-8", "replace") if match else ""
    return tuple(word for word in _BETWEEN.split(text) if word)


def saved_on(core_xml: bytes) -> dt.date | None:
    """Return the day of the last change in ``docProps/core.xml``; None where it has none, or our `STAMP`.

    >>> saved_on(b"<dcterms:modified>2019-06-04T10:00:00Z</dcterms:modified>")
    datetime.date(2019, 6, 4)
    """
    match = _MODIFIED.search(core_xml)
    try:
        day = None if match is None else dt.date.fromisoformat(match.group(1).decode())
    except ValueError:
        return None
    return None if day == STAMP.date() and RECORDING in keywords_of(core_xml) else day


def refuse_original(target: Path, *, suffix: str) -> None:
    """Refuse to write a result over a file that the toolkit did not make, or under another kind's name.

    Raises
    ------
    OutputError
        ``target`` exists and is no result of the toolkit, or its name does not end with ``suffix``
    """
    if target.suffix.lower() != suffix:
        raise OutputError(
            "the output's name is of another kind of file",
            where=target,
            got=target.suffix or "no ending",
            expected=f"a name that ends with {suffix}",
            next_step="name another file; nothing was written",
            rule="output-name",
        )
    if target.exists() and not (target.is_file() and is_own_output(target)):
        raise OutputError(
            "the output would replace a file that the toolkit did not make",
            where=target,
            got="an original",
            expected="a new name, or an earlier result of the toolkit",
            next_step="name another file; originals are never written to",
            rule="original",
        )


def machine_named(keywords: tuple[str, ...]) -> str | None:
    """Return the machine that a recording's keywords name."""
    if RECORDING in keywords:
        for word in keywords:
            if word.startswith("machine="):
                return word.removeprefix("machine=")
    return None


def machine_of(path: Path) -> str | None:
    """Return the machine that a recording written by the toolkit names in its properties, else None.

    Never raises for what a file holds: a file that cannot be opened names no machine.
    """
    return machine_in(_content(path))


def machine_in(data: bytes) -> str | None:
    """Return the machine that a recording's content names, as `machine_of`."""
    return machine_named(_core_keywords(data))


def is_own_output(path: Path) -> bool:
    """Tell by its content whether a file is a result that the toolkit wrote; see `own_output`."""
    return own_output(_content(path))


def own_output(data: bytes) -> bool:
    """Tell whether this is the content of a result that the toolkit wrote.

    True for JSON with ``"generator": "toolkit"`` at the top level, an .xlsx or .docx whose keywords hold
    `OWN_OUTPUT`, a PDF or a Parquet table that carries it, and any other file that shows it in its first
    4096 bytes.
    """
    kind = sniff(data)
    if kind.id == "zip":
        return OWN_OUTPUT in _core_keywords(data)
    if kind.id == "pdf":
        # Writers store the keywords as bytes, as UTF-16 or as hexadecimal UTF-16, or in the XMP packet.
        wide = OWN_OUTPUT.encode("utf-16-be")
        return any(mark in data for mark in (OWN_OUTPUT.encode(), wide, wide.hex().upper().encode()))
    if kind.id == "parquet":  # the marks stand in its footer, whose length is told before the last word
        return OWN_OUTPUT.encode() in data[-8 - int.from_bytes(data[-8:-4], "little") :]
    if data[:64].lstrip().startswith(b"{"):
        try:
            top = json.loads(data)
        except (ValueError, RecursionError):
            return OWN_OUTPUT.encode() in data[:_HEAD]  # JSON Lines: the first one tells
        return isinstance(top, dict) and top.get("generator") == GENERATOR
    return OWN_OUTPUT.encode() in data[:_HEAD]


COPY = "corrected copy of"
"""With these words the title of a corrected copy begins (`toolkit.audit.corrected`)."""


def is_corrected_copy(data: bytes) -> bool:
    """Tell by its title whether a workbook is a recording whose Fy and Mz the toolkit computed."""
    return f">{COPY} ".encode() in _core(data)


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, RECORDING_FILE)
    except (OSError, ValueError):
        return b""


def _core_keywords(data: bytes) -> tuple[str, ...]:
    return keywords_of(_core(data))


def _core(data: bytes) -> bytes:
    if sniff(data).id != "zip":
        return b""
    try:
        parts = read_members(data, where=None, only=("docProps/core.xml",))
    except UnreadableError:
        return b""
    return parts.get("docProps/core.xml", b"")
