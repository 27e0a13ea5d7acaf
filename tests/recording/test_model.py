"""A recording's name is text that every document can print, whatever the disk calls the file."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from tests.conftest import EXAMPLES
from toolkit.machine import load_machine
from toolkit.printable import unprintable
from toolkit.recording.read import read_recording


@pytest.mark.parametrize(
    ("disk", "text"),
    [(b"a\x08b", "a\\x08b"), (b"R\xfcck", "R\\udcfcck"), ("Rück".encode(), "Rück"), (b"a\nb", "a\\nb")],
)
def test_a_name_that_no_text_holds_is_shown_by_its_escapes(tmp_path: Path, disk: bytes, text: str) -> None:
    folder = tmp_path / "below"
    folder.mkdir()
    path = folder / os.fsdecode(disk)
    shutil.copy(EXAMPLES / "fig4_4" / "M15_fig4_4.xlsx", path)
    recording = read_recording(path, load_machine("m15"))
    assert (recording.name, recording.name_in(tmp_path)) == (text, f"below/{text}")
    assert unprintable(recording.name) is None
