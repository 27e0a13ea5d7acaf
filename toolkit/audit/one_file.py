"""One file of an archive: which calibration computed it, what was in force, what would change."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path

from toolkit.audit.columns import columns_of
from toolkit.audit.context import DEFAULT_MACHINE, Context, MachineSource, context_of
from toolkit.audit.identify import identify_columns
from toolkit.audit.inspection import Choice, choose
from toolkit.audit.model import Grade, Identification
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.recording.marks import is_own_output, machine_of
from toolkit.recording.read import read_recording
from toolkit.reduction.opened import split_blocks


@dataclass(frozen=True, slots=True, kw_only=True)
class FileAudit:
    """What is known of one file. ``path`` is relative to the archive, with ``/``.

    ``found`` is None where the file is unreadable; ``reason`` then begins with the rule that refused it.
    ``context`` tells why its test.toml could not be used, None where it could or there is none.
    """

    path: str
    sha256: str | None
    size: int | None
    instrument: str | None
    date: dt.date | None
    rows: int | None
    found: Identification | None
    reason: str | None
    context: str | None = None

    @property
    def grade(self) -> Grade:
        """The file's grade."""
        return "unreadable" if self.found is None else self.found.grade


class Auditor:
    """Audits files one after another; what the registry offers is asked once an instrument and day."""

    def __init__(self, archive: Path, registry: Registry, known_at: dt.date | None) -> None:
        self.archive = archive
        self.registry = registry
        self.known_at = known_at
        self._choices: dict[tuple[str, dt.date | None], Choice] = {}

    def __call__(self, name: str) -> FileAudit | None:
        """Audit one file by its path in the archive; None for a result that the toolkit wrote.

        What a file holds never raises.
        """
        path = self.archive / name
        if is_own_output(path):
            return None
        sha256 = size = None
        try:
            size = path.stat().st_size
            sha256 = sha256_file(path)
        except OSError as error:
            return unreadable(name, f"no-file: {error.strerror}")
        context, trouble = _context(path)
        try:
            recording = read_recording(path, context.machine)
            if not context.is_tare:
                split_blocks(recording, context.machine)
        except ToolkitError as error:
            told = f"{error.rule or 'unreadable'}: {error.what}" + (f", got {error.got}" if error.got else "")
            return unreadable(name, told, sha256=sha256, size=size, context=trouble)
        columns = columns_of(recording)
        choice = self.choice(context.machine.name, context.date)
        return FileAudit(
            path=name,
            sha256=sha256,
            size=size,
            instrument=context.machine.name,
            date=context.date,
            rows=recording.rows,
            found=identify_columns(
                columns, choice.records, on=context.date, in_force=choice.in_force, void=choice.void
            ),
            reason=None if columns.loads else "no-own-values: the file has no FY and no MZ of its own",
            context=trouble,
        )

    def choice(self, instrument: str, on: dt.date | None) -> Choice:
        """Return what the registry offers for an instrument and a day."""
        key = (instrument, on)
        if key not in self._choices:
            self._choices[key] = choose(self.registry, instrument, on=on, known_at=self.known_at)
        return self._choices[key]


def unreadable(
    name: str,
    reason: str,
    *,
    sha256: str | None = None,
    size: int | None = None,
    context: str | None = None,
) -> FileAudit:
    """Return the row of a file that cannot be read; ``reason`` begins with a rule id."""
    return FileAudit(
        path=name, sha256=sha256, size=size, instrument=None, date=None, rows=None, found=None,
        reason=reason, context=context,
    )  # fmt: skip


def _context(path: Path) -> tuple[Context, str | None]:
    # A test.toml that cannot be used must not hide what its recordings hold: they have no date then.
    try:
        return context_of(path), None
    except ToolkitError as error:
        own = machine_of(path)
        source: MachineSource = "default" if own is None else "file"
        machine = load_machine(own or DEFAULT_MACHINE)
        told = f"{error.rule or 'test-toml'}: {error.what} ({error.where})"
        return Context(machine=machine, machine_source=source, date=None, test_toml=None), told
