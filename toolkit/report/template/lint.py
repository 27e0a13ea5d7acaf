"""What the template lint says: its rules, and a finding with its rule and place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

RULES = {
    "no-tags": "the template has no tag of the toolkit",
    "unknown-tag": "a tag is not in the catalogue",
    "malformed-tag": "a literal tag is not closed or has no path",
    "missing-required": "a required tag is not in the template",
    "doubled-tag": "a figure or table stands twice in the body",
    "bad-format": "the format after the bar does not fit the tag",
    "wrong-place": "a tag stands where it cannot be filled",
    "overlapping-tags": "a tag stands inside a control that will be filled as a whole",
    "no-table": "a table tag has no table",
    "prototype": "a table has no prototype row, or more than one",
    "unknown-column": "a prototype row names a column that the table has not",
    "column-count": "a prototype row without tags has more or fewer cells than the table has columns",
    "tracked-changes": "the template holds tracked changes",
    "comments": "the template holds comments",
    "date-field": "a DATE or TIME field becomes the day of printing",
    "if-field": "an IF field is not evaluated",
    "contents": "a table of contents or an index is of a kind that is not updated",
    "missing-style": "a style that the style file names is not in the template",
    "font-unavailable": "a font is not installed and will be replaced",
    "attached-template": "the template is attached to another file, which is dropped",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LintFinding:
    """One finding: rule, level, the part of the package, the place in it, and a sentence."""

    rule: str
    level: Literal["error", "warning"]
    part: str
    place: str
    message: str

    def as_dict(self) -> dict[str, str]:
        """Return the finding as a JSON-ready dict."""
        return {
            "rule": self.rule,
            "level": self.level,
            "part": self.part,
            "place": self.place,
            "message": self.message,
        }
