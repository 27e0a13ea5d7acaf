"""An audit to the content of its summary: the texts, tables and the picture of the audit's vocabulary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from toolkit.audit.model import TELLS, Grade
from toolkit.files import sha256_bytes
from toolkit.report.audit.vocabulary import AUDIT, TABLES
from toolkit.report.content import Cell, Curve, Plot, ReportContent, Table, Value
from toolkit.report.style import Style
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.report.audit.page import AuditView

_RIGHT = ("exact", "rounding")
_MOST_TESTS, _MOST_REPORTS = 25, 40


def build_audit_content(view: AuditView, style: Style | None = None) -> ReportContent:
    """Return what the template of an audit's summary can ask for."""
    style = style or Style()
    made = view.made
    totals = _totals(made)
    tables = _tables(view)
    plots = _plots(totals["years"], style)
    values = {f"audit.{name}": Value(kind="text", value=text) for name, text in _texts(view, totals).items()}
    values["audit.known_at"] = Value(kind="date", value=made.known_at.isoformat())
    counts = {"files": len(made.files), "right": totals["right"], "not_right": totals["wrong"],
              "unreadable": made.grades["unreadable"], "undated": made.undated}  # fmt: skip
    values |= {f"audit.{name}": Value(kind="number", value=float(n)) for name, n in counts.items()}
    values["audit.largest_FY"] = Value(kind="number", value=totals["FY"], unit="N", spec=".1f")
    values["audit.largest_MZ"] = Value(kind="number", value=totals["MZ"], unit="N*m", spec=".2f")
    values |= {f"caption.{name}": Value(kind="text", value=plot.caption) for name, plot in plots.items()}
    conditions = dict.fromkeys(AUDIT.conditions, False)
    conditions |= {path: not value.missing for path, value in values.items()}
    conditions |= {name: bool(table.rows) for name, table in tables.items()} | dict.fromkeys(plots, True)
    conditions["reports_to_amend"] = bool(tables["audit_reports"].rows)
    conditions["all_right"] = totals["wrong"] == 0 and made.grades["unreadable"] == 0
    return ReportContent(
        values=values,
        tables=tables,
        plots=plots,
        conditions=conditions,
        calibrations=view.uses,
        title=str(values["audit.title"].value),
        author=style.laboratory or "toolkit",
        identity=str(values["audit.id"].value),
        subject="Audit of an archive of recordings",
        issued=made.known_at.isoformat(),
        style=style,
        vocabulary=AUDIT,
    )


def audit_plots(made: ArchiveAudit, style: Style | None = None) -> dict[str, Plot]:
    """Return the figures of an audit by name; none where the files are of one year."""
    return _plots(_totals(made)["years"], style or Style())


def _totals(made: ArchiveAudit) -> dict[str, Any]:
    # One pass over the files: what the texts and the picture need of them.
    FY = MZ = 0.0
    right = wrong = repaired = 0
    years: dict[int, list[int]] = {}
    for one in made.files.plain():
        ok = one["grade"] in _RIGHT
        right += ok
        wrong += not ok and one["grade"] != "unreadable"
        if one["date"] is not None and one["grade"] != "unreadable":
            years.setdefault(int(one["date"][:4]), [0, 0])[not ok] += 1
        if not ok and one["repair"] is not None:
            repaired += 1
            FY = max(FY, one["repair"]["FY_max_abs_N"] or 0.0)
            MZ = max(MZ, one["repair"]["MZ_max_abs_Nm"] or 0.0)
    return {"FY": FY, "MZ": MZ, "right": right, "wrong": wrong, "repaired": repaired, "years": years}


def _texts(view: AuditView, totals: Mapping[str, Any]) -> dict[str, str | None]:
    made = view.made
    name = made.archive.absolute().name
    heads = ", ".join(f"{who} {head}" for who, head in made.heads)
    files = len(made.files)
    if totals["right"] + totals["wrong"] == 0:
        conclusion = "The archive has no file that could be read as a recording."
    elif totals["wrong"] == 0:
        conclusion = (
            f"All {totals['right']} files that could be read carry the values of the record in force."
        )
    else:
        conclusion = (
            f"Of {files} files, {totals['right']} carry the Fy and Mz of the record that was in force on the "
            f"day of their test, and {totals['wrong']} do not. "
        )
        conclusion += (
            f"By that record Fy changes by up to {totals['FY']:.1f} N and Mz by up to {totals['MZ']:.2f} N·m."
            if totals["repaired"]
            else "By how much cannot be told: for none of them a record in force on its day is known."
        )
    if unreadable := made.grades["unreadable"]:
        many = "files could not be read and are" if unreadable > 1 else "file could not be read and is"
        conclusion += f" {unreadable} {many} set aside."
    reports = None
    if view.linked is not None:
        amend = sum(one.to_amend for one in view.linked.reports)
        reports = (
            f"{len(view.linked.reports)} reports were looked at; {amend} of them rest on "
            "other values than those of the record in force. "
            f"For {len(view.linked.unknown)} tests the report is unknown."
        )
    since = None
    if view.drift is not None:
        largest = max((one.FY_N or 0.0 for one in view.drifted), default=0.0)
        since = (
            f"{view.drift.failed.session_record} of {view.drift.failed.date} found "
            f"{view.drift.failed.record} out of tolerance. Since {view.drift.good} of "
            f"{view.drift.good_date}, {len(view.drifted)} files were recorded; the interpolated effect on Fy "
            f"is up to {largest:.2f} N."
        )
    key = f"{name}|{made.known_at}|{heads}|{dict(made.grades)}"
    return {
        "id": f"AUDIT-{made.known_at.isoformat()}-{sha256_bytes(key.encode())[:8]}",
        "title": f"Audit of the archive {name}",
        "archive": name,
        "conclusion": conclusion,
        "heads": heads or "no instrument",
        "refused": "; ".join(f"{one.id}: {one.reason}" for one in made.refused) or None,
        "since_good": since,
        "reports": reports,
        "software": f"toolkit {__version__}",
    }


def _tables(view: AuditView) -> dict[str, Table]:
    made = view.made
    files = max(len(made.files), 1)
    grades: list[tuple[Cell, ...]] = [
        (grade, str(count), f"{100 * count / files:.1f}", _meaning(grade))  # type: ignore[arg-type]
        for grade, count in made.grades.items()
        if count
    ]
    rules = Counter(one.rule for one in made.findings)
    findings: list[tuple[Cell, ...]] = [
        (rule, str(count), view.rules.get(rule, {}).get("means"), view.rules.get(rule, {}).get("do"))
        for rule, count in rules.most_common()
    ]
    reports: list[tuple[Cell, ...]] = [
        (
            one.report,
            ", ".join(sorted(one.linked_by)),
            ", ".join(sorted(one.tests)),
            f"{one.not_clean} of {one.files}",
        )
        for one in (view.linked.reports if view.linked is not None else ())
        if one.to_amend
    ]
    rows: dict[str, list[tuple[Cell, ...]]] = {
        "audit_grades": grades,
        "audit_tests": _worst_tests(view),
        "audit_reports": reports[:_MOST_REPORTS],
        "audit_findings": findings,
    }
    return {
        name: Table(name=name, columns=TABLES[name][1], rows=tuple(found)) for name, found in rows.items()
    }


def _meaning(grade: Grade) -> str:
    return TELLS[grade] if grade == "unreadable" else f"computed {TELLS[grade]}"


def _worst_tests(view: AuditView) -> list[tuple[Cell, ...]]:
    worst: list[dict[str, Any]] = []
    for test in view.made.tests:
        if test["not_clean"]:
            worst.append(test)
            worst = sorted(worst, key=lambda one: -one["FY_max_abs_N"])[:_MOST_TESTS]
    return [
        (
            test["test"],
            test["date"],
            f"{test['not_clean']} of {test['files']}",
            f"{test['FY_max_abs_N']:.1f}",
            f"{test['MZ_max_abs_Nm']:.2f}",
            largest_change(test["effects"], "cornering_stiffness", percent=True),
            largest_change(test["effects"], "conicity"),
            largest_change(test["effects"], "plysteer"),
        )
        for test in worst
    ]


def largest_change(effects: Sequence[Mapping[str, Any]], name: str, *, percent: bool = False) -> str | None:
    """Return the largest change of a characteristic over its loads as text; None where there is none."""
    changes = [
        100 * one["change"] / abs(one["old"]) if percent else one["change"]
        for one in effects
        if one["name"] == name and (one["old"] or not percent)
    ]
    return f"{max(changes, key=abs):+.2f}" if changes else None


def _plots(years: Mapping[int, list[int]], style: Style) -> dict[str, Plot]:
    if len(years) < 2:
        return {}
    x = tuple(float(year) for year in sorted(years))
    curves = tuple(
        Curve(label=label, x=x, y=tuple(float(years[int(year)][at]) for year in x), style="both", group=at)
        for at, label in enumerate(("right", "not right"))
    )
    wrong = sum(counts[1] for counts in years.values())
    return {
        "audit_years": Plot(
            name="audit_years",
            x_label="year of the test",
            y_label="files",
            curves=curves,
            caption="Files by the year of their test.",
            alt=f"Files by the year of their test, {int(x[0])} to {int(x[-1])}: {wrong} are not right.",
            decimal_comma=style.decimal_comma,
        )
    }
