"""An archive of recordings audited, as a notebook uses it: what `Laboratory.audit_archive` returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.faces import Face, Facts

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
