"""Versions of what a home keeps, and changes that are accepted only if made from the current one.

Whoever changes something looked at it before. A form states which version its page showed; a change that was
made from an older version is refused, so that nobody undoes the work of another page, window or program
unseen. A version is a hash of the files themselves: it needs no memory, outlives the server, and sees what
an editor wrote.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import ConfigError
from toolkit.files import sha256_file
from toolkit.inputs import is_regular
from toolkit.staging import locked

_WHOLE = 4 << 20
"""Bytes of a file up to which its content is hashed; of a larger one its size and time count."""


class StaleError(ConfigError):
    """A change that was made from a version which is no longer the current one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """What a change was made from: the version that its page showed, which page, and its how many-th change.

    A page that is left sends its last change before the answer to the one before it came: its own changes
    count as known to it, in the order of their numbers.
    """

    version: str
    page: str = ""
    number: int = 0

    @classmethod
    def of(cls, form: Mapping[str, str]) -> Origin:
        """Return what a form states; a form that states nothing is as old as can be."""
        number = form.get("number", "")
        return cls(
            version=form.get("version", ""), page=form.get("page", ""),
            number=int(number) if number.isdecimal() and len(number) < 10 else 0,
        )  # fmt: skip


def version_of(folder: Path, names: Iterable[str] | None = None) -> str:
    """Return the version of a folder: a hash of the names and contents of its files, or of some of them.

    Hidden files and folders do not count. A folder that is not there has a version too.
    """
    total = hashlib.sha256()
    wanted = None if names is None else frozenset(names)
    with contextlib.suppress(FileNotFoundError):
        for path in sorted(folder.iterdir()):
            counts = not path.name.startswith(".") if wanted is None else path.name in wanted
            if not counts or not is_regular(path):
                continue
            with contextlib.suppress(FileNotFoundError):
                state = path.stat()
                content = (
                    sha256_file(path) if state.st_size <= _WHOLE else f"{state.st_size} {state.st_mtime_ns}"
                )
                total.update(f"{path.name}\0{content}\0".encode(errors="surrogateescape"))
    return total.hexdigest()[:16]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Written:
    version: str
    page: str
    number: int


class Versions:
    """The changes of a home's folders, one at a time for each."""

    def __init__(self) -> None:
        self._written: dict[Path, _Written] = {}
        self._locks: dict[Path, threading.Lock] = {}

    @contextlib.contextmanager
    def held(self, folder: Path) -> Iterator[None]:
        """Keep a folder as it is while the block reads it."""
        with self._locks.setdefault(folder, threading.Lock()), locked(folder.parent):
            yield

    @contextlib.contextmanager
    def changing(self, folder: Path, origin: Origin, *, names: Iterable[str] | None = None) -> Iterator[bool]:
        """Yield whether a change is still to be made: not where a later one of the same page came first.

        Raises
        ------
        StaleError
            ``stale``: somebody else changed the folder since; nothing is changed
        """
        with self.held(folder):
            now, before = version_of(folder, names), self._written.get(folder)
            is_own = bool(origin.page) and before is not None and before.version == now
            is_own = is_own and before is not None and before.page == origin.page
            if origin.version != now and not is_own:
                raise _stale(folder)
            if is_own and before is not None and origin.number < before.number:
                yield False
                return
            try:
                yield True
            finally:
                after = version_of(folder, names)
                if after != now or is_own:
                    self._written[folder] = _Written(version=after, page=origin.page, number=origin.number)


def _stale(folder: Path) -> StaleError:
    return StaleError(
        "this was changed elsewhere since the page was opened", where=f"{folder.parent.name}/{folder.name}",
        got="a change that was made from an older version", expected="a change of the version that is kept",
        next_step="compare the two and choose; nothing was overwritten", rule="stale",
    )  # fmt: skip
