"""Files as every module touches them: whole or not at all, hashed, and TOML without unknown keys."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeGuard

from toolkit.errors import ConfigError, OutputError
from toolkit.inputs import SETTINGS_FILE, open_regular, read_input
from toolkit.printable import check_entries
from toolkit.spelling import nearest
from toolkit.system import sync_file, sync_folder

_AT_ONCE = 2**20
LARGEST = 1e100
"""No number of a file is larger, in any unit: squares and products of larger ones are no floats."""


def sha256_bytes(data: bytes) -> str:
    """Return the SHA-256 of bytes as 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def sha256_file(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    digest = hashlib.sha256()
    with open_regular(path) as stream:
        while data := stream.read(_AT_ONCE):
            digest.update(data)
    return digest.hexdigest()


@contextlib.contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``target`` and rename it there when the block succeeds.

    A reader sees the old file or the new one, never a part: the content is flushed to the disk before
    the rename and the folder after it. When the block raises, nothing is left behind. A file that is
    replaced keeps its mode; a new one has what the process's umask and the folder's rules leave it.

    Raises
    ------
    OutputError
        the folder cannot be written to, or the disk is full
    """
    temporary: Path | None = None
    remedy = "free space or choose another folder with --out; nothing was changed"
    try:
        if not target.parent.is_dir():
            target.parent.mkdir(parents=True, exist_ok=True)
        mode = _mode(target)
        temporary = _new_part(target, 0o666 if mode is None else mode)
        yield temporary
        sync_file(temporary)
        if mode is not None:
            temporary.chmod(mode)
        temporary.replace(target)
        temporary = None
        remedy = (
            "the new file is in its place, but a power cut may undo it: mend the disk, and write it again"
        )
        sync_folder(target.parent)
    except OSError as error:
        raise OutputError(
            "a file cannot be written",
            where=target,
            got=error.strerror or str(error),
            expected="a folder with write permission and free space",
            next_step=remedy,
            rule="not-writable",
        ) from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):  # the error that is raised says more
                temporary.unlink(missing_ok=True)


def _new_part(target: Path, mode: int) -> Path:
    """Make an empty file of a new name beside ``target``, readable by nobody whom ``mode`` keeps out."""
    while True:
        path = target.parent / f".{target.name[:60]}.{os.urandom(4).hex()}.part"
        with contextlib.suppress(FileExistsError):
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode & 0o666 | 0o600))
            return path


def _mode(target: Path) -> int | None:
    """Return the mode of a file that will be replaced; None where there is none."""
    try:
        return stat.S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return None


def write_atomic(target: Path, data: bytes | str) -> None:
    """Write a whole file or nothing (see `atomic_path`)."""
    with atomic_path(target) as temporary:
        temporary.write_bytes(data.encode() if isinstance(data, str) else data)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    ConfigError
        ``no-file``: missing or unreadable; ``not-toml``
    """
    return parse_toml(read_input(path, SETTINGS_FILE), where=path)


def parse_json(data: bytes | str) -> Any:
    """Return the values of a JSON text, in which no object may state a name twice.

    Which of the two counts is open (RFC 8259, section 4): what was signed or hashed of such a text need not
    be what the next program reads of it.

    Raises
    ------
    ValueError
        no JSON, or a name that stands twice

    >>> parse_json('{"a": {"b": 1, "b": 2}}')
    Traceback (most recent call last):
    ValueError: 'b' stands twice in one object
    """
    return json.loads(data, object_pairs_hook=_each_once)


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for name, value in pairs:
        if name in entries:
            raise ValueError(f"{name!r} stands twice in one object")
        entries[name] = value
    return entries


class _Beyond(float):
    """A number that is too large for a double: infinity, told as it was written."""

    text: str

    def __new__(cls, text: str) -> _Beyond:
        """Keep the text beside the value."""
        number = super().__new__(cls, text)
        number.text = text
        return number

    def __str__(self) -> str:
        return self.text


def as_written(text: str) -> float:
    """Return the number of a text; one that only its size makes infinite is told as the text.

    >>> str(as_written("1e400")), str(as_written("inf")), as_written("2.5")
    ('1e400', 'inf', 2.5)
    """
    number = float(text)
    return _Beyond(text) if math.isinf(number) and text.lstrip("+-") != "inf" else number


DEEPEST = 100
"""Parts of a key of TOML, ``a.b.c`` of three, that are read: no form of the toolkit has ten."""

# What a text of TOML is made of, in one pass: a text without an end takes all that is left.
_PIECE = re.compile(
    r'''"""(?:[^"\\]|\\[\s\S]?|"(?!""))*+(?:"{3,5}|\Z)|'''
    r"""'''(?:[^']|'(?!''))*+(?:'{3,5}|\Z)|"""
    r"""(?P<key>"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'|[A-Za-z0-9_-]++)|(?P<dot>\.)|(?P<space>[ \t]++)|"""
    r"""["'][\s\S]*|\#[^\n]*+|[\s\S]"""
)


def toml_entries(text: str) -> dict[str, Any]:
    """Return the entries of a text of TOML, in a time that its length bounds.

    The reader of Python's library takes the square of a key's parts: fifty thousand of them, in 100 kB, would
    take minutes.

    Raises
    ------
    ValueError
        no TOML, or a key of more than `DEEPEST` parts
    RecursionError
        arrays or tables within one another without end
    """
    if any(line.count(".") >= DEEPEST for line in text.split("\n")):
        _demand_short_keys(text)
    return tomllib.loads(text, parse_float=as_written)


def _demand_short_keys(text: str) -> None:
    parts, after_dot = 0, False
    for piece in _PIECE.finditer(text):
        if piece.lastgroup == "key":
            parts, after_dot = (parts + 1 if after_dot else 1), False
            if parts > DEEPEST:
                line = text.count("\n", 0, piece.start()) + 1
                raise tomllib.TOMLDecodeError(f"a key of more than {DEEPEST} parts (at line {line})")
        elif piece.lastgroup == "dot":
            after_dot = parts > 0
        elif piece.lastgroup != "space":
            parts, after_dot = 0, False


def parse_toml(data: bytes, *, where: object, entered: bool = False) -> dict[str, Any]:
    """Parse the content of a TOML file; ``where`` names it in the message.

    ``entered``: the laboratory keeps the file already. What it says is read as it is, whatever its texts
    have: today's rules of what may enter make no record of the past unreadable.

    Raises
    ------
    ConfigError
        ``not-toml``; ``unprintable``: a text or a key with a character that no document can print
    """
    try:
        # Editors of Windows begin a file with a mark.
        text = data.decode("utf-8-sig")
        entries = toml_entries(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, arrays without end
        twice = "Cannot overwrite" in str(error) or "Cannot declare" in str(error)
        raise ConfigError(
            "a settings file is not TOML",
            where=where,
            got=str(error).partition("; use sys.")[0],  # what a program could do about digits
            expected="each key once, as a value or as a table" if twice else "TOML 1.0 in UTF-8",
            next_step="mend the line that is named",
            rule="not-toml",
        ) from error
    if not entered:
        check_entries(entries, where=where, source=text)
    return entries


def real_path(path: Path) -> Path:
    """Return where a path leads when links are followed; a loop of links is followed no further.

    What cannot be reached is a matter for whoever opens it: `Path.resolve` fails on a loop by an error that
    is no `OSError`.
    """
    try:
        return Path(os.path.realpath(path))
    except ValueError:  # a name that no file can have
        return path.absolute()


def same_file(path: Path, twin: Path) -> bool:
    """Tell whether two paths lead to one place, by links or where a file system takes A for a."""
    with contextlib.suppress(OSError, ValueError):
        if path.samefile(twin):
            return True
    return real_path(path) == real_path(twin)


def is_number(value: object) -> TypeGuard[int | float]:
    """Tell whether an entry of a settings file is a number that can be computed with: at most 1e100.

    Nothing measured is larger, in any unit; squares of larger ones are no floats, and some solvers wait for
    ever on what is none.

    >>> [is_number(one) for one in (1, -2.5, True, "1", float("nan"), 10**400, 1e300)]
    [True, True, False, False, False, False, False]
    """
    # Not math.isfinite: TOML has whole numbers of any length, and one past a float's reach raises there.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def reads_as_number(text: str) -> bool:
    """Tell whether a text is a number as Python reads it.

    >>> reads_as_number("-1e3"), reads_as_number("1,5")
    (True, False)
    """
    try:
        float(text)
    except ValueError:
        return False
    return True


def number_of(text: str) -> float | None:
    """Return the number of a word that somebody typed; None where it is none that can be computed with.

    >>> number_of(" -1e3 "), number_of("1e300"), number_of("nan"), number_of("1,5")
    (-1000.0, None, None, None)
    """
    value = float(text) if reads_as_number(text) else None
    return value if is_number(value) else None


def number_expected(actual: object, expected: str) -> str:
    """Return what is expected in place of a value: where it is a number out of reach, the reach.

    >>> number_expected(1e101, "a finite number"), number_expected("1", "a finite number")
    ('a number of at most 1e+100 in size', 'a finite number')
    """
    if isinstance(actual, int | float) and LARGEST < abs(actual) < math.inf:
        return f"a number of at most {LARGEST:g} in size"
    return expected


def check_keys(table: Mapping[str, Any], known: Iterable[str], *, where: object) -> None:
    """Refuse a key that is not known and name the nearest one that is.

    >>> check_keys({"sped": 1}, ["speed", "surface"], where="test.toml")
    Traceback (most recent call last):
    toolkit.errors.ConfigError: unknown key 'sped'
      where:    test.toml
      got:      sped
      expected: speed
      next:     did you mean 'speed'?
    """
    names = sorted(known)
    for key in table:
        if key not in names:
            near = nearest(key, names)
            raise ConfigError(
                f"unknown key {key!r}",
                where=where,
                got=key,
                expected=near or ", ".join(names),
                next_step=f"did you mean {near!r}?" if near else "remove it or use one of those expected",
                rule="unknown-key",
            )
