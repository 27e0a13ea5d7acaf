"""An archive of recordings audited, as a notebook uses it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.faces import Face, Facts, as_path

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.findings import Finding
    from toolkit.lab.archives.audit_answer import AuditOutcome
    from toolkit.report.content import Plot


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Audit(Face):
    """Which calibration computed each file of an archive, and what it changes; ``written`` lie in ``out``."""

    result: AuditOutcome
    written: tuple[Path, ...]

    @property
    def grades(self) -> dict[str, int]:
        """How many files have each grade."""
        return dict(self.result.made.grades)

    @property
    def clean(self) -> bool:
        """Whether nothing asks for a person's attention."""
        return self.result.made.clean

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What should be known about the archive."""
        return self.result.made.findings

    def to_dataframe(self) -> pd.DataFrame:
        """Return one file a row: path, grade, record, variant, the change by the record in force."""
        import pandas as pd

        rows = []
        for file in self.result.made.files.plain():
            repair: dict[str, Any] = file["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
            keys = ("path", "date", "grade", "record", "variant", "in_force", "reason")
            rows.append({key: file[key] for key in keys} | repair)
        return pd.DataFrame(rows)

    def _facts(self) -> Facts:
        audit = self.result.made
        return {
            "archive": audit.archive,
            "files": f"{len(audit.files)} files",
            "grades": ", ".join(f"{count} {grade}" for grade, count in audit.grades.items() if count),
            "known at": f"known at {audit.known_at.isoformat()}",
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.audit.content import audit_plots
        from toolkit.report.content import Curve, Plot

        counts = {grade: count for grade, count in self.grades.items() if count}
        bars = Curve(
            label="files", x=tuple(map(float, range(len(counts)))), y=tuple(map(float, counts.values())),
            style="bars", notes=tuple(map(str, counts.values())),
        )  # fmt: skip
        counted = ", ".join(f"{count} {grade}" for grade, count in counts.items())
        grades = Plot(
            name="grades", x_label="", y_label="files", curves=(bars,), names=tuple(counts),
            caption="Files by grade.", alt=f"Files by grade: {counted}.",
        )  # fmt: skip
        return {"grades": grades} | audit_plots(self.result.made)


def audit_archive(
    archive: str | Path,
    *,
    out: str | Path | None = None,
    calibrations: str | Path | None = None,
    home: str | Path | None = None,
    known_at: dt.date | None = None,
    workers: int = 1,
    repair: str | Path | None = None,
    reports: str | Path | None = None,
) -> Audit:
    """Tell for every file of an archive which calibration computed its forces, and what it changes.

    Parameters
    ----------
    archive : a folder of recordings, in any depth
    out : folder for the page and the lines; an audit goes on where it was ended; None writes nothing
    calibrations, home : the registry, or the laboratory; default the nearest one upward
    known_at : the registry is judged as known on this day; default today
    workers : processes that read files
    repair : folder for corrected copies; the originals are never touched
    reports : reports of past years, a folder or a CSV

    Raises
    ------
    ToolkitError
        the archive, the registry or a folder cannot be used
    """
    from toolkit.lab.archives.audit import AuditOrder, audit

    answer, written = audit(
        AuditOrder(
            archive=Path(archive),
            known_at=known_at,
            workers=workers,
            out=as_path(out),
            repair=as_path(repair),
            reports=as_path(reports),
            calibrations=as_path(calibrations),
            home=as_path(home),
        )
    )
    return Audit(result=answer, written=written)
