"""What test.toml may say of protocol, reversal and repeats; each wrong word is an error of its own line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recording.workbook_factory import members, packed
from toolkit.errors import ConfigError, ToolkitError
from toolkit.machine import load_machine
from toolkit.pipeline import machine_of
from toolkit.recording.folder import read_test_folder

PLAN = """
source = "two angles"
slip_angles = { value = [0, 1], unit = "deg" }
loads = { value = [1], unit = "kN" }
slip_angle_tolerance = { value = 0.5, unit = "deg" }
load_tolerance = 0.05
settle_revolutions = 1
average_revolutions = 1
acquisition = "after_settling"
"""


def folder_of(tmp_path: Path, toml: str) -> Path:
    folder = tmp_path / "test"
    folder.mkdir()
    (folder / "test.toml").write_text(f'machine = "m15"\n{toml}')
    (folder / "plans").mkdir()
    (folder / "plans" / "two.toml").write_text(PLAN)
    (folder / "a").write_bytes(packed(members()))
    return folder


def test_a_test_may_bring_its_protocol_and_it_is_no_recording(tmp_path: Path) -> None:
    test = read_test_folder(folder_of(tmp_path, 'protocol = "plans/two.toml"'))
    assert [path.name for path in test.files] == ["a"]
    assert test.protocol is not None
    assert machine_of(test).protocol.source == "two angles"


def test_without_one_the_machine_s_applies_and_a_named_one_goes_first(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, "")
    (folder / "plans" / "two.toml").rename(tmp_path / "two.toml")
    test = read_test_folder(folder)
    assert test.protocol is None
    assert machine_of(test).protocol == load_machine("m15").protocol
    from toolkit.machine import read_protocol

    assert machine_of(test, read_protocol(tmp_path / "two.toml")).protocol.loads_N == (1000.0,)


def test_repeats_are_told_apart_by_words(tmp_path: Path) -> None:
    toml = (
        'protocol = "plans/two.toml"\nmounting = "2nd"\nlaboratory = "Süd"\nreversal = "tire"\n'
        '[tire]\nbelt = "reversed"'
    )
    info = read_test_folder(folder_of(tmp_path, toml)).info
    assert (info.mounting, info.laboratory, info.reversal, info.tire_belt) == (
        "2nd",
        "Süd",
        "tire",
        "reversed",
    )


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ('protocol = "plans/three.toml"', "three.toml"),
        ("protocol = true", "a text"),
        ('reversal = "hub"', "drum or tire"),
        ("reversal = 1", "drum or tire"),
        ('mountng = "2"', "mounting"),
        ("mounting = [1]", "a text"),
        ('[tire]\nbelt = "left"', "regular or reversed"),
        ('[tire]\nbelts = "regular"', "belt"),
    ],
)
def test_a_wrong_word_is_refused(tmp_path: Path, toml: str, said: str) -> None:
    with pytest.raises(ToolkitError) as caught:
        read_test_folder(folder_of(tmp_path, toml))
    assert said in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_wrong_protocol_names_its_own_file(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, 'protocol = "plans/two.toml"')
    (folder / "plans" / "two.toml").write_text(PLAN + "speeed = 1\n")
    with pytest.raises(ConfigError) as caught:
        read_test_folder(folder)
    assert "two.toml" in str(caught.value.where)
