"""Pictures of an audit as SVG: the timeline of the versions, and the rows of a file, old and new."""

from __future__ import annotations

import datetime as dt
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from toolkit.audit.timeline import Stretch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.audit.timeline import Timeline

COLOURS = {
    "exact": "#2e7d32", "rounding": "#7cb342", "undated": "#78909c", "stale": "#ef8e19",
    "sign_variant": "#c62828", "column_swap": "#8e24aa", "ambiguous": "#5c6bc0", "unknown": "#37474f",
    "unreadable": "#9e9e9e",
}  # fmt: skip
_MOST_POINTS = 600


def timeline(lines: Timeline) -> str:
    """Return when each record was in force, and the files that it computed: a lane a record or grade."""
    counts, first, last = lines.counts, lines.first, lines.last
    others = sorted({who for who, _, _ in counts} - {one.record for one in lines.stretches})
    rows = [*lines.stretches, *(Stretch(record=who, begin=None, end=None) for who in others)]
    left, right, top, height = 130, 20, 14, 24
    width = 1040
    days = max((last - first).days, 1)

    def x(day: dt.date) -> float:
        inside = min(max((day - first).days, 0), days)
        return left + inside / days * (width - left - right)

    bottom = top + height * len(rows)
    parts = [_frame(width, bottom + 30, "timeline of the calibrations")]
    step = max(1, -(-(last.year - first.year + 1) // 14))
    for year in range(first.year, last.year + 2, step):
        day = dt.date(year, 1, 1)
        if first <= day <= last:
            parts.append(f'<line x1="{x(day):.1f}" y1="{top}" x2="{x(day):.1f}" y2="{bottom}" class="grid"/>')
            parts.append(f'<text x="{x(day):.1f}" y="{bottom + 16}" class="tick">{year}</text>')
    for number, lane in enumerate(rows):
        y = top + height * number + height / 2
        parts.append(f'<text x="{left - 8}" y="{y + 4:.1f}" class="name">{escape(lane.record)}</text>')
        parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{width - right}" y2="{y:.1f}" class="grid"/>')
        if lane.begin is not None:
            a, b = x(lane.begin), x(lane.end or last)
            kind = "void" if lane.void else "force"
            parts.append(
                f'<rect x="{a:.1f}" y="{y - 8:.1f}" width="{max(b - a, 1):.1f}" height="16" class="{kind}">'
                f"<title>{escape(lane.record)} {'void' if lane.void else 'in force'} from {lane.begin}"
                f"{' to ' + str(lane.end) if lane.end else ''}</title></rect>"
            )
    places = {one.record: number for number, one in enumerate(rows)}
    for (who, month, grade), count in sorted(counts.items(), key=lambda pair: (-pair[1], pair[0])):
        y = top + height * places[who] + height / 2
        day = dt.date.fromisoformat(month + "-15")
        size = min(2.0 + count**0.5, 9.0)
        parts.append(
            f'<circle cx="{x(day):.1f}" cy="{y:.1f}" r="{size:.1f}" fill="{COLOURS[grade]}" class="dot">'
            f"<title>{month}: {count} {escape(grade)}, {escape(who)}</title></circle>"
        )
    return "".join([*parts, "</svg>"])


def rows_of(
    load: str, unit: str, old: NDArray[np.float64], new: NDArray[np.float64], *, width: int = 500
) -> str:
    """Return one load of a file against its rows, as the file has it and by the record in force."""
    left, right, top, height = 62, 10, 10, 150
    low = float(min(old.min(), new.min()))
    high = float(max(old.max(), new.max()))
    if high <= low:
        low, high = low - 1.0, high + 1.0
    pad = 0.06 * (high - low)
    low, high = low - pad, high + pad
    some = np.unique(np.linspace(0, len(old) - 1, min(len(old), _MOST_POINTS)).round().astype(int))
    span = max(len(old) - 1, 1)

    def y(value: float) -> float:
        return top + (high - value) / (high - low) * height

    parts = [_frame(width, top + height + 34, f"{load} by row")]
    for value in _ticks(low, high):
        at = f"{y(value):.1f}"
        parts.append(f'<line x1="{left}" y1="{at}" x2="{width - right}" y2="{at}" class="grid"/>')
        parts.append(f'<text x="{left - 6}" y="{y(value) + 4:.1f}" class="name">{value:g}</text>')
    for values, kind, stroke in ((old, "file", 2.6), (new, "right", 1.3)):  # both are seen where they agree
        points = " ".join(
            f"{left + i / span * (width - left - right):.1f},{y(float(values[i])):.1f}" for i in some.tolist()
        )
        parts.append(f'<polyline points="{points}" class="{kind}" fill="none" stroke-width="{stroke}"/>')
    foot = top + height + 26
    parts.append(f'<text x="{left}" y="{foot}" class="left">row 1 to {len(old)}; {load} [{unit}]</text>')
    parts.append(f'<text x="{width - right}" y="{foot}" class="name"><tspan class="file">file</tspan> \u2003'
                 f'<tspan class="right">record in force</tspan></text>')  # fmt: skip
    return "".join([*parts, "</svg>"])


def _frame(width: int, height: float, title: str) -> str:
    return (
        f'<svg viewBox="0 0 {width} {height:.0f}" width="{width}" height="{height:.0f}" role="img" '
        f'aria-label="{escape(title)}" xmlns="http://www.w3.org/2000/svg">'
    )


def _ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(power * min((m for m in (1, 2, 5, 10) if m * power >= rough), default=10))
    first = float(np.ceil(low / step) * step)
    return [round(first + i * step, 10) for i in range(int((high - first) / step + 1e-9) + 1)]
