"""Files that were moved to the test of another day: told, and never repaired by what was in force then."""

from __future__ import annotations

import shutil

import pytest

from tests.audit.archive_made import dated, factory, recording, write, write_saved
from toolkit.audit.archive import audit_archive
from toolkit.audit.corrected import write_copies
from toolkit.audit.day import CONTRADICTED
from toolkit.calibration.registry.registry import Registry

OLD, NEW = factory.EDITIONS[2], factory.EDITIONS[6]


@pytest.fixture(scope="module")
def registry(tmp_path_factory):
    folder = tmp_path_factory.mktemp("editions") / "calibrations"
    factory.make_registry(folder)
    return Registry(folder)


def old(seed=1):
    return recording(seed=seed, FY=OLD[1], MZ=OLD[2])


def told(made):
    return {one.where: one.message for one in made.findings if one.rule == CONTRADICTED}


def test_the_same_recording_in_tests_of_two_days_is_told_and_not_repaired(tmp_path, registry):
    archive = tmp_path / "archive"
    for name, edition in (("old", OLD), ("new", NEW)):
        dated(archive / name, edition[0])
    write(archive / "old" / "a.xlsx", old())
    write(archive / "new" / "own.xlsx", old(seed=2))  # its own, computed by the record of before: stale
    shutil.copy(archive / "old" / "a.xlsx", archive / "new" / "b.xlsx")
    made = audit_archive(archive, registry, known_at=factory.KNOWN_AT)
    assert {one.path: one.grade for one in made.files} == {
        "new/b.xlsx": "stale", "new/own.xlsx": "stale", "old/a.xlsx": "exact",
    }  # fmt: skip
    messages = told(made)
    assert list(messages) == ["new/b.xlsx", "old/a.xlsx"]
    assert f"old/a.xlsx in a test of {OLD[0]}" in messages["new/b.xlsx"]
    assert f"new/b.xlsx in a test of {NEW[0]}" in messages["old/a.xlsx"]
    copies = {one.path: one for one in write_copies(made, registry, tmp_path / "fixed")}
    assert copies["new/own.xlsx"].sha256 is not None
    assert copies["new/b.xlsx"].sha256 is None
    assert str(copies["new/b.xlsx"].reason).startswith("date-contradicted: ")


def test_copies_under_one_record_say_nothing_of_the_day(tmp_path, registry):
    for name, day in (("one", "2000-02-01"), ("two", "2000-02-09")):
        dated(tmp_path / name, day)
        write(tmp_path / name / "a.xlsx", old())
    assert told(audit_archive(tmp_path, registry, known_at=factory.KNOWN_AT)) == {}


def test_a_file_that_was_saved_before_its_test_is_told(tmp_path, registry):
    dated(tmp_path, "2008-06-10")
    for name, day in (("moved", "1996-05-01"), ("evening", "2008-06-09"), ("own", "2008-06-10")):
        write_saved(tmp_path / f"{name}.xlsx", old(), f"{day}T22:00:00Z")
    messages = told(audit_archive(tmp_path, registry, known_at=factory.KNOWN_AT))
    assert list(messages) == ["moved.xlsx"]
    assert "saved on 1996-05-01, 4423 days before the test of 2008-06-10" in messages["moved.xlsx"]
