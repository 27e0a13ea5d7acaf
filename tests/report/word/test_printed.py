"""Each text of a Word file takes its own place in the text of a PDF."""

from __future__ import annotations

import io
import random
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.template_factory import p, tbl
from tests.report.word.test_fill import filled
from toolkit.report.word.printed import passages_of, unprinted

PROSE = "The lateral force was measured at five loads and thirteen slip angles on the drum of the machine"


def lost(folder: Path, body: str, *readings: str) -> list[str]:
    """Return what is lost of a template's body, whose hash and signature are printed at the end."""
    result = filled(folder, body)
    end = " ".join(entry.text for entry in result.manifest)
    return unprinted(result, set(), [f"{reading} {end}" for reading in readings])


@pytest.mark.parametrize(
    ("body", "reading"),
    [
        (p("one two"), "one\ntwo"),
        (p(PROSE), PROSE.replace(" five", " five\nfooter 3\f header\n")),
        (p(PROSE), PROSE.upper()),
        (p("a" * 30 + "b" * 34), "a" * 30 + " footer\fheader " + "b" * 34),
        (p(PROSE), PROSE.replace("machine", "ma-\nchine")),
        (tbl(["1.5", "21.54"], ["4", "14.5"]), "14.5 4 21.54 1.5"),
        (p("12.5 kN") * 2, "12.5 kN 12.5 kN"),
        (p("• first") + p("– second"), "first second"),
        (p("non\u2011breaking 10\u207b\u00b3, so\u00adft"), "non-breaking 10-3, soft"),
        (p("final flow"), "\ufb01nal \ufb02ow"),
    ],
)
def test_what_stands_there_is_found(tmp_path: Path, body: str, reading: str) -> None:
    assert lost(tmp_path, body, reading) == []


@pytest.mark.parametrize(
    ("body", "reading"),
    [
        (p("12.5 kN") * 2, "12.5 kN"),
        (p("Mean: 12.5 kN") + p("12.5 kN"), "Mean: 12.5 kN"),
        (p("Mean: 12.5 kN") + p("12.5 kN"), "Mean: 12.5 kN and 2.5 kN"),
        (p(PROSE), PROSE.replace("thirteen", "")),
        (p(PROSE), " ".join(reversed(PROSE.split()))),
        (p("The tire does not pass"), "The tire passes"),
        (tbl(["7", "8"], ["9", "10"]), "7 8 9"),
    ],
)
def test_what_does_not_is_lost(tmp_path: Path, body: str, reading: str) -> None:
    assert len(lost(tmp_path, body, reading)) == 1


def test_it_is_enough_to_stand_in_one_order_of_the_print(tmp_path: Path) -> None:
    body = p("[10 k\u03a9] total") + p("second 5 N")
    assert lost(tmp_path, body, "[10 k] total \u03a9 second 5 N", "[10 k\u03a9] total second 5 N") == []
    assert lost(tmp_path, body, "[10 k] total \u03a9 second", "[10 k\u03a9] total second") != []


@pytest.mark.parametrize("seed", range(5))
def test_in_whatever_order_cells_are_painted_none_is_lost_and_each_that_is_cut_is_found(
    tmp_path: Path, seed: int
) -> None:
    drawn = random.Random(seed)
    rows = [[f"{drawn.gauss(0, 50):.{drawn.randrange(3)}f}" for _ in range(6)] for _ in range(30)]
    cells = [cell for row in rows for cell in row]
    drawn.shuffle(cells)
    assert lost(tmp_path, tbl(*rows), " ".join(cells)) == []
    assert lost(tmp_path, tbl(*rows), " ".join(cells[1:])) != []


def test_a_style_that_shows_what_its_base_hides_is_seen(tmp_path: Path) -> None:
    styles = "".join(
        f'<w:style w:type="paragraph" w:styleId="{name}"><w:name w:val="{name}"/>{base}'
        f"<w:rPr>{mark}</w:rPr></w:style>"
        for name, base, mark in (
            ("Secret", "", "<w:vanish/>"),
            ("Secret2", '<w:basedOn w:val="Secret"/>', ""),
            ("Told", '<w:basedOn w:val="Secret"/>', '<w:vanish w:val="0"/>'),
        )
    )
    body = "".join(
        f'<w:p><w:pPr><w:pStyle w:val="{name}"/></w:pPr><w:r><w:t>text of {name}</w:t></w:r></w:p>'
        for name in ("Secret", "Secret2", "Told")
    )
    result = filled(tmp_path, body)
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(result.docx)) as source, zipfile.ZipFile(stream, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "word/styles.xml":
                data = data.replace(b"</w:styles>", styles.encode() + b"</w:styles>")
            target.writestr(name, data)
    passages, _ = passages_of(replace(result, docx=stream.getvalue()), set())
    texts = [text for passage in passages for text in passage.texts]
    assert [text for text in texts if text.startswith("text of")] == ["text of Told"]
