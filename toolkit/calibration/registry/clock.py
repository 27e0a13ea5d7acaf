"""Days and times of the registry: what has begun, and what comes before what.

Days are those that people write (a session, a decision) and belong to the calendar where they are; the time
of a ledger entry is UTC. A day lies in the future only where it has not begun anywhere on earth, so that no
laboratory is refused for its time zone.

Whether a time server keeps this computer's clock is asked of its kernel (``adjtimex``).
"""

from __future__ import annotations

import ctypes
import os
from datetime import UTC, date, datetime, timedelta
from typing import Literal

from toolkit.errors import RegistryError

ClockState = Literal["synchronised", "not synchronised", "unknown"]

_SIZE = 512  # bytes, more than any kernel's struct timex; its first word, modes, is 0: nothing is set
_ERROR = 5  # TIME_ERROR, timex.h: the clock is not synchronised


def clock_state() -> ClockState:
    """Return whether the clock is kept; ``unknown`` where the system does not tell.

    A container has the clock of its host, and some are not allowed to ask.
    """
    library = ctypes.CDLL(None, use_errno=True)
    ask = getattr(library, "adjtimex", None)
    if ask is None or os.name != "posix":
        return "unknown"
    answer = ask(ctypes.create_string_buffer(_SIZE))
    if answer < 0:
        return "unknown"
    return "not synchronised" if answer == _ERROR else "synchronised"


_FAST = timedelta(minutes=5)  # by which clocks of computers differ
_EARLIEST_ZONE = timedelta(hours=14)  # UTC+14, Kiribati: where a day begins first


def today() -> date:
    """Return the day by this computer's own time zone: the default day of knowledge and of a decision."""
    return datetime.now().astimezone().date()


def now() -> str:
    """Return the time of an entry, UTC to the second."""
    return datetime.now(tz=UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def moment(text: str) -> datetime:
    """Return the time of an entry; one without a zone is UTC.

    Raises
    ------
    ValueError
        the text is no time
    """
    parsed = datetime.fromisoformat(text)
    return parsed if parsed.tzinfo is not None else parsed.replace(tzinfo=UTC)


def day_of(time: str) -> date:
    """Return the day of an entry's time by this computer's own time zone."""
    try:
        return moment(time).astimezone().date()
    except OverflowError:  # the first or the last day that a date can be
        return moment(time).date()


def begun(day: date, at: datetime | None = None) -> bool:
    """Tell whether a day has begun somewhere on earth at a time (default: now).

    >>> begun(date(2026, 3, 2), datetime(2026, 3, 1, 9, 0, tzinfo=UTC))
    False
    >>> begun(date(2026, 3, 2), datetime(2026, 3, 1, 10, 0, tzinfo=UTC))
    True
    """
    return day <= ((at or datetime.now(tz=UTC)) + _EARLIEST_ZONE).date()


def ahead(time: str) -> bool:
    """Tell whether an entry's time lies after this computer's clock: one of the two is wrong."""
    return moment(time) - datetime.now(tz=UTC) > _FAST


def in_future(day: date) -> str:
    """Return what is said of a test whose day has not begun."""
    return f"the test is dated {day.isoformat()}, in the future: what will be in force then cannot be known"


def check_begun(day: date, what: str, where: object) -> None:
    """Refuse a day in the future; ``what`` names it, such as "the session".

    Raises
    ------
    RegistryError
        ``time``
    """
    if not begun(day):
        raise untimely(
            f"{what} lies in the future", where, day.isoformat(), f"a day up to {today().isoformat()}"
        )


def check_after(last: str | None, time: str, where: object, way_on: str = "") -> None:
    """Refuse an entry whose time lies before that of the last one: a clock was set back.

    ``way_on`` says what helps where it was the last one's clock that was fast.

    Raises
    ------
    RegistryError
        ``time``
    """
    if last is not None and moment(time) < moment(last):
        raise RegistryError(
            "the time of a ledger entry lies before that of the entry before it",
            where=where,
            got=time,
            expected=f"a time from {last} on",
            next_step=f"correct this computer's clock; nothing was written{way_on}",
            rule="time",
        )


def untimely(problem: str, where: object, actual: str, expected: str) -> RegistryError:
    """Return the error of a day that cannot be."""
    return RegistryError(
        problem, where=where, got=actual, expected=expected,
        next_step="correct the date, or this computer's clock; nothing was written", rule="time",
    )  # fmt: skip
