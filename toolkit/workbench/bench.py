"""What the pages share: the home, its registry, and answers that hold until the registry changes."""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from toolkit.calibration.registry.clock import today

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.workbench.guard import Keys

Answer = TypeVar("Answer")
_MOST_ANSWERS = 64


class Bench:
    """The workbench of one home. Answers that cost seconds are remembered by what they rest on."""

    def __init__(self, home: Path, registry: Registry, keys: Keys) -> None:
        self.home, self.registry, self.keys = home, registry, keys
        self._answers: dict[tuple[object, ...], object] = {}
        self._asked: dict[tuple[str, str | None], threading.Lock] = {}

    @property
    def today(self) -> dt.date:
        """The day by which things are due."""
        return today()

    def remembered(self, question: str, instrument: str | None, ask: Callable[[], Answer]) -> Answer:
        """Return an answer about an instrument's records (None: all), asked again when a byte changed.

        Who asks the same meanwhile waits for that answer; who asks something else does not.
        """
        names = self.registry.instruments() if instrument is None else (instrument,)
        with self._asked.setdefault((question, instrument), threading.Lock()):
            state = tuple((name, self.registry.digest(name)) for name in names)
            key = (question, instrument, self.today, state)
            if key not in self._answers:
                answer = ask()
                while len(self._answers) >= _MOST_ANSWERS:
                    self._answers.pop(next(iter(self._answers)), None)
                self._answers[key] = answer
                return answer
            return self._answers[key]  # type: ignore[return-value]
