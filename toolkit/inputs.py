"""The opener of every input: regular files, each read up to the limit of its form.

A pipe never ends, a device fills the memory, a socket or a terminal waits: none is opened. What is opened
stays what it was when it was looked at, and gives no more bytes than its form allows, however its size is
told (files of /proc tell none). Nothing else in the package opens an input; `tests.house` holds that.

Every limit stands in this module, with its reason. ``--max-size`` of every command raises them all.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NoReturn

from toolkit.errors import (
    ConfigError,
    SessionError,
    TemplateError,
    ToolkitError,
    TrustError,
    UnreadableError,
)
from toolkit.system import WITHOUT_WAITING

MIB = 2**20
_NO_FILE = "no-file"
_LISTED = 6  # names of a folder in an error


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What is read as one kind of input.

    ``title`` begins messages; ``limit`` in bytes, and ``reason`` why no file of this form is
    larger; ``error``, ``rule``, ``expected`` and ``next_step`` are those of a file that cannot be read.
    """

    title: str
    limit: int
    reason: str
    error: type[ToolkitError] = UnreadableError
    rule: str = _NO_FILE
    expected: str = "a readable file"
    next_step: str = "check the path and its permissions"


SETTINGS_FILE = Form(
    title="a settings file",
    limit=16 * MIB,
    reason="a person wrote it",
    error=ConfigError,
    expected="a readable TOML file",
    next_step="check the path",
)
RECORDING_FILE = Form(
    title="the file",
    limit=128 * MIB,
    reason="a day of the machine has a tenth of it",
    expected="a readable recording",
)
TABLE_FILE = Form(
    title="the table",
    limit=128 * MIB,
    reason="a million rows of measured forces",
    expected="a readable CSV file",
    next_step="check the path",
)
TYDEX_FILE = Form(
    title="the TYDEX file",
    limit=256 * MIB,
    reason="two million rows of measured forces",
    expected="a readable TYDEX file",
    next_step="check the path",
)
TIRE_FILE = Form(
    title="the tire file",
    limit=8 * MIB,
    reason="some hundred lines of coefficients",
    expected="a readable .tir file",
    next_step="check the path",
)
TEMPLATE_FILE = Form(
    title="the template",
    limit=64 * MIB,
    reason="a page with its logo has a hundredth of it",
    error=TemplateError,
    rule="no-template",
    expected="a Word file (.docx or .dotx)",
    next_step="check --template, or make one with 'toolkit template new'",
)
RESULT_FILE = Form(
    title="the answer",
    limit=256 * MIB,
    reason="a diagnosis of a hundred runs has a tenth of it",
    error=ConfigError,
    expected="a readable answer of the toolkit",
    next_step="check the path",
)
CODE_FILE = Form(
    title="the simulator",
    limit=16 * MIB,
    reason="a person wrote it",
    error=ConfigError,
    expected="a readable Python file",
    next_step="check the path",
)
FMU_FILE = Form(
    title="the FMU",
    limit=512 * MIB,
    reason="it holds binaries of every system",
    error=ConfigError,
    expected="a readable .fmu file",
    next_step="check the path",
)
RECORD_FILE = Form(
    title="a file of the registry",
    limit=512 * MIB,
    reason="a ledger of a million entries has three quarters of it",
)
NAMED_FILE = Form(
    title="a file that the case names",
    limit=128 * MIB,
    reason="as a recording",
    error=ConfigError,
    expected="a readable regular file; paths are relative to the case file",
    next_step="correct the path in the case",
)
LIST_FILE = Form(
    title="the list of reports",
    limit=128 * MIB,
    reason="a million reports",
    error=ConfigError,
    expected="a readable CSV file",
    next_step="check the path",
)
DATA_FILE = Form(
    title="a data file of the session",
    limit=128 * MIB,
    reason="a million reference loads",
    error=SessionError,
    rule="no-data",
    next_step="correct its name in the session; nothing was written",
)
PDF_FILE = Form(title="the PDF", limit=512 * MIB, reason="a report of a thousand figures has half of it")
DCC_FILE = Form(
    title="the digital certificate", limit=32 * MIB, reason="a certificate of many loads has 1 MB"
)
CERTIFICATE_FILE = Form(
    title="a key or certificate",
    limit=4 * MIB,
    reason="a chain of certificates has a hundredth of it",
    error=TrustError,
    rule="trust-certificate",
    expected="a certificate, PEM or DER",
)
REQUEST_FILE = Form(
    title="the signing request",
    limit=16 * MIB,
    reason="a record has a hundredth of it",
    error=TrustError,
    rule="request",
    expected="a file that --request wrote, or toolkit sign",
    next_step="check the path",
)

_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(?:([KMGT])I?)?B?\s*", re.IGNORECASE)
_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
_raised = 0  # of the process: readers in threads have it too; workers are given it


class TooLargeError(OSError):
    """A file has more bytes than its form allows."""


def size_of(text: str) -> int:
    """Return the bytes that a size names; MB and MiB are 2**20 bytes.

    >>> [size_of(text) for text in ("512", "2 kB", "1.5GiB")]
    [512, 2048, 1610612736]

    Raises
    ------
    ValueError
        it is no size
    """
    match = _SIZE.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is no size, such as 500MB or 2GB")
    return int(float(match[1]) * 1024 ** (" KMGT".index(match[2].upper()) if match[2] else 0))


def size_text(size: int) -> str:
    """Return a number of bytes for people.

    >>> [size_text(size) for size in (12, 16 << 20, 1610612736)]
    ['12 bytes', '16 MB', '1.5 GB']
    """
    for scale, name in ((2**30, "GB"), (MIB, "MB"), (2**10, "kB")):
        if size >= scale:
            return f"{size / scale:.4g} {name}"
    return f"{size} bytes"


def raise_limits(size: int) -> None:
    """Let every form be read up to ``size`` bytes in this process; 0 puts the limits of the table back."""
    global _raised  # noqa: PLW0603  a property of the process, as its umask is
    _raised = size


def raised_to() -> int:
    """Return what the limits were raised to [bytes], 0 where they are those of the table."""
    return _raised


def limit_of(form: Form) -> int:
    """Return the largest file that is read as a form [bytes]."""
    return max(form.limit, _raised)


@contextlib.contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file, or a link to one, for reading; nothing else is opened at all.

    Raises
    ------
    OSError
        it cannot be opened, or is no regular file
    """
    demand_regular(path)
    # It may have been exchanged since: a pipe must not block here, nor a terminal become this process's.
    handle = os.open(path, os.O_RDONLY | WITHOUT_WAITING)
    with os.fdopen(handle, "rb") as stream:
        _demand_regular(os.fstat(handle).st_mode, path)
        yield stream


def is_regular(path: Path) -> bool:
    """Tell whether a path leads to a regular file; a name that no file can have leads to none."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def read_regular(path: Path, form: Form = RECORD_FILE) -> bytes:
    """Read a regular file whole.

    Raises
    ------
    TooLargeError
        it has more bytes than the form allows
    OSError
        it cannot be read, or is no regular file
    """
    limit = limit_of(form)
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > limit:
            _too_large(size_text(size), form, path)
        # Two bytes more than are told: one shows that a file has grown, or that none were told.
        data = _read(stream, size + 1, path)
        if len(data) > size:
            data += _read(stream, limit + 1 - len(data), path)
        if len(data) > limit:
            _too_large(f"more than {size_text(limit)}", form, path)
        return data


def read_input(path: Path, form: Form) -> bytes:
    """Read an input whole.

    Raises
    ------
    ToolkitError
        the error of the form: its rule where the file cannot be read, ``too-large`` beyond its limit
    """
    try:
        return read_regular(path, form)
    except (OSError, ValueError) as error:
        raise unreadable(path, form, error) from error


def check_size(data: bytes, form: Form, where: str) -> None:
    """Refuse an input that came otherwise than from a file, beyond the limit of its form.

    Raises
    ------
    ToolkitError
        the error of the form, ``too-large``
    """
    if len(data) > limit_of(form):
        size = size_text(len(data))
        raise unreadable(Path(where), form, TooLargeError(errno.EFBIG, size, where, None, size))


def unreadable(path: Path, form: Form, error: OSError | ValueError) -> ToolkitError:
    """Return the error of an input that `read_regular` could not read."""
    if isinstance(error, TooLargeError):
        return form.error(
            f"{form.title} is too large",
            where=path,
            got=error.filename2,
            expected=f"at most {size_text(limit_of(form))}: {form.reason}",
            next_step="check that it is the file that was meant; --max-size SIZE reads a larger one",
            rule="too-large",
        )
    if form.rule == _NO_FILE and _is_folder(path):
        return form.error(
            f"{form.title} is a folder", where=path, got=_listed(path),
            expected=f"{form.expected}, not the folder that it lies in",
            next_step="name the file in the folder", rule="folder-for-file",
        )  # fmt: skip
    return form.error(
        f"{form.title} cannot be read",
        where=path,
        got=getattr(error, "strerror", None) or error,
        expected=form.expected,
        next_step=form.next_step,
        rule=form.rule,
    )


def _is_folder(path: Path) -> bool:
    with contextlib.suppress(OSError, ValueError):
        return path.is_dir()
    return False


def _listed(folder: Path) -> str:
    """Return the first names in a folder, for people."""
    with contextlib.suppress(OSError):
        names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        return f"a folder with {', '.join(names[:_LISTED])}{more}" if names else "an empty folder"
    return "a folder"


def open_regular_to_append(path: Path) -> BinaryIO:
    """Open a file to be read and appended to, made where there is none; it stays open.

    Raises
    ------
    OSError
        it cannot be opened, or is no regular file
    """
    with contextlib.suppress(FileNotFoundError):
        demand_regular(path)
    handle = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | WITHOUT_WAITING, 0o666)
    try:
        _demand_regular(os.fstat(handle).st_mode, path)
        return os.fdopen(handle, "a+b")
    except OSError:
        os.close(handle)
        raise


def demand_regular(path: Path) -> None:
    """Demand that a path leads to a regular file.

    Raises
    ------
    OSError
        it leads to something else, or nowhere
    """
    _demand_regular(os.stat(path).st_mode, path)  # noqa: PTH116  a str is taken too


def _demand_regular(mode: int, path: Path) -> None:
    if not stat.S_ISREG(mode):
        kind = next((text for holds, text in _KINDS if holds(mode)), "no file")
        raise OSError(errno.EINVAL, f"{kind}, not a regular file", str(path))


def _read(stream: BinaryIO, size: int, path: Path) -> bytes:
    data: bytes | None = stream.read(size)
    if data is None:  # a file of the kernel that waits for what is to come
        raise OSError(errno.EAGAIN, "a file that has nothing to read and no end", str(path))
    return data


def _too_large(actual: str, form: Form, path: Path) -> NoReturn:
    text = f"{actual}, over the limit of {size_text(limit_of(form))}; --max-size SIZE raises it"
    raise TooLargeError(errno.EFBIG, text, str(path), None, actual)
