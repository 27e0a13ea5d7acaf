"""The audit's page: one file that needs no network, and says what the audit found; and its summary."""

from __future__ import annotations

import datetime as dt
import html
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from tests.audit.archive_made import factory
from tests.conftest import EXAMPLES
from toolkit.audit.archive import audit_archive
from toolkit.audit.linked import RestingReport, link
from toolkit.audit.timeline import timelines, traces, worst_files
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.rules import rules_catalogue
from toolkit.recording.marks import own_output
from toolkit.report.audit.content import build_audit_content
from toolkit.report.audit.page import AuditView, _largest, page, write_page
from toolkit.report.audit.svg import rows_of

CHECKOUT = Path(__file__).resolve().parents[3]


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.links, self.open, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        self.links += [(tag, key, value) for key, value in attrs if key in ("src", "href", "action", "data")]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    root = tmp_path_factory.mktemp("page")
    made = factory.make_archive(root, files=60, rows=60, seed=5)
    evil = made.folder / "1991" / "<script>alert(1) & co"
    evil.write_bytes(b"nothing")
    registry = Registry(made.calibrations)
    audited = audit_archive(made.folder, registry, known_at=factory.KNOWN_AT)
    first = next(one for one in audited.tests if one["not_clean"])["test"]
    reports = (
        RestingReport(report="R <1>", words=factory_words(first)),
        RestingReport(report="other", words="none"),
    )
    return AuditView(
        made=audited,
        rules=rules_catalogue(),
        timelines=timelines(audited.files.plain(), registry, audited.known_at),
        traces=tuple(traces(audited, registry, 3)),
        linked=link(audited, reports),
    )


def undecided(file):
    """Tell whether the cells of a file are wrong, or may be: it is counted apart, and nothing is computed."""
    return file["sides"] is not None and file["sides"]["side"] in ("cells", "open")


def factory_words(test):
    return " ".join(re.findall(r"[a-z0-9]+", test.lower()))


@pytest.fixture(scope="module")
def text(view):
    return "".join(page(view))


def test_it_takes_nothing_from_outside(text):
    reader = Reader()
    reader.feed(text)
    assert reader.links == []
    assert "default-src 'none'" in html.unescape(text)
    assert not re.search(r"url\(|@import|://", text)


def test_the_table_holds_every_file_and_a_hostile_name_stays_text(view, text):
    data = json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S).group(1)
    )
    assert [row[0] for row in data["rows"]] == [one["path"] for one in view.made.files.plain()]
    assert any("<script>alert(1)" in row[0] for row in data["rows"])
    assert text.count("<script") == 2  # the data and the page's own
    assert "&lt;script&gt;alert(1)" in text  # among the findings


def test_every_grade_has_a_colour(view, text):
    assert set(re.findall(r"^\[data-grade=(\w+)\]", text, re.M)) == set(view.made.grades)
    shown = {grade for grade, count in view.made.grades.items() if count}
    assert set(re.findall(r'class="chip" data-grade="(\w+)"', text)) == shown


def test_every_rule_is_explained_in_a_sentence(view, text):
    for rule in {one.rule for one in view.made.findings}:
        assert f"<code>{rule}</code>" in text
        assert view.rules[rule]["means"] in html.unescape(text)


def test_pictures_are_well_formed_and_drawn_for_the_worst(view, text):
    pictures = re.findall(r"<svg.*?</svg>", text, re.S)
    assert len(pictures) == len(view.timelines) + 2 * len(view.traces)
    for one in pictures:
        ET.fromstring(one)  # noqa: S314  our own
    worst = worst_files(view.made, 3)
    told = [one for one in view.made.files.plain() if not undecided(one)]
    repairs = [one["repair"]["FY_max_abs_N"] for one in told
               if one["repair"] and one["grade"] not in ("exact", "rounding")]  # fmt: skip
    assert [one["repair"]["FY_max_abs_N"] for one in worst] == sorted(repairs, reverse=True)[:3]


def test_a_files_heading_stands_with_its_pictures_on_paper_too(view, text):
    sections = re.findall(r"<section>(.*?)</section>", text, re.S)
    worst = worst_files(view.made, 3)
    for one, section in zip(worst, sections, strict=True):
        assert section.startswith(f"<h3>{html.escape(one['path'])}</h3>")
        assert section.count("<svg") == 2  # FY and MZ


def test_a_change_that_rounds_to_nothing_has_no_sign():
    def told(change):
        return _largest([{"name": "conicity", "change": change, "old": 5.0}], "conicity")

    assert [told(change) for change in (-0.001, 0.001, -0.5, 1.25)] == ["0.00", "0.00", "-0.50", "+1.25"]


def test_the_timeline_counts_every_dated_file(view):
    (one,) = view.timelines
    dated = [f for f in view.made.files.plain() if f["date"] is not None and f["instrument"] is not None]
    assert sum(one.counts.values()) == len(dated)
    stretches = {s.record: s for s in one.stretches}
    assert stretches["m15-r1"].void
    assert (stretches["m15-r3"].begin, stretches["m15-r3"].end) == (dt.date(1993, 1, 1), dt.date(1996, 1, 1))
    assert stretches["m15-r13"].end is None


def test_the_page_is_known_as_the_toolkits_own(view, tmp_path):
    write_page(tmp_path / "audit.html", view)
    assert own_output((tmp_path / "audit.html").read_bytes())


def test_reports_stand_with_what_links_them(text, view):
    assert "R &lt;1&gt;" in text
    assert f"report unknown: {len(view.linked.unknown)} tests" in text


def test_a_line_that_never_changes_is_drawn_in_a_range():
    ET.fromstring(rows_of("FY", "N", np.zeros(10), np.zeros(10)))  # noqa: S314


class TestSummary:
    def test_its_numbers_are_those_of_the_audit(self, view):
        content = build_audit_content(view)
        grades = view.made.grades
        assert content.values["audit.right"].value == grades["exact"] + grades["rounding"]
        files = list(view.made.files.plain())
        told_apart = ("exact", "rounding", "unreadable", "no_recording")
        wrong = [one for one in files if one["grade"] not in told_apart and not undecided(one)]
        apart = sum(map(undecided, files))
        assert apart > 1
        assert content.values["audit.not_right"].value == len(wrong)
        assert f" {apart} files disagree with their cells" in content.values["audit.conclusion"].value
        table = {row[0]: row[1] for row in content.tables["audit_grades"].rows}
        assert table == {grade: str(count) for grade, count in grades.items() if count}
        assert [row[0] for row in content.tables["audit_reports"].rows] == ["R <1>"]
        assert content.conditions["reports_to_amend"]

    def test_it_does_not_say_no_change_where_none_can_be_told(self):
        # Figure 4.4 carries the withdrawn record and no date: no record in force is known, and no change.
        registry = Registry(CHECKOUT / "calibrations")
        made = audit_archive(EXAMPLES / "fig4_4", registry, known_at=dt.date(2026, 1, 1))
        bare = AuditView(made=made, rules=rules_catalogue(), timelines=(), traces=(), linked=None)
        told = build_audit_content(bare).values["audit.conclusion"].value
        assert "cannot be told" in told
        assert "0.0 N" not in told

    def test_it_is_filled_converted_and_verified(self, view, tmp_path):
        from toolkit.report.deliver import deliver
        from toolkit.report.word.package import read_template

        template = read_template(CHECKOUT / "report_templates" / "audit.docx")
        done = deliver(template, build_audit_content(view), tmp_path, name="audit")
        assert done.pdf.read_bytes().startswith(b"%PDF")
        assert not [one for one in done.checks if not one.ok and not one.warning]

    @pytest.mark.parametrize("archive", [EXAMPLES / "fig4_4", None], ids=["undated", "empty"])
    def test_a_heading_without_rows_is_left_out(self, archive, tmp_path):
        from docx import Document

        from toolkit.report.deliver import deliver
        from toolkit.report.word.package import read_template

        (tmp_path / "nothing").mkdir()
        made = audit_archive(archive or tmp_path / "nothing", Registry(CHECKOUT / "calibrations"))
        content = build_audit_content(AuditView(made=made, rules=rules_catalogue(), timelines=(), traces=()))
        conclusion = str(content.values["audit.conclusion"].value)
        # Beside the two recordings lies a note, which is no recording and no unreadable file.
        for said in ("0 carry", "2 do not") if archive else ("has no file",):
            assert said in conclusion
        assert "could not be read" not in conclusion
        template = read_template(CHECKOUT / "report_templates" / "audit.docx")
        done = deliver(template, content, tmp_path / "out", name="audit")
        headings = [one.text for one in Document(str(done.docx)).paragraphs if one.style.name == "Heading 1"]
        assert headings == (["Grades", "Findings"] if archive else [])

    def test_a_template_is_known_by_its_tags_and_asks_for_no_reports_tags(self):
        from toolkit.report.audit.content import AUDIT
        from toolkit.report.certificate.content import CERTIFICATE
        from toolkit.report.test.content import REPORT

        asked = ("tk:test.name", "tk:certificate.id", "tk:audit.id")
        assert AUDIT.vocabulary.demanded(asked) == ("tk:audit.heads", "tk:audit.id")
        assert "tk:audit.id" not in REPORT.vocabulary.demanded(asked)
        assert "tk:audit.id" not in CERTIFICATE.vocabulary.demanded(asked)
