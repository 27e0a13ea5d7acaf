"""The qualification record: what was checked, what was asked for and what was reached.

Reference: ISO/IEC 17025:2017, clause 7.11 (software is validated before use).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date
from decimal import Decimal, InvalidOperation
from typing import Annotated, Literal

from toolkit.declared import Entry, Keyed, derived
from toolkit.errors import ConfigError

Measure = Literal["correct digits", "units of the last digit", "share of the largest load", "text", "rules"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check. ``measure`` says what ``required`` and ``reached`` count.

    *correct digits*: at least ``required``. *units of the last digit*: difference from a printed number, at
    most 0.5. *share of the largest load*: at most ``required``. *text*: equal. *rules*: the ids of the
    rules that refused, all of them and no other; *passes* where nothing may. ``note`` tells what else there
    is to know, the refusal's own words, and the reason where it failed without a number.
    """

    group: str
    name: str
    quantity: str
    measure: Measure
    required: float | str
    reached: float | str | None
    passed: bool
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class NotCovered:
    """A published example or record that no check covers, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class QualificationRecord:
    """What this installation computes, held against certified values, on one day.

    ``numbers_sha256`` identifies the packaged numbers.
    """

    software: str
    python: str
    packages: Annotated[tuple[tuple[str, str], ...], Keyed(), Entry("versions that change numbers")]
    platform: str
    date: date
    numbers_sha256: str
    checks: tuple[Check, ...]
    not_covered: tuple[NotCovered, ...]

    @property
    @derived(after="")
    def passed(self) -> bool:
        """Whether every check passed, and there was one."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass."""
        return tuple(check for check in self.checks if not check.passed)


def not_run(group: str, name: str, reason: str) -> Check:
    """Return the failed check of something that could not be run."""
    return Check(
        group=group, name=name, quantity="", measure="text", required="runs", reached=None, passed=False,
        note=reason,
    )  # fmt: skip


# Two ways to count agreement: correct digits, and units of a printed number's last digit.


CERTIFIED_DIGITS = 15.0


def correct_digits(value: float, certified: float) -> float:
    """Return -log10 of the relative error, absolute where the certified value is 0; 0 to 15.

    >>> round(correct_digits(3.14159, math.pi), 1)
    6.1
    """
    off = abs(value - certified) / (abs(certified) or 1.0)
    if not math.isfinite(off):
        return 0.0
    return CERTIFIED_DIGITS if off == 0 else min(CERTIFIED_DIGITS, max(0.0, -math.log10(off)))


def digits_check(
    group: str, name: str, quantity: str, required: float, reached: float, note: str = ""
) -> Check:
    """Return the check of a number of correct digits."""
    return Check(
        group=group, name=name, quantity=quantity, measure="correct digits", required=required,
        reached=reached, passed=reached >= required, note=note,
    )  # fmt: skip


def printed_check(group: str, name: str, quantity: str, printed: str, value: float) -> Check:
    """Return the check of a value against a printed number: it must round to the digits printed.

    Raises
    ------
    ConfigError
        ``wrong-value``: the printed number is none
    """
    try:
        number = Decimal(printed)
        last = Decimal(1).scaleb(int(number.as_tuple().exponent))
    except (InvalidOperation, ValueError, TypeError) as error:
        raise ConfigError(
            "a packaged number cannot be read", where=f"{group}, {name}, {quantity}", got=printed,
            expected="a decimal number", next_step="install the package again", rule="wrong-value",
        ) from error  # fmt: skip
    off = float(abs(Decimal(value) - number) / last) if math.isfinite(value) else math.inf
    return Check(
        group=group, name=name, quantity=quantity, measure="units of the last digit", required=0.5,
        reached=off if math.isfinite(off) else None, passed=off <= 0.5,
        note=f"printed {printed}, got {value:.9g}",
    )  # fmt: skip
