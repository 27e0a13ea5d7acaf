"""The qualification record: what was checked, what was asked for and what was reached.

Reference: ISO/IEC 17025:2017, clause 7.11 (software is validated before use).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Literal

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
    """The outcome on one day, of one version on one machine's libraries.

    ``packages`` are the versions that change numbers; ``numbers_sha256`` identifies the packaged numbers.
    """

    software: str
    python: str
    packages: tuple[tuple[str, str], ...]
    platform: str
    date: date
    numbers_sha256: str
    checks: tuple[Check, ...]
    not_covered: tuple[NotCovered, ...]

    @property
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
