"""The refusals that the walks share."""

from __future__ import annotations

from typing import NoReturn

from toolkit.errors import UnreadableError

_AGAIN = "copy the file again from the machine; it was cut off or damaged on its way"


def truncated(where: object, problem: str, actual: object, expected: object) -> NoReturn:
    """Refuse a file that ends before its own headers say (rule ``truncated``)."""
    raise UnreadableError(
        problem, where=where, got=actual, expected=expected, next_step=_AGAIN, rule="truncated"
    )


def damaged(where: object, what: str, actual: object, expected: object) -> NoReturn:
    """Refuse a file whose lengths or links contradict each other (rule ``damaged``)."""
    raise UnreadableError(what, where=where, got=actual, expected=expected, next_step=_AGAIN, rule="damaged")


def too_large(where: object, actual: object, most: int) -> NoReturn:
    """Refuse a file that grows out of all proportion (rule ``inflation``)."""
    raise UnreadableError(
        "the file grows out of all proportion when it is unpacked",
        where=where,
        got=actual,
        expected=f"at most {most // 2**20} MB in all",
        next_step="find out where the file comes from; the machine does not write such files",
        rule="inflation",
    )


def version(where: object, what: str, actual: object, expected: object, next_step: str) -> NoReturn:
    """Refuse a version of a format that is not read (rule ``format-version``)."""
    raise UnreadableError(
        what, where=where, got=actual, expected=expected, next_step=next_step, rule="format-version"
    )


def no_numbers(where: object, problem: str, actual: object) -> NoReturn:
    """Refuse objects, texts or complex values where columns of numbers are read (rule ``not-numbers``)."""
    raise UnreadableError(
        problem,
        where=where,
        got=actual,
        expected="columns of real numbers",
        next_step="export the channels as arrays of numbers",
        rule="not-numbers",
    )
