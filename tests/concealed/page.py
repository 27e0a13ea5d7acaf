"""PROOF.md, and the page of the same content: one HTML file, no script, nothing beside it."""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from tests.concealed.content import Table, closing, intro, span, tables
from tests.concealed.proof_file import path_beside

_CHECK = """    python -m tests.concealed draw --cases 400 --out DIR    # seed: the operating system's
    python -m tests.concealed run --out DIR                 # resumable; answers stay sealed
    python -m tests.concealed score --out DIR --proof .     # opens, scores, writes this page
    python -m tests.concealed verify --out DIR              # cases and answers against their seal
    make proof                                              # all of these, and the log

`batch.json` holds the hashes, `sealed/answers.json` the answers with a salt of 256 bits and the seed; its
SHA-256 is the seal. This batch without its data stands in the repository:

    python -m tests.concealed verify --answers {small}
    python -m tests.concealed verify --answers {small} --out NEW

The first compares the opened answers with their seal and scores again what was answered; the second also
draws the data again from the opened seed and compares them with theirs (the batch names its generator and
libraries: {generator}). Only the tool's own answers cannot be had without running it: `run --out NEW`."""


def check(batch: dict[str, Any]) -> str:
    """Return how a reader draws, runs, scores and verifies."""
    small = path_beside(Path("tests/concealed/batches.jsonl"), batch).as_posix()
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


def curve(bins: list[dict[str, Any]], label: str) -> str:
    """Return a power curve as SVG: the rate and its exact interval in each bin."""
    width, height, left, bottom = 520, 260, 46, 44
    step = (width - left - 16) / max(len(bins), 1)
    y = lambda v: 12 + (1 - v) * (height - bottom - 12)  # noqa: E731
    parts = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{html.escape(label)}">']
    for v in (0.0, 0.5, 0.9, 1.0):
        parts.append(f'<line x1="{left}" x2="{width - 8}" y1="{y(v):.1f}" y2="{y(v):.1f}" class="grid"/>')
        parts.append(f'<text x="{left - 6}" y="{y(v) + 4:.1f}" class="end">{100 * v:.0f} %</text>')
    points = []
    for i, row in enumerate(bins):
        x, r = left + (i + 0.5) * step, row["rate"]
        parts.append(f'<text x="{x:.1f}" y="{height - 24}" class="mid">{html.escape(span(row))}</text>')
        if r.of:
            ends = f'y1="{y(r.low):.1f}" y2="{y(r.high):.1f}"'
            parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" {ends} class="bar"/>')
            parts.append(f'<circle cx="{x:.1f}" cy="{y(r.value):.1f}" r="4"/>')
            points.append(f"{x:.1f},{y(r.value):.1f}")
    parts.append(f'<polyline points="{" ".join(points)}"/>')
    parts.append(f'<text x="{width / 2:.0f}" y="{height - 6}" class="mid">{html.escape(label)}</text></svg>')
    return "".join(parts)


_STYLE = """
body { font: 15px/1.5 sans-serif; color: #1b1f24; background: #fff;
       max-width: 66em; margin: 2em auto; padding: 0 1em }
table { border-collapse: collapse; margin: .6em 0 1.6em }
td, th { border-bottom: 1px solid #d5d9de; padding: .3em .8em; text-align: left; vertical-align: top }
th { color: #57606a; font-weight: 600 }
code { font-size: .85em; overflow-wrap: anywhere }
svg { max-width: 36em; width: 100%; font-size: 11px; fill: #1b1f24; display: block }
svg circle { fill: #0b5cad }
svg polyline { fill: none; stroke: #0b5cad; stroke-width: 2 }
.bar { stroke: #0b5cad; stroke-width: 1.5 }
.grid { stroke: #e3e6ea }
.mid { text-anchor: middle }
.end { text-anchor: end }
.no { color: #b3261e; font-weight: 600 }
.yes { color: #1a7f37 }
.wide, pre { overflow-x: auto }
@media print { .wide, pre { overflow: visible; white-space: pre-wrap } table { font-size: .7em } }
"""


def _inline(text: str) -> str:
    """Return a sentence or cell as HTML: code in backticks, the state of a bar in its colour."""
    out = re.sub(r"`([^`]*)`", r"<code>\1</code>", html.escape(text))
    out = out.replace("**not met**", '<span class="no">not met</span>')
    return '<span class="yes">met</span>' if out == "met" else out


def _table(table: Table, chart: str) -> str:
    cells = "".join(f"<th>{html.escape(h)}</th>" for h in table.head)
    rows = "".join("<tr>" + "".join(f"<td>{_inline(c)}</td>" for c in row) + "</tr>" for row in table.rows)
    whole = f"<table><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table>"
    head = f"<h2>{html.escape(table.title)}</h2><p>{html.escape(table.sentence)}</p>"
    return f'{head}{chart}<div class="wide">{whole}</div>'


def page(score: dict[str, Any], batch: dict[str, Any]) -> str:
    """Return the proof as one HTML page."""
    body = ["<h1>Proof on concealed effects</h1>", *(f"<p>{_inline(s)}</p>" for s in intro(score, batch))]
    for table in tables(score):
        unit = "" if table.curve == "power by detectable" else " [noise sd]"
        chart = curve(score[table.curve], table.head[0] + unit) if table.curve else ""
        body.append(_table(table, chart))
    body += ["<h2>To check it</h2>", f"<pre>{html.escape(check(batch))}</pre>"]
    body += ["<h2>Not covered</h2>", *(f"<p>{_inline(s)}</p>" for s in closing())]
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    title = "<title>Proof on concealed effects</title>"
    start = f'<!doctype html><html lang="en"><head>{head}{title}<style>{_STYLE}</style></head><body>'
    return start + "".join(body) + "</body></html>\n"
