"""Results that outlive a run: an interrupted audit goes on, and a second one does only what changed.

``results.jsonl`` holds one line a file, written as soon as the file is done; without an output folder it is a
temporary file. Nothing but its index stays in memory, so that an archive may have any number of files. A
result is used again only for the same content of the file, the same words of its test.toml (and of a machine
that it names by a file), the same registry and day of knowledge, and the same version of the toolkit. Every
file is read and hashed for that: its size and its times are never asked, for a copy of an archive keeps them
and an editor may set them.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import weakref
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, overload

from toolkit.audit.model import DisagreeingSides
from toolkit.audit.one_file import ArchivedFile, OwnOutput
from toolkit.audit.sides import grade_of
from toolkit.declared import json_value, object_of
from toolkit.errors import OutputError
from toolkit.files import sha256_bytes, sha256_file, toml_entries
from toolkit.inputs import SETTINGS_FILE, open_regular_to_append, raised_to, read_regular
from toolkit.recording.folder import nearest_test_toml
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT
from toolkit.system import WITHOUT_WAITING, lock_file
from toolkit.version import __version__

RESULTS = "results.jsonl"
SHAPE = 6
"""Of an `ArchivedFile` as it is kept; results of another one are not used again."""
_HEADER = (json.dumps({"generator": GENERATOR, "marks": OWN_OUTPUT}) + "\n").encode()
_REST, _END = b', "result": ', b"}\n"
_HASHING = 4  # threads; reading and hashing leave the interpreter free
_SMALL = 2**20
_BATCH = 32  # files that a thread is given at once


@dataclass(frozen=True, slots=True)
class Done:
    """A result as it is kept: the hash of the file, and the plain answer as JSON (null: an own output)."""

    sha256: str | None
    body: bytes


def done(result: ArchivedFile | OwnOutput) -> Done:
    """Return a result as it is kept."""
    if isinstance(result, OwnOutput):
        return Done(result.sha256, b"null")
    # What a library would have read is asked again: it may be installed by then.
    lacking = result.reason is not None and result.reason.startswith("missing-extra")
    return Done(None if lacking else result.sha256, json.dumps(json_value(result)).encode())


class Files(Sequence[ArchivedFile]):
    """The results of an audit, sorted by path, read from the disk when they are asked for."""

    def __init__(self, file: IO[bytes], places: Sequence[int]) -> None:
        self._file, self._places = file, places
        self._sides: dict[str, DisagreeingSides] = {}
        weakref.finalize(self, file.close)

    def decide(self, sides: Mapping[str, DisagreeingSides]) -> None:
        """Take what the other files of a test say of files that their own rows leave open, by path."""
        self._sides.update(sides)

    def line(self, index: int) -> dict[str, Any]:
        """Return one result under the keys of the answer."""
        return self._plain(self._places[index])

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> ArchivedFile: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[ArchivedFile, ...]: ...
    def __getitem__(self, index: int | slice) -> ArchivedFile | tuple[ArchivedFile, ...]:
        """Return one result, or some."""
        if isinstance(index, slice):
            return tuple(object_of(ArchivedFile, self._plain(place)) for place in self._places[index])
        return object_of(ArchivedFile, self._plain(self._places[index]))

    def __iter__(self) -> Iterator[ArchivedFile]:
        return (object_of(ArchivedFile, line) for line in self.plain())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Files):
            return NotImplemented
        return len(self) == len(other) and all(
            a == b for a, b in zip(self.plain(), other.plain(), strict=True)
        )

    __hash__ = None  # type: ignore[assignment]

    def plain(self) -> Iterator[dict[str, Any]]:
        """Yield the results under the keys of the answer."""
        return (self._plain(place) for place in self._places)

    def raw(self) -> Iterator[bytes]:
        """Yield what `plain` yields as JSON in ASCII."""
        if self._sides:
            return (json.dumps(line).encode() for line in self.plain())
        return (self._raw(place) for place in self._places)

    def _plain(self, place: int) -> dict[str, Any]:
        line: dict[str, Any] = json.loads(self._raw(place))
        sides = self._sides.get(line["path"])
        if sides is not None:
            line |= {"grade": grade_of(sides), "sides": asdict(sides)}
        return line

    def _raw(self, place: int) -> bytes:
        self._file.seek(place)
        line = self._file.readline()
        return line[line.index(_REST) + len(_REST) : -len(_END)]


class Results:
    """The results file of an output folder; one audit writes it at a time.

    ``known`` tells which files need not be audited again, ``put`` appends a result.
    """

    def __init__(self, folder: Path | None, *, archive: Path, registry_hash: str) -> None:
        """Read what is there; a line that was cut off by a crash is left out and written again.

        Raises
        ------
        OutputError
            ``in-use``: another audit writes here; ``output``: the folder cannot be written to
        """
        self._archive = archive
        limits = f"|{raised_to()}" if raised_to() else ""
        self._base = f"{__version__}|{SHAPE}|{registry_hash}{limits}"
        self._tomls: dict[str, str] = {}
        # path -> key, CRC-32 of the answer, offset of its newest line
        self._places: dict[str, tuple[bytes, int, int]] = {}
        self._own: set[str] = set()  # paths of files that the toolkit wrote
        self._path = None if folder is None else folder / RESULTS
        self._file = tempfile.TemporaryFile() if self._path is None else _opened(self._path)  # noqa: SIM115
        self._file.seek(0)
        length = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            self._remember(line, length)
            length += len(line)
        self._file.truncate(length)
        self._file.seek(length)
        self._end = length
        if length == 0:
            self._write(_HEADER)

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        if self._path is not None:
            # Every line is flushed: only what a full disk refused, which was told, is written again here.
            with contextlib.suppress(OSError):
                self._file.close()  # and with it the lock

    def known(self, names: Sequence[str]) -> Iterator[str]:
        """Yield those of the names whose results still hold."""
        before = [name for name in names if name in self._places]
        batches = [before[at : at + _BATCH] for at in range(0, len(before), _BATCH)]
        with ThreadPoolExecutor(_HASHING) as pool:
            for batch, contents in zip(batches, pool.map(self._hashed, batches), strict=True):
                for name, content in zip(batch, contents, strict=True):
                    if content is not None and self._places[name][0] == self._key(name, content):
                        yield name

    def put(self, name: str, done: Done) -> None:
        """Append a result; one without a hash is not used again."""
        key = b"" if done.sha256 is None else self._key(name, done.sha256)
        # ASCII: a name that is no UTF-8 survives as well.
        crc = zlib.crc32(done.body)
        head = json.dumps({"key": key.hex(), "path": name, "crc": crc})
        self._places[name] = (key, crc, self._end)
        self._write(head[:-1].encode() + _REST + done.body + _END)
        self._mark(name, own=done.body == b"null")

    def files(self, names: Sequence[str]) -> Files:
        """Return the results of the names, without those of files that the toolkit wrote."""
        self._file.flush()
        stream = self._file if self._path is None else open_regular_to_append(self._path)
        return Files(stream, [self._places[name][2] for name in sorted(names) if name not in self._own])

    def digest(self, names: Sequence[str]) -> str | None:
        """Return the hash of all that the results of the names are, None where one is not used again."""
        running = hashlib.sha256()
        for name in sorted(names):
            key, crc, _ = self._places[name]
            if not key:
                return None
            running.update(json.dumps([name, key.hex(), crc]).encode())
        return running.hexdigest()

    def _mark(self, name: str, *, own: bool) -> None:
        # A file that was replaced by another is what its newest line says.
        if own:
            self._own.add(name)
        else:
            self._own.discard(name)

    def _write(self, line: bytes) -> None:
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            where = self._path or Path(tempfile.gettempdir())
            raise _refused(where, error.strerror or "an error", "space for the results") from error
        self._end += len(line)

    def _hashed(self, names: Sequence[str]) -> list[str | None]:
        return [_content_hash(f"{self._archive}/{name}") for name in names]

    def _key(self, name: str, content: str) -> bytes:
        folder = name.rpartition("/")[0]
        if folder not in self._tomls:
            self._tomls[folder] = _words(nearest_test_toml(self._archive / folder))
        return bytes.fromhex(sha256_bytes(f"{self._base}|{content}|{self._tomls[folder]}".encode()))

    def _remember(self, line: bytes, place: int) -> None:
        try:
            cut = line.index(_REST)
            head = json.loads(line[:cut] + b"}")
            body = line[cut + len(_REST) : -len(_END)]
            if line.endswith(_END) and zlib.crc32(body) == head["crc"]:
                self._places[head["path"]] = (bytes.fromhex(head["key"]), head["crc"], place)
                self._mark(head["path"], own=body == b"null")
        except (ValueError, KeyError, TypeError):
            return  # the header, or of another version, or damaged: the file is audited again


def _content_hash(path: str) -> str | None:
    try:
        # One read and no buffer, nor a Path: most files are small, and there are very many.
        handle = os.open(path, os.O_RDONLY | WITHOUT_WAITING)
        try:
            size = os.fstat(handle).st_size
            data = os.read(handle, size + 1) if size <= _SMALL else b""
        finally:
            os.close(handle)
        return sha256_bytes(data) if data and len(data) == size else sha256_file(Path(path))
    except OSError:
        return None


def _words(toml: Path | None) -> str:
    # A machine that test.toml names by a file is as much a part of it as its own words.
    if toml is None:
        return ""
    data = b""
    try:
        data = read_regular(toml, SETTINGS_FILE)
        machine = toml_entries(data.decode()).get("machine") if b".toml" in data else None
        is_file = isinstance(machine, str) and machine.endswith(".toml")
        definition = sha256_file(toml.parent / str(machine)) if is_file else ""
    except (OSError, ValueError) as error:
        definition = str(error)
    return f"{toml}:{sha256_bytes(data)}:{definition}"


def _opened(path: Path) -> IO[bytes]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = open_regular_to_append(path)
    except OSError as error:
        raise _refused(path, error.strerror or "an error", "a folder that can be written to") from error
    try:
        lock_file(file.fileno())
    except OSError as error:
        file.close()
        raise _refused(path, "another audit writes here", "a folder of its own", rule="in-use") from error
    return file


def _refused(path: Path, actual: str, expected: str, *, rule: str = "output") -> OutputError:
    return OutputError(
        "the results cannot be written",
        where=path,
        got=actual,
        expected=expected,
        next_step="name another folder with --out; what was written before is whole and will be used again",
        rule=rule,
    )
