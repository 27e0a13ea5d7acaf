"""Zip members, inflated within bounds and checked, before any reader of workbooks sees them."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Mapping
from typing import NoReturn

from toolkit.errors import UnreadableError
from toolkit.inputs import RECORDING_FILE, limit_of, size_text

MAX_MEMBERS = 512
MAX_RATIO = 200
"""Inflated to stored size of one member; a worksheet of numbers has 5 to 20, a bomb about 1000."""

RATIO_FREE_BYTES = 2**20
"""Below this inflated size the ratio does not matter."""

_LOCAL = struct.Struct("<4s5H3L2H")
_CENTRAL = struct.Struct("<4s6H3L5H2L")
_END = struct.Struct("<4s4H2LH")
_STAMP = (0, 0x21)  # 1980-01-01: the archive is only ever in memory


def read_members(data: bytes, *, where: object, only: tuple[str, ...] | None = None) -> dict[str, bytes]:
    """Return the members of a zip archive, name -> content, in the order of its directory.

    Parameters
    ----------
    data : the whole file
    where : for the messages
    only : names to inflate; the rest are checked for their names alone

    Raises
    ------
    UnreadableError
        rule ``zip-truncated zip-damaged zip-method encrypted member-path members inflation``
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error, EOFError, OSError) as error:
        _refuse(
            "zip-truncated",
            "the file begins like a workbook, and its end is missing or damaged",
            where,
            got=f"{len(data)} bytes: {error}",
            expected="a zip archive with its directory at the end",
            next_step="copy the file again from the machine; it was cut off or damaged on its way",
        )
    _check_names([member.filename for member in members], where)
    budget = limit_of(RECORDING_FILE)
    contents: dict[str, bytes] = {}
    for member in members:
        if member.is_dir() or (only is not None and member.filename not in only):
            continue
        content = _inflate(data, member, budget, where)
        budget -= len(content)
        contents[member.filename] = content
    return contents


def stored_archive(members: Mapping[str, bytes]) -> bytes:
    """Return an uncompressed zip archive of members that were checked.

    A reader is given these bytes, not the file's: what was checked is then exactly what is read, and
    nothing is inflated twice.
    """
    body: list[bytes] = []
    directory: list[bytes] = []
    offset = 0
    for name, content in members.items():
        raw, crc, size = name.encode(), zlib.crc32(content), len(content)
        head = _LOCAL.pack(b"PK\x03\x04", 20, 0x800, 0, *_STAMP, crc, size, size, len(raw), 0)
        directory.append(
            _CENTRAL.pack(
                b"PK\x01\x02", 20, 20, 0x800, 0, *_STAMP, crc, size, size, len(raw), 0, 0, 0, 0, 0, offset
            )
            + raw
        )
        body += (head, raw, content)
        offset += len(head) + len(raw) + size
    tail = b"".join(directory)
    end = _END.pack(b"PK\x05\x06", 0, 0, len(members), len(members), len(tail), offset, 0)
    return b"".join([*body, tail, end])


def _check_names(names: list[str], where: object) -> None:
    if len(names) > MAX_MEMBERS:
        _refuse(
            "members",
            "the archive holds too many members",
            where,
            got=len(names),
            expected=f"at most {MAX_MEMBERS}",
        )
    lower_names: set[str] = set()
    for name in names:
        parts = name.replace("\\", "/").split("/")
        if not name or ".." in parts or name.startswith(("/", "\\")) or ":" in name or not name.isprintable():
            _refuse(
                "member-path",
                "a member of the archive names a place outside of it",
                where,
                got=repr(name),
                expected="names such as 'xl/worksheets/sheet1.xml'",
            )
        if name.lower() in lower_names:
            _refuse("member-path", "two members of the archive have the same name", where, got=repr(name),
                    expected="every name once")  # fmt: skip
        lower_names.add(name.lower())


def _inflate(data: bytes, member: zipfile.ZipInfo, budget: int, where: object) -> bytes:
    name = member.filename
    if member.flag_bits & 0x41:
        _refuse("encrypted", "a member of the archive is encrypted", where, got=name,
                expected="a workbook without a password",
                next_step="save it without a password and try again")  # fmt: skip
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        _refuse("zip-method", "a member of the archive is packed in a way that workbooks never are", where,
                got=f"{name}: method {member.compress_type}", expected="stored or deflated")  # fmt: skip
    if member.file_size > limit_of(RECORDING_FILE):
        _too_large(name, where)  # what it claims is enough
    raw = _raw(data, member, where)
    if member.compress_type == zipfile.ZIP_STORED:
        content = raw
        if len(content) > budget:
            _too_large(name, where)
    else:
        # The sizes in the directory are claims: what comes out is counted, whatever they say.
        bound = min(budget, max(RATIO_FREE_BYTES, MAX_RATIO * len(raw)))
        engine = zlib.decompressobj(-zlib.MAX_WBITS)
        try:
            content = engine.decompress(raw, bound + 1)
        except zlib.error as error:
            _damaged(name, str(error), where, error)
        if len(content) > bound:
            _too_large(name, where)
        if not engine.eof:
            _damaged(name, "the packed data ends early", where)
    if len(content) != member.file_size:
        _damaged(name, f"{len(content)} bytes where the directory says {member.file_size}", where)
    if zlib.crc32(content) != member.CRC:
        _damaged(name, "the check sum differs", where)
    return content


def _raw(data: bytes, member: zipfile.ZipInfo, where: object) -> bytes:
    start = member.header_offset
    head = data[start : start + _LOCAL.size]
    if len(head) < _LOCAL.size or head[:4] != b"PK\x03\x04":
        _damaged(member.filename, "its header is not where the directory says", where)
    fields = _LOCAL.unpack(head)
    begin = start + _LOCAL.size + fields[9] + fields[10]
    raw = data[begin : begin + member.compress_size]
    if len(raw) < member.compress_size:
        _damaged(member.filename, "its data ends early", where)
    return raw


def _too_large(name: str, where: object) -> NoReturn:
    limit = size_text(limit_of(RECORDING_FILE))
    _refuse(
        "inflation",
        "a member of the archive grows out of all proportion when it is unpacked",
        where,
        got=name,
        expected=f"at most {limit} in all and {MAX_RATIO} times its packed size",
    )


def _damaged(name: str, how: str, where: object, cause: Exception | None = None) -> NoReturn:
    _refuse(
        "zip-damaged",
        "a member of the archive is damaged",
        where,
        got=f"{name}: {how}",
        expected="intact data",
        next_step="copy the file again from the machine",
        cause=cause,
    )


def _refuse(
    rule: str,
    problem: str,
    where: object,
    *,
    got: object,
    expected: object,
    next_step: str = "find out where the file comes from; the machine does not write such files",
    cause: Exception | None = None,
) -> NoReturn:
    raise UnreadableError(
        problem, where=where, got=got, expected=expected, next_step=next_step, rule=rule
    ) from cause
