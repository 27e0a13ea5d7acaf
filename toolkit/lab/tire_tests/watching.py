"""Watch a folder of tests: which are whole, which are waited for, which are set aside and why.

A test is a folder with a ``test.toml``. Its files count as arrived when they have not changed for a while;
what they hold then decides: a file that is cut off, or a step of the protocol that is missing, is waited for;
a file that is damaged otherwise sets the test aside until its files change. Originals are never touched.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from toolkit.declared import Entry, plain, read_text
from toolkit.errors import OutputError, RegistryError, ToolkitError
from toolkit.files import real_path, same_file, sha256_bytes
from toolkit.inputs import RESULT_FILE, read_regular
from toolkit.lab.tire_tests.reports import MadeReport
from toolkit.lab.tire_tests.resolve import Resolved
from toolkit.version import __version__

STATE = "watch.json"
BATCH = 16
"""Reports made in one call: tests that are held with their recordings, and one start of LibreOffice."""
SET_ASIDE = "set-aside"
# What a file looks like while it is being copied, and what a test lacks whose last file is on its way.
_PARTIAL = frozenset(
    "empty-file zip-truncated zip-damaged no-data no-recordings no-file xml not-toml".split()
)
# A watch makes no drafts: a test stands aside until a record for it is in force.
_NOT_IN_FORCE = frozenset(("not-in-force", "no-record-in-force"))
_LONGEST = 200  # bytes of a file's name, less than the 255 that file systems allow
_MISSING = frozenset(("missing", "missing-repeat", "short-block"))

Listing = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """A test that is not whole yet, and what is waited for."""

    test: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Aside:
    """A test that was set aside: the rule and the reason, until its files change."""

    test: str
    rule: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Round:
    """What one look at the folder made, and which tests wait or stand aside at its end."""

    made: tuple[MadeReport, ...]
    waiting: tuple[Waiting, ...]
    set_aside: tuple[Aside, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What became of a test, as the state keeps it: of which content, by which toolkit and settings."""

    state: Literal["made", "set-aside"]
    content: str
    rule: str | None = None
    reason: str | None = None
    version: str | None = None
    registry: str | None = None
    settings: str | None = None
    report: str | None = None
    content_sha256: str | None = None
    units: tuple[str, ...] = ()

    def aside(self, test: str) -> Aside:
        """Return the test as one that stands aside."""
        return Aside(test=test, rule=self.rule or "error", reason=self.reason or "")


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchState:
    """``watch.json``: every test of a watched folder that was judged."""

    generator: Literal["toolkit"]
    schema: Literal[1]
    tests: Annotated[Mapping[str, Judged], Entry("by their folder below the watched one")]


class Watcher:
    """The state of a watched folder, kept in ``watch.json`` of the output folder: a restart goes on there.

    Parameters
    ----------
    folder, out : what is watched, and where reports and the state go
    resolve, report : read a test; make the reports of tests that were read, in one call, each in its folder
    settle_s : files that did not change for so long have arrived
    patience_s : after so long without a change a cut file sets its test aside, and a test that lacks steps
        is reported with its findings
    clock : seconds that never go back
    settings : what the reports are made by; what was refused under others is tried again
    registry : the state of the registry; a test without a record in force is tried again under another one
    version : of the toolkit; what another one set aside is tried once more
    """

    def __init__(
        self,
        folder: Path,
        out: Path,
        *,
        resolve: Callable[[Path], Resolved],
        report: Callable[[dict[Path, Resolved], Sequence[Path]], list[MadeReport]],
        settle_s: float,
        patience_s: float,
        clock: Callable[[], float],
        settings: str = "",
        registry: Callable[[], str] = lambda: "",
        version: str = __version__,
    ) -> None:
        self.folder, self.out, self.version = folder, out, version
        self.resolve, self.report, self.clock = resolve, report, clock
        self.settle_s, self.patience_s, self.settings = settle_s, patience_s, settings
        self.registry = registry
        self.seen: dict[str, tuple[Listing, float]] = {}
        self.contents: dict[str, tuple[Listing, str]] = {}
        self.heads = ""  # of the registry, as this look began
        self.waited: dict[str, tuple[str, str]] = {}
        self.unwritten: dict[Path, tuple[str, str]] = {}
        self.state = self._load()
        self.unsaved = False

    def look(self) -> Round:
        """Look once: make the reports of all tests that have become whole, a batch at a time.

        What a test holds is read once for each listing of its files; the registry is asked once, before any
        test is read, and the state is written once a batch: a look at tests that did not change reads none
        of their files, and one at many that did holds no more of them than a batch.
        """
        reports: list[MadeReport] = []
        waiting: list[Waiting] = []
        aside: list[Aside] = []
        self.heads = ""
        with contextlib.suppress(ToolkitError):  # the tests that need it say what is wrong with it
            self.heads = self.registry()
        ready: dict[Path, Resolved] = {}
        contents: dict[Path, str] = {}
        for path, (text, _) in list(self.unwritten.items()):
            self._write(path, text)
        for test in self._tests():
            name = self._name(test)
            listing = self._listing(test)
            before = self.seen.get(name)
            if before is None or before[0] != listing:
                before = self.seen[name] = (listing, self.clock())
            age = self.clock() - before[1]
            if age < self.settle_s:
                waiting.append(Waiting(test=name, reason="files are arriving"))
                continue
            try:
                content = self._content(test, name, listing)
            except OSError as error:
                waiting.append(Waiting(test=name, reason=f"a file cannot be read yet: {error.strerror}"))
                continue
            earlier = self.state.get(name)
            if earlier is not None and earlier.content == content and not self._refused_otherwise(earlier):
                if earlier.state == SET_ASIDE:
                    aside.append(earlier.aside(name))
                continue
            waited = self.waited.get(name)
            if waited is not None and waited[0] == content and age < self.patience_s:
                waiting.append(Waiting(test=name, reason=waited[1]))
                continue
            contents[test] = content
            judged = self._read(test, age)
            if self._listing(test) != listing:
                # Files came or grew while the test was read: what was read is not what was hashed.
                waiting.append(Waiting(test=name, reason="files are arriving"))
                continue
            if isinstance(judged, Waiting):
                self.waited[name] = (content, judged.reason)
                waiting.append(judged)
            elif isinstance(judged, Aside):
                aside.append(judged)
                self._set_aside(judged, content)
            else:
                ready[test] = judged
                if len(ready) == BATCH:
                    reports += self._make(ready, contents, waiting, aside)
                    ready = {}
        reports += self._make(ready, contents, waiting, aside)
        if self.unsaved:
            self._save()
        waiting += [Waiting(test=path.name, reason=why) for path, (_, why) in self.unwritten.items()]
        return Round(made=tuple(reports), waiting=tuple(waiting), set_aside=tuple(aside))

    def _content(self, test: Path, name: str, listing: Listing) -> str:
        """Return one hash of all of a test's files, read again only where one of them has changed."""
        if name not in self.contents or self.contents[name][0] != listing:
            self.contents[name] = (listing, _content(test, listing))
        return self.contents[name][1]

    def _read(self, test: Path, age: float) -> Resolved | Waiting | Aside:
        name = self._name(test)
        try:
            resolved = self.resolve(test)
        except RegistryError as error:
            if error.rule not in _NOT_IN_FORCE:
                raise  # no test is to blame for the registry
            return Aside(test=name, rule=error.rule or "error", reason=str(error))
        except ToolkitError as error:
            if error.rule in _PARTIAL and age < self.patience_s:
                return Waiting(test=name, reason=f"{error.rule}: {error.what} ({error.where})")
            return Aside(test=name, rule=error.rule or "error", reason=str(error))
        missing = [finding for finding in resolved.findings if finding.rule in _MISSING]
        if missing and age < self.patience_s:
            return Waiting(test=name, reason="; ".join(f"{one.where}: {one.message}" for one in missing[:3]))
        return resolved

    def _make(
        self,
        ready: dict[Path, Resolved],
        contents: dict[Path, str],
        waiting: list[Waiting],
        aside: list[Aside],
    ) -> list[MadeReport]:
        if not ready:
            return []
        delivered = []
        for report in self.report(ready, [self.out / self._name(test) for test in ready]):
            name = self._name(report.test)
            if isinstance(report.outcome, OutputError):
                # A full disk is no fault of the test: the next look tries again.
                waiting.append(Waiting(test=name, reason=str(report.outcome)))
            elif isinstance(report.outcome, ToolkitError):
                fault = Aside(test=name, rule=report.outcome.rule or "error", reason=str(report.outcome))
                aside.append(fault)
                self._set_aside(fault, contents[report.test], by=self.settings)
            else:
                delivered.append(report)
                self.unwritten.pop(self._note(name), None)
                self._note(name).unlink(missing_ok=True)
                self.state[name] = Judged(
                    state="made",
                    content=contents[report.test],
                    report=str(report.outcome.pdf),
                    content_sha256=report.outcome.content_sha256,
                    units=tuple(report.outcome.units),
                )
        self._save()
        return delivered

    def _tests(self) -> list[Path]:
        tests = []
        for base, folders, files in os.walk(self.folder):
            here = Path(base)
            folders[:] = sorted(folder for folder in folders if not self._skipped(here / folder))
            if "test.toml" in files:
                tests.append(here)
        return tests

    def _skipped(self, folder: Path) -> bool:
        return folder.name.startswith(".") or same_file(folder, self.out)

    def _listing(self, test: Path) -> Listing:
        """Return (path, size, time of change) of a test's files: what tells that one is still growing."""
        listing = []
        for base, folders, files in os.walk(test):
            folders[:] = [folder for folder in folders if not self._skipped(Path(base) / folder)]
            for name in files:
                path = Path(base) / name
                if name.startswith((".", "~$")) or path.is_symlink():
                    continue
                with contextlib.suppress(OSError):
                    status = path.stat()
                    listing.append((path.relative_to(test).as_posix(), status.st_size, status.st_mtime_ns))
        return tuple(sorted(listing))

    def _name(self, test: Path) -> str:
        relative = test.relative_to(self.folder).as_posix()
        return real_path(test).name if relative == "." else relative

    def _note(self, name: str) -> Path:
        # Two tests never share a note: year/one and year_one are different tests.
        file_name = name.replace("%", "%25").replace("/", "%2F")
        if len(file_name.encode()) > _LONGEST:
            file_name = f"{file_name[:40]}-{sha256_bytes(name.encode())[:16]}"
        return self.out / SET_ASIDE / f"{file_name}.txt"

    def _refused_otherwise(self, entry: Judged) -> bool:
        """Tell whether a test was refused by another toolkit or under other settings.

        Nothing may be wrong with it then. A state of before versions were noted is an older toolkit's.
        """
        if entry.state != SET_ASIDE:
            return False
        if entry.rule in _NOT_IN_FORCE and entry.registry != self.heads:
            return True
        return entry.version != self.version or entry.settings not in (None, self.settings)

    def _set_aside(self, fault: Aside, content: str, *, by: str | None = None) -> None:
        from toolkit.recording.marks import OWN_OUTPUT

        self.state[fault.test] = Judged(
            state="set-aside",
            content=content,
            rule=fault.rule,
            reason=fault.reason,
            version=self.version,
            registry=self.heads if fault.rule in _NOT_IN_FORCE else None,
            settings=by,
        )
        self._write(self._note(fault.test), f"{OWN_OUTPUT}\n{fault.test}: {fault.rule}\n\n{fault.reason}\n")
        self.unsaved = True

    def _load(self) -> dict[str, Judged]:
        path = self.out / STATE
        if not path.is_file():
            return {}
        try:
            return dict(read_text(WatchState, read_regular(path, RESULT_FILE), where=path).tests)
        except (OSError, ToolkitError) as error:
            raise OutputError(
                "the state of the watch cannot be read",
                where=path,
                got=error,
                expected="the file as toolkit watch wrote it",
                next_step="delete it: every test is reported anew, the same reports replace the old ones",
                rule="original",
            ) from error

    def _save(self) -> None:
        self.unsaved = False
        state = WatchState(generator="toolkit", schema=1, tests=dict(sorted(self.state.items())))
        self._write(self.out / STATE, json.dumps(plain(state), ensure_ascii=False, indent=2) + "\n")

    def _write(self, path: Path, text: str) -> None:
        """Write a file of the watch's own; on a full disk it is written at a later look, and said to wait."""
        from toolkit.publication import write_result

        self.unwritten.pop(path, None)
        try:
            write_result(path, text)
        except OutputError as error:
            self.unwritten[path] = (text, str(error))


def _content(test: Path, listing: Listing) -> str:
    """Return one hash of all of a test's files: a copy of the same test is the same test."""
    from toolkit.files import sha256_file
    from toolkit.recording.marks import is_own_output

    # What the toolkit wrote itself, a reduced test or the truth of a simulation, is no part of the test.
    parts = [name for name, _, _ in listing if not is_own_output(test / name)]
    return sha256_bytes("\n".join(f"{name} {sha256_file(test / name)}" for name in parts).encode())
