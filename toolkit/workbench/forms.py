"""Forms as a browser sends them: fields, and files with the names that they had (RFC 7578).

A form is whole or refused. Starlette's own parser takes one that was cut off for one with fewer fields, and
reads text that is no UTF-8 as Latin-1: a decision must rest on neither. Nor on a field that no document can
print: what was typed is kept for ever, and may have been pasted from anywhere.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from email.message import Message
from urllib.parse import parse_qsl

from toolkit.printable import check_text, escaped

FORM_TYPE = "application/x-www-form-urlencoded"
FILES_TYPE = "multipart/form-data"
MOST_FIELDS = 50
CONTENTS = frozenset(("session", "data", "check"))
"""Fields that hold a file as it is typed: a draft keeps it whatever it says, and its reader judges it."""
_BOUNDARY = re.compile(r"[0-9A-Za-z'()+_,./:=? -]{0,69}[0-9A-Za-z'()+_,./:=?-]")


@dataclass(frozen=True, slots=True)
class Upload:
    """A file of a form. ``name`` is what the browser calls it: a title for messages, never a path."""

    name: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Form:
    """The fields of a form by name, and its files; a file that nobody chose is none of them."""

    fields: dict[str, str]
    files: dict[str, tuple[Upload, ...]] = field(default_factory=dict)


def read_form(body: bytes, content_type: str) -> Form:
    """Read a form.

    >>> read_form(b"a=1&b=%C3%A4", FORM_TYPE).fields
    {'a': '1', 'b': '\xe4'}

    Raises
    ------
    ValueError
        it is none, is no UTF-8, or has too many fields
    ConfigError
        ``unprintable``: a field has a character that no document can print
    """
    form = _parsed(body, content_type)
    for name, text in form.fields.items():
        if name not in CONTENTS:
            check_text(text, where=escaped(name, lines=False))
    return form


def _parsed(body: bytes, content_type: str) -> Form:
    if content_type.partition(";")[0].strip().lower() == FORM_TYPE:
        pairs = parse_qsl(
            body.decode(),
            keep_blank_values=True,
            strict_parsing=True,
            errors="strict",
            max_num_fields=MOST_FIELDS,
        )
        return Form(dict(pairs))
    header = Message()
    header["content-type"] = content_type
    boundary = header.get_param("boundary")
    if not isinstance(boundary, str) or not _BOUNDARY.fullmatch(boundary):
        raise ValueError("no boundary")
    start, *parts, end = (b"\r\n" + body).split(b"\r\n--" + boundary.encode())
    if start or end.strip() != b"--" or len(parts) > MOST_FIELDS:
        raise ValueError("no whole form, or too many fields")
    fields: dict[str, str] = {}
    files: dict[str, tuple[Upload, ...]] = {}
    for part in parts:
        head, found, data = part.removeprefix(b"\r\n").partition(b"\r\n\r\n")
        name, file = _disposition(head.decode())
        if not found or name is None:
            raise ValueError("a part without a name")
        if file is None:
            fields[name] = data.decode()
        elif file or data:
            files[name] = (*files.get(name, ()), Upload(file, data))
    return Form(fields, files)


def _disposition(head: str) -> tuple[str | None, str | None]:
    """Return the name of a part and that of its file, None where it is none."""
    for line in head.split("\r\n"):
        key, _, value = line.partition(":")
        if key.strip().lower() == "content-disposition":
            # A browser writes quotes and line ends in a name as %22, %0D, %0A, and backslashes as they are.
            pairs = dict(re.findall(r';\s*(name|filename)="([^"]*)"', value))
            return pairs.get("name"), pairs.get("filename")
    return None, None
