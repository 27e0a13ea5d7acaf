"""What the files of a home are, of which version each is, and the steps that lead to today's.

A kind names its files, reads one whole by the reader that every command uses, and tells its version: the
number of the schema that it states, or the release that shipped it. ``steps`` lead from a version to the
next, as long as there is one; a version without a step is read as it is. Evidence (records, ledgers, sealed
documents) has no steps, ever: its hashes are what later entries rest on.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Annotated, Any, Literal

from toolkit.declared import Entry, read_text
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes, toml_entries
from toolkit.inputs import RESULT_FILE, SETTINGS_FILE, TEMPLATE_FILE, Form, read_input
from toolkit.lab.home import TEMPLATES, packaged_home
from toolkit.recording.marks import is_own_output

MIGRATIONS = "migrations"
"""Folder of a home with what each migration replaced."""
_CALIBRATIONS = "calibrations"
_SKIPPED = frozenset((_CALIBRATIONS, MIGRATIONS, "node_modules"))
_REDUCED = "reduced test"
_TODAY = "today's"

Version = int | str | None
FileState = Literal["current", "to migrate", "migrated", "own", "newer", "refused"]
Step = Callable[[str, bytes], bytes]
"""From the name and the content of a file to the content in the next version."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """One kind of file: where it lies, how it is read, its newest version, its steps.

    ``folder`` is the folder of the home that it lies in, None: anywhere. ``read`` reads a file whole and
    returns which version of the toolkit wrote it, None where the file does not say.
    """

    title: str
    names: tuple[str, ...]
    read: Callable[[Path], str | None]
    version: Callable[[str, bytes], Version]
    form: Form = SETTINGS_FILE
    folder: str | None = None
    newest: int = 1
    steps: Mapping[Version, Step] = field(default_factory=lambda: MappingProxyType({}))

    def holds(self, place: PurePosixPath) -> bool:
        """Tell whether a file of a home is of this kind, by its place."""
        inside = self.folder is None or place.parts[0] == self.folder
        return inside and any(fnmatchcase(place.name, name) for name in self.names)

    def converted(self, name: str, data: bytes) -> tuple[bytes, tuple[Version, ...]]:
        """Return a file's content after all steps, and the versions that it had on the way."""
        passed: list[Version] = []
        while (version := self.version(name, data)) in self.steps and version not in passed:
            passed.append(version)
            data = self.steps[version](name, data)
        return data, tuple(passed)


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptFile:
    """A file of a home that the toolkit reads again."""

    place: Annotated[str, Entry("in the home")]
    kind: str
    version: Annotated[Version, Entry("schema of the file, or release that shipped it; null where neither")]
    written_by: Annotated[str | None, Entry("version of the toolkit; null where the file does not say")]
    state: Annotated[FileState, Entry("own: the laboratory's; a home with newer files is refused as a whole")]
    reason: Annotated[str | None, Entry("why it is refused")] = None
    content: Annotated[bytes | None, Entry("what a migration writes in its place", output=False)] = None


def kept_files(home: Path) -> Iterator[KeptFile]:
    """Yield every file of a home that the toolkit reads again: its registry first, each file read whole."""
    yield from _registry(home)
    for folder, below, names in os.walk(home):
        below[:] = sorted(name for name in below if not name.startswith(".") and name not in _SKIPPED)
        for name in sorted(names):
            path = Path(folder, name)
            place = PurePosixPath(path.relative_to(home).as_posix())
            kind = next((kind for kind in kinds() if kind.holds(place)), None)
            if kind is not None and (kind.title != _REDUCED or is_own_output(path)):
                yield _judged(kind, path, place)


def _judged(kind: Kind, path: Path, place: PurePosixPath) -> KeptFile:
    row = partial(KeptFile, place=str(place), kind=kind.title)
    version: Version = None
    try:
        data = read_input(path, kind.form)
        version = kind.version(place.name, data)
        if isinstance(version, int) and version > kind.newest:
            reason = f"schema {version}; this version reads up to {kind.newest}"
            return row(version=version, written_by=None, state="newer", reason=reason)
        content, passed = kind.converted(place.name, data)
        written_by = kind.read(path)
    except (ToolkitError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"{error}"
        if isinstance(error, ToolkitError):
            reason = f"{error.what}: {error.got}; {error.next_step}"
        return row(version=version, written_by=None, state="refused", reason=reason)
    if passed:
        return row(version=version, written_by=written_by, state="to migrate", content=content)
    is_own = kind.steps and version is None
    return row(version=version, written_by=written_by, state="own" if is_own else "current")


def _registry(home: Path) -> Iterator[KeptFile]:
    """Yield the records of a registry, each refitted and held against its ledger, and what damages it."""
    from toolkit.calibration.registry.verify import verify_registry
    from toolkit.lab.home import open_registry

    registry = open_registry(home=home)
    try:
        registry.people()
    except ToolkitError as error:
        yield KeptFile(
            place=_CALIBRATIONS, kind="people", version=1, written_by=None, state="refused",
            reason=f"{error.what}: {error.got}",
        )  # fmt: skip
        return
    places = {path.stem: path for path in sorted(registry.folder.glob("*/*.json"))}
    for record in verify_registry(registry):
        path = places.get(record.id, registry.folder / record.id)
        version, written_by = _of_record(path)
        state: FileState = "current" if record.ok else "refused"
        if record.reason is not None and record.reason.startswith("newer-schema"):
            state = "newer"
        yield KeptFile(
            place=path.relative_to(registry.folder.parent).as_posix(), kind="calibration record",
            version=version, written_by=written_by, state=state, reason=None if record.ok else record.reason,
        )  # fmt: skip


def _of_record(path: Path) -> tuple[Version, str | None]:
    try:
        document = json.loads(read_input(path, RESULT_FILE))
        return document["schema"], str(document["software"]["toolkit"])
    except (ToolkitError, ValueError, KeyError, TypeError):
        return None, None


@cache
def kinds() -> tuple[Kind, ...]:
    """Return the kinds of files that lie in a home beside its registry."""
    from toolkit.diagnosis.answer.reader import read_answer
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.lab.desk.jobs import FILE as JOB
    from toolkit.lab.desk.jobs import FOLDER as JOBS
    from toolkit.lab.desk.jobs import read_job
    from toolkit.lab.desk.kept_plans import read_plan
    from toolkit.lab.tire_tests.watching import WatchState
    from toolkit.recording.folder import StatedTest
    from toolkit.report.style import read_style
    from toolkit.report.word.package import read_template
    from toolkit.simulation.model_file import read_model
    from toolkit.testfile.read import read_test_file

    shipped = partial(
        Kind, folder=TEMPLATES, version=_release,
        steps=MappingProxyType(dict.fromkeys(_shipped(), _todays)),
    )  # fmt: skip
    settings = partial(Kind, version=_schema_of_toml)
    result = partial(Kind, form=RESULT_FILE, version=_schema_of_json)
    return (
        shipped(title="template", names=("*.docx",), read=_silent(read_template), form=TEMPLATE_FILE),
        shipped(title="style file", names=("*.toml",), read=_silent(read_style)),
        settings(title="job", names=(JOB,), folder=JOBS, read=_silent(lambda path: read_job(path.parent))),
        settings(title="test", names=("test.toml",), read=_declared(StatedTest, SETTINGS_FILE)),
        settings(title="case", names=("case.toml", "CASE.toml"), read=_silent(read_case)),
        settings(title="model", names=("model.toml",), read=lambda path: read_model(path).code_version),
        result(title="diagnosis", names=("diagnosis.json",), read=_silent(read_answer)),
        result(title="plan", names=("plan.json",), read=_silent(lambda path: read_plan(path.parent))),
        result(title="manifest", names=("manifest.json",), read=_read_manifest),
        result(title="watch", names=("watch.json",), read=_declared(WatchState, RESULT_FILE)),
        result(
            title=_REDUCED,
            names=("*.xlsx",),
            version=lambda *_: 1,
            read=lambda path: read_test_file(path).reduced.code_version,
        ),
    )


def _schema_of_toml(_name: str, data: bytes) -> Version:
    return _schema(toml_entries(data.decode("utf-8-sig")))


def _schema_of_json(_name: str, data: bytes) -> Version:
    return _schema(json.loads(data))


def _schema(table: dict[str, Any]) -> Version:
    schema = table.get("schema", 1)
    return schema if isinstance(schema, int) else None


def _release(name: str, data: bytes) -> Version:
    """Return the release that shipped a template; None: nobody did, it is the laboratory's own."""
    digest = sha256_bytes(data)
    releases = (release for release, files in _shipped().items() if digest in files.get(name, ()))
    return next(releases, _TODAY if digest in _todays_digests() else None)


@cache
def _shipped() -> Mapping[str, Mapping[str, list[str]]]:
    """Return the hashes of what releases shipped and this version does not."""
    table = tomllib.loads(Path(__file__).with_name("shipped_templates.toml").read_text("utf-8"))
    return {
        release: {
            name: [sha for sha in digests if sha not in _todays_digests()] for name, digests in files.items()
        }
        for release, files in table.items()
    }


@cache
def _todays_digests() -> frozenset[str]:
    folder = packaged_home() / TEMPLATES
    return frozenset(sha256_bytes(path.read_bytes()) for path in folder.iterdir() if path.is_file())


def _todays(name: str, _data: bytes) -> bytes:
    return (packaged_home() / TEMPLATES / name).read_bytes()


def _silent(read: Callable[[Path], object]) -> Callable[[Path], str | None]:
    """Return the reader of a file that does not say which version of the toolkit wrote it."""

    def read_whole(path: Path) -> None:
        read(path)

    return read_whole


def _declared(cls: type, form: Form) -> Callable[[Path], str | None]:
    return _silent(lambda path: read_text(cls, read_input(path, form), where=path))


def _read_manifest(path: Path) -> str | None:
    software = json.loads(read_input(path, RESULT_FILE)).get("software", {})
    return software.get("toolkit") if isinstance(software, dict) else None
