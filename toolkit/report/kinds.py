"""The kinds of documents that templates are made for; a kind is loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from toolkit.report.content import ReportContent, Value
from toolkit.report.document import Document
from toolkit.report.style import Style
from toolkit.report.tags import DRAWN
from toolkit.report.vocabulary import Entry, Vocabulary
from toolkit.report.word.check import LintFinding, check_template, vocabulary_of
from toolkit.report.word.package import Template, open_package
from toolkit.report.word.scan import scan
from toolkit.report.word.xml import stories


def list_tags(content: ReportContent | None, style: Style, vocabulary: Vocabulary) -> list[dict[str, Any]]:
    """Return every tag as a JSON-ready dict; ``available`` and ``value`` are null without a test."""
    entries = vocabulary.entries
    listed = {entry.path for entry in entries}
    families = [
        Entry(
            path=path, kind=value.kind, description="coefficient of the calibration record", unit=value.unit
        )
        for path, value in (content.values if content else {}).items()
        if path not in listed
    ]
    return [_tag(entry, content, style, vocabulary) for entry in (*entries, *families)]


def _tag(entry: Entry, content: ReportContent | None, style: Style, vocabulary: Vocabulary) -> dict[str, Any]:
    available: bool | None = None
    shown: str | bool | None = None
    name = entry.path.partition(".")[2]
    unit = style.unit(entry.unit)[0]
    if content is not None and entry.kind in ("text", "number", "date"):
        value = content.values.get(entry.path, Value(kind="text", value=None))
        available = not value.missing
        shown = value.text(None, content.style) if available else None
        unit = value.unit or unit
    elif content is not None and entry.kind in DRAWN:
        available = name in content.plots
        shown = content.plots[name].alt if available else None
    elif content is not None and entry.kind == "table":
        rows = content.tables[name].rows
        available, shown = bool(rows), f"{len(rows)} rows"
    elif content is not None and entry.kind == "if":
        available = shown = content.conditions.get(name, False)
    return {
        "tag": f"tk:{entry.path}",
        "kind": entry.kind,
        "unit": unit,
        "required": f"tk:{entry.path}" in vocabulary.demanded(style.required),
        "columns": [column.name for column in entry.columns],
        "available": available,
        "value": shown,
        "description": entry.description,
    }


# The report of a test stands first: a template without the tags of another kind is its own.
_DOCUMENTS = {
    "report": ("test.content.REPORT", "The report of a test"),
    "certificate": ("certificate.content.CERTIFICATE", "A calibration certificate"),
    "comparison": ("comparison.content.COMPARISON", "A comparison"),
    "diagnosis": ("diagnosis.answer.DIAGNOSIS", "A diagnosis"),
    "audit": ("audit.content.AUDIT", "An audit's summary"),
    "plan": ("plan.content.PLAN", "The sheet of a plan"),
    "laboratories": ("laboratories.content.LABORATORIES", "An interlaboratory comparison"),
}
TITLES = {name: title for name, (_, title) in _DOCUMENTS.items()}


class Vocabularies(Mapping[str, "Vocabulary"]):
    """What templates of each kind can ask for, by the name of the kind."""

    def __getitem__(self, name: str) -> Vocabulary:
        module, _, attribute = _DOCUMENTS[name][0].rpartition(".")
        document: Document[object] = getattr(import_module(f"toolkit.report.{module}"), attribute)
        return document.vocabulary

    def __iter__(self) -> Iterator[str]:
        return iter(_DOCUMENTS)

    def __len__(self) -> int:
        return len(_DOCUMENTS)


VOCABULARIES = Vocabularies()


def kind_of(template: Template) -> str:
    """Return the name of the kind of documents that a template was made for, as its tags tell.

    Raises
    ------
    TemplateError
        it is no Word file that can be read
    """
    vocabulary = vocabulary_of(scan(stories(open_package(template))), VOCABULARIES)
    return next(name for name, known in VOCABULARIES.items() if known is vocabulary)


def check(template: Template, style: Style, *, fonts: bool = True) -> tuple[LintFinding, ...]:
    """Return what is wrong with a template of any kind (see `toolkit.report.word.check.check_template`)."""
    return check_template(template, style, VOCABULARIES, fonts=fonts)
