"""What a reader can see of a print: by the page itself, whatever property of the document is to blame."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.report.template_factory import make
from toolkit.report.word.legible import Print, seen
from toolkit.report.word.office import Office

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def para(word: str, look: str = "", more: str = "", ppr: str = "") -> str:
    return f"<w:p><w:pPr>{ppr}</w:pPr><w:r><w:rPr>{look}</w:rPr><w:t>{word}</w:t></w:r>{more}</w:p>"


def cell(inner: str, fill: str, height: str = "", border: str = "") -> str:
    return (
        f'<w:tbl><w:tblPr><w:tblBorders>{border}</w:tblBorders></w:tblPr><w:tblGrid><w:gridCol w:w="4000"/>'
        f'</w:tblGrid><w:tr><w:trPr>{height}</w:trPr><w:tc><w:tcPr><w:tcW w:w="4000" w:type="dxa"/>'
        f'<w:shd w:val="clear" w:color="auto" w:fill="{fill}"/></w:tcPr>{inner}</w:tc></w:tr></w:tbl><w:p/>'
    )


def shape(colour: str) -> str:
    return (
        '<w:r><w:pict xmlns:v="urn:schemas-microsoft-com:vml"><v:rect style="position:absolute;'
        "margin-left:-20pt;margin-top:-10pt;width:400pt;height:40pt;z-index:99999;"
        'mso-position-horizontal-relative:text;mso-position-vertical-relative:text" '
        f'fillcolor="{colour}" stroked="f"/></w:pict></w:r>'
    )


WHITE, TINY = '<w:color w:val="FFFFFF"/>', '<w:sz w:val="4"/><w:szCs w:val="4"/>'
EXACT = '<w:trHeight w:val="20" w:hRule="exact"/>'
LINES = "".join(f'<w:{side} w:val="single" w:sz="12"/>' for side in ("top", "left", "bottom", "right"))
READABLE: dict[str, Callable[[str], str]] = {
    "plain": para,
    "grey": lambda word: para(word, '<w:color w:val="808080"/><w:sz w:val="16"/>'),
    "small": lambda word: para(word, '<w:sz w:val="12"/>'),
    "white in a dark cell": lambda word: cell(para(word, WHITE), "1F3864"),
    "underlined": lambda word: para(word, '<w:u w:val="single"/>'),
    "with signs": lambda word: para(f"{word} = - . _"),
    "condensed": lambda word: para(word, '<w:w w:val="60"/>'),
}
UNREADABLE: dict[str, Callable[[str], str]] = {
    "white": lambda word: para(word, WHITE),
    "two points": lambda word: para(word, TINY),
    "nearly white": lambda word: para(word, '<w:color w:val="F2F2F2"/>'),
    "of the colour of its cell": lambda word: cell(para(word, '<w:color w:val="1F3864"/>'), "1F3864"),
    "of the colour of its shading": lambda word: para(
        word, '<w:color w:val="C00000"/><w:shd w:val="clear" w:color="auto" w:fill="C00000"/>'
    ),
    "white and underlined in black": lambda word: para(
        word, '<w:color w:val="FFFFFF"/><w:u w:val="single" w:color="000000"/>'
    ),
    "white between borders": lambda word: cell(para(word, WHITE), "FFFFFF", border=LINES),
    "letters of no width": lambda word: para(word, '<w:w w:val="1"/>'),
    "in a row of no height": lambda word: cell(para(word), "FFFFFF", EXACT),
    "under a shape": lambda word: para(word, more=shape("white")) + "<w:p/>" * 4,
}


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return why each case cannot be read: one document, each case a word of its own."""
    folder = tmp_path_factory.mktemp("print")
    cases = {**READABLE, **UNREADABLE}
    words = {name: f"WORD{number:02d}READ" for number, name in enumerate(cases, 11)}
    said = {name: f"{word} = - . _" if name == "with signs" else word for name, word in words.items()}
    body = "".join(build(words[name]) + "<w:p/>" for name, build in cases.items())
    path = make(folder, body, hash_=False)
    with Office() as office:
        pdf = office.convert([path], folder)[0]
    hidden = dict(seen(pdf, tuple(said.values()), None))
    texts = "".join(page.text for page in Print(pdf, folder).pages)
    assert all(word in texts for word in words.values()), (
        "what is not in the text is the matter of another check"
    )
    return {name: hidden.get(text, "") for name, text in said.items()}


@pytest.mark.parametrize("name", READABLE)
def test_text_that_people_can_read_is_let_pass(printed: dict[str, str], name: str) -> None:
    assert printed[name] == ""


@pytest.mark.parametrize("name", UNREADABLE)
def test_text_that_nobody_sees_is_told_with_its_page(printed: dict[str, str], name: str) -> None:
    assert printed[name].startswith("page ")


def test_one_readable_place_is_enough_but_not_for_what_every_page_must_show(tmp_path: Path) -> None:
    broken = '<w:p><w:r><w:br w:type="page"/></w:r></w:p>'
    path = make(tmp_path, para("MARKED") + broken + para("MARKED", WHITE), hash_=False)
    with Office() as office:
        pdf = office.convert([path], tmp_path)[0]
    assert list(seen(pdf, ("MARKED",), None)) == []
    ((text, why),) = seen(pdf, (), "MARKED")
    assert (text, why.partition(":")[0]) == ("MARKED", "page 2")


def test_the_luminance_of_a_page_is_that_of_its_colours(tmp_path: Path) -> None:
    # WCAG 2: white 1, black 0, and the primaries by their weights.
    path = make(tmp_path, cell(para("x"), "00FF00"), hash_=False)
    with Office() as office:
        pdf = office.convert([path], tmp_path)[0]
    page = Print(pdf, tmp_path).drawn(1)
    assert page.max() == pytest.approx(1)
    assert np.isclose(page, 0.7152, atol=1e-3).sum() > 1000
