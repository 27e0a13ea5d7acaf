"""The audit as one HTML file that opens without a network: mailable and archivable."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.audit.since_good import DriftedFile, DriftedTest
from toolkit.calibration.records.use import mark_of
from toolkit.characteristics.catalogue import summary
from toolkit.files import atomic_path
from toolkit.recording.marks import OWN_OUTPUT
from toolkit.report.audit.svg import COLOURS, rows_of, timeline

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.audit.linked import Linked
    from toolkit.audit.since_good import Drift
    from toolkit.audit.timeline import Timeline
    from toolkit.audit.traces import Trace
    from toolkit.calibration.records.use import CalibrationUse

MOST_ROWS = 20_000
"""Beyond so many files the table leaves out those that are right, and says so."""

_PLACES, _TESTS = 25, 60
_HEAD = (
    "file",
    "grade",
    "computed by",
    "how",
    "in force",
    "test date",
    "ΔFy max [N]",
    "ΔMz max [N·m]",
    "reports",
)
_KINDS = ("text", "grade", "text", "text", "text", "date", "number", "number", "text")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AuditView:
    """What the page shows. ``rules``: rule id -> what it means and what to do.

    ``uses``: the records in force by which repairs were computed.
    """

    made: ArchiveAudit
    rules: Mapping[str, Mapping[str, str]]
    timelines: Sequence[Timeline]
    traces: Sequence[Trace]
    linked: Linked | None = None
    drift: Drift | None = None
    drifted: Sequence[DriftedFile] = ()
    drifted_tests: Sequence[DriftedTest] = ()
    uses: tuple[CalibrationUse, ...] = ()


def write_page(path: Path, view: AuditView) -> None:
    """Write the page, whole or not at all.

    Raises
    ------
    OutputError
        the folder cannot be written to
    """
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", errors="replace") as stream:
        for part in page(view):
            stream.write(part)


def page(view: AuditView) -> Iterator[str]:
    """Yield the page in parts; the table's rows are never held as a whole."""
    made = view.made
    title = escape(f"Audit of {made.archive.absolute().name}")
    yield (
        f"<!doctype html>\n<html lang=en><head><meta charset=utf-8><title>{title}</title>"
        f'<meta name=keywords content="{OWN_OUTPUT}"><meta name=viewport content="width=device-width">'
        "<meta http-equiv=Content-Security-Policy content=\"default-src 'none'; style-src 'unsafe-inline'; "
        "script-src 'unsafe-inline'; img-src data:\">"
        f"<style>{_asset('page.css')}</style></head><body><main>"
    )
    if (mark := mark_of(view.uses)) is not None:
        yield f"<p><strong>{escape(mark)}</strong></p>"
    yield from _summary(view, title)
    for one in view.timelines:
        yield f"<h2>Versions of {escape(one.instrument)}</h2>"
        yield "<p class=soft>Bars: the days on which a record is in force; dashed: void. Dots: files by "
        yield "month, "
        yield "in the lane of what computed them, in the colour of their grade.</p>"
        yield f"<div class=wide>{timeline(one)}</div>"
    yield from _files()
    yield from _worst(view.traces)
    yield from _effects(made)
    yield from _unknown(made)
    yield from _reports(view.linked)
    yield from _drift(view)
    yield from _findings(view)
    yield '</main><script type="application/json" id="data">'
    yield from _data(view)
    yield f"</script><script>{_asset('page.js')}</script></body></html>\n"


def _summary(view: AuditView, title: str) -> Iterator[str]:
    made = view.made
    yield f"<h1>{title}</h1><p class=soft>{len(made.files)} files; judged as known on "
    yield f"{made.known_at.isoformat()}; {made.undated} without a test date.</p><ul class=chips>"
    for grade, count in made.grades.items():
        if count:
            yield f'<li><button class=chip data-grade="{grade}" style="--c:{COLOURS[grade]}" '
            yield "aria-pressed=true>"
            yield f"<b>{count}</b> {grade}</button></li>"
    yield "</ul>"
    for name, head in made.heads:
        yield f"<p><small>Head of the ledger of {escape(name)}: <code>{escape(head)}</code></small></p>"
    if made.refused:
        yield "<p><b>Records that were left out:</b></p><ul>"
        for one in made.refused:
            yield f"<li><code>{escape(one.id)}</code> ({escape(one.rule)}): {escape(one.reason)}</li>"
        yield "</ul>"


def _files() -> Iterator[str]:
    yield "<h2>Files</h2><p class=soft>Type to filter, press a grade above to hide it, press a heading to "
    yield "sort. "
    yield "Δ is the largest change of any row by the record in force on the test's date.</p>"
    yield '<input type=search id=search placeholder="filter: path, record, variant ..." aria-label="filter">'
    yield "<p class=soft id=count></p><div class=scroll><table id=files><thead><tr>"
    for text, kind in zip(_HEAD, _KINDS, strict=True):
        yield f"<th{' class=n' if kind == 'number' else ''}>{escape(text)}</th>"
    yield "</tr></thead><tbody></tbody></table></div><p><button id=more hidden>show more</button></p>"
    yield "<noscript><p>The table needs scripts; the same is in audit.jsonl beside this page.</p></noscript>"


def _data(view: AuditView) -> Iterator[str]:
    yield f'{{"colours": {json.dumps(COLOURS)}, "kinds": {json.dumps(_KINDS)}, "rows": ['
    all_of_them = len(view.made.files) <= MOST_ROWS
    first = True
    for one in view.made.files.plain():
        if not all_of_them and one["grade"] in ("exact", "rounding"):
            continue
        repair = one["repair"] or {}
        row = [
            one["path"],
            one["grade"],
            one["record"] or ", ".join(one["candidates"]) or None,
            one["variant"] or one["reason"],
            one["in_force"],
            one["date"],
            repair.get("FY_max_abs_N"),
            repair.get("MZ_max_abs_Nm"),
            ", ".join(view.linked.of_test(one["test"])) if view.linked is not None else None,
        ]
        yield ("" if first else ",\n") + json.dumps(row).replace("<", "\\u003c")
        first = False
    yield "]}"


def _worst(traces: Sequence[Trace]) -> Iterator[str]:
    if not traces:
        return
    yield "<h2>The files that change most</h2>"
    for one in traces:
        plain = one.plain
        how = f", {plain['variant']}" if plain["variant"] else ""
        who = plain["record"] or " or ".join(plain["candidates"]) or "no record"
        yield f"<section><h3>{escape(plain['path'])}</h3><p class=soft>{_grade(plain['grade'])} "
        yield f"computed by {escape(who + how)}; in force "
        yield f"{escape(plain['in_force'])}; "
        yield f"largest change {plain['repair']['FY_max_abs_N']:.1f}&nbsp;N</p><div class=two>"
        for load, unit in (("FY", "N"), ("MZ", "N·m")):
            if load in one.old:
                yield rows_of(load, unit, one.old[load], one.new[load])
        yield "</div></section>"


def _effects(made: ArchiveAudit) -> Iterator[str]:
    worst: list[tuple[float, dict[str, Any]]] = []
    for test in made.tests:
        if test["not_clean"]:
            worst.append((test["FY_max_abs_N"], test))
            worst = sorted(worst, key=lambda pair: -pair[0])[:_TESTS]
    if not worst:
        return
    yield "<h2>What it changes in the results of tests</h2><p class=soft>New minus old, by the means of "
    yield "the load "
    yield "blocks: the secant through the ±1° steps and the line through the steps next to 0°. The largest "
    yield "of all "
    yield f"loads; the {_TESTS} tests that change most.</p><div class=scroll><table><thead><tr><th>test</th>"
    yield "<th>date</th><th class=n>files not right</th>"
    characteristics = summary()
    for one in characteristics:
        unit = "%" if one.scope == "direction" else one.printed_unit.replace("*", "·")
        yield f"<th class=n>{str(one.summary).replace('_', ' ')} [{unit}]</th>"
    yield "</tr></thead><tbody>"
    for _, test in worst:
        yield f"<tr><td>{escape(test['test'])}</td><td class=d>{test['date']}</td>"
        yield f"<td class=n>{test['not_clean']} of {test['files']}</td>"
        for one in characteristics:
            percent = one.scope == "direction"
            yield f"<td class=n>{_largest(test['effects'], str(one.summary), percent=percent)}</td>"
        yield "</tr>"
    yield "</tbody></table></div>"


def _largest(effects: Sequence[Mapping[str, Any]], name: str, *, percent: bool = False) -> str:
    changes = [
        100 * one["change"] / abs(one["old"]) if percent and one["old"] else one["change"]
        for one in effects
        if one["name"] == name
    ]
    text = f"{max(changes, key=abs):+.2f}" if changes else ""
    return "0.00" if text in ("+0.00", "-0.00") else text


def _unknown(made: ArchiveAudit) -> Iterator[str]:
    shown = 0
    for one in made.files.plain():
        told = one["estimate"]
        if told is None:
            continue
        if shown == 0:
            yield "<h2>Files that no record explains</h2><p class=soft>The equation of their own rows by "
            yield "least "
            yield "squares, and the interval that the printed digits prove for each coefficient (a linear "
            yield "programme). It names a version; it is no calibration.</p>"
        if shown == _PLACES:
            yield "<p class=soft>More of them are in audit.jsonl.</p>"
            return
        shown += 1
        near = told["nearest"]
        yield f"<details><summary>{escape(one['path'])}, rows {told['first_row']} to {told['last_row']}"
        if near is not None:
            yield f"; nearest {escape(near['record'])}, off by {near['FY_max_abs_N'] or 0:.4g} N and "
            yield f"{near['MZ_max_abs_Nm'] or 0:.4g} N·m"
        yield "</summary>"
        for load, equation in told["equations"].items():
            yield f"<p>{load} [{escape(equation['unit'])}]: "
            yield (
                "one linear equation gives every row"
                if equation["linear"]
                else (f"no linear equation gives every row (residuals up to {equation['max_abs']:.4g})")
            )
            yield "</p><table><tr><th>term</th><th class=n>estimate</th><th class=n>from</th><th class=n>"
            yield "to</th></tr>"
            for name, c in equation["coefficients"].items():
                low, high = (("open" if v is None else f"{v:.6g}") for v in (c["low"], c["high"]))
                yield f"<tr><td>{escape(name)}</td><td class=n>{c['value']:.6g}</td><td class=n>{low}</td>"
                yield f"<td class=n>{high}</td></tr>"
            yield "</table>"
        yield "</details>"


def _reports(linked: Linked | None) -> Iterator[str]:
    if linked is None:
        return
    yield "<h2>Reports that rest on these files</h2><div class=scroll><table><thead><tr><th>report</th><th>"
    yield "linked by"
    yield "</th><th>tests</th><th class=n>files not right</th></tr></thead><tbody>"
    for one in linked.reports:
        told = one.as_dict()
        yield f"<tr><td>{escape(told['report'])}</td><td>{', '.join(told['linked_by']) or 'nothing'}</td>"
        yield f"<td>{escape(', '.join(told['tests']))}</td><td class=n>{one.not_clean} of {one.files}</td>"
        yield "</tr>"
    yield "</tbody></table></div>"
    if linked.unknown:
        yield f"<details><summary>report unknown: {len(linked.unknown)} tests</summary><ul>"
        yield "".join(f"<li>{escape(test)}</li>" for test in linked.unknown) + "</ul></details>"


def _drift(view: AuditView) -> Iterator[str]:
    drift, files = view.drift, view.drifted
    if drift is None:
        return
    yield f"<h2>Since the last good as-found, {escape(drift.good)}</h2><p>{escape(drift.told[:1].upper())}"
    yield f"{escape(drift.told[1:])}. After {drift.good_date}, the last day on which it was good, and until "
    yield f"then, {len(files)} files of {len(view.drifted_tests)} tests were recorded. Each has the share "
    yield "of the change that its day has of the days between: an estimate, since nobody knows when the "
    yield "change came. The largest of any row:</p>"
    if not files:
        return
    yield from _shares("test", [(one.test, one) for one in view.drifted_tests])
    yield f"<details><summary>the {len(files)} files</summary>"
    by_day = sorted(files, key=lambda f: (f.date, f.path))
    yield from _shares("file", [(one.path, one) for one in by_day])
    yield "</details>"


def _shares(what: str, rows: Sequence[tuple[str, DriftedFile | DriftedTest]]) -> Iterator[str]:
    yield f"<div class=scroll><table><thead><tr><th>{what}</th><th>date</th><th class=n>share</th>"
    yield "<th class=n>ΔFy max [N]</th><th class=n>ΔMz max [N·m]</th><th></th></tr></thead><tbody>"
    for name, one in rows:
        if isinstance(one, DriftedTest):
            left_out = f"without {one.left_out} of {one.files} files" if one.left_out else ""
        else:
            left_out = one.reason or ""
        FY = "" if one.FY_N is None else f"{one.FY_N:.2f}"
        MZ = "" if one.MZ_Nm is None else f"{one.MZ_Nm:.3f}"
        yield f"<tr><td>{escape(name)}</td><td class=d>{one.date}</td><td class=n>{one.share:.0%}</td>"
        yield f"<td class=n>{FY}</td><td class=n>{MZ}</td><td>{escape(left_out)}</td></tr>"
    yield "</tbody></table></div>"


def _findings(view: AuditView) -> Iterator[str]:
    counts = Counter(one.rule for one in view.made.findings)
    if not counts:
        return
    yield "<h2>Findings</h2>"
    for rule, count in counts.most_common():
        said = view.rules.get(rule, {})
        yield f"<details><summary><b>{count}</b> × <code>{escape(rule)}</code>: "
        yield f"{escape(said.get('means', ''))}"
        yield f"</summary><p>{escape(said.get('do', ''))}</p><ul>"
        some = [one for one in view.made.findings if one.rule == rule][:_PLACES]
        yield "".join(f"<li>{escape(one.where)}: {escape(one.message)}</li>" for one in some)
        if count > len(some):
            yield f"<li class=soft>and {count - len(some)} more</li>"
        yield "</ul></details>"


def _grade(grade: str) -> str:
    return f'<span class=g style="--c:{COLOURS[grade]}">{grade}</span>'


def _asset(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
