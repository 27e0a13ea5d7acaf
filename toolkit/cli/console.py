"""How every command speaks: data to stdout, progress and errors to stderr, one JSON document on request."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

if TYPE_CHECKING:
    from toolkit.errors import ToolkitError
    from toolkit.findings import Finding
    from toolkit.trust.keys import Signer
    from toolkit.trust.signing import Travel


_Command = TypeVar("_Command", bound=Callable[..., int])


def into_folder(folder: Path | None) -> Path | None:
    """Refuse a folder that results cannot enter: the callback of an option, before anything is worked out."""
    if folder is not None:
        from toolkit.publication import check_folder

        check_folder(folder)
    return folder


def into_file(path: Path | None) -> Path | None:
    """Refuse a file that cannot be a result, as `into_folder` does."""
    if path is not None:
        from toolkit.publication import check_file

        check_file(path)
    return path


def _home(folder: Path | None) -> Path | None:
    """Refuse a home that is none: what is named is never passed over, whether it is needed or not."""
    if folder is not None:
        from toolkit.lab.home import find_home

        find_home(folder)
    return folder


def _registry(folder: Path | None) -> Path | None:
    if folder is not None:
        from toolkit.lab.home import calibrations_folder

        calibrations_folder(folder)
    return folder


def new_registry(folder: Path | None) -> Path | None:
    """Refuse a registry folder that is none and cannot be made."""
    if folder is not None:
        from toolkit.lab.home import registry_to_write

        registry_to_write(folder)
    return folder


Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Calibrations = Annotated[
    Path | None,
    typer.Option(
        "--calibrations",
        callback=_registry,
        help="Registry folder; default: calibrations/ of the laboratory's home.",
    ),
]
NewCalibrations = Annotated[
    Path | None,
    typer.Option(
        "--calibrations",
        callback=new_registry,
        help="Registry folder, made where there is none; default: calibrations/ of the laboratory's home.",
    ),
]
LockFile = Annotated[
    bool,
    typer.Option(
        "--lock-file",
        help="Keep other writers out by a lock file, where the file system has no locks; all writers must.",
    ),
]
Sign = Annotated[
    list[Path] | None,
    typer.Option(
        "--sign",
        metavar="KEY",
        help="Private SSH key that signs, or the public one of a key in the agent; once for each person.",
    ),
]
RequestFile = Annotated[
    Path | None,
    typer.Option(
        "--request",
        metavar="FILE",
        callback=into_file,
        help="Write what is to be signed to FILE, for 'toolkit sign' on another computer; enter nothing.",
    ),
]
IssuedBy = Annotated[
    list[str] | None,
    typer.Option(
        "--issued-by",
        metavar="ID",
        help="With --request: who will sign, whose name the document states; once for each person.",
    ),
]
Answers = Annotated[
    list[Path] | None,
    typer.Option(
        "--answer",
        metavar="FILE",
        help="Enter what was requested, by the answer of 'toolkit sign'; once for each file.",
    ),
]
Machine = Annotated[
    str | None,
    typer.Option(
        "--machine",
        help="Machine definition that states the cells' polarity; default: the packaged one of the "
        "instrument's name.",
    ),
]
Home = Annotated[
    Path | None,
    typer.Option(
        "--home",
        callback=_home,
        help="Laboratory's home; default: the nearest folder upward with calibrations/.",
    ),
]
Id = Annotated[str, typer.Argument(help="Record id, such as rig-r2.")]
CalibrationId = Annotated[
    str | None,
    typer.Option("--calibration", help="Record id; default: the one in force on the test's date."),
]
KnownAt = Annotated[
    datetime | None,
    typer.Option("--known-at", formats=["%Y-%m-%d"], help="Judge the registry as known on this day."),
]
Draft = Annotated[
    bool,
    typer.Option(
        "--draft",
        help="Allow a record that is not approved and in force; everything made is then marked as a draft.",
    ),
]
Seal = Annotated[
    Path | None,
    typer.Option(
        "--seal",
        metavar="KEY",
        help="Seal what is issued by this key, PKCS #12 or PEM; default: TOOLKIT_SEAL_KEY.",
    ),
]
TimeStamp = Annotated[
    str | None, typer.Option("--time-stamp", metavar="URL", help="Time-stamp server of the seal (RFC 3161).")
]
ProtocolFile = Annotated[
    Path | None,
    typer.Option(
        "--protocol", metavar="FILE", help="Protocol (.toml); default: the test's own, else the machine's."
    ),
]
Isolated = Annotated[
    bool,
    typer.Option(
        "--isolated",
        help="Run the case's own code without network, and with a read-only view of the files but for a "
        "temporary folder; where the kernel cannot, stop.",
    ),
]
Memory = Annotated[
    float | None,
    typer.Option(
        "--memory", min=0.05, help="GB that each process of the case's own code may take; default 4."
    ),
]
Processes = Annotated[
    int | None,
    typer.Option("--processes", min=1, help="Processes that this code may have at once; default 64."),
]
Units = Annotated[
    str, typer.Option("--units", help="SI or lbf, for people; the JSON answer is always in SI.")
]
Reader = Annotated[
    str, typer.Option("--reader", help="calamine, or both: read again with openpyxl and compare.")
]


def ask_passphrase(key: Path, *, twice: bool = False) -> str:
    """Ask for the passphrase of a key: at the terminal, unseen, or as the first line of the input.

    ``twice``: of a new key, whose passphrase is typed a second time at a terminal.

    Raises
    ------
    TrustError
        ``signing-key``: the input has ended, or the two differ
    """
    from getpass import getpass

    from toolkit.errors import TrustError

    text = f"passphrase of {key}: "
    got = "the end of the input"
    with contextlib.suppress(EOFError):
        if not sys.stdin.isatty():
            if line := sys.stdin.readline():
                return line.rstrip("\r\n")
        else:
            passphrase = getpass(text)
            if not twice or passphrase == getpass(f"{text}once more: "):
                return passphrase
            got = "two that differ"
    raise TrustError(
        "a key takes a passphrase", where=key, got=got,
        expected="the passphrase at a terminal, or as the first line of the input",
        next_step="run it at a terminal; without one, name the public half of a key that the SSH agent holds",
        rule="signing-key",
    )  # fmt: skip


def day(moment: datetime | None) -> date | None:
    """Return the day of a date option, None where it was not given."""
    return moment.date() if moment else None


def reader(name: str) -> Literal["calamine", "both"]:
    """Return the reader that ``--reader`` names, or refuse the word."""
    if name not in ("calamine", "both"):
        raise typer.BadParameter("calamine or both", param_hint="--reader")
    return "both" if name == "both" else "calamine"


def open_signers(keys: Sequence[Path] | None) -> tuple[Signer, ...]:
    """Return the signers of ``--sign``; the passphrase of an encrypted key is asked for on the terminal.

    Raises
    ------
    TrustError
        ``signing-key``, ``weak-key``
    """
    from functools import partial

    from toolkit.trust.keys import open_signer

    return tuple(open_signer(key, partial(ask_passphrase, key)) for key in keys or ())


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


def answers(declared: str | type) -> Callable[[_Command], _Command]:
    """Declare the JSON answer of a command: a type, or ``module:name`` of what is heavy to import.

    `toolkit.cli.groups` prints it as page and schema; a test looks for commands without it.
    """

    def declare(command: _Command) -> _Command:
        command.answer = declared  # type: ignore[attr-defined]
        return command

    return declare


def answer(payload: Mapping[str, Any], text: str, *, as_json: bool, quiet: bool) -> None:
    """Print a command's result: the JSON document, or the text for people, or nothing."""
    with _printing():
        if as_json:
            from toolkit.declared import json_value

            document = {"schema": 1, **json_value(payload)}
            typer.echo(json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False))
        elif not quiet and text:
            typer.echo(text)


@contextlib.contextmanager
def _printing() -> Iterator[None]:
    """Turn a failure to print into an error: what the command did is done by then."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        from toolkit.errors import OutputError

        raise OutputError(
            "the answer cannot be printed",
            where="standard output",
            got=error.strerror or error,
            expected="an output with free space",
            next_step="what the command had to write is written: look at it, or ask again with free space",
            rule="not-writable",
        ) from error


def stream(payload: dict[str, Any]) -> None:
    """Print a JSON document whose iterators are written element by element, never held as a whole."""
    with _printing():
        _stream(payload)


def _stream(payload: dict[str, Any]) -> None:
    write = sys.stdout.write
    write('{\n  "schema": 1')
    for key, value in payload.items():
        write(f",\n  {json.dumps(key)}: ")
        if isinstance(value, Iterator):
            write("[")
            first = True
            for element in value:
                write(("" if first else ",") + "\n    " + _json(element))
                first = False
            write("]" if first else "\n  ]")
        else:
            write(_json(value))
    write("\n}\n")
    sys.stdout.flush()


def _json(value: Any) -> str:
    from toolkit.declared import json_value

    text = json.dumps(json_value(value), ensure_ascii=False, allow_nan=False)
    try:
        text.encode()
    except UnicodeEncodeError:  # the name of a file that is no UTF-8
        text = json.dumps(json_value(value), allow_nan=False)
    return text


def exit_code(findings: Sequence[Finding]) -> int:
    """Return 1 where a finding asks for a person's attention, else 0."""
    from toolkit.lab.answers import needs_attention

    return int(needs_attention(findings))


def print_error(error: ToolkitError, *, as_json: bool) -> None:
    """Print an error: JSON to stdout where it was asked for, else lines to stderr."""
    if as_json:
        with contextlib.suppress(OSError):
            typer.echo(json.dumps({"schema": 1, "error": error.as_dict()}, ensure_ascii=False, indent=2))
            return
    typer.echo(f"error: {error}", err=True)


def print_usage_error(error: Exception, *, as_json: bool) -> None:
    """Print what was wrong with the command's words."""
    hint = "see 'toolkit --help' or 'toolkit COMMAND --help'"
    message = str(getattr(error, "format_message", error.__str__)()).strip()
    if message.startswith("Usage:"):  # no words at all: the help is the answer
        typer.echo(message, err=not as_json)
        return
    if as_json:
        parts = {"rule": "usage", "what": message, "next_step": hint}
        typer.echo(json.dumps({"schema": 1, "error": parts}, ensure_ascii=False, indent=2))
    else:
        typer.echo(f"error: {message}\n  next:     {hint}", err=True)


@contextlib.contextmanager
def progress(total: int | None, title: str, *, show: bool = True) -> Iterator[Callable[[str], None]]:
    """Yield ``step(text)``: advances a bar on stderr, drawn only on a terminal, or the note of a job."""
    from toolkit.lab.progress_note import note_of

    if (note := note_of(title, total)) is not None:
        yield note.step
        return
    if not (show and sys.stderr.isatty()):
        yield lambda _text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[text]}"),
        TimeElapsedColumn(),
        *([] if total is None else [TextColumn("left"), TimeRemainingColumn(compact=True)]),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task(title, total=total, text="")
        yield lambda text: bar.update(task, advance=1, text=text)
