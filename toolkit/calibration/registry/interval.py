"""A recall interval: how long after its session's date an instrument is due again."""

from __future__ import annotations

import calendar
import datetime as dt
import re
from dataclasses import dataclass

from toolkit.errors import RegistryError

_TEXT = re.compile(r"\s*(?P<count>[1-9][0-9]{0,3})\s*(?P<unit>day|week|month|year)s?\s*\Z", re.IGNORECASE)
_MOST = {"day": 18263, "week": 2609, "month": 600, "year": 50}


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A number of days, weeks, months or years by the calendar; its text is the ledger's."""

    count: int
    unit: str

    def __str__(self) -> str:
        return f"{self.count} {self.unit}" + ("" if self.count == 1 else "s")

    def after(self, day: dt.date) -> dt.date:
        """Return the day that lies this interval after another; a month's last day stays one.

        >>> Interval(count=1, unit="month").after(dt.date(2024, 1, 31))
        datetime.date(2024, 2, 29)
        """
        if self.unit in ("day", "week"):
            return day + dt.timedelta(days=self.count * (7 if self.unit == "week" else 1))
        months = day.year * 12 + day.month - 1 + self.count * (12 if self.unit == "year" else 1)
        year, month = divmod(months, 12)
        return dt.date(year, month + 1, min(day.day, calendar.monthrange(year, month + 1)[1]))


def parse_interval(text: str) -> Interval:
    """Read an interval.

    >>> str(parse_interval("12 Months"))
    '12 months'

    Raises
    ------
    RegistryError
        ``recall``: not a whole number of days, weeks, months or years, or more than 50 years
    """
    match = _TEXT.match(text)
    found = None if match is None else Interval(count=int(match["count"]), unit=match["unit"].lower())
    if found is None or found.count > _MOST[found.unit]:
        raise RegistryError(
            "the recall interval cannot be used",
            where="--recall",
            got=text,
            expected='a whole number of days, weeks, months or years up to 50 years, such as "12 months"',
            next_step="nothing was changed; write the interval again",
            rule="recall",
        )
    return found
