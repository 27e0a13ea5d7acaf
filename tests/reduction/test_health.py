import numpy as np
import pytest

from tests.audit.archive_made import HEADER, recording, write
from toolkit.findings import Finding
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording
from toolkit.reduction.health import first_of_many, health_findings, quality


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


BLOCKS = [slice(start, start + 20) for start in range(0, 100, 20)]


def health(tmp_path, *, stretches=BLOCKS, read=None, **changes):
    g = np.random.default_rng(5)
    level = np.repeat([1.0, 2, 3, 4, 5], 20)
    table = recording(rows=100) | {
        name: np.round(100 * level + g.normal(0, 1, 100), 4) for name in ("D51", "D52", "E5", "FZ")
    }
    write(tmp_path / "one.xlsx", table | changes, HEADER | {"t": "t [s]"})
    return health_findings(
        read_recording(tmp_path / "one.xlsx", load_machine("m15")), "one.xlsx", stretches=stretches, read=read
    )


def test_sound_blocks_have_nothing(tmp_path):
    # The clock restarts with every block, and the slip angle is held.
    assert health(tmp_path, t=np.tile(np.arange(20) * 0.05, 5), SA=np.full(100, 2.0)) == []


@pytest.mark.parametrize(("read", "level"), [(None, "error"), (("D51",), "warning")])
def test_a_dead_cell_is_an_error_where_the_result_reads_it(tmp_path, read, level):
    (found,) = health(tmp_path, E5=np.full(100, -12.5), read=read)
    assert (found.rule, found.level) == ("constant-channel", level)


@pytest.mark.parametrize(("value", "rule"), [(250.0, "constant-channel"), (700.0, "saturated-channel")])
def test_a_cell_that_stands_still_in_some_blocks(tmp_path, value, rule):
    g = np.random.default_rng(6)
    D51 = np.round(np.repeat([100.0, 200, 300, 400, 500], 20) + g.normal(0, 1, 100), 4)
    D51[40:80] = value
    (found,) = health(tmp_path, D51=D51)
    assert (found.rule, found.level) == (rule, "error")
    assert "rows 41 to 80" in found.message


@pytest.mark.parametrize(
    ("of_D51", "word"),
    [
        (lambda D51: D51, "last digit"),
        (lambda D51: -D51, "other sign"),
        (lambda D51: D51 + 12.5, "last digit"),
    ],
    ids=["copy", "turned", "another zero"],
)
@pytest.mark.parametrize(("read", "level"), [(None, "error"), (("E5",), "warning")])
def test_a_cell_that_is_a_copy_of_another_one(tmp_path, of_D51, word, read, level):
    """Two amplifiers have two noises: a channel that was connected twice has one."""
    D51 = recording(rows=100)["D51"] + np.round(np.random.default_rng(7).normal(0, 1, 100), 4)
    (found,) = health(tmp_path, D51=D51, D52=np.round(of_D51(D51), 10), read=read)
    assert (found.rule, found.level) == ("copied-channel", level)
    assert "D51" in found.message
    assert "D52" in found.message
    assert word in found.message
    assert "copied-channel" in {note.rule for note in notes(tmp_path, D51=D51, D52=np.round(of_D51(D51), 10))}


def test_cells_of_coarse_digits_that_agree_by_chance_are_no_copies(tmp_path):
    coarse = np.where(np.arange(100) == 50, 101.0, 100.0)
    assert "copied-channel" not in {found.rule for found in health(tmp_path, D51=coarse, D52=coarse)}
    ramp = np.arange(100) * 0.5
    assert "copied-channel" not in {found.rule for found in health(tmp_path, D51=ramp, D52=ramp)}


def test_one_sample_held_over_each_block(tmp_path):
    held = {name: np.repeat([1.0, 2, 3, 4, 5], 20) * 100 for name in ("D51", "D52", "E5", "FZ")}
    (found,) = health(tmp_path, **held)
    assert (found.rule, found.level) == ("constant-channel", "warning")


@pytest.mark.parametrize(
    ("t", "level", "words"),
    [
        (np.where(np.arange(100) > 50, -5.0, 0.0) + np.arange(100) * 0.01, "error", "runs backwards"),
        (np.full(100, 5.0), "error", "stands at 5"),
        (np.arange(100) // 4 * 0.04, "note", "repeats"),
        (np.where(np.arange(100) > 50, 5.0, 0.0) + np.arange(100) * 0.01, "warning", "leaps"),
    ],
)
def test_a_clock_that_does_not_run_in_a_block(tmp_path, t, level, words):
    (found,) = health(tmp_path, t=t)
    assert (found.rule, found.level) == ("clock-jump", level)
    assert words in found.message


def test_what_many_files_show_alike_is_said_once():
    many = [Finding(rule="clock-jump", where=f"{i}.csv", message="t stands", level="error") for i in range(9)]
    assert [one.where for one in first_of_many(many)] == ["9 files (0.csv, ...)"]
    assert first_of_many(many[:3]) == many[:3]
