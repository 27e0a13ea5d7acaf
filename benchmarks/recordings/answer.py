"""The case that a recording is written as, and what the tool's answer on it is worth."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.command import answer_of, entry
from benchmarks.recordings.recording import Recording, Run

CASES = Path(__file__).parent / "cases"
# From the worst: the order of the table.
OUTCOMES = ("failed", "false name", "nothing said", "not named", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """One line of the table: the verdict, what it is worth, and the errors on rows that no fit has seen."""

    recording: str
    outcome: str
    verdict: str
    effects: tuple[str, ...] = ()
    remaining: str = ""
    complete: bool = False
    errors: str = ""
    processor_s: float = 0.0
    remark: str = ""
    laws: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return the answer as a JSON-ready dict."""
        return asdict(self)


def write_case(recording: Recording, runs: Sequence[Run], folder: Path) -> Path:
    """Write a recording's case: its text-book files and a table for each run."""
    shutil.copytree(
        CASES / recording.name, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__")
    )
    lines = [(folder / "CASE.toml").read_text(encoding="utf-8").rstrip()]
    for run in runs:
        file = f"{run.name}.csv"
        run.table.to_csv(folder / file, index=False, float_format="%.12g")
        conditions = [f"{key} = {value!r}" for key, value in run.conditions.items()]
        lines += ["", "[[recording.run]]", f'file = "{file}"', *conditions]
    (folder / "CASE.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "CASE.toml"


def outcome(recording: Recording, verdict: str, effects: Sequence[str]) -> str:
    """Return what an answer is worth, one of `OUTCOMES`.

    A name is right where it stands alone or in a class; another name beside a right one is shown by the
    table and not judged here. Structure that no effect of the catalogue is must stay *unknown*.
    """
    if verdict in ("named", "equivalent"):
        wanted = {name for group in effects for name in group.split(" = ")} & set(recording.names)
        return "right" if wanted else "false name"
    if recording.kind == "control":
        return "right" if verdict == "nothing" else "not named"
    if verdict == "unknown":
        return "right" if recording.kind == "structure" else "not named"
    return "nothing said"


def diagnose(recording: Recording, runs: Sequence[Run], folder: Path, *, budget_s: float) -> Answer:
    """Return the judged answer of ``toolkit diagnose`` on a recording.

    Raises
    ------
    ToolkitError : where the command ends with an error
    """
    case = write_case(recording, runs, folder / "case")
    document, processor_s = answer_of(case, folder / "answer", budget_s=budget_s)
    effects = tuple(entry(effect) for effect in document["effects"])
    return Answer(
        recording=recording.name, outcome=outcome(recording, document["verdict"], effects),
        verdict=document["verdict"], effects=effects, remaining=document["remaining"],
        complete=bool(document["complete"]), processor_s=processor_s,
        laws=tuple(_law(law) for law in document["laws"]),
        errors="; ".join(_errors(row) for row in document["fit"]["held_out"]),
    )  # fmt: skip


def _law(law: dict[str, Any]) -> str:
    """Return a law in one line: where, what, and the share that it takes."""
    what = law["formula"] or f"a curve of {' and '.join(law['variables'])}"
    share = 100 * law["evidence"]["share_of_gap"]
    return f"{law['place']['channel']} {law['acts']} {what}: {share:.0f} %"


def _errors(row: dict[str, Any]) -> str:
    """Return the three errors of an output on held-out rows, with its floor of noise."""
    keys = ("nominal_rmse", "refitted_rmse", "augmented_rmse", "noise_floor")
    nominal, refitted, augmented, floor = ("-" if row.get(k) is None else f"{row[k]:.3g}" for k in keys)
    lawful = "" if row.get("with_laws_rmse") is None else f", with laws {row['with_laws_rmse']:.3g}"
    return f"{nominal}, {refitted}, {augmented}{lawful} ({floor}) {row['unit']}"
