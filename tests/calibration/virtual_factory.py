"""The packaged session of the virtual M-15, written again with something changed in both of its files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.approval import Decision, approve
from toolkit.calibration.registry.candidate import Candidate
from toolkit.calibration.registry.registry import Registry

PACKAGED = Path(__file__).resolve().parents[2] / "calibrations" / "m15-virtual"
DAY = "2026-11-01"  # of the new session; the packaged record is of 2026-03-02
Change = Callable[[str], str]


def columns(**factors: float) -> Change:
    """Return a change that multiplies columns, their headers as they are."""

    def change(text: str) -> str:
        header, *rows = text.strip().split("\n")
        names = [re.match(r"\w+", cell)[0] for cell in header.split(",")]  # type: ignore[index]
        out = [header]
        for row in rows:
            cells = row.split(",")
            for name, factor in factors.items():
                at = names.index(name)
                cells[at] = repr(factor * float(cells[at]))
            out.append(",".join(cells))
        return "\n".join(out) + "\n"

    return change


def shifted(name: str, by: float) -> Change:
    """Return a change that adds a constant to a column."""

    def change(text: str) -> str:
        header, *rows = text.strip().split("\n")
        at = [re.match(r"\w+", cell)[0] for cell in header.split(",")].index(name)  # type: ignore[index]
        cells = [row.split(",") for row in rows]
        for row in cells:
            row[at] = repr(by + float(row[at]))
        return "\n".join([header, *(",".join(row) for row in cells)]) + "\n"

    return change


def write_virtual(folder: Path, *changes: Change, session: Change = str) -> Path:
    """Write the packaged session, its files changed and its text too."""
    folder.mkdir(parents=True)
    for name in ("loads", "check"):
        text = (PACKAGED / f"m15-virtual-r1.{name}.csv").read_text()
        for change in changes:
            text = change(text)
        (folder / f"{name}.csv").write_text(text)
    text = (PACKAGED / "m15-virtual-r1.session.toml").read_text()
    for name in ("loads", "check"):
        text = text.replace(f"{name}_simulated.csv", f"{name}.csv")
    (folder / "SESSION.toml").write_text(session(text.replace("2026-03-02", DAY)))
    return folder / "SESSION.toml"


def judged(
    registry: Registry, path: Path, *, reason: str | None = None, polarity: Path | None = None
) -> tuple[Candidate, Decision]:
    """Return the candidate of a session and what its approval comes to."""
    import datetime as dt

    made = calibrate(path, registry)
    day = dt.date.fromisoformat(made.record.date)
    decision = approve(
        registry, made.record.id, in_force_from=day, checked_by="Z", reason=reason, polarity=polarity
    )
    return made, decision


def rules(made: Candidate, *levels: str) -> set[str]:
    """Return the rules of a candidate's findings; without levels, of those that ask for attention."""
    return {one.rule for one in made.findings if one.level in (levels or ("warning", "error"))}


def failed(decision: Decision) -> set[str]:
    """Return the rules that keep a record from being approved."""
    return {one.rule for one in decision.failed}
