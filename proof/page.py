"""PROOF.md, and the page of the same content: one HTML file, no script, nothing beside it.

It reads what was scored, and takes the page kit from the toolkit: no part of what draws, runs or judges cases
imports this module.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from proof.content import Table, closing, intro, span, tables
from proof.proof_file import path_beside
from toolkit.report.audit.svg import Drawing
from toolkit.report.pages import kit

_CHECK = """    python -m proof draw --cases 400 --out DIR              # seed: the operating system's
    python -m proof run --out DIR                           # resumable; answers stay sealed
    python -m proof score --out DIR --proof docs/proof      # opens, scores, writes this page
    python -m proof verify --out DIR                        # cases and answers against their seal
    make proof                                              # all of these, and the log

`batch.json` holds the hashes, `sealed/answers.json` the answers with a salt of 256 bits and the seed; its
SHA-256 is the seal. This batch without its data stands in the repository:

    python -m proof verify --answers {small}
    python -m proof verify --answers {small} --out NEW

The first compares the opened answers with their seal and scores again what was answered; the second also
draws the data again from the opened seed and compares them with theirs (the batch names its generator and
libraries: {generator}). Only the tool's own answers cannot be had without running it: `run --out NEW`."""


def check(batch: dict[str, Any]) -> str:
    """Return how a reader draws, runs, scores and verifies."""
    small = path_beside(Path("proof/batches.jsonl"), batch).as_posix()
    versions = ", ".join(f"{k} {v}" for k, v in batch.get("versions", {}).items())
    generator = f"sources {batch.get('generator_sha256', 'not stated')[:16]}"
    return _CHECK.format(small=small, generator=f"{generator}, {versions}" if versions else generator)


def markdown(score: dict[str, Any], batch: dict[str, Any]) -> str:
    """Return PROOF.md."""
    lines = ["# Proof on concealed effects", ""]
    for sentence in intro(score, batch):
        lines += [sentence, ""]
    for table in tables(score):
        lines += [f"## {table.title}", "", table.sentence, ""]
        lines += ["| " + " | ".join(table.head) + " |", "|" + "---|" * len(table.head)]
        lines += ["| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in table.rows]
        lines.append("")
    lines += ["## To check it", "", check(batch), "", "## Not covered", ""]
    for sentence in closing():
        lines += [sentence, ""]
    return "\n".join(lines)


def curve(bins: Sequence[dict[str, Any]], label: str) -> Markup:
    """Return a power curve as SVG: the rate and its exact interval in each bin."""
    width, height, left, bottom = 520, 260, 46, 44
    step = (width - left - 16) / max(len(bins), 1)

    def y(rate: float) -> float:
        return 12 + (1 - rate) * (height - bottom - 12)

    drawing = Drawing(width=width, height=height, label=label)
    for level in (0.0, 0.5, 0.9, 1.0):
        drawing.line((left, y(level)), (width - 8, y(level)), "grid")
        drawing.text((left - 6, y(level) + 4), "end", f"{100 * level:.0f} %")
    points = []
    for i, row in enumerate(bins):
        x, rate = left + (i + 0.5) * step, row["rate"]
        drawing.text((x, height - 24), "middle", span(row))
        if rate.of:
            drawing.line((x, y(rate.low)), (x, y(rate.high)), "bar")
            drawing.dot((x, y(rate.value)), 4, "")
            points.append((x, y(rate.value)))
    drawing.polyline(points, "")
    drawing.text((width / 2, height - 6), "middle", label)
    return drawing.markup()


def page(score: dict[str, Any], batch: dict[str, Any]) -> str:
    """Return the proof as one HTML page."""
    return "".join(
        kit.page_parts(
            Path(__file__).parent,
            intro=intro(score, batch),
            sections=list(_sections(score)),
            check=check(batch),
            closing=closing(),
            spans=spans,
        )
    )


def spans(text: str) -> list[tuple[str, str]]:
    """Return a sentence or cell in parts, each with its kind: text, code (in backticks), met or not met."""
    if text == "met":
        return [("met", text)]
    parts = re.split(r"(`[^`]*`|\*\*not met\*\*)", text)
    kinds = {"`": "code", "*": "not met"}
    return [(kinds[part[0]], part.strip("`*")) if i % 2 else ("text", part) for i, part in enumerate(parts)]


def _sections(score: dict[str, Any]) -> Iterator[tuple[Table, Markup | None, kit.Table]]:
    """Yield each table of the proof, the curve that stands beside it, and its columns and rows."""
    for section in tables(score):
        unit = "" if section.curve == "power by detectable" else " [noise sd]"
        chart = curve(score[section.curve], section.head[0] + unit) if section.curve else None
        yield section, chart, kit.table(section.head, section.rows)
