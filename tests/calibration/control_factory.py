"""Sessions of one cell over the years: a known gain, a known error, no noise unless asked for."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from pathlib import Path

from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import Candidate
from toolkit.calibration.registry.registry import Registry

GAIN = 500.0
CHECKS = (150.0, 450.0, 950.0)
FORCES = tuple(100.0 * i for i in range(1, 11))


def write_session(
    folder: Path,
    day: dt.date,
    *,
    span: float = 1.0,
    checks: Sequence[float] = CHECKS,
    check_errors: Sequence[float] = (0.0, 0.0, 0.0),
    phase: str | None = None,
    zero: str = "tared",
    tail: str = "",
) -> Path:
    """Write a session whose cell indicates ``span`` F / GAIN, and so at the check loads plus an error [N]."""
    folder.mkdir(parents=True)
    rows = ["S [mV/V],FY [N],run,direction"]
    # A scatter of +-1e-6 mV/V that sums to zero in each run: a perfect line has no scatter to judge by.
    rows += [
        f"{span * force / GAIN + 1e-6 * (-1) ** (i + run):.9f},{force},{run},up"
        for run in (1, 2, 3)
        for i, force in enumerate(FORCES)
    ]
    (folder / "loads.csv").write_text("\n".join(rows) + "\n")
    check_rows = [
        f"{(span * force + error) / GAIN:.9f},{force}"
        for force, error in zip(checks, check_errors, strict=True)
    ]
    (folder / "check.csv").write_text("\n".join(["S [mV/V],FY [N]", *check_rows]) + "\n")
    path = folder / "SESSION.toml"
    path.write_text(
        f'schema = 1\ninstrument = "cell"\ndate = {day.isoformat()}\noperator = "A"\nindications = ["S"]\n'
        f'loads = ["FY"]\ndata = "loads.csv"\nzero = "{zero}"\n'
        # A load of known direction that is no row of the session, read to a percent.
        + 'polarity = [{ load = "FY", value = { value = 500.0, unit = "N" }, indications = '
        + f'{{ S = {{ value = {1.01 * span * 500 / GAIN:.6f}, unit = "mV/V" }} }} }}]\n'
        + (f'phase = "{phase}"\n' if phase else "")
        + f'[check]\nfile = "check.csv"\n{tail}'
    )
    return path


def enter(registry: Registry, folder: Path, day: dt.date, **changes: object) -> Candidate:
    """Enter a session as a candidate, with its findings."""
    return calibrate(write_session(folder, day, **changes), registry)  # type: ignore[arg-type]


def put_in_force(registry: Registry, made: Candidate, recall: str | None = None) -> None:
    """Approve a candidate from its session's day on, decided on that day."""
    day = dt.date.fromisoformat(made.record.date)
    decision = approve(
        registry, made.record.id, in_force_from=day, checked_by="B", known_on=day, recall=recall,
        reason="entered from paper",
    )  # fmt: skip
    assert decision.done, decision.findings
