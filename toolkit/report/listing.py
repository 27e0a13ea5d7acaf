"""The list of tags, with what a test has for each."""

from __future__ import annotations

from typing import Any

from toolkit.report.content import ReportContent, Value
from toolkit.report.entries import Spec
from toolkit.report.style import Style
from toolkit.report.vocabulary import REPORT, Vocabulary


def list_tags(
    content: ReportContent | None, style: Style, vocabulary: Vocabulary = REPORT
) -> list[dict[str, Any]]:
    """Return every tag as a JSON-ready dict; ``available`` and ``value`` are null without a test."""
    listed = [_entry(one, content, style, vocabulary) for one in vocabulary.catalogue]
    known = {one["tag"] for one in listed}
    for path, value in (content.values if content else {}).items():
        if f"tk:{path}" not in known:
            spec = Spec(
                path=path,
                kind=value.kind,
                description="coefficient of the calibration record",
                unit=value.unit,
            )
            listed.append(_entry(spec, content, style, vocabulary))
    return listed


def _entry(one: Spec, content: ReportContent | None, style: Style, vocabulary: Vocabulary) -> dict[str, Any]:
    available: bool | None = None
    value: str | bool | None = None
    name = one.path.partition(".")[2]
    unit = style.unit(one.unit)[0]
    if content is not None and one.kind in ("text", "number", "date"):
        found = content.values.get(one.path, Value(kind="text", value=None))
        available = not found.missing
        value = found.text(None, content.style) if available else None
        unit = found.unit or unit
    elif content is not None and one.kind == "figure":
        available = name in content.plots
        value = content.plots[name].alt if available else None
    elif content is not None and one.kind == "table":
        rows = content.tables[name].rows
        available, value = bool(rows), f"{len(rows)} rows"
    elif content is not None and one.kind == "if":
        available = value = content.conditions.get(name, False)
    return {
        "tag": f"tk:{one.path}",
        "kind": one.kind,
        "unit": unit,
        "required": f"tk:{one.path}" in vocabulary.demanded(style.required),
        "columns": [column.name for column in one.columns],
        "available": available,
        "value": value,
        "description": one.description,
    }
