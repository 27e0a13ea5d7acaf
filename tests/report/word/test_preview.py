"""Pages of a PDF as a screen shows them: where a mark stands, whatever lies around it."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.errors import RenderError
from toolkit.report.word import preview
from toolkit.report.word.preview import page_picture, pages_of

LISTING = """<doc>
  <page width="595.3" height="841.9">
    <word xMin="10.0" yMin="20.0" xMax="30.0" yMax="28.0">n/a</word>
    <word xMin="40.0" yMin="20.0" xMax="60.0" yMax="28.0">n/a,</word>
    <word xMin="10.0" yMin="40.0" xMax="30.0" yMax="48.0">not</word>
    <word xMin="32.0" yMin="40.0" xMax="60.0" yMax="48.5">&lt;there&gt;</word>
  </page>
  <page width="841.9" height="595.3">
  </page>
</doc>"""


@pytest.mark.parametrize(
    ("mark", "holes"),
    [("n/a", ((10.0, 20.0, 20.0, 8.0),)), ("not <there>", ((10.0, 40.0, 50.0, 8.5),)), ("", ()), ("-", ())],
)
def test_a_mark_is_found_as_the_words_that_it_is(
    mark: str, holes: tuple[tuple[float, ...], ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preview, "poppler", lambda _words: LISTING)
    first, second = pages_of(Path("report.pdf"), mark)
    assert first.holes == holes
    assert (second.width, second.height, second.holes) == (841.9, 595.3, ())


def test_what_is_no_pdf_is_refused_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "report.pdf").write_bytes(b"no pdf")
    with pytest.raises(RenderError) as caught:
        page_picture(tmp_path / "report.pdf", 1)
    assert "report.pdf" in str(caught.value)
