"""Each finding of a template stands on the printed page where its text stands, and nothing else moves."""

from __future__ import annotations

from pathlib import Path

from docx import Document

from toolkit.report.kinds import check
from toolkit.report.style import Style
from toolkit.report.word.office import Office
from toolkit.report.word.package import read_template
from toolkit.report.word.preview import marked_pages, marked_template, words_of


def printed(folder: Path, data: bytes) -> Path:
    folder.mkdir()
    (folder / "template.docx").write_bytes(data)
    with Office() as office:
        return office.convert([folder / "template.docx"], folder)[0]


def test_a_mark_lies_at_the_tag_that_its_finding_is_about(tmp_path: Path) -> None:
    document = Document()
    document.sections[0].header.paragraphs[0].text = "{{tk:wrong.header}}"
    document.add_paragraph("Report {{tk:wrong.first}}")
    table = document.add_table(2, 2)
    table.cell(1, 0).text = "{{tk:wrong.cell}}"
    document.add_page_break()
    document.add_paragraph("{{tk:wrong.last}}")
    document.save(str(tmp_path / "own.docx"))
    template = read_template(tmp_path / "own.docx")
    findings = check(template, Style(), fonts=False)
    marked = printed(tmp_path / "marked", marked_template(template, [(f.part, f.place) for f in findings]))
    plain = printed(tmp_path / "plain", template.data)
    tags = {
        (number, text): top
        for number, (_, _, words) in enumerate(words_of(plain))
        for text, _, top, _, _ in words
        if "wrong" in text
    }
    pages = marked_pages(marked)
    assert len(pages) == len(words_of(plain)) == 2
    at = {
        (number, findings[mark - 1].message): top
        for number, seen in enumerate(pages)
        for mark, _, top in seen.marks
    }
    for (page, tag), top in tags.items():
        name = tag.strip("{}").removeprefix("tk:")
        (mark,) = [y for (number, message), y in at.items() if number == page and name in message]
        # A word of one point stands at the foot of its line, which is some ten points high.
        assert 0 <= mark - top < 14, tag
    # The header is on both pages; what is about the whole part stands at no place of a page.
    assert sum("wrong.header" in message for _, message in at) == 2
    assert not any("lacks the required tag" in message for _, message in at)
    # Nothing else moves: each word stays in its line, and behind a mark by the width of that at most.
    for (_, _, before), (_, _, after) in zip(words_of(plain), words_of(marked), strict=True):
        for text, _, top, right, _ in before:
            assert any(
                word.endswith(text) and abs(y - top) < 0.5 and abs(end - right) < 10
                for word, _, y, end, _ in after
            ), text


def test_a_place_that_is_none_has_no_mark(tmp_path: Path) -> None:
    document = Document()
    document.add_paragraph("text")
    document.save(str(tmp_path / "own.docx"))
    template = read_template(tmp_path / "own.docx")
    part = "word/document.xml"
    places = [
        (part, "part"),
        (part, "paragraph 9"),
        ("word/other.xml", "paragraph 1"),
        (part, "table 1, row 1"),
    ]
    assert marked_pages(printed(tmp_path / "p", marked_template(template, places)))[0].marks == ()
