"""What stands in documents: every value, table cell and figure text, by its tag and part."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from tests.golden.cases import CASES
from tests.golden.entries import golden
from tests.golden.simulation import packaged_test
from tests.golden.surface import PLANS, TEMPLATES, make_archive
from tests.golden.workplace import NO_RESULT_TAGS, Workplace

DAY = "2026-06-01"
_WORD = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
_OF_THE_DAY = (".issued", ".software", ".ledger_head", ".seconds", "audit.id", "audit.heads")
"""Ends of tags that print the day, a version, a time, or a hash of files or entries with times in them."""


def tagged_texts(path: Path) -> dict[str, list[str]]:
    """Return the texts of a Word file by tag, in the order of the document; a row's by table and column."""
    from lxml import etree

    texts: dict[str, list[str]] = {}
    with zipfile.ZipFile(path) as package:
        parts = [name for name in package.namelist() if name.startswith("word/") and name.endswith(".xml")]
        for part in sorted(parts):
            for control in etree.fromstring(package.read(part)).iter(f"{_WORD}sdt"):
                tag = _tag(control)
                if tag and not tag.endswith(_OF_THE_DAY) and not tag.startswith("tk:table."):
                    if tag.startswith("tk:row."):
                        above = map(_tag, control.iterancestors(f"{_WORD}sdt"))
                        tag = f"{next((name for name in above if name.startswith('tk:table.')), '')} {tag}"
                    text = "".join(part.text or "" for part in control.iter(f"{_WORD}t"))
                    texts.setdefault(tag, []).append(text)
    return texts


def _tag(control: Any) -> str:
    tag = control.find(f"{_WORD}sdtPr/{_WORD}tag")
    return "" if tag is None else str(tag.get(f"{_WORD}val"))


def _report(place: Workplace, template: str, *words: object) -> dict[str, Any]:
    test, _ = packaged_test(place)
    return place.packaged(
        "report", test, "--template", TEMPLATES / template, "--out", "report", "--known-at", DAY, *words
    )


@golden("documents/report-org", quick=True)
def report_org(place: Workplace) -> Any:
    """The packaged virtual test in the organisation's template."""
    return _report(place, "org.docx")


@golden("documents/report-german")
def report_german(place: Workplace) -> Any:
    """The same in the German template, with its decimal comma."""
    return _report(place, "pruefbericht.docx")


@golden("documents/report-pounds-and-models")
def report_pounds(place: Workplace) -> Any:
    """The same in pounds, with tire models compared."""
    return _report(place, "org.docx", "--units", "lbf", "--models", "mf61", "--models", "brush")


@golden("documents/report-summary")
def report_summary(place: Workplace) -> Any:
    """The same on one page."""
    return _report(place, "summary.docx")


@golden("documents/template-tags", quick=True)
def template_tags(place: Workplace) -> Any:
    """Every tag with its kind, unit and columns, and what it holds for the packaged test."""
    test, _ = packaged_test(place)
    answer = place.packaged("template", "tags", "--test", test)
    rows = answer["answer"]["tags"]
    answer["answer"]["tags"] = {row["tag"]: row for row in rows if row["tag"] not in NO_RESULT_TAGS}
    return answer


@golden("documents/comparison")
def comparison(place: Workplace) -> Any:
    """The packaged test against itself on another surface, and against a maker's values."""
    first, _ = packaged_test(place)
    second = place.folder / "sandpaper"
    words = ("--effect", "surface_friction=1.1", "--seed", 5)
    place.packaged("simulate", PLANS / "test_plan.toml", "--out", second, *words)
    table = "FZ [N],conicity [N],U_conicity [N],plysteer [N]\n1115,14,5,30\n3700,45,9,120\n6100,70,9,180\n"
    maker = place.write({"maker.csv": table}) / "maker.csv"
    document = ("--out", "document", "--template", TEMPLATES / "comparison.docx")
    return {
        "tests": place.packaged("compare", first, second, *document),
        "document": tagged_texts(place.folder / "document" / "comparison.docx"),
        "maker": place.packaged("compare", first, maker),
    }


@golden("documents/audit")
def audit_summary(place: Workplace) -> Any:
    """The summary of a small archive."""
    archive, calibrations = make_archive(place.folder, files=26, rows=60, seed=7)
    answer = place.answer(
        "audit", archive, "--known-at", "2026-01-01", "--out", "out", "--template", TEMPLATES / "audit.docx",
        calibrations=calibrations,
    )  # fmt: skip
    answer["answer"].pop("files", None)
    return answer | {"document": tagged_texts(place.folder / "out" / "audit.docx")}


@golden("documents/diagnosis")
def diagnosis(place: Workplace) -> Any:
    """The document of a diagnosis, and the chapter of it in a report."""
    case = place.write(CASES["tire-offset"](), "case") / "CASE.toml"
    answer = place.packaged(
        "diagnose", case, "--out", "answer", "--pdf", "--template", TEMPLATES / "diagnosis.docx",
        "--by", "operator two", "--budget", 3600,
    )  # fmt: skip
    chapter = _report(place, "org.docx", "--diagnosis", place.folder / "answer", "--by", "operator two")
    tags = chapter["answer"].get("manifest", {})
    return {
        "answer": answer["answer"]["document"],
        "document": tagged_texts(place.folder / "answer" / "diagnosis.docx"),
        "chapter": {tag: texts for tag, texts in tags.items() if "diagnosis" in tag},
    }
