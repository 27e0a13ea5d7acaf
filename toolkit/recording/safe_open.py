"""The gate: a file from outside is hostile until it has passed here; no reader sees it before.

Rules (``error.rule``): ``not-a-workbook empty-file zip-truncated zip-damaged zip-method encrypted
member-path members inflation macro external-link embedded-object dtd encoding xml far-cell doubled-cell
truncated damaged format-version formula not-numbers``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree as ET

from toolkit.errors import UnreadableError
from toolkit.files import sha256_bytes
from toolkit.inputs import RECORDING_FILE, read_input
from toolkit.recording.archive import read_members
from toolkit.recording.cells import MalformedSheetError, find_cells
from toolkit.recording.formats.mat import unpack_mat
from toolkit.recording.formats.mdf import walk_mdf
from toolkit.recording.formats.tdms import walk_tdms
from toolkit.recording.grid import Grid, find_grid
from toolkit.recording.sniff import Kind, office_kind, ole_kind, sniff

_FOREIGN = "find out where the file comes from; the machine does not write such files"
_RELATIONSHIP = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*?encoding\s*=\s*["']([^"']*)["']""")
_ENCODINGS = (b"utf-8", b"us-ascii", b"ascii")
_MACRO_PARTS = ("vbaproject.bin", "xl/macrosheets/", "xl/dialogsheets/", "vbadata.xml")
_LINK_PARTS = ("xl/externallinks/", "xl/connections.xml", "xl/querytables/", "xl/model/", "customui/")
_OBJECT_PARTS = ("xl/embeddings/", "xl/activex/", "xl/ctrlprops/", "xl/webextensions/")


@dataclass(frozen=True, slots=True, kw_only=True)
class Gated:
    """A file that passed: its bytes, their SHA-256, its kind, and what is inside.

    ``kind`` is ``xlsx``, ``text``, ``lvm``, ``mat``, ``mdf`` or ``tdms``. ``members`` of a workbook: name ->
    inflated content; of a MAT-file: ``mat`` -> the file with its arrays unpacked. ``grids``: name -> the
    rectangle of numbers of a worksheet that has one.
    """

    path: Path
    data: bytes
    sha256: str
    kind: str
    members: Mapping[str, bytes]
    grids: Mapping[str, Grid] = field(default_factory=dict)


def gate(path: Path, data: bytes | None = None) -> Gated:
    """Read a file's bytes and refuse it unless it is harmless to read.

    ``data`` is the file's content where the caller has read it already.

    Raises
    ------
    UnreadableError
        the file is missing, too large, no workbook and no text, damaged or hostile; see the rules above
    """
    if data is None:
        data = read_input(path, RECORDING_FILE)
    kind = sniff(data)
    if kind.id in _PLAIN:
        return Gated(path=path, data=data, sha256=sha256_bytes(data), kind=_PLAIN[kind.id], members={})
    if kind.id in _WALKED:
        members = _WALKED[kind.id](data, path)
        return Gated(path=path, data=data, sha256=sha256_bytes(data), kind=kind.id, members=members)
    if kind.id == "ole":
        kind = ole_kind(data)
        if kind.id == "encrypted":
            _refuse(
                "encrypted",
                "the workbook is encrypted",
                path,
                kind.text,
                "a workbook without a password",
                "open it in Excel, remove the password and save it again",
            )
    if kind.id in ("empty", "blank"):
        _refuse("empty-file", "the file is empty", path, f"{len(data)} bytes", "a recording",
                "copy the file again from the machine")  # fmt: skip
    if kind.id != "zip":
        _no_workbook(path, kind)
    members = read_members(data, where=path)
    grids = check_members(members, where=path)
    return Gated(path=path, data=data, sha256=sha256_bytes(data), kind="xlsx", members=members, grids=grids)


def check_workbook(path: Path) -> Gated:
    """Pass a file through the gate and demand a workbook.

    Raises
    ------
    UnreadableError
        as `gate`, and for any other kind of recording
    """
    gated = gate(path)
    if gated.kind != "xlsx":
        _no_workbook(path, sniff(gated.data))
    return gated


def check_members(members: Mapping[str, bytes], *, where: Path) -> dict[str, Grid]:
    """Check the inflated members of a zip archive: a workbook, without anything active or far.

    Return the grids of its worksheets, by the name of the member.

    Raises
    ------
    UnreadableError
        see the rules above
    """
    by_lower = {name.lower(): name for name in members}
    types = members.get(by_lower.get("[content_types].xml", ""), b"")
    kind = office_kind(frozenset(by_lower), types)
    for lower, name in by_lower.items():
        if any(part in lower for part in _MACRO_PARTS):
            _refuse("macro", "the workbook holds macros", where, name, "a workbook of values", _FOREIGN)
    if kind.id == "xlsm" or b"macroEnabled" in types or b"vbaProject" in types:
        _refuse("macro", "the workbook is of a kind that holds macros", where, kind.text, "an .xlsx workbook",
                "save it as .xlsx, without macros")  # fmt: skip
    if kind.id != "xlsx":
        _no_workbook(where, kind)
    grids: dict[str, Grid] = {}
    for lower, name in by_lower.items():
        if lower.startswith(_LINK_PARTS):
            _refuse("external-link", "the workbook takes data from outside", where, name,
                    "a workbook of values", _FOREIGN)  # fmt: skip
        if lower.startswith(_OBJECT_PARTS):
            _refuse("embedded-object", "the workbook holds embedded objects", where, name,
                    "a workbook of values", _FOREIGN)  # fmt: skip
        content = members[name]
        if (
            lower.endswith((".xml", ".rels", ".vml"))
            or content[:64].lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<"
        ):
            grid = _check_xml(name, content, where)
            if grid is not None:
                grids[name] = grid
    return grids


def _walk_mat(data: bytes, where: Path) -> Mapping[str, bytes]:
    return {"mat": unpack_mat(data, where)}


def _walk_mdf(data: bytes, where: Path) -> Mapping[str, bytes]:
    walk_mdf(data, where)
    return {}


def _walk_tdms(data: bytes, where: Path) -> Mapping[str, bytes]:
    walk_tdms(data, where)
    return {}


_PLAIN = {"text": "text", "utf-16": "text", "lvm": "lvm"}
_WALKED = {"mat": _walk_mat, "mdf": _walk_mdf, "tdms": _walk_tdms}


def _check_xml(name: str, xml: bytes, where: Path) -> Grid | None:
    # UTF-16 would hide everything from the searches below; Office writes UTF-8 only.
    declared = _ENCODING.match(xml[: xml.find(b"?>") + 2].removeprefix(b"\xef\xbb\xbf"))
    if b"\x00" in xml or (declared and declared.group(1).lower() not in _ENCODINGS):
        _refuse("encoding", "a part of the workbook is not in UTF-8", where, name, "UTF-8", _FOREIGN)
    if b"!" in xml and (b"<!DOCTYPE" in xml or b"<!ENTITY" in xml):
        _refuse("dtd", "a part of the workbook has a document type definition", where, name,
                "XML without one", _FOREIGN)  # fmt: skip
    if name.endswith(".rels"):
        _check_relationships(name, xml, where)
    elif b"sheetData" in xml:
        return _check_sheet(name, xml, where)
    return None


def _check_relationships(name: str, xml: bytes, where: Path) -> None:
    try:
        root = ET.fromstring(xml)  # noqa: S314  no DTD can be in it: just checked
    except (ET.ParseError, ValueError, LookupError) as error:
        _refuse("xml", "a part of the workbook is not well-formed", where, f"{name}: {error}", "XML",
                "copy the file again from the machine")  # fmt: skip
    for relationship in root.iter(_RELATIONSHIP):
        kind = relationship.get("Type", "").rpartition("/")[2]
        target = relationship.get("Target", "")
        outside = relationship.get("TargetMode", "").lower() == "external" or "://" in target
        if (outside and kind != "hyperlink") or kind in ("externalLink", "externalLinkPath"):
            _refuse("external-link", "the workbook takes content from outside", where,
                    f"{name}: {target[:120]}", "a workbook of values", _FOREIGN)  # fmt: skip


def _check_sheet(name: str, xml: bytes, where: Path) -> Grid | None:
    grid = find_grid(xml)
    try:
        cells = find_cells(xml, grid)
    except MalformedSheetError as error:
        _refuse("xml", "a worksheet cannot be parsed", where, f"{name}: {error}", "well-formed XML",
                "copy the file again from the machine")  # fmt: skip
    if not xml.rstrip().endswith(b"worksheet>"):
        _refuse("xml", "a worksheet ends early", where, name, "a closing worksheet tag",
                "copy the file again from the machine")  # fmt: skip
    if far := cells.far:
        _refuse("far-cell", "a cell stands far beyond the data", where, f"{name}: cell {far}",
                f"cells near each other; the worksheet has {len(cells.rows)} in all",
                "delete that cell in a copy of the file, or find out where the file comes from")  # fmt: skip
    if doubled := cells.doubled:
        _refuse("doubled-cell", "a cell occurs twice in a worksheet", where, f"{name}: cell {doubled}",
                "every cell once", _FOREIGN)  # fmt: skip
    return grid


def _no_workbook(where: Path, kind: Kind) -> NoReturn:
    _refuse("not-a-workbook", f"the file is {kind.text}, not a recording", where, kind.text,
            "an .xlsx workbook, a CSV file with a header row, or TDMS, LVM, MDF 4 or MAT (version 5 to 7)",
            "give the file that the acquisition program wrote")  # fmt: skip


def _refuse(
    rule: str, problem: str, where: object, actual: object, expected: object, next_step: str
) -> NoReturn:
    raise UnreadableError(problem, where=where, got=actual, expected=expected, next_step=next_step, rule=rule)
