"""What stands in documents: every value, table cell and figure text, by its tag and part."""

from __future__ import annotations

from typing import Any

from tests.golden.cases import CASES
from tests.golden.entries import golden
from tests.golden.simulation import packaged_test
from tests.golden.surface import PLANS, TEMPLATES, make_archive
from tests.golden.workplace import Workplace

DAY = "2026-06-01"


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
    answer["answer"]["tags"] = {row["tag"]: row for row in answer["answer"]["tags"]}
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
    return answer


@golden("documents/diagnosis")
def diagnosis(place: Workplace) -> Any:
    """The document of a diagnosis, and the chapter of it in a report."""
    case = place.write(CASES["machine-offset"](), "case") / "CASE.toml"
    answer = place.packaged(
        "diagnose", case, "--out", "answer", "--pdf", "--template", TEMPLATES / "diagnosis.docx",
        "--by", "operator two", "--budget", 3600,
    )  # fmt: skip
    chapter = _report(place, "org.docx", "--diagnosis", place.folder / "answer", "--by", "operator two")
    tags = chapter["answer"].get("manifest", {})
    return {
        "document": answer,
        "chapter": {tag: texts for tag, texts in tags.items() if "diagnosis" in tag},
    }
