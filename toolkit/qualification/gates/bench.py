"""The bench of the demonstrations: a registry that is thrown away, and what a refusal was.

A demonstration prepares its case and returns the act that is to be refused. The runner looks at the files
before and after the act: what is refused must not have written anything.
"""

from __future__ import annotations

import datetime as dt
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.files import sha256_file
from toolkit.qualification.gates.virtual_hub import FIRST, Session
from toolkit.qualification.model import Check

GROUP = "gates"
PASSES = "passes"
CHECKER = "virtual checker"

# What a demonstration may end in instead of a refusal: the qualification then has a failed check.
FAULTS = (
    ToolkitError,
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    OSError,
    TypeError,
    ValueError,
)

Refusals = Iterable[tuple[str, str]]
Act = Callable[[], Refusals]


class Bench:
    """A registry in which ``rig-r1`` is approved and in force, copied anew for each demonstration."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.registry = Registry(folder / "calibrations")
        self._sessions = 0

    def fill(self) -> Bench:
        """Enter and approve the first record."""
        self.registry.folder.mkdir(parents=True)
        self.approved(Session(day=FIRST, reading=1))
        return self

    def copy(self, folder: Path) -> Bench:
        """Return a bench with the same records in another folder."""
        shutil.copytree(self.registry.folder, folder / "calibrations")
        return Bench(folder)

    def written(self, session: Session) -> Path:
        """Write a session beside the registry; return its SESSION.toml."""
        self._sessions += 1
        return session.write(self.folder / f"session{self._sessions}")

    def entered(self, session: Session) -> str:
        """Enter a session's candidate; return its id."""
        return calibrate(self.written(session), self.registry).record.id

    def approved(self, session: Session, **more: Any) -> str:
        """Enter a session's record and approve it; return its id."""
        record_id = self.entered(session)
        failed = tuple(self.approval(record_id, session.day, **more)())
        if failed:
            raise ValueError(f"{record_id} should have been approved: {failed}")
        return record_id

    def approval(self, record_id: str, day: dt.date, **more: Any) -> Act:
        """Return the act of approving a record in force from a day."""

        def act() -> Refusals:
            decision = approve(self.registry, record_id, in_force_from=day, **{"checked_by": CHECKER, **more})
            return [(result.rule, f"{result.where}: {result.message}") for result in decision.failed]

        return act

    def judged(self, session: Session, **more: Any) -> Act:
        """Return the act of approving a session's record, entered before."""
        return self.approval(self.entered(session), session.day, **more)


@dataclass(frozen=True, slots=True, kw_only=True)
class Demonstration:
    """One thing that must be refused, and by which rules: no other, and none of them lacking.

    ``stage`` says what is refused, such as "approval"; without ``rules`` it must pass.
    """

    name: str
    stage: str
    rules: tuple[str, ...]
    prepare: Callable[[Bench], Act]

    def check(self, bench: Bench) -> Check:
        """Show it; return the check. An error that is no refusal is a failed check too."""
        try:
            act = self.prepare(bench)
            before = _contents(bench.registry.folder)
            reached, note = _refusal(act)
            if reached and _contents(bench.registry.folder) != before:
                reached, note = {*reached, "written"}, f"{note}; the registry was changed all the same"
        except FAULTS as error:
            reached, note = {"not shown"}, f"{type(error).__name__}: {error}"
        return Check(
            group=GROUP, name=self.name, quantity=self.stage, measure="rules",
            required=_listed(self.rules), reached=_listed(reached), passed=reached == set(self.rules),
            note=note.splitlines()[0] if note else "",
        )  # fmt: skip


def _refusal(act: Act) -> tuple[set[str], str]:
    try:
        refusals = list(act())
    except ToolkitError as error:
        if error.exit_code != 2:
            raise
        return {error.rule or "without a rule"}, f"{error.what}: {error.got}; expected {error.expected}"
    return {rule for rule, _ in refusals}, "; ".join(text for _, text in refusals[:1])


def _listed(rules: Iterable[str]) -> str:
    return ", ".join(sorted(rules)) or PASSES


def _contents(folder: Path) -> dict[str, str]:
    return {str(path): sha256_file(path) for path in sorted(folder.rglob("*")) if path.is_file()}
