"""The diagnosis on a set: its text-book model on the training records, the test part predicted."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.command import answer_of, entry
from benchmarks.records import PublicSet, Record, Split

CASES = Path(__file__).parent / "cases"
STAGES = ("nominal", "refitted", "augmented")
_REFIT = "refit of the nominal parameters"  # as the answer names the step


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the diagnosis said of a set, and the errors of its three simulations on the test part.

    ``refitted`` is false where the budget was spent before the parameters had been fitted;
    ``processor_s`` [s] counts the processes that have ended by themselves.
    """

    verdict: str
    remaining: str
    complete: bool
    refitted: bool
    effects: tuple[str, ...]
    errors: dict[str, tuple[float, ...]]
    processor_s: float

    def names(self, wanted: tuple[str, ...]) -> bool:
        """Tell whether one of the names stands alone or in a class."""
        return any(name in entry.split(" = ") for name in wanted for entry in self.effects)


def write_case(public: PublicSet, split: Split, folder: Path) -> Path:
    """Write a set's case: its text-book files, a run for each training record, inputs of each test record."""
    shutil.copytree(
        CASES / public.name, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__")
    )
    lines = [(folder / "CASE.toml").read_text(encoding="utf-8").rstrip()]
    for kind, records in (("run", split.train), ("predict", split.test)):
        for record in records:
            file = f"{kind}_{record.name}.csv"
            _write(record, folder / file, outputs=kind == "run")
            start = "" if record.lead_in else _start(record)
            lines += ["", f"[[recording.{kind}]]", f'file = "{file}"', *([start] if start else [])]
    (folder / "CASE.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "CASE.toml"


def _start(record: Record) -> str:
    """Return output and rate at the first row of a test record as conditions of its run."""
    if not record.warm_up:
        return ""
    value, rate = record.start()
    return f"y0 = {value!r}\nrate0 = {rate!r}"


def _write(record: Record, path: Path, *, outputs: bool) -> None:
    table = {"t": record.t, "u": record.u, **({"y": record.y} if outputs else {})}
    pd.DataFrame(table).to_csv(path, index=False, float_format="%.12g")


def diagnose(public: PublicSet, split: Split, folder: Path, *, budget_s: float) -> Answer:
    """Return the answer of ``toolkit diagnose`` on a set; the test's outputs are read after it has answered.

    Raises
    ------
    ToolkitError : where the command ends with an error
    """
    case, out = write_case(public, split, folder / "case"), folder / "answer"
    answer, processor_s = answer_of(case, out, budget_s=budget_s)
    return Answer(
        verdict=answer["verdict"], remaining=answer["remaining"], complete=bool(answer["complete"]),
        refitted=_REFIT not in answer["skipped"],
        effects=tuple(entry(effect) for effect in answer["effects"]), errors=_errors(public, split, out),
        processor_s=processor_s,
    )  # fmt: skip


def _errors(public: PublicSet, split: Split, out: Path) -> dict[str, tuple[float, ...]]:
    """Return the errors of the predictions in the set's unit; a stage that was not reached has none."""
    tables = []
    for record in split.test:
        path = out / "predictions" / f"predict_{record.name}.csv"
        tables.append(pd.read_csv(path) if path.is_file() else None)
    errors: dict[str, tuple[float, ...]] = {}
    for stage in STAGES:
        columns = [None if table is None else table.get(f"y_{stage}") for table in tables]
        errors[stage] = tuple(
            float("nan")
            if column is None
            else public.scale * record.error_of(np.asarray(column, dtype=np.float64))
            for column, record in zip(columns, split.test, strict=True)
        )
    return errors
