"""How far a command is, for who cannot see its terminal: a small file that is replaced as it goes on.

``TOOLKIT_PROGRESS`` in the environment names the file; a job of the workbench sets it.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.errors import OutputError
from toolkit.files import write_atomic
from toolkit.inputs import RESULT_FILE, read_regular

VARIABLE = "TOOLKIT_PROGRESS"
LEVEL = "level"
"""Name of the file beside the note that holds the gravest level of the command's findings."""
_SECONDS = 0.5  # between two notes: a note is written to the disk


@dataclass(slots=True)
class ProgressNote:
    """A note of one stage: steps done, of how many (None where nobody knows), and what was done last."""

    path: Path
    title: str
    total: int | None
    done: int = 0
    _written: float = field(default=0.0)

    def step(self, text: str) -> None:
        """Count a step; the note is written twice a second at most. A disk that is full stops no work."""
        self.done += 1
        now = time.monotonic()
        if now - self._written < _SECONDS and self.done != self.total:
            return
        self._written = now
        note = {"title": self.title, "done": self.done, "total": self.total, "text": text}
        try:
            write_atomic(self.path, json.dumps(note))
        except OSError:
            return


def note_of(title: str, total: int | None) -> ProgressNote | None:
    """Return the note of a stage; None where nobody asked for one."""
    path = os.environ.get(VARIABLE)
    return None if not path else ProgressNote(path=Path(path), title=title, total=total)


def note_level(levels: Iterable[str]) -> None:
    """Note the gravest level of a command's findings where somebody asked for notes."""
    path = os.environ.get(VARIABLE)
    gravest = next((level for level in ("error", "warning") if level in set(levels)), None)
    if path and gravest is not None:
        with contextlib.suppress(OSError, OutputError):
            write_atomic(Path(path).with_name(LEVEL), gravest)


def read_note(path: Path) -> dict[str, Any] | None:
    """Return what was noted last; None where nothing was yet."""
    try:
        note = json.loads(read_regular(path, RESULT_FILE))
        return {
            "title": str(note["title"]), "done": int(note["done"]), "text": str(note["text"]),
            "total": None if note["total"] is None else int(note["total"]),
        }  # fmt: skip
    except (OSError, ValueError, TypeError, KeyError):
        return None
