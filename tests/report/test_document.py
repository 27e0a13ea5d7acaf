"""Documents as declared: what a module declares is listed, checked, built and printed."""

from __future__ import annotations

import dataclasses
import re
import zipfile
from pathlib import Path

import pytest

import toolkit.report.test
from tests.house.manual import tags_text
from tests.recipes import file_of
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import FOLDER, make, p, tbl, texts
from toolkit.report.kinds import VOCABULARIES, check, list_tags
from toolkit.report.style import Style
from toolkit.report.test.content import REPORT, build_content
from toolkit.report.vocabulary import Entry, TableEntry, Vocabulary, columns_of
from toolkit.report.word.fill import fill
from toolkit.report.word.package import read_template

KINDS = {
    "org": "report",
    "pruefbericht": "report",
    "summary": "report",
    "audit": "audit",
    "plan": "plan",
    "certificate": "certificate",
    "comparison": "comparison",
    "diagnosis": "diagnosis",
}
WORDS = Vocabulary(
    name="audit",
    values=(
        Entry(path="audit.id", kind="text", description="its name"),
        Entry(path="audit.files", kind="number", description="files", unit="N", spec=".1f"),
    ),
    figures={"years": "files a year"},
    tables={"cells": TableEntry(description="the cells", columns=columns_of("cell|its name\nunit|its unit"))},
    conditions={"right": "all is right"},
    required=(),
    marks={},
)


@pytest.mark.parametrize("name", KINDS)
def test_the_list_of_a_kind_names_every_tag_of_its_packaged_template(name: str) -> None:
    with zipfile.ZipFile(FOLDER / f"{name}.docx") as package:
        text = "".join(package.read(one).decode() for one in package.namelist() if one.endswith(".xml"))
    used = {tag.partition("|")[0] for tag in re.findall(r'<w:tag w:val="(tk:[^"]+)"', text)}
    assert used, "the template holds tags"
    assert used <= {one["tag"] for one in list_tags(None, Style(), VOCABULARIES[KINDS[name]])}


@pytest.mark.parametrize("kind", VOCABULARIES)
def test_every_figure_table_and_value_can_be_asked_for(kind: str) -> None:
    words = VOCABULARIES[kind]
    asked = {entry.path for entry in words.entries if entry.kind == "if"}
    assert asked == {f"if.{name}" for name in words.asked}
    paths = [entry.path for entry in words.values]
    assert {f"if.{name}" for name in (*words.figures, *words.tables, *paths)} <= asked
    assert all(words.knows_condition(name) for name in words.asked)


def test_entries_follow_the_order_of_the_manual() -> None:
    assert [entry.path for entry in WORDS.entries] == [
        "audit.id", "audit.files", "caption.years", "figure.years", "table.cells",
        "if.right", "if.years", "if.cells", "if.audit.id", "if.audit.files", "row.cell", "row.unit",
    ]  # fmt: skip


def test_a_condition_of_a_tables_name_keeps_its_own_meaning() -> None:
    words = dataclasses.replace(WORDS, conditions={"cells": "cells were loaded"})
    assert words.asked["cells"] == "cells were loaded"


def test_columns_are_read_from_lines() -> None:
    file, value, U, slip, seconds = columns_of(
        "file|recording\nFY ±|lateral force|force|.1f\nSA|slip angle|deg|.2f|U of U_SA\nt|time|s|.2f|run"
    )
    assert (file.kind, file.unit) == ("text", None)
    assert (value.name, value.unit, value.quantity, value.U) == ("FY", "N", "force", "U_FY")
    assert (U.name, U.description, U.U) == ("U_FY", "expanded uncertainty (95 %) of FY", "U_FY")
    assert (slip.unit, slip.quantity, slip.U) == ("deg", None, "U_SA")
    assert (seconds.of_the_run, seconds.U) == (True, None)


def test_a_report_of_one_kind_is_not_asked_for_the_tags_of_the_others() -> None:
    assert set(REPORT.vocabulary.foreign) == set(VOCABULARIES) - {"report"}
    for name in REPORT.vocabulary.foreign:
        assert f"tk:{name}.id" not in REPORT.vocabulary.demanded([f"tk:{name}.id"])


def test_a_new_table_is_one_declaration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "heaviest.py").write_text(file_of("Add a report table"))
    monkeypatch.setattr(toolkit.report.test, "__path__", [*toolkit.report.test.__path__, str(tmp_path)])
    for derived in ("declarations", "vocabulary"):
        monkeypatch.delitem(vars(REPORT), derived, raising=False)
    body = p("{{tk:table.heaviest}}") + tbl(["a", "b"], ["{{tk:row.file}}", "{{tk:row.FZ}}"])
    path = make(tmp_path, body)
    try:
        entries = {entry["tag"]: entry for entry in list_tags(None, Style(), REPORT.vocabulary)}
        assert entries["tk:table.heaviest"]["columns"] == ["file", "FZ", "U_FZ"]
        assert "`tk:table.heaviest`: the conditions" in tags_text([REPORT.vocabulary])
        found = check(read_template(path), Style(), fonts=False)
        assert [finding for finding in found if finding.level != "note"] == []
        content = build_content(make_result(), make_record(), style=Style(force="lbf"))
        (row,) = content.tables["heaviest"].rows
        assert row[1] == pytest.approx((6103 + 11) / 4.4482216152605)
        filled = fill(read_template(path), content, {})
        # U = 20 N = 4.496 lbf has its second digit in the tenths.
        assert "1374.5" in texts(filled.docx)
    finally:
        monkeypatch.undo()
        for derived in ("declarations", "vocabulary"):
            vars(REPORT).pop(derived, None)
    assert check(read_template(path), Style(), fonts=False)[0].rule == "unknown-tag"
