"""`toolkit session|machine|test|case|plan new`: commented files to fill in, from the declarations."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypedDict

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import Output


class StarterAnswer(TypedDict):
    """A new file, and what is still open in it."""

    path: Path
    guessed: Annotated[Mapping[str, Any], "entries that a recording told"]
    not_guessed: Annotated[list[str], "columns that it did not"]
    open: Annotated[list[str], "required entries that a person fills in"]
    lacking: Annotated[Mapping[str, str], "by entry, what the file that it names must still be given"]


NEW = "new"
File = Annotated[Path, "A new .toml file; nothing is written over.", ARGUMENT, Mark(metavar="FILE")]
Set = Annotated[
    list[str] | None,
    "State an entry; KEY may be TABLE.KEY; once for each entry.",
    Mark(names=("--set",), metavar="KEY=VALUE"),
]
From = Annotated[
    Path | None,
    "Guess from the columns and units of a recording.",
    Mark(names=("--from",), metavar="RECORDING"),
]
Ask = Annotated[
    bool | None,
    "Ask for what must be stated; default: on a terminal, without --json and --quiet.",
    Mark(names=("--ask/--no-ask",)),
]

session = typer.Typer(help="Calibration sessions: begin a file.", no_args_is_help=True)
test = typer.Typer(help="Tests: begin a file.", no_args_is_help=True)
case = typer.Typer(help="Cases of a diagnosis: begin a file.", no_args_is_help=True)


@session.callback()
@test.callback()
@case.callback()
def _group() -> None:
    pass


@session.command(NEW)
@answers(StarterAnswer)
def new_session(
    file: File, entries: Set = None, recording: From = None, ask: Ask = None, *,
    output: Output,
) -> int:  # fmt: skip
    """Begin a session file; --from takes loads and indications from a table's headers and units.

    Example: toolkit session new SESSION.toml --from loads.csv --set instrument=press-7
    """
    return _begin("session", file, entries, recording, output, ask=ask)


@answers(StarterAnswer)
def new_machine(
    file: File, entries: Set = None, recording: From = None, ask: Ask = None, *,
    output: Output,
) -> int:  # fmt: skip
    """Begin a machine definition; --from takes the columns from a recording's headers and units.

    Example: toolkit machine new belt.toml --from run_01.csv --set name=belt-2
    """
    return _begin("machine", file, entries, recording, output, ask=ask)


@test.command(NEW)
@answers(StarterAnswer)
def new_test(
    file: File, entries: Set = None, ask: Ask = None, *, output: Output,
) -> int:  # fmt: skip
    """Begin the test.toml of a folder of recordings.

    Example: toolkit test new test.toml --set machine=belt.toml --set date=2026-03-17
    """
    return _begin("test", file, entries, None, output, ask=ask)


@case.command(NEW)
@answers(StarterAnswer)
def new_case(
    file: File, entries: Set = None, recording: From = None, ask: Ask = None, *,
    output: Output,
) -> int:  # fmt: skip
    """Begin a case: a simulation and the recordings that it is held against; --from takes the channels.

    Example: toolkit case new CASE.toml --from run_01.csv --set simulation.kind=machine
    """
    return _begin("case", file, entries, recording, output, ask=ask)


@answers(StarterAnswer)
def new_plan(
    file: File, entries: Set = None, ask: Ask = None, *, output: Output,
) -> int:  # fmt: skip
    """Begin a plan of the virtual machine.

    Example: toolkit plan new plan.toml --set date=2026-03-17
    """
    return _begin("plan", file, entries, None, output, ask=ask)


def _begin(
    word: str,
    file: Path,
    words: list[str] | None,
    recording: Path | None,
    output: Output,
    *,
    ask: bool | None,
) -> int:
    from toolkit.lab.starters import entries_of, refuse_existing, start, starter_text
    from toolkit.publication import write_result

    refuse_existing(file)
    entries = entries_of(words or ())
    starter = start(word, entries, recording, file=file)
    if ask or (ask is None and sys.stdin.isatty() and not output.silent):
        starter = start(word, entries | _asked(starter.open, starter.helps), recording, file=file)
    write_result(file, starter.text)
    payload: StarterAnswer = {
        "path": file,
        "guessed": starter.guess.values,
        "not_guessed": list(starter.guess.silent),
        "open": list(starter.open),
        "lacking": starter.guess.lacking,
    }
    output.answer(payload, starter_text(word, file, starter))
    return 0


def _asked(names: tuple[str, ...], helps: dict[str, str]) -> dict[str, Any]:
    from toolkit.lab.starters import entries_of

    typer.echo("what is left empty stays open in the file", err=True)
    words = []
    for name in names:
        if "[" not in name:
            text = typer.prompt(f"{name}: {helps[name]}", default="", show_default=False, err=True)
            words += [f"{name}={text}"] if text.strip() else []
    return entries_of(words)
