"""How every command speaks: data to stdout, progress and errors to stderr, one JSON document on request."""

from __future__ import annotations

import contextlib
import json
import re
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from toolkit.printable import escaped

if TYPE_CHECKING:
    from toolkit.errors import ToolkitError
    from toolkit.findings import Finding


def say(text: str, *, err: bool = False) -> None:
    """Print text for people; what would steer their terminal is shown as its escape.

    Names and values come from files of others: none may hide a line, or write another in its place.
    """
    typer.echo(escaped(text), err=err)


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


def answer(payload: Mapping[str, Any], text: str, *, as_json: bool, quiet: bool) -> None:
    """Print a command's result: the JSON document, or the text for people, or nothing."""
    with _printing():
        if as_json:
            from toolkit.declared import json_value

            document = {"schema": 1, **json_value(payload)}
            typer.echo(json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False))
        elif not quiet and text:
            say(text)


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
    from toolkit.lab.progress_note import note_level

    note_level(finding.level for finding in findings)
    return int(needs_attention(findings))


def print_error(error: ToolkitError, *, as_json: bool) -> None:
    """Print an error: JSON to stdout where it was asked for, else lines to stderr."""
    if as_json:
        with contextlib.suppress(OSError):
            typer.echo(json.dumps({"schema": 1, "error": error.as_dict()}, ensure_ascii=False, indent=2))
            return
    say(f"error: {error}", err=True)


# The parser's own errors say what and, at most, of which option. What was typed and what may stand there is
# taken from the words and from the command that they call: each usage error, of whatever kind, comes by here.


_EXTRA = re.compile(r"unexpected extra arguments? *(?:\(s\) *)?\((?P<words>.*)\)", re.DOTALL)
_COMMAND = re.compile(r"No such command '(?P<word>.*?)'", re.DOTALL)
_QUOTED = re.compile(r"(?:Value )?'(?P<value>.*?)'", re.DOTALL)
_EXPECTED = (
    (re.compile(r"is not a valid (?P<rest>.+?)\.?\Z", re.DOTALL), "{rest}"),
    (re.compile(r"is not in the range (?P<rest>.+?)\.?\Z", re.DOTALL), "{rest}"),
    (re.compile(r"is not one of (?P<rest>.+?)\.?\Z", re.DOTALL), "one of {rest}"),
)


def print_usage_error(error: Exception, words: Sequence[str], tree: Any, *, as_json: bool) -> None:
    """Print what was wrong with the command's words; ``tree`` is the group of all commands."""
    message = str(getattr(error, "format_message", error.__str__)()).strip()
    if message.startswith("Usage:"):  # no words at all: the help is the answer
        typer.echo(message, err=not as_json)
        return
    print_error(_usage_error(error, words, tree), as_json=as_json)


def _usage_error(error: Exception, words: Sequence[str], tree: Any) -> ToolkitError:
    """Return a parser's error with all its parts; ``words`` are those that follow ``toolkit``."""
    from toolkit.errors import ConfigError

    message = str(getattr(error, "format_message", error.__str__)()).strip()
    context = getattr(error, "ctx", None)
    command = _called(words, tree) if context is None else str(context.command_path)
    place, got, expected = _parts(error, context, message, words)
    return ConfigError(
        message,
        where=f"{command}: {place}" if place else command,
        got=got,
        expected=expected,
        next_step=f"see '{command} --help'",
        rule="usage",
    )


def _parts(error: Any, context: Any, message: str, words: Sequence[str]) -> tuple[str | None, str, str]:
    """Return the option or argument of an error, what was typed there, and what may stand there."""
    parameter = getattr(error, "param", None)
    hint = getattr(error, "param_hint", None) or (
        parameter and (parameter.opts[-1] if _is_option(parameter) else _metavar(parameter))
    )
    if type(error).__name__ == "MissingParameter":
        meaning = getattr(parameter, "help", None)
        return hint, "nothing", _clean(meaning) if meaning else f"a value of {hint}"
    if hint:
        return str(hint), _typed(error.message, parameter, str(hint), words), _wanted(error.message)
    option = getattr(error, "option_name", None)
    if option and "does not take a value" in message:
        return option, _after(option, words) or option, "the option alone"
    if option and "requires" in message:
        return option, "nothing", f"{option} and its value"
    if option:
        near = getattr(error, "possibilities", None)
        return option, option, ", ".join(sorted(near) if near else _options(context)) or "no option"
    if match := _COMMAND.search(message):
        return None, match["word"], ", ".join(_commands(context)) or "a command"
    if match := _EXTRA.search(message):
        names = [_metavar(part) for part in _parameters(context) if not _is_option(part)]
        return None, match["words"], " ".join(names) or "no word besides options"
    return None, " ".join(words) or "nothing", "words as its help has them"


def _called(words: Sequence[str], tree: Any) -> str:
    """Return the command that words call, where the parser does not say it."""
    command, called = tree, ["toolkit"]
    for word in words:
        below = getattr(command, "commands", {})
        if word not in below:
            break
        command = below[word]
        called.append(word)
    return " ".join(called)


def _typed(message: str, parameter: Any, hint: str, words: Sequence[str]) -> str:
    options = list(getattr(parameter, "opts", ())) if _is_option(parameter) else [hint]
    for option in options:
        if (value := _after(option, words)) is not None:
            return value or "an empty word"
    match = _QUOTED.match(message)
    return match["value"] if match else shlex.join(words)


def _after(option: str, words: Sequence[str]) -> str | None:
    """Return what stands behind an option, the last time that it is named."""
    value = None
    for at, word in enumerate(words):
        if word == option and at + 1 < len(words):
            value = words[at + 1]
        elif word.startswith(f"{option}="):
            value = word.partition("=")[2]
    return value


def _wanted(message: str) -> str:
    for pattern, form in _EXPECTED:
        if match := pattern.search(message):
            return form.format(rest=match["rest"])
    return _clean(message)


def _clean(text: str) -> str:
    return " ".join(text.split()).rstrip(".")


def _is_option(parameter: Any) -> bool:
    return getattr(parameter, "param_type_name", None) == "option"


def _metavar(parameter: Any) -> str:
    return str(parameter.metavar or parameter.name.upper())


def _parameters(context: Any) -> list[Any]:
    return [] if context is None else list(context.command.get_params(context))


def _options(context: Any) -> list[str]:
    options = [part for part in _parameters(context) if _is_option(part)]
    return [max(part.opts, key=len) for part in options]


def _commands(context: Any) -> list[str]:
    return [] if context is None else sorted(getattr(context.command, "commands", ()))


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
        TextColumn("{task.fields[text]}", markup=False),
        TimeElapsedColumn(),
        *([] if total is None else [TextColumn("left"), TimeRemainingColumn(compact=True)]),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task(title, total=total, text="")
        yield lambda text: bar.update(task, advance=1, text=escaped(text, lines=False))
