"""Results that outlive a run: an interrupted audit goes on, and a second one does only what changed.

``results.jsonl`` holds one line a file, written as soon as the file is done. A result is used again only for
the same content of the file, the same words of its test.toml, the same registry and day of knowledge, and the
same version of the toolkit; file times are never asked.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from toolkit import __version__
from toolkit.audit.one_file import FileAudit
from toolkit.audit.serial import from_plain, to_plain
from toolkit.errors import OutputError
from toolkit.files import sha256_bytes
from toolkit.recording.folder import nearest_test_toml
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT

RESULTS = "results.jsonl"
_HEADER = (json.dumps({"generator": GENERATOR, "marks": OWN_OUTPUT}) + "\n").encode()


class Results:
    """The results file of an output folder; one audit writes it at a time.

    ``key_of`` makes a file's key; ``get`` looks one up, ``put`` appends one.
    """

    def __init__(self, folder: Path, *, archive: Path, registry_hash: str) -> None:
        """Read what is there; a line that was cut off by a crash is left out and written again.

        Raises
        ------
        OutputError
            ``in-use``: another audit writes here; ``output``: the folder cannot be written to
        """
        self._archive = archive
        self._base = f"{__version__}|{registry_hash}"
        self._tomls: dict[Path, str] = {}
        self._contents: dict[str, str] = {}
        self._known: dict[tuple[str, str], dict[str, Any] | None] = {}
        path = folder / RESULTS
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b")
        except OSError as error:
            raise _refused(path, error.strerror or "an error", "a folder that can be written to") from error
        _lock(self._file, path)
        self._file.seek(0)
        whole = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            self._remember(line)
            whole += len(line)
        self._file.truncate(whole)
        self._file.seek(whole)
        if whole == 0:
            self._file.write(_HEADER)

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def key_of(self, name: str) -> str | None:
        """Return the key of a file by its path in the archive; None where it cannot be read."""
        path = self._archive / name
        try:
            content = sha256_bytes(path.read_bytes())
        except OSError:
            return None
        self._contents[name] = content
        return sha256_bytes(f"{self._base}|{content}|{self._toml(path.parent)}".encode())

    def has(self, name: str, key: str | None) -> bool:
        """Tell whether a file's result is known."""
        return key is not None and (name, key) in self._known

    def get(self, name: str, key: str) -> FileAudit | None:
        """Return a known result; None for a file that the toolkit wrote."""
        plain = self._known[name, key]
        return None if plain is None else from_plain(plain)

    def put(self, name: str, key: str | None, result: FileAudit | None) -> None:
        """Append a result; one without a key is never used again."""
        if key is None or (result is not None and result.sha256 != self._contents[name]):
            return  # the file changed while it was read
        plain = None if result is None else to_plain(result)
        line = json.dumps({"path": name, "key": key, "result": plain}, ensure_ascii=False) + "\n"
        try:
            self._file.write(line.encode())
            self._file.flush()
        except OSError as error:
            raise _refused(
                Path(self._file.name), error.strerror or "an error", "space for the results"
            ) from error

    def _toml(self, folder: Path) -> str:
        if folder not in self._tomls:
            toml = nearest_test_toml(folder)
            self._tomls[folder] = "" if toml is None else f"{toml}:{sha256_bytes(toml.read_bytes())}"
        return self._tomls[folder]

    def _remember(self, line: bytes) -> None:
        try:
            entry: Mapping[str, Any] = json.loads(line)
            plain = entry["result"]
            if plain is not None:
                from_plain(plain)
            self._known[entry["path"], entry["key"]] = plain
        except (ValueError, KeyError, TypeError):
            return  # of another version, or damaged: the file is audited again


def _lock(file: Any, path: Path) -> None:
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise _refused(path, "another audit writes here", "a folder of its own", rule="in-use") from error


def _refused(path: Path, got: str, expected: str, *, rule: str = "output") -> OutputError:
    return OutputError(
        "the results cannot be written",
        where=path,
        got=got,
        expected=expected,
        next_step="name another folder with --out; what was written before is whole and will be used again",
        rule=rule,
    )
