import numpy as np
import pytest

from tests.audit.archive_made import HEADER, recording, write
from toolkit.audit.quality import quality
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording


def notes(tmp_path, **changes):
    table = recording(rows=100) | changes
    headers = HEADER | {"t": "t [s]"}
    write(tmp_path / "one.xlsx", table, headers)
    return quality(read_recording(tmp_path / "one.xlsx", load_machine("m15")), "one.xlsx")


def test_a_sound_file_has_none(tmp_path):
    assert notes(tmp_path, t=np.arange(100) * 0.01) == ()


def test_a_channel_that_never_changes(tmp_path):
    (found,) = notes(tmp_path, E5=np.full(100, 12.5))
    assert (found.rule, found.level) == ("constant-channel", "note")
    assert "E5" in found.message


@pytest.mark.parametrize("end", [max, min])
def test_a_channel_at_the_end_of_its_range(tmp_path, end):
    D51 = recording(rows=100)["D51"]
    D51[40:50] = end(D51) * (1.5 if end is max else 0.5)
    (found,) = notes(tmp_path, D51=D51)
    assert found.rule == "saturated-channel"
    assert "rows 41 to 50" in found.message


def test_a_coarse_channel_that_often_repeats_is_not_saturated(tmp_path):
    assert notes(tmp_path, SA=np.round(np.linspace(0, 0.3, 100), 1)) == ()


@pytest.mark.parametrize("row", [30, 60])
def test_a_clock_that_jumps(tmp_path, row):
    t = np.arange(100) * 0.01
    t[row:] += 5.0 if row == 30 else -0.3
    (found,) = notes(tmp_path, t=t)
    assert found.rule == "clock-jump"
    assert f"after row {row}" in found.message


def test_a_few_rows_prove_nothing(tmp_path):
    write(tmp_path / "two.xlsx", {k: v[:2] for k, v in recording().items()} | {"E5": np.zeros(2)})
    assert quality(read_recording(tmp_path / "two.xlsx", load_machine("m15")), "two.xlsx") == ()
