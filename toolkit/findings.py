"""Findings: what a user should know about data that could still be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, TypedDict

Level = Literal["error", "warning", "note"]


class FindingEntry(TypedDict):
    """A finding in an answer; ``toolkit explain RULE`` tells more."""

    rule: Annotated[str, "id of the rule"]
    where: Annotated[str, "file, condition, load or record"]
    message: Annotated[str, "in words"]
    level: Annotated[Level, "a note leaves the exit code at 0"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One departure from what was expected.

    ``rule`` is a short id that ``toolkit explain`` knows, ``where`` names file, block, channel or
    record, ``message`` is one sentence with the numbers. A ``note`` informs and leaves the exit code at 0.
    An ``error`` is what cannot be, or makes the result worthless: of a calibration session it refuses the
    approval of the record.
    """

    rule: str
    where: str
    message: str
    level: Level = "warning"

    def as_dict(self) -> FindingEntry:
        """Return the finding as an answer has it."""
        return {"rule": self.rule, "where": self.where, "message": self.message, "level": self.level}
