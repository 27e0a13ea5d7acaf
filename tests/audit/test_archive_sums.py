"""What an archive amounts to is added up once, and again as soon as any of it is another."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recording.fig4_4 import write_fig4_4
from toolkit.audit import archive as archive_module
from toolkit.audit.archive import SUMS, audit_archive, read_sums, sum_up, write_sums
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import OutputError

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"
NAMES = ("one", "two")


@pytest.fixture
def archive(tmp_path):
    root = tmp_path / "archive"
    for name in NAMES:
        (root / name).mkdir(parents=True)
        write_fig4_4(root / name)
        (root / name / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2018-03-01\n')
    (root / "letter.xlsx").write_bytes(b"no recording")
    return root


@pytest.fixture
def added(monkeypatch):
    """How many files were added up, run by run; the work is done here, without processes."""
    runs = []

    def counted(files):
        every = list(files)
        runs.append(len(every))
        return sum_up(every)

    def run(make, todo, *, workers, timeout_s=None):
        work = make()
        return [(name, work(name)) for name in todo]

    monkeypatch.setattr(archive_module, "sum_up", counted)
    monkeypatch.setattr(archive_module, "run_isolated", run)
    return runs


def audit(archive, out):
    return audit_archive(archive, Registry(CALIBRATIONS), out=out)


def test_an_unchanged_archive_is_added_up_once(archive, tmp_path, added):
    first = audit(archive, tmp_path / "out")
    assert {one.rule for one in first.findings} >= {"duplicate-file", "unreadable-file"}
    assert len(first.tests) == len(NAMES)
    assert audit(archive, tmp_path / "out") == first
    assert added == [len(first.files)]


def test_without_a_folder_nothing_is_kept(archive, tmp_path, added):
    first = audit(archive, None)
    assert audit(archive, None) == first
    assert len(added) == 2
    assert not list(tmp_path.rglob(SUMS))


@pytest.mark.parametrize("change", ["content", "new", "gone", "moved", "date"])
def test_any_change_of_the_archive_is_added_up_anew(archive, tmp_path, added, change):
    audit(archive, tmp_path / "out")
    letter = archive / "letter.xlsx"
    if change == "content":
        letter.write_bytes(b"no Recording")  # as long as before
    elif change == "new":
        (archive / "another").write_bytes(b"no recording")
    elif change == "gone":
        letter.unlink()
    elif change == "moved":
        letter.rename(archive / "a letter.xlsx")
    else:
        (archive / "one" / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-05\n')
    second = audit(archive, tmp_path / "out")
    assert len(added) == 2
    assert second == audit(archive, None)


@pytest.mark.parametrize("harm", ["cut", "flipped", "empty", "other", "longer"])
def test_damaged_sums_are_made_again(archive, tmp_path, added, harm):
    first = audit(archive, tmp_path / "out")
    kept = tmp_path / "out" / SUMS
    data = kept.read_bytes()
    kept.write_bytes(
        {
            "cut": data[: len(data) // 2],
            "flipped": data.replace(b"unreadable-file", b"Unreadable-file"),
            "empty": b"",
            "other": b"[1, 2]\n",
            "longer": data + data,
        }[harm]
    )
    assert audit(archive, tmp_path / "out") == first
    assert len(added) == 2
    assert kept.read_bytes() == data


def test_sums_under_another_key_are_not_taken(tmp_path):
    write_sums(tmp_path, sum_up([]), "a key")
    assert read_sums(tmp_path, "another") is None
    again = read_sums(tmp_path, "a key")
    assert again is not None
    assert set(again.grades.values()) == {0}


def test_a_full_disk_leaves_no_part_of_them(tmp_path, monkeypatch):
    def full(sums, key):
        yield b"{}\n"
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("toolkit.audit.archive._lines", full)
    with pytest.raises(OutputError, match="No space left"):
        write_sums(tmp_path, sum_up([]), "a key")
    assert list(tmp_path.iterdir()) == []
