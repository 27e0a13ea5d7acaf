"""Options that commands share, each declared once: by itself, or with those that go with it as a class.

A command that has a parameter of such a class takes its options (`toolkit.cli.console.Command`).
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli import console
from toolkit.cli.command import ARGUMENT, Mark
from toolkit.days import FORM, parse_day

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.answers import Timing
    from toolkit.lab.signatures.sealing import Sealing
    from toolkit.lab.tire_tests.resolve import Basis
    from toolkit.trust.keys import Signer
    from toolkit.trust.signing import Travel
    from toolkit.worker.posix import Limits


def moment_of(text: str) -> datetime:
    """Read the day of an option: the parser of every one that takes a day."""
    try:
        return datetime.combine(parse_day(text), datetime.min.time())
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not a valid day {FORM}, such as 2026-03-31") from None


DAY = Mark(parser=moment_of, metavar=FORM)
INTO_FOLDER = Mark(check="toolkit.publication:check_folder")
INTO_FILE = Mark(check="toolkit.publication:check_file")
INTO_REGISTRY = Mark(check="toolkit.lab.home:registry_to_write")

Json = Annotated[bool, "Print one JSON document and nothing else."]
Quiet = Annotated[bool, "Print nothing but errors.", Mark(names=("--quiet", "-q"))]
Calibrations = Annotated[
    Path | None,
    "Registry folder; default: calibrations/ of the laboratory's home.",
    Mark(check="toolkit.lab.home:calibrations_folder"),
]
NewCalibrations = Annotated[
    Path | None,
    "Registry folder, made where there is none; default: calibrations/ of the laboratory's home.",
    INTO_REGISTRY,
]
LockFile = Annotated[
    bool, "Keep other writers out by a lock file, where the file system has no locks; all writers must."
]
Sign = Annotated[
    list[Path] | None,
    "Private SSH key that signs, or the public one of a key in the agent; once for each person.",
    Mark(metavar="KEY"),
]
RequestFile = Annotated[
    Path | None,
    "Write what is to be signed to FILE, for 'toolkit sign' on another computer; enter nothing.",
    INTO_FILE,
    Mark(metavar="FILE"),
]
IssuedBy = Annotated[
    list[str] | None,
    "With --request: who will sign, whose name the document states; once for each person.",
    Mark(metavar="ID"),
]
Answers = Annotated[
    list[Path] | None,
    "Enter what was requested, by the answer of 'toolkit sign'; once for each file.",
    Mark(names=("--answer",), metavar="FILE"),
]
Machine = Annotated[
    str | None,
    "Machine definition that states the cells' polarity; default: the packaged one of the instrument's name.",
]
Home = Annotated[
    Path | None,
    "Laboratory's home; default: the nearest folder upward with calibrations/.",
    Mark(check="toolkit.lab.home:find_home"),
]
Id = Annotated[str, "Record id, such as rig-r2.", ARGUMENT]
ReportTemplate = Annotated[Path | None, "Word template; default: report_templates/org.docx of the home."]
AllowMissing = Annotated[bool, "Print n/a for a value that the test does not have."]
CalibrationId = Annotated[str | None, "Record id; default: the one in force on the test's date."]
KnownAt = Annotated[datetime | None, "Judge the registry as known on this day.", DAY]
Draft = Annotated[
    bool, "Allow a record that is not approved and in force; everything made is then marked as a draft."
]
Seal = Annotated[
    Path | None,
    "Seal what is issued by this key, PKCS #12 or PEM; default: TOOLKIT_SEAL_KEY.",
    Mark(metavar="KEY"),
]
TimeStamp = Annotated[str | None, "Time-stamp server of the seal (RFC 3161).", Mark(metavar="URL")]
ProtocolFile = Annotated[
    Path | None, "Protocol (.toml); default: the test's own, else the machine's.", Mark(metavar="FILE")
]
Isolated = Annotated[
    bool,
    "Run the case's own code without network, and with a read-only view of the files but for a temporary "
    "folder; where the kernel cannot, stop.",
]
Memory = Annotated[
    float | None, "GB that each process of the case's own code may take; default 4.", Mark(min=0.05)
]
Processes = Annotated[int | None, "Processes that this code may have at once; default 64.", Mark(min=1)]
Units = Annotated[str, "SI or lbf, for people; the JSON answer is always in SI."]
Reader = Annotated[str, "calamine, or both: read again with openpyxl and compare."]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """How a command speaks: one JSON document, a text for people, or nothing but errors."""

    json: Json = False
    quiet: Quiet = False
    began: float = field(default_factory=time.perf_counter, init=False, repr=False, compare=False)

    @property
    def timing(self) -> Timing:
        """How long the command has taken until now."""
        return {"seconds": time.perf_counter() - self.began}

    @property
    def silent(self) -> bool:
        """True where no text for people is printed on the way."""
        return self.json or self.quiet

    def answer(self, payload: Mapping[str, Any], text: str) -> None:
        """Print the result."""
        console.answer(payload, text, as_json=self.json, quiet=self.quiet)

    def progress(self, title: str) -> contextlib.AbstractContextManager[Callable[[str], None]]:
        """Show how far a command is, where people are looking."""
        return console.progress(None, title, show=not self.silent)


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistryOptions:
    """Which registry a command reads."""

    calibrations: Calibrations = None
    home: Home = None

    def registry(self, sign: Sequence[Path] | None = None) -> Registry:
        """Return it, with the signers of ``sign``."""
        from toolkit.lab.home import open_registry

        return open_registry(self.calibrations, self.home, signers=open_signers(sign))

    def basis(
        self,
        *,
        calibration: str | None = None,
        known_at: datetime | None = None,
        draft: bool = False,
        protocol: Path | None = None,
        reader: str = "calamine",
    ) -> Basis:
        """Return what results of tests rest on, or refuse the word of ``--reader``."""
        from toolkit.lab.tire_tests.resolve import Basis

        if reader not in ("calamine", "both"):
            raise typer.BadParameter("calamine or both", param_hint="--reader")
        return Basis(
            calibration=calibration, calibrations=self.calibrations, home=self.home, known_at=day(known_at),
            draft=draft, protocol=protocol, reader="both" if reader == "both" else "calamine",
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionOptions(RegistryOptions):
    """Which registry a decision enters, and whose signatures it carries."""

    lock_file: LockFile = False
    sign: Sign = None
    request: RequestFile = None
    answers: Answers = None

    def registry(self, sign: Sequence[Path] | None = None) -> Registry:
        """Return the registry, whose entries are signed."""
        from toolkit.lab.home import open_registry

        return open_registry(
            self.calibrations, self.home, lock_file=self.lock_file,
            signers=open_signers(sign or self.sign), travel=open_travel(self.request, self.answers),
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryOptions(DecisionOptions):
    """Which registry a record enters, made where there is none, and whose signatures that carries."""

    calibrations: NewCalibrations = None

    def registry(self, sign: Sequence[Path] | None = None) -> Registry:
        """Return the registry, made where there is none."""
        from toolkit.calibration.registry.registry import Registry
        from toolkit.lab.home import registry_to_write

        return Registry(
            registry_to_write(self.calibrations, self.home), lock_file=self.lock_file,
            signers=open_signers(sign or self.sign), travel=open_travel(self.request, self.answers),
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class IssueOptions(DecisionOptions):
    """Which ledger a document enters, and by whose signatures and seal."""

    issued_by: IssuedBy = None
    seal: Seal = None
    time_stamp: TimeStamp = None

    @property
    def asked(self) -> bool:
        """True where a document is issued for anything that is stated."""
        stated = (self.sign, self.request, self.answers, self.seal, self.time_stamp)
        return any(stated) or bool(os.environ.get("TOOLKIT_SEAL_KEY"))

    def sealing(self, registry: Registry, *, draft: bool) -> Sealing | None:
        """Return the seal of what is issued; None without one."""
        from toolkit.lab.signatures.sealing import open_sealing

        home = registry.folder.parent
        return open_sealing(self.seal, home, ask=console.ask_passphrase, stamps=self.time_stamp, draft=draft)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerOptions:
    """Limits of a case's own code."""

    isolated: Isolated = False
    memory: Memory = None
    processes: Processes = None

    def limits(self) -> Limits:
        """Return them, as the worker takes them."""
        from toolkit.lab.studies.diagnosis import worker_limits

        return worker_limits(isolated=self.isolated, memory_GB=self.memory, processes=self.processes)


def day(moment: datetime | None) -> date | None:
    """Return the day of a date option, None where it was not given."""
    return moment.date() if moment else None


def open_signers(keys: Sequence[Path] | None) -> tuple[Signer, ...]:
    """Return the signers of ``--sign``; the passphrase of an encrypted key is asked for on the terminal.

    Raises
    ------
    TrustError
        ``signing-key``, ``weak-key``
    """
    from functools import partial

    from toolkit.trust.keys import open_signer

    return tuple(open_signer(key, partial(console.ask_passphrase, key)) for key in keys or ())


def open_travel(request: Path | None, answers: Sequence[Path] | None) -> Travel:
    """Return what travels to keys elsewhere: the request to write, or the answers that came back.

    Raises
    ------
    ConfigError
        ``usage``: both
    TrustError
        ``request``: an answer is none
    """
    from toolkit.trust.requests import read_request
    from toolkit.trust.signing import Travel

    if request is not None and answers:
        from toolkit.errors import ConfigError

        raise ConfigError(
            "a request and its answer are two steps", where="--request, --answer", got="both",
            expected="one of the two",
            next_step="make the request, let it be signed, then give --answer; nothing was changed",
            rule="usage",
        )  # fmt: skip
    return Travel(request=request, answers=tuple(map(read_request, answers or ())))
