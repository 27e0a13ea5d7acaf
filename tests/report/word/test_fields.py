"""The fields of a document: their codes and results, inside each other and beside, and what is none."""

from __future__ import annotations

from lxml import etree

from tests.report.template_factory import run
from toolkit.report.word.fields import CODE, fields_of, number_captions
from toolkit.report.word.xml import NS, element, field_mark, text_run


def mark(kind: str) -> str:
    return f'<w:r><w:fldChar w:fldCharType="{kind}"/></w:r>'


def code(text: str) -> str:
    return f"<w:r><w:instrText>{text}</w:instrText></w:r>"


def paragraph(*content: str) -> etree._Element:
    return etree.fromstring(f'<w:p xmlns:w="{NS["w"]}">{"".join(content)}</w:p>')


def test_a_field_inside_the_code_of_another_belongs_to_both_and_its_result_to_its_own() -> None:
    inner = mark("begin") + code(" PAGE ") + mark("separate") + run("7") + mark("end")
    root = paragraph(
        mark("begin"), code(" IF "), inner, code(" = 7 "), mark("separate"), run("x"), mark("end")
    )
    outer, page = fields_of(root)
    assert (outer.words, page.words) == (["IF", "=", "7"], ["PAGE"])
    assert outer.whole == " IF  PAGE  = 7 "
    assert [text.text for text in page.results] == ["7"]
    assert [text.text for text in outer.results] == ["x"]


def test_a_code_in_no_field_is_found_and_numbers_nothing() -> None:
    root = paragraph(
        code(" SEQ Figure "),
        '<w:fldSimple w:instr=" SEQ Figure "/>',
        mark("begin"),
        code(" SEQ Figure "),
        mark("end"),
    )
    stray, simple, bare = fields_of(root)
    assert (stray.code, stray.whole) == ("", " SEQ Figure ")
    number_captions(root)
    assert [[text.text for text in field.results] for field in fields_of(root)] == [[], ["1"], ["2"]]
    assert (simple.end, bare.separate) == (None, None)


def test_what_is_written_is_read_again() -> None:
    root = element(
        "w:p",
        field_mark("begin"),
        text_run(" REF a ", CODE),
        field_mark("separate"),
        text_run("1"),
        field_mark("end"),
    )
    (field,) = fields_of(root)
    assert field.paragraphs == [root]
    field.show("12")
    assert "".join(root.itertext()) == " REF a 12"
