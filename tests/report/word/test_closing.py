"""The end of a document: its signatures where the template has no place for them, and the code's place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from lxml import etree

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import W, opened, p, texts
from toolkit.calibration.records.use import CalibrationUse
from toolkit.errors import RenderError
from toolkit.report.content import ReportContent, signature_text
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word import closing, preview
from toolkit.report.word.fill import fill

SIGNED = CalibrationUse(
    id="m15-r3", sha256="ab" * 32, unverified=False, signature="entered by Carl on 2026-11-22"
)
BODY = p("Size {{tk:tire.size}}")


def _content(**changes: object) -> ReportContent:
    return build_content(make_result(), make_record(), **changes)  # type: ignore[arg-type]


def _paragraphs(folder: Path, body: str, content: ReportContent) -> list[str]:
    return [text for text in texts(fill(opened(folder, body), content, {}).docx).split("\n") if text]


@pytest.mark.parametrize(
    ("uses", "issuer", "text"),
    [
        ((), None, "unsigned"),
        ((SIGNED, replace(SIGNED, id="m15-r4", signature="unsigned")), None, "unsigned"),
        ((SIGNED,), None, "m15-r3: entered by Carl on 2026-11-22; document unsigned"),
        ((SIGNED,), "Anna", "m15-r3: entered by Carl on 2026-11-22; document issued by Anna"),
        ((replace(SIGNED, signature="unsigned"),), "Anna", "record unsigned; document issued by Anna"),
    ],
)
def test_the_line_says_who_signed_what(
    uses: tuple[CalibrationUse, ...], issuer: str | None, text: str
) -> None:
    assert signature_text(uses, issuer) == text


def test_a_template_without_a_place_has_the_line_at_its_end(tmp_path: Path) -> None:
    assert _paragraphs(tmp_path, BODY, _content())[-1] == "Signature: unsigned"
    style = Style(words=(("Signature", "Unterschrift"),))
    assert _paragraphs(tmp_path, BODY, _content(style=style))[-1] == "Unterschrift: unsigned"


def test_the_line_stands_where_the_template_says_and_only_there(tmp_path: Path) -> None:
    body = p("Signed: {{tk:signature}}") + BODY
    shown = _paragraphs(tmp_path, body, _content())
    assert shown[0] == "Signed: unsigned"
    assert not any(text.startswith("Signature:") for text in shown)
    issued = _paragraphs(tmp_path, body, _content().issued_by("Anna"))
    assert issued[0] == "Signed: record unsigned; document issued by Anna"
    assert issued[-1] == closing.CAPTION


@pytest.mark.parametrize(
    ("tail", "place"),
    [("End of {identity}", 1), ("End of the report", 3), ("", 3)],
)
def test_the_words_that_end_a_document_stay_its_last(tail: str, place: int) -> None:
    content = _content().issued_by(None)
    words = [p("Size"), p(tail.format(identity=content.identity)), p(""), "<w:sectPr/>"]
    body = etree.fromstring(f'<w:body xmlns:w="{W}">{"".join(words)}</w:body>')
    assert [text for _, text in closing.close(body, content, signed=False)] == [
        "Signature: unsigned",
        closing.CAPTION,
    ]
    shown = ["".join(child.itertext()) for child in body]
    at = shown.index("Signature: unsigned")
    assert shown[at + 1] == closing.CAPTION
    assert at == place
    assert body[-1].tag == f"{{{W}}}sectPr"


_PAGE = '<page width="595.0" height="842.0">\n{}</page>'


def _listing(*words: tuple[float, float, str]) -> str:
    rows = (
        f'<word xMin="{x}" yMin="{y}" xMax="{x + 20}" yMax="{y + 10}">{text}</word>\n' for x, y, text in words
    )
    return _PAGE.format("".join(rows))


def _caption(top: float) -> list[tuple[float, float, str]]:
    words = closing.CAPTION.replace("'", "&apos;").split()
    return [(60 + 25 * (n % 15), top + 12 * (n // 15), word) for n, word in enumerate(words)]


def test_the_code_stands_below_its_words(monkeypatch: pytest.MonkeyPatch) -> None:
    listing = _listing((60, 40, "Header"), *_caption(100), (60, 400, "End"))
    monkeypatch.setattr(preview, "poppler", lambda _words: listing)
    place = closing.place_of_symbol(Path("x.pdf"), 7, _content().issued_by(None))
    lines = -(-len(closing.CAPTION.split()) // 15)
    assert (place.page, place.left, place.size) == (6, 60.0, closing.SIZE)
    assert 100 + 12 * (lines - 1) + 10 <= place.top <= 100 + 12 * lines + 10


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ([(60, 40, "Header")], "not on the last page"),
        ([*_caption(100), (100, 200, "stamp")], "'stamp' stands there"),
        (_caption(700), "the page ends there"),
    ],
)
def test_a_page_without_a_place_is_refused(
    words: list[tuple[float, float, str]], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preview, "poppler", lambda _words: _listing(*words))
    with pytest.raises(RenderError) as refusal:
        closing.place_of_symbol(Path("x.pdf"), 1, _content().issued_by(None))
    assert refusal.value.rule == "proof-place"
    assert why in str(refusal.value.got)
