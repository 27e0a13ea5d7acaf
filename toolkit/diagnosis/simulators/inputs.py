"""Inputs of a differential equation between the rows of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Run


class Inputs:
    """Inputs between rows: linear, as a dict of floats."""

    def __init__(self, run: Run, names: Sequence[str]) -> None:
        self._t = run.t.tolist()
        self._columns = [(name, run.columns[name].tolist()) for name in names]
        self._at = 0
        self._last = len(self._t) - 1

    def __call__(self, t: float) -> dict[str, float]:
        """Return the inputs at a time."""
        if not self._columns:
            return {}
        times, i = self._t, self._at
        while i > 0 and t < times[i]:
            i -= 1
        while i < self._last - 1 and t >= times[i + 1]:
            i += 1
        self._at = i
        if self._last == 0:
            return self.row(0)
        w = (t - times[i]) / (times[i + 1] - times[i])
        w = 0.0 if w < 0 else (1.0 if w > 1 else w)
        return {name: (1 - w) * column[i] + w * column[i + 1] for name, column in self._columns}

    def row(self, k: int) -> dict[str, float]:
        """Return the inputs of a row."""
        return {name: column[k] for name, column in self._columns}
