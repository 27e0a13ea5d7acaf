"""The tables of docs/recordings.md: the answers, failures first, and the sources."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.recordings.answer import OUTCOMES, Answer
from benchmarks.recordings.catalogue import RECORDINGS


def table(answers: Iterable[Answer]) -> str:
    """Return the answers as a table, the worst first."""
    order = ("not run", *OUTCOMES)
    rows = sorted(answers, key=lambda a: order.index(a.outcome))
    kinds = {recording.name: recording for recording in RECORDINGS}
    lines = [
        "| recording | expected | answer | worth | errors on held-out rows | processor s |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        recording = kinds[row.recording]
        expected = " or ".join(f"`{name}`" for name in recording.names) or {
            "structure": "*unknown*", "control": "*nothing*",
        }.get(recording.kind, "")  # fmt: skip
        said = ", ".join([row.verdict, *(f"`{effect}`" for effect in row.effects)])
        if row.remaining == "unknown" and row.verdict != "unknown":
            said += "; more remains"
        if row.verdict and not row.complete:
            said += "; budget spent"
        cells = (
            row.recording,
            expected,
            row.remark or said,
            row.outcome,
            row.errors,
            f"{row.processor_s:.0f}" if row.verdict else "",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def sources() -> str:
    """Return what each recording is: what is missing, where it is published, licence and hashes."""
    parts = []
    for recording in RECORDINGS:
        files = "; ".join(f"`{name}` `{sha256}`" for name, sha256 in recording.files.items())
        parts += [
            f"### {recording.name}", "", f"- missing: {recording.missing}",
            f"- published at {recording.published_at}", f"- licence: {recording.licence}",
            f"- files and SHA-256: {files}", "",
        ]  # fmt: skip
    return "\n".join(parts)
