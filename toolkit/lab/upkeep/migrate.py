"""The migration of a home: checked whole, then converted in one publication that can be undone.

What is replaced is kept beside it, in ``migrations/<id>/before``, under its own place; ``migration.toml``
says by which hash each file was known before and after. A migration changes nothing that is of today's
version, so that a second one finds nothing to do.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Annotated, ClassVar, TypedDict

from toolkit.declared import Entry, Format, read_text, toml_text
from toolkit.errors import ConfigError
from toolkit.files import sha256_bytes
from toolkit.inputs import SETTINGS_FILE, TEMPLATE_FILE, is_regular, read_input
from toolkit.lab.home import find_home
from toolkit.lab.upkeep.kept_files import MIGRATIONS, KeptFile, kept_files
from toolkit.listing import table
from toolkit.publication import publication, settle
from toolkit.version import __version__

FILE, BEFORE = "migration.toml", "before"


@dataclass(frozen=True, slots=True, kw_only=True)
class Replaced:
    """A file that a migration replaced, by the hashes of its content."""

    place: Annotated[str, Entry("in the home", example="report_templates/org.docx")]
    before: Annotated[str, Entry("SHA-256 of what was replaced", example="3f1c...")]
    after: Annotated[str, Entry("SHA-256 of what took its place", example="90ab...")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Migration:
    """What one migration did to a home, and whether it was undone."""

    FORMAT: ClassVar[Format] = Format(title="migration", schema=1)

    toolkit: Annotated[str, Entry("version that did it", example="1.0.0")]
    done: Annotated[str, Entry("UTC", example="2026-11-24T10:11:12Z")]
    undone: Annotated[str | None, Entry("UTC; nothing while it stands")] = None
    file: Annotated[tuple[Replaced, ...], Entry("each file that was replaced")] = ()


class MigrateAnswer(TypedDict):
    """A home, checked whole and brought to this version."""

    home: Path
    dry_run: Annotated[bool, "nothing was written"]
    files: Annotated[Sequence[KeptFile], "empty with --undo"]
    migration: Annotated[str | None, "folder of what was replaced; null where nothing was"]
    undone: Annotated[list[str], "places that --undo put back"]


def migrate(folder: Path, *, dry_run: bool = False) -> tuple[MigrateAnswer, str]:
    """Check a home whole and bring its files to this version; return answer and text.

    Raises
    ------
    ConfigError
        ``no-home``; ``newer-home``: a newer version wrote a file of it. Nothing is changed
    OutputError
        ``not-writable``: nothing is changed
    """
    home = find_home(folder)
    if not dry_run:
        settle(home)
    files = tuple(kept_files(home))
    if newer := [file for file in files if file.state == "newer"]:
        raise ConfigError(
            "the home has files of a newer version of the toolkit", where=home / newer[0].place,
            got=f"{newer[0].reason}" + (f"; and {len(newer) - 1} more" if newer[1:] else ""),
            expected=f"files that toolkit {__version__} reads",
            next_step="update the toolkit; nothing was changed", rule="newer-home",
        )  # fmt: skip
    name = None
    if not dry_run and any(file.content is not None for file in files):
        name = _replaced(home, files)
        files = tuple(replace(file, state="migrated") if file.content is not None else file for file in files)
    return _answer(home, files, name, dry_run=dry_run), _text(home, files, name, dry_run=dry_run)


def undo(folder: Path) -> tuple[MigrateAnswer, str]:
    """Put back what the last migration of a home replaced; return answer and text.

    Raises
    ------
    ConfigError
        ``no-home``; ``no-migration``: none stands; ``migration-changed``: a file has changed since.
        Nothing is changed
    OutputError
        ``not-writable``: nothing is changed
    """
    home = find_home(folder)
    settle(home)
    name, migration = _last(home)
    before = home / MIGRATIONS / name / BEFORE
    for file in migration.file:
        for path, digest in ((home / file.place, file.after), (before / file.place, file.before)):
            content = sha256_bytes(read_input(path, TEMPLATE_FILE)) if is_regular(path) else "no file"
            if content != digest:
                raise ConfigError(
                    "a file of the last migration has changed since", where=path, got=content,
                    expected=digest, rule="migration-changed",
                    next_step=f"copy what you want back from {before}; nothing was changed",
                )  # fmt: skip
    undone = replace(migration, undone=_now())
    with publication(home) as stage:
        for file in migration.file:
            _write(stage / file.place, read_input(before / file.place, TEMPLATE_FILE))
        _write(stage / MIGRATIONS / name / FILE, toml_text(undone).encode())
    answer = _answer(home, (), name, dry_run=False)
    answer["undone"] = [file.place for file in migration.file]
    lines = "\n".join(f"  {file.place}" for file in migration.file)
    return answer, f"home: {home}\nundone: migration {name}; as before:\n{lines}"


def _replaced(home: Path, files: Sequence[KeptFile]) -> str:
    """Write what files become, with what they were beside; return the migration's name."""
    name, rows = f"{datetime.now(tz=UTC):%Y%m%dT%H%M%S%f}", []
    with publication(home) as stage:
        for file in files:
            if file.content is None:
                continue
            original = read_input(home / file.place, TEMPLATE_FILE)
            _write(stage / MIGRATIONS / name / BEFORE / file.place, original)
            _write(stage / file.place, file.content)
            before, after = sha256_bytes(original), sha256_bytes(file.content)
            rows.append(Replaced(place=file.place, before=before, after=after))
        migration = Migration(toolkit=__version__, done=_now(), file=tuple(rows))
        _write(stage / MIGRATIONS / name / FILE, toml_text(migration).encode())
    return name


def _last(home: Path) -> tuple[str, Migration]:
    """Return the newest migration that stands."""
    for path in sorted((home / MIGRATIONS).glob(f"*/{FILE}"), reverse=True):
        migration = read_text(Migration, read_input(path, SETTINGS_FILE), where=path)
        places = [PurePosixPath(file.place) for file in migration.file]
        if migration.undone is None and not any(p.is_absolute() or ".." in p.parts for p in places):
            return path.parent.name, migration
    raise ConfigError(
        "no migration of this home stands", where=home / MIGRATIONS, got="none, or all undone",
        expected="one that 'toolkit migrate' did", next_step="nothing is to be undone", rule="no-migration",
    )  # fmt: skip


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def _now() -> str:
    return f"{datetime.now(tz=UTC):%Y-%m-%dT%H:%M:%SZ}"


def _answer(home: Path, files: Sequence[KeptFile], name: str | None, *, dry_run: bool) -> MigrateAnswer:
    return {
        "home": home,
        "dry_run": dry_run,
        "files": files,
        "migration": None if name is None else f"{MIGRATIONS}/{name}",
        "undone": [],
    }  # fmt: skip


def _text(home: Path, files: Sequence[KeptFile], name: str | None, *, dry_run: bool) -> str:
    counts = Counter(
        (file.kind, str(file.version or ""), file.written_by or "", file.state) for file in files
    )
    rows = [[kind, version, by, str(n), state] for (kind, version, by, state), n in sorted(counts.items())]
    lines = [f"home: {home}", table(["kind", "version", "written by", "files", "state"], rows, align="<<<><")]
    lines += [f"refused: {file.place}\n  {file.reason}" for file in files if file.state == "refused"]
    moved = [file.place for file in files if file.content is not None]
    if not moved:
        lines.append("nothing is to be migrated")
    elif dry_run:
        lines.append("\n".join(["would become today's:", *(f"  {place}" for place in moved)]))
    else:
        lines.append("\n".join(["are today's now:", *(f"  {place}" for place in moved)]))
        lines.append(
            f"what they were: {MIGRATIONS}/{name}/{BEFORE}\nundo it with: toolkit migrate {home} --undo"
        )
    return "\n\n".join(lines)
