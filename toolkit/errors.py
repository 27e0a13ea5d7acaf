"""Every error that the toolkit raises on purpose.

    ToolkitError                    what, where, got, expected, next step; exit code 2
     |- ConfigError                 a TOML file: unknown key, wrong type, missing value
     |- RecordingError              a recording that cannot be used
     |   |- UnreadableError         its content is no recording (rule: not-a-workbook zip-truncated ...)
     |   |- ColumnError             a column is missing, doubled, or has no known unit
     |   `- CellError               text, an error value or NaN in a number's place
     |- UnitError                   an unknown unit, or one of another dimension
     |- SessionError                reference-load data that cannot be fitted
     |- RegistryError               the registry cannot be used, or no record applies
     |   `- RecordError             one record: wrong hash, does not reproduce, wrong units
     |- FitError                    a tire model cannot be fitted
     |- TemplateError               a Word template that cannot be used
     |- RenderError                 LibreOffice is missing, failed, or made a PDF that is not the report
     |- TrustError                  a key, a signature or a log of decisions that proves nothing
     `- OutputError                 a result cannot be written

Anything else that reaches the command line is a bug and ends with exit code 101.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Collection

LONGEST = 1000  # characters of a line of an error; a header of a hundred columns has fewer


class ToolkitError(Exception):
    """An error that a user can act on.

    Attributes
    ----------
    what : one sentence that names the problem
    where : file, sheet, row, channel or record
    line : the line of a text file, with its number
    got, expected : what stood there and what should have
    next_step : what the user can do about it
    rule : id of the finding's rule, for ``toolkit explain``
    """

    exit_code = 2

    def __init__(
        self,
        sentence: str,
        *,
        where: object = None,
        line: str | None = None,
        got: object = None,
        expected: object = None,
        next_step: str | None = None,
        rule: str | None = None,
    ) -> None:
        sentence = _readable(sentence)
        super().__init__(sentence)
        self.what = sentence
        self.where = None if where is None else _readable(where)
        self.line = None if line is None else _readable(line)
        self.got = None if got is None else _readable(got)
        self.expected = None if expected is None else _readable(expected)
        self.next_step = next_step
        self.rule = rule

    def __str__(self) -> str:
        """Return the error as lines: what first, then each part that is known.

        Parts name files and quote them: no line of a part begins where a line of the error does.
        """
        parts = [_inside(self.what)]
        for label, text in (
            ("where", self.where),
            ("line", self.line),
            ("got", self.got),
            ("expected", self.expected),
            ("next", self.next_step),
        ):
            if text is not None:
                parts.append(f"  {label + ':':<10}{_inside(text)}")
        return "\n".join(parts)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by keyword: exceptions cross process borders in isolated workers."""
        return (_rebuild, (type(self), self.what, self.as_dict()))

    def as_dict(self) -> dict[str, str | None]:
        """Return the parts as a JSON-ready dict; ``line`` only where there is one."""
        return {
            "rule": self.rule,
            "what": self.what,
            "where": self.where,
            **({} if self.line is None else {"line": self.line}),
            "got": self.got,
            "expected": self.expected,
            "next_step": self.next_step,
        }


def _readable(part: object) -> str:
    """Return a part of an error as text whose lines people can read: a cell of megabytes keeps its begin."""
    return "\n".join(
        line if len(line) <= LONGEST else f"{line[:LONGEST]} ... ({len(line)} characters)"
        for line in str(part).split("\n")
    )


_INDENT = " " * 12


def _inside(part: str) -> str:
    """Return a part whose lines after the first stand below it; some of them do already."""
    first, *lines = part.split("\n")
    return "\n".join([first, *(text if text.startswith(_INDENT) else _INDENT + text for text in lines)])


def _rebuild(cls: type[ToolkitError], sentence: str, parts: dict[str, str | None]) -> ToolkitError:
    return cls(sentence, **{key: value for key, value in parts.items() if key != "what"})


class ConfigError(ToolkitError):
    """A TOML file: unknown key, wrong type, missing value."""


class RecordingError(ToolkitError):
    """A recording that cannot be used."""


class UnreadableError(RecordingError):
    """The content of a file is no recording."""


class ColumnError(RecordingError):
    """A column is missing, doubled, or has no known unit."""


class CellError(RecordingError):
    """Text, an error value or NaN stands in a number's place."""


class UnitError(ToolkitError):
    """An unknown unit, or one of another dimension."""


class SessionError(ToolkitError):
    """Reference-load data that cannot be fitted. ``further``: the other cells that cannot be used."""

    further: tuple[SessionError, ...] = ()


class RegistryError(ToolkitError):
    """The registry cannot be used, or no record applies."""


class RecordError(RegistryError):
    """One record: its hash is wrong, it does not reproduce, or its units differ."""


class FitError(ToolkitError):
    """A tire model cannot be fitted to the data."""


class TemplateError(ToolkitError):
    """A Word template that cannot be used."""


class RenderError(ToolkitError):
    """LibreOffice is missing, failed, or made a PDF that is not the report."""


class TrustError(ToolkitError):
    """A key, a signature, a person or a log of decisions that cannot be trusted."""


class OutputError(ToolkitError):
    """A result cannot be written."""


def refuse_unknown(
    noun: str,
    word: object,
    choices: Collection[str],
    *,
    where: str,
    rule: str,
    error: type[ToolkitError] = ConfigError,
) -> None:
    """Refuse a word, such as that of an option, that is none of its choices.

    Raises
    ------
    ToolkitError
        an ``error`` of the ``rule``, which names the choices
    """
    if word not in choices:
        raise error(
            f"unknown {noun} {word!r}", where=where, got=word, expected=", ".join(choices),
            next_step="name one of those expected", rule=rule,
        )  # fmt: skip
