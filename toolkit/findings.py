"""Findings: what a user should know about data that could still be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One departure from what was expected.

    ``rule`` is a short id that ``toolkit explain`` knows, ``where`` names file, block, channel or
    record, ``message`` is one sentence with the numbers. A ``note`` informs and leaves the exit code at 0.
    """

    rule: str
    where: str
    message: str
    level: Level = "warning"

    def as_dict(self) -> dict[str, str]:
        """Return the finding as a JSON-ready dict."""
        return {"rule": self.rule, "where": self.where, "message": self.message, "level": self.level}
