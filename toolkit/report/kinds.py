"""The kinds of documents that templates are made for; a kind is loaded when it is asked for."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.report.reference import reference_page
from toolkit.report.word.check import LintFinding, check_template

if TYPE_CHECKING:
    from toolkit.report.document import Document
    from toolkit.report.style import Style
    from toolkit.report.vocabulary import Vocabulary
    from toolkit.report.word.package import Template

# The report of a test stands first: a template without the tags of another kind is its own.
_DOCUMENTS = {
    "report": "test.content.REPORT",
    "certificate": "certificate.content.CERTIFICATE",
    "comparison": "comparison.content.COMPARISON",
    "diagnosis": "diagnosis.answer.DIAGNOSIS",
    "audit": "audit.content.AUDIT",
}


class Vocabularies(Mapping[str, "Vocabulary"]):
    """What templates of each kind can ask for, by the name of the kind."""

    def __getitem__(self, name: str) -> Vocabulary:
        module, _, attribute = _DOCUMENTS[name].rpartition(".")
        document: Document[object] = getattr(import_module(f"toolkit.report.{module}"), attribute)
        return document.vocabulary

    def __iter__(self) -> Iterator[str]:
        return iter(_DOCUMENTS)

    def __len__(self) -> int:
        return len(_DOCUMENTS)


VOCABULARIES = Vocabularies()
GENERATED = "<!-- generated -->\n"


def check(template: Template, style: Style, *, fonts: bool = True) -> tuple[LintFinding, ...]:
    """Return what is wrong with a template of any kind (see `toolkit.report.word.check.check_template`)."""
    return check_template(template, style, VOCABULARIES, fonts=fonts)


def write_manual(page: Path) -> None:
    """Write the lists of tags into a page of the manual, below the line that says that they are generated."""
    head, mark, _ = page.read_text(encoding="utf-8").partition(GENERATED)
    page.write_text(f"{head}{mark}\n{reference_page(VOCABULARIES.values())}", encoding="utf-8")


if __name__ == "__main__":
    write_manual(Path(sys.argv[1]))
