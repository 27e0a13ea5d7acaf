"""The rows of a run, as JSON and as the tables of docs/benchmarks.md."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from benchmarks.records import PublicSet

NOT_RUN = "not run"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One method on one set: its errors on the test records in the set's unit, or why it was not run."""

    method: str
    errors: tuple[float, ...] = ()
    remark: str = ""
    why_not: str = ""
    processor_s: float | None = None

    def cells(self) -> list[str]:
        """Return method, errors, processor time and remark as text."""
        shown = " / ".join(map(number, self.errors)) if not self.why_not else NOT_RUN
        seconds = "" if self.processor_s is None else f"{self.processor_s:.0f}"
        return [self.method, shown, seconds, self.why_not or self.remark]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The rows of one set."""

    public: PublicSet
    rows: Sequence[Row] = field(default_factory=tuple)

    def document(self) -> dict[str, object]:
        """Return the rows as a JSON-ready dict; an error that is no number is null."""
        return {
            "set": self.public.name,
            "unit": self.public.unit,
            "aims": list(self.public.aims),
            "rows": [
                {
                    "method": row.method,
                    "errors": [value if math.isfinite(value) else None for value in row.errors],
                    "run": not row.why_not,
                    "remark": row.why_not or row.remark,
                    "processor_s": row.processor_s,
                }
                for row in self.rows
            ],
            "published": [
                {"who": f.who, "errors": list(f.errors), "source": f.source} for f in self.public.figures
            ],
        }

    def markdown(self) -> str:
        """Return the section of the set: where it is published, its hashes, and the table."""
        public = self.public
        files = "; ".join(f"`{name}` `{sha256}`" for name, sha256 in public.files.items())
        aims = " / ".join("none" if aim is None else number(aim) for aim in public.aims)
        head = [
            f"## {public.title}",
            "",
            f"- published at <{public.published_at}>",
            f"- files and SHA-256: {files}",
            f"- licence: {public.licence}",
        ]
        if public.missing:
            head.append(f"- left out of the text-book model: `{'` or `'.join(public.missing)}`")
        if aims:
            head.append(f"- aim: {aims} {public.unit}")
        table = ["", f"| method | error [{public.unit}] | processor s | remark |", "|---|---|---|---|"]
        rows = [row.cells() for row in self.rows]
        for figure in public.figures:
            errors = " / ".join("" if error is None else number(error) for error in figure.errors)
            rows.append([f"{figure.who} (published)", errors, "", figure.source])
        table += ["| " + " | ".join(cells) + " |" for cells in rows]
        return "\n".join([*head, *table, ""])


def number(value: float) -> str:
    """Return three digits; a simulation that ran away is *diverged*, one that is absent a dash.

    >>> number(0.39611), number(14200.0), number(float("inf")), number(float("nan"))
    ('0.396', '14200', 'diverged', '-')
    """
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "diverged"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def page(reports: Iterable[Report]) -> str:
    """Return the sections of all sets."""
    return "\n".join(report.markdown() for report in reports)
