"""A case on disk: CASE.toml, its runs as CSV, its simulator; byte for byte the same for the same draw."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from proof.labview_cases import write_xlsx
from proof.model import Array, Run, Scenario

SESSIONS = "sessions"


def toml_value(x: Any) -> str:
    """Return a TOML value: text, number, list or inline table."""
    if isinstance(x, bool):
        return "true" if x else "false"
    if isinstance(x, str):
        return '"' + x.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(x, (int, float)):
        return repr(x)
    if isinstance(x, dict):
        return "{ " + ", ".join(f"{k} = {toml_value(v)}" for k, v in x.items()) + " }"
    return "[" + ", ".join(toml_value(v) for v in x) + "]"


def case_text(s: Scenario, *, order: dict[str, int]) -> str:
    """Return CASE.toml."""
    lines = ["schema = 1", f"title = {toml_value(s.title)}", "", "[simulation]"]
    lines += [f"{k} = {toml_value(v)}" for k, v in s.simulation.items()]
    if s.simulated:
        lines.append(f"simulated = {toml_value(dict(s.simulated))}")
    for p in () if s.kind == "columns" else s.parameters:
        if s.kind == "machine" and p.sd is None:
            continue
        lines += ["", f"[simulation.parameters.{p.name}]", f"value = {p.declared!r}", f'unit = "{p.unit}"']
        if p.sd is not None:
            lines.append(f"sd = {p.sd:.6g}")
    lines += ["", "[recording]"]
    lines += [] if s.timeless else ['time = "t"']
    if s.axes:
        lines.append(f"axes = {toml_value(s.axes)}")
    lines += ["", "[recording.channels]"]
    for name, c in s.channels.items():
        entry: dict[str, Any] = {"unit": c.unit, "role": c.role}
        if c.sd is not None:
            entry["sd"] = float(f"{c.sd:.4g}")
        lines.append(f"{name} = {toml_value(entry)}")
    for run in s.runs:
        lines += ["", "[[recording.run]]", f'file = "{run.name}"', f"order = {order[run.name]}"]
        lines += [f"{k} = {toml_value(v)}" for k, v in run.conditions.items()]
    for run in s.predict:
        lines += ["", "[[recording.predict]]", f'file = "{run.name}"']
        lines += [f"{k} = {toml_value(v)}" for k, v in run.conditions.items() if v != "forward"]
    return "\n".join(lines) + "\n"


def table(s: Scenario, run: Run, measured: dict[str, Array] | None) -> pd.DataFrame:
    """Return the rows of a run's file; without measured outputs, those of a file to predict."""
    df = s.inputs(run).round(7)
    df = df.drop(columns="t") if s.timeless else df
    if s.simulated:
        for output, y in s.nominal(df, run, s.declared_parameters()).items():
            df[s.simulated[output]] = y
    if measured and s.written:
        measured = s.written(measured)
    for name, y in (measured or {}).items():
        df[name] = y
    return df


def write_csv(df: pd.DataFrame, path: Path) -> None:
    """Write a run: ten significant digits, an empty cell for a missing sample; or the machine's columns."""
    if path.suffix == ".xlsx":
        write_xlsx(df, path)
        return
    df.to_csv(path, index=False, float_format="%.10g", lineterminator="\n")


def enter(sessions: list[Path], registry: Path, tool: list[str]) -> Path:
    """Enter sessions into a new registry by the public command, in order; return the last one's record.

    The command's exit may be 1 for findings; a registry's ledger has the time of day, its records have not.
    """
    path = registry
    for session in sessions:
        ran = subprocess.run(
            [*tool, "calibrate", str(session / "SESSION.toml"), "--json",
             "--calibrations", str(registry.resolve())],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if ran.returncode not in (0, 1):
            raise RuntimeError(f"no record of the session: {ran.stderr or ran.stdout}")
        path = Path(json.loads(ran.stdout)["record"]["path"])
    return path


def _records(sessions: tuple[Mapping[str, str], ...], folder: Path) -> None:
    """Write record.json and, where there are several sessions, the sessions in the case's folder."""
    with tempfile.TemporaryDirectory() as place:
        made = []
        for i, session in enumerate(sessions):
            made.append(Path(place) / f"session{i + 1}")
            made[-1].mkdir()
            for name, text in session.items():
                (made[-1] / name).write_text(text, encoding="utf-8")
        tool = [str(Path(sys.executable).with_name("toolkit"))]
        shutil.copyfile(enter(made, Path(place) / "registry", tool), folder / "record.json")
        if len(made) > 1:
            for path in made:
                shutil.copytree(path, folder / SESSIONS / path.name)


def write_case(s: Scenario, measured: list[dict[str, Array]], folder: Path) -> None:
    """Write the case into a new folder."""
    folder.mkdir(parents=True)
    for name, text in s.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    if s.sessions:
        _records(s.sessions, folder)
    for run, y in zip(s.runs, measured, strict=True):
        write_csv(table(s, run, y), folder / run.name)
    for run in s.predict:
        write_csv(table(s, run, None), folder / run.name)
    order = {run.name: i + 1 for i, run in enumerate(s.runs)}
    (folder / "CASE.toml").write_text(case_text(s, order=order), encoding="utf-8")


def sha256_of_tree(folder: Path) -> str:
    """Return one hash of all files below the folder: their relative paths and contents, sorted."""
    total = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix().encode()
        total.update(len(name).to_bytes(4, "big") + name + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def missing(y: Array, share: float, rng: np.random.Generator) -> Array:
    """Return the samples with a share of them lost."""
    return np.where(rng.random(y.size) < share, np.nan, y)
