"""The real layer: each public recording made into a case, run, and its answer against what is known."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from proof.judge import sets_of
from proof.real_cases import CASES, RealCase
from proof.running import run_case


def right(case: RealCase, verdict: str, reported: tuple[frozenset[str], ...]) -> bool:
    """Return whether one of the wanted sets was reported whole, and nothing else that is not optional."""
    if not reported:
        return () in case.wanted and verdict in ("nothing", "untestable")
    for wanted in case.wanted:
        rest = [r for r in reported if not any(name in r for name in (*wanted, *case.optional))]
        if wanted and not rest and all(any(name in r for r in reported) for name in wanted):
            return True
    return False


def sized(case: RealCase, answer: dict[str, Any]) -> bool:
    """Return whether every published size is that of a reported effect, by its name or its class."""
    for name, size, share in case.sizes:
        values = [
            abs(float(effect["parameters"][0]["value"]))
            for effect in answer.get("effects") or []
            if name in (effect["name"], *effect.get("equivalent_to", ())) and effect.get("parameters")
        ]
        if not any(abs(value - size) <= share * size for value in values):
            return False
    return True


def _error(case: RealCase, answer: dict[str, Any], folder: Path, data: Path) -> str:
    """Return the held-out error before and after in words."""
    if case.score_on and case.truth:
        found = pd.read_csv(folder / "predictions" / case.score_on)
        words = []
        for channel, y in case.truth(data).items():
            for which in ("refitted", "augmented"):
                wrong = float(np.linalg.norm(found[f"{channel}_{which}"].to_numpy() - y) / np.linalg.norm(y))
                words.append(f"{which} {100 * wrong:.1f} %")
        return f"{case.score_on}: " + ", ".join(words)
    rows = answer.get("fit", {}).get("held_out", [])
    return "; ".join(
        f"{r['channel']} {r['refitted_rmse']:.3g} to {r['augmented_rmse']:.3g} {r['unit']}"
        for r in rows
        if r.get("refitted_rmse") is not None and r.get("augmented_rmse") is not None
    )


def _row(
    case: RealCase, answer: dict[str, Any] | None, ran: dict[str, Any], folder: Path, data: Path
) -> dict[str, Any]:
    asked = " or ".join("+".join(w) if w else "nothing" for w in case.wanted)
    row = {"case": case.name, "title": case.title, "asked": asked, "published": case.published, "error": ""}
    if answer is None:
        return row | {"answered": f"no answer (exit {ran['exit']})", "right": "no"}
    reported = sets_of(answer)
    names = ", ".join(" or ".join(sorted(r)) for r in reported)
    try:
        row["error"] = _error(case, answer, folder, data)
    except (OSError, KeyError, ValueError) as error:
        row["error"] = f"not given ({type(error).__name__})"
    verdict = str(answer["verdict"])
    row["answered"] = f"{verdict}: {names}" if names else verdict
    row["right"] = "yes" if right(case, verdict, reported) and sized(case, answer) else "no"
    return row


def run_real(
    data: Path, out: Path, *, tool: list[str], budget: float, progress: Callable[[str], None] = lambda _: None
) -> list[dict[str, Any]]:
    """Make and run every case whose recording is there; write real.json and return its rows."""
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for case in CASES:
        progress(case.name)
        if not (data / case.folder).is_dir():
            reason = f"{case.folder} is not in the data's folder"
            rows.append({
                "case": case.name, "title": case.title, "asked": "", "right": "", "error": "",
                "answered": f"skipped: {reason}", "published": case.published,
            })  # fmt: skip
            continue
        folder = out / "cases" / case.name
        if not (folder / "CASE.toml").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            case.make(data, folder)
        ran = run_case(folder, out / "runs" / case.name, tool, budget)
        path = out / "runs" / case.name / "answer"
        try:
            answer = json.loads((path / "diagnosis.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            answer = None
        rows.append(_row(case, answer, ran, path, data))
    (out / "real.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return rows
