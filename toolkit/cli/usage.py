"""What is wrong with a command's words, as every other error is told: what, where, got, expected, next step.

The parser's own errors say what and, at most, of which option. What was typed and what may stand there is taken
from the words and from the command that they call: each usage error, of whatever kind, comes by here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from toolkit.errors import ConfigError, ToolkitError

_EXTRA = re.compile(r"unexpected extra arguments? *(?:\(s\) *)?\((?P<words>.*)\)", re.DOTALL)
_COMMAND = re.compile(r"No such command '(?P<word>.*?)'", re.DOTALL)
_QUOTED = re.compile(r"(?:Value )?'(?P<value>.*?)'", re.DOTALL)
_EXPECTED = (
    (re.compile(r"is not a valid (?P<rest>.+?)\.?\Z", re.DOTALL), "{rest}"),
    (re.compile(r"is not in the range (?P<rest>.+?)\.?\Z", re.DOTALL), "{rest}"),
    (re.compile(r"is not one of (?P<rest>.+?)\.?\Z", re.DOTALL), "one of {rest}"),
)


def usage_error(error: Exception, words: Sequence[str]) -> ToolkitError:
    """Return a parser's error with all its parts; ``words`` are those that follow ``toolkit``."""
    message = str(getattr(error, "format_message", error.__str__)()).strip()
    context = getattr(error, "ctx", None)
    command = "toolkit" if context is None else str(context.command_path)
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
    options = _options(context)
    if option and option not in options:  # with a hint of the near ones, where there are any
        near = getattr(error, "possibilities", None)
        return option, option, ", ".join(sorted(near) if near else options) or "no option"
    if option:
        alone = "does not take a value" in message
        return option, _after(option, words) or "nothing", "the option alone" if alone else f"{option} VALUE"
    if match := _COMMAND.search(message):
        return None, match["word"], ", ".join(_commands(context)) or "a command"
    if match := _EXTRA.search(message):
        names = [_metavar(part) for part in _parameters(context) if not _is_option(part)]
        return None, match["words"], " ".join(names) or "no word besides options"
    return None, " ".join(words) or "nothing", "words as its help has them"


def _typed(message: str, parameter: Any, hint: str, words: Sequence[str]) -> str:
    options = list(getattr(parameter, "opts", ())) if _is_option(parameter) else [hint]
    for option in options:
        if (value := _after(option, words)) is not None:
            return value
    match = _QUOTED.match(message)
    return match["value"] if match else " ".join(words)


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
