"""What no installed font has is an empty box in print, whatever the PDF's text says."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.template_factory import opened, p
from toolkit.report.deliver import Delivered
from toolkit.report.kinds import check
from toolkit.report.style import Style
from toolkit.report.word.filled import Filled
from toolkit.report.word.fonts import undrawn
from toolkit.report.word.verify import verify_pdf

pytestmark = pytest.mark.skipif(not shutil.which("fc-list"), reason="fontconfig is not installed")

# One letter of each of many scripts; some of them no computer's fonts have.
SCRIPTS = "aßЖαאبअকกကაጠᎣខᠠぁ田한ꀀ𐎀𒀀𓀀𖤀𞄀"


def has_font(character: str) -> bool:
    """Ask fontconfig itself which fonts have a character."""
    asked = subprocess.run(["fc-list", f":charset={ord(character):x}"], capture_output=True, check=True)
    return bool(asked.stdout.strip())


@pytest.fixture(scope="module")
def boxed() -> str:
    """A letter that no installed font has."""
    lacking = [character for character in SCRIPTS if not has_font(character)]
    if not lacking:
        pytest.skip("the fonts of this computer have a letter of each of these scripts")
    return lacking[0]


def test_a_character_is_drawn_where_fontconfig_knows_a_font_of_it() -> None:
    boxes = undrawn(SCRIPTS)
    assert boxes == [
        f"{character!r} (U+{ord(character):04X})" for character in sorted(SCRIPTS) if not has_font(character)
    ]


def test_what_is_never_drawn_by_itself_is_no_box() -> None:
    assert undrawn("\t\n \u00a0\u200f\ufe0f\ue000\U000f0000") == []


def test_a_value_that_is_printed_as_boxes_is_told(plain_report: Delivered, boxed: str) -> None:
    whole: Filled = plain_report.filled
    assert "glyphs" not in {check.name for check in verify_pdf(plain_report.pdf, whole)[0]}
    entry = replace(whole.manifest[0], text=boxed)
    checks = verify_pdf(plain_report.pdf, replace(whole, manifest=(*whole.manifest, entry)))[0]
    (told,) = (check for check in checks if check.name == "glyphs")
    assert (told.ok, told.warning) == (False, True)
    assert f"U+{ord(boxed):04X}" in told.message


def test_a_template_s_own_text_of_boxes_is_told(tmp_path: Path, boxed: str) -> None:
    body = p("{{tk:calibration.hash}}") + p(f"x{boxed}y")
    (told,) = (one for one in check(opened(tmp_path, body), Style()) if one.rule == "character-undrawn")
    assert (told.level, told.part) == ("warning", "word/document.xml")
    assert f"U+{ord(boxed):04X}" in told.message
