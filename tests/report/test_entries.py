"""Vocabularies: every kind of document lists every tag that its templates use."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest

from toolkit.report.audit.vocabulary import AUDIT
from toolkit.report.certificate.vocabulary import CERTIFICATE
from toolkit.report.comparison.vocabulary import COMPARISON
from toolkit.report.diagnosis.vocabulary import DIAGNOSIS
from toolkit.report.entries import Tables, catalogue_of, conditions_of, text_columns, values_of
from toolkit.report.listing import list_tags
from toolkit.report.style import Style
from toolkit.report.vocabulary import REPORT, Vocabulary

TEMPLATES = Path(__file__).resolve().parents[2] / "report_templates"
TABLES: Tables = {"cells": ("the cells", text_columns("cell|its name\nunit|its unit"))}
KINDS = {
    "org.docx": REPORT,
    "pruefbericht.docx": REPORT,
    "summary.docx": REPORT,
    "audit.docx": AUDIT,
    "certificate.docx": CERTIFICATE,
    "comparison.docx": COMPARISON,
    "diagnosis.docx": DIAGNOSIS,
}


@pytest.mark.parametrize("name", KINDS)
def test_the_list_of_a_kind_names_every_tag_of_its_packaged_template(name: str) -> None:
    with zipfile.ZipFile(TEMPLATES / name) as package:
        text = "".join(package.read(one).decode() for one in package.namelist() if one.endswith(".xml"))
    used = {tag.partition("|")[0] for tag in re.findall(r'<w:tag w:val="(tk:[^"]+)"', text)}
    assert used, "the template holds tags"
    assert used <= {one["tag"] for one in list_tags(None, Style(), KINDS[name])}


@pytest.mark.parametrize(
    "words", [REPORT, AUDIT, CERTIFICATE, COMPARISON, DIAGNOSIS], ids=lambda one: one.name
)
def test_every_figure_table_and_value_can_be_asked_for(words: Vocabulary) -> None:
    asked = {one.path for one in words.catalogue if one.kind == "if"}
    assert asked == {f"if.{name}" for name in words.conditions}
    own = [one.path for one in words.catalogue if one.path.startswith(f"{words.name}.")]
    assert {f"if.{name}" for name in (*words.figures, *words.tables, *own)} <= asked


def test_entries_follow_the_order_of_the_manual() -> None:
    values = values_of("audit", "id|text|its name\nfiles|number|files", {"audit.files": ("N", ".1f")})
    names = conditions_of({"right": "all is right"}, {"years": "files a year"}, TABLES, values)
    made = catalogue_of(values, {"years": "files a year"}, TABLES, names)
    assert [one.path for one in made] == [
        "audit.id", "audit.files", "caption.years", "figure.years", "table.cells",
        "if.right", "if.years", "if.cells", "if.audit.id", "if.audit.files", "row.cell", "row.unit",
    ]  # fmt: skip
    assert (made[1].kind, made[1].unit, made[1].spec) == ("number", "N", ".1f")


def test_a_condition_of_a_tables_name_keeps_its_own_meaning() -> None:
    assert conditions_of({"cells": "cells were loaded"}, {}, TABLES, ())["cells"] == "cells were loaded"
