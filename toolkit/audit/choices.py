"""What the registry offers for a file: asked once an instrument, and once a stretch of days.

Which record is in force changes only on the days that the ledger names, so an archive of thousands of test
dates asks for a few of them.
"""

from __future__ import annotations

import bisect
import datetime as dt
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from toolkit.audit.inspection import Choice, choose
from toolkit.audit.screen import Screen, Signature, layout, screen_of
from toolkit.errors import RegistryError

if TYPE_CHECKING:
    from toolkit.audit.model import Columns
    from toolkit.calibration.registry.registry import Registry


@dataclass(slots=True, kw_only=True, eq=False)
class Choices:
    """The registry as known on a day, remembered as far as it was asked."""

    registry: Registry
    known_at: dt.date | None
    _edges: dict[str, tuple[dt.date, ...]] = field(default_factory=dict)
    _made: dict[tuple[str, int | None], Choice] = field(default_factory=dict)
    _screens: dict[tuple[str, Signature], Screen] = field(default_factory=dict)

    def on(self, instrument: str, day: dt.date | None) -> Choice:
        """Return what the registry offers for an instrument and a day; None: a test without a date."""
        edges = self.days(instrument)
        key = (instrument, None if day is None else bisect.bisect_right(edges, day))
        if key not in self._made:
            first = self._made.get((instrument, None))
            if first is None:
                first = choose(self.registry, instrument, on=None, known_at=self.known_at)
                self._made[instrument, None] = first
            if day is not None:
                self._made[key] = choose(
                    self.registry, instrument, on=day, known_at=self.known_at, offered=first
                )
        return self._made[key]

    def screen(self, instrument: str, columns: Columns) -> Screen:
        """Return the screen of an instrument's records for files of a layout."""
        key = (instrument, layout(columns))
        if key not in self._screens:
            self._screens[key] = screen_of(self.on(instrument, None).records, columns)
        return self._screens[key]

    def days(self, instrument: str) -> tuple[dt.date, ...]:
        """Return the days on which the record in force may change."""
        if instrument not in self._edges:
            try:
                entries = self.registry.ledger(instrument).entries
            except RegistryError:
                entries = ()
            since_days = {entry.since for entry in entries if entry.since is not None}
            self._edges[instrument] = tuple(sorted(since_days))
        return self._edges[instrument]
