"""The log of the batches, one JSON object a line: written when a batch is drawn, completed when it is scored.

The hashes stand in the log, and the log in the repository, before the tool sees a case; a batch stands in it
once, and is never drawn again under the same line.
"""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path
from typing import Any


def read(path: Path) -> list[dict[str, Any]]:
    """Return the log's rows, oldest first; an absent file is an empty log."""
    return [json.loads(x) for x in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def drawn(path: Path, batch: dict[str, Any], changed: str) -> None:
    """Append a batch that was drawn and sealed, with what changed in the tool since the one before."""
    rows = read(path)
    if all(r["answers_sha256"] != batch["answers_sha256"] for r in rows):
        _write(
            path, [*rows, {"drawn": _today(), "cases": batch["cases"], **_hashes(batch), "changed": changed}]
        )


def scored(
    path: Path, batch: dict[str, Any], score: dict[str, Any], reasons: dict[str, str] | None = None
) -> list[dict[str, Any]]:
    """Complete a batch's row by its score and return the log; a score that stands is kept.

    `reasons`: bar -> why it is not met; a bar of another name is an error.
    """
    wrong = set(reasons or {}) - {b.title for b in score["bars"] if b.met is False}
    if wrong:
        raise ValueError(f"no bar that is not met is called {', '.join(sorted(wrong))}")
    drawn(path, batch, "")
    rows = read(path)
    for row in rows:
        if row["answers_sha256"] == batch["answers_sha256"] and "scored" not in row:
            bars = score["bars"]
            row["scored"] = _today()
            row["bars"] = f"{sum(b.met is True for b in bars)} of {len(bars)}"
            row["figures"] = {b.title: b.observed for b in bars}
        if row["answers_sha256"] == batch["answers_sha256"] and reasons:
            row["reasons"] = row.get("reasons", {}) | reasons
    _write(path, rows)
    return rows


def _today() -> str:
    return dt.datetime.now(tz=dt.UTC).date().isoformat()


def _hashes(batch: dict[str, Any]) -> dict[str, str]:
    return {k: batch[k] for k in ("answers_sha256", "data_sha256")}


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    path.write_text("".join(json.dumps(r) + "\n" for r in rows), encoding="utf-8")
