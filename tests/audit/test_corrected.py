"""Corrected copies: right by the record in force, named after what they replace, the originals untouched."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from tests.audit.archive_made import FY, HEADER, MZ, dated, factory, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.audit.corrected import INDEX, check_target, write_copies
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import OutputError
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording

REGISTRY = Registry(Path(__file__).resolve().parents[2] / "calibrations")
WRONG = (*FY[:2], -FY[2], FY[3])


def audit(folder):
    return audit_archive(folder, REGISTRY, known_at=dt.date(2026, 1, 1))


@pytest.fixture
def archive(tmp_path):
    root = tmp_path / "archive"
    dated(root / "test", "2019-06-01")
    write(root / "test" / "right.xlsx", recording())
    write(
        root / "test" / "wrong",
        recording(seed=2, FY=WRONG) | {"T": np.full(50, 21.5)},
        HEADER | {"T": "T [degC]"},
    )
    newton = recording(seed=3, FY=WRONG)
    newton["FY"] = newton["FY"] * 4.4482216152605
    write(root / "test" / "newton.xlsx", newton, HEADER | {"FY": "Fy [N]"})
    table = recording(seed=4, MZ=(-MZ[0], *MZ[1:]))
    lines = [",".join(HEADER[name] for name in table)]
    lines += [",".join(repr(v) for v in row) for row in np.column_stack(list(table.values())).tolist()]
    (root / "test" / "table.csv").write_text("\n".join(lines))
    (root / "loose.csv").write_text("\n".join(lines))
    return root


def test_copies_are_exact_and_everything_else_is_as_it_was(archive, tmp_path):
    before = {path: sha256_file(path) for path in archive.rglob("*") if path.is_file()}
    made = audit(archive)
    copies = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert [one.path for one in copies] == ["test/newton.xlsx", "test/table.csv", "test/wrong"]
    assert {path: sha256_file(path) for path in archive.rglob("*") if path.is_file()} == before
    again = audit(tmp_path / "fixed")
    assert {one.path: one.grade for one in again.files} == {one.path: "exact" for one in copies}
    machine = load_machine("m15")
    for one in copies:
        old, new = (read_recording(root / one.path, machine) for root in (archive, tmp_path / "fixed"))
        assert {s.symbol for s in new.series} == {s.symbol for s in old.series}
        for series in old.series:
            if series.symbol not in ("FY", "MZ"):
                np.testing.assert_array_equal(new[series.symbol].si, series.si)


def test_the_index_names_what_each_copy_replaces_and_by_which_record(archive, tmp_path):
    write_copies(audit(archive), REGISTRY, tmp_path / "fixed")
    told = json.loads((tmp_path / "fixed" / INDEX).read_text())
    one = next(one for one in told["files"] if one["path"] == "test/wrong")
    assert one["replaces_sha256"] == sha256_file(archive / "test" / "wrong")
    assert one["sha256"] == sha256_file(tmp_path / "fixed" / "test" / "wrong")
    assert (one["record"], one["record_sha256"]) == ("m15-r2", REGISTRY.load("m15-r2").sha256)


def test_a_second_run_writes_the_same(archive, tmp_path):
    made = audit(archive)
    first = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert write_copies(made, REGISTRY, tmp_path / "fixed") == first


@pytest.mark.parametrize("where", ["archive", "archive/inside", "."])
def test_a_folder_where_originals_are_is_refused(archive, tmp_path, where):
    with pytest.raises(OutputError) as caught:
        check_target(archive, tmp_path / where)
    assert caught.value.rule == "repair-target"


def test_a_link_to_the_archive_is_refused(archive, tmp_path):
    (tmp_path / "link").symlink_to(archive)
    with pytest.raises(OutputError):
        check_target(archive, tmp_path / "link")


def test_a_folder_with_other_files_and_a_file_are_refused(archive, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    for name in ("full", "full/mine.txt"):
        with pytest.raises(OutputError):
            check_target(archive, tmp_path / name)


def test_a_link_inside_the_folder_does_not_lead_out_of_it(archive, tmp_path):
    made = audit(archive)
    write_copies(made, REGISTRY, tmp_path / "fixed")
    for path in (tmp_path / "fixed" / "test").iterdir():
        path.unlink()
    (tmp_path / "fixed" / "test").rmdir()
    (tmp_path / "fixed" / "test").symlink_to(archive / "test")
    with pytest.raises(OutputError, match="corrected copies"):
        write_copies(made, REGISTRY, tmp_path / "fixed")


def test_a_file_that_changed_since_the_audit_has_no_copy(archive, tmp_path):
    made = audit(archive)
    write(archive / "test" / "wrong", recording(seed=8))
    copies = {one.path: one for one in write_copies(made, REGISTRY, tmp_path / "fixed")}
    assert copies["test/wrong"].sha256 is None
    assert "changed" in copies["test/wrong"].reason
    assert not (tmp_path / "fixed" / "test" / "wrong").exists()


def test_a_header_that_a_spreadsheet_would_run_becomes_text(archive, tmp_path):
    text = (archive / "test" / "table.csv").read_text().splitlines()
    lines = [text[0] + ',"=cmd [1]"', *(line + ",1.0" for line in text[1:])]
    (archive / "test" / "table.csv").write_text("\n".join(lines))
    write_copies(audit(archive), REGISTRY, tmp_path / "fixed")
    assert "'=cmd [1]" in (tmp_path / "fixed" / "test" / "table.csv").read_text().splitlines()[0]


@pytest.mark.parametrize(
    ("separator", "decimal", "encoding"),
    [(";", ",", "utf-8"), ("\t", ",", "utf-16"), ("\t", ".", "utf-8"), (";", ".", "utf-16")],
)
def test_text_of_any_dialect_has_a_copy_that_is_exact(archive, tmp_path, separator, decimal, encoding):
    path = archive / "test" / "table.csv"
    words = path.read_text().replace(",", separator).replace(".", decimal)
    path.write_bytes(words.encode(encoding))
    before = sha256_file(path)
    copies = write_copies(audit(archive), REGISTRY, tmp_path / "fixed")
    assert "test/table.csv" in [one.path for one in copies if one.replaces_sha256 == before]
    assert sha256_file(path) == before
    assert {one.grade for one in audit(tmp_path / "fixed").files} == {"exact"}


def test_every_kind_of_wrong_file_has_a_copy_that_is_exact(tmp_path):
    # Ambiguous, unknown, cut in the middle, one row off, swapped, turned, stale; originals cannot be written.
    made = factory.make_archive(tmp_path / "made", files=300, rows=60, seed=3)
    truth = made.truth
    assert set(made.grades) == {*factory.SHARES} - {"segments", "single_row"}
    assert any(len(one.segments) == 3 for one in truth.values())
    before = {path: sha256_file(path) for path in made.folder.rglob("*") if path.is_file()}
    for path in (*before, *made.folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    registry = Registry(made.calibrations)
    copies = write_copies(
        audit_archive(made.folder, registry, known_at=factory.KNOWN_AT), registry, tmp_path / "fixed"
    )
    for path in made.folder.rglob("*"):
        if path.is_dir():
            path.chmod(0o755)
    right = ("exact", "rounding", "undated", "unreadable")
    assert {one.path for one in copies} == {path for path, one in truth.items() if one.grade not in right}
    assert all(one.replaces_sha256 == before[made.folder / one.path] for one in copies)
    refused = {one.path for one in copies if one.sha256 is None}
    # Nothing tells on which side a column was turned or exchanged, or one row of few was changed.
    assert {truth[path].grade for path in refused} <= {"column_swap", "sign_variant", "unknown"}
    assert len(refused) < len(copies) / 2
    copies = tuple(one for one in copies if one.sha256)
    assert {path: sha256_file(path) for path in before} == before
    again = audit_archive(tmp_path / "fixed", registry, known_at=factory.KNOWN_AT)
    assert {(one.path, one.grade) for one in again.files} == {(one.path, "exact") for one in copies}


def test_a_copy_by_a_record_that_is_expired_is_a_draft_or_none(archive, tmp_path):
    shutil.copytree(REGISTRY.folder, tmp_path / "cal")
    registry = Registry(tmp_path / "cal")
    done = approve(
        registry, "m15-r2", in_force_from=dt.date(1973, 1, 1), checked_by="B", recall="1 month",
        reason="an interval is set", known_on=dt.date(2020, 1, 2),
    )  # fmt: skip
    assert done.done, done.failed
    dated(archive / "test", "2021-06-01")
    made = audit_archive(archive, registry, known_at=dt.date(2026, 1, 1))
    refused = write_copies(made, registry, tmp_path / "none")
    assert refused
    assert all(one.sha256 is None and "expired: its recall" in str(one.reason) for one in refused)
    assert [one.name for one in (tmp_path / "none").iterdir()] == [INDEX]
    copies = write_copies(made, registry, tmp_path / "drafts", draft=True)
    told = json.loads((tmp_path / "drafts" / INDEX).read_text())["files"]
    assert all(one.sha256 for one in copies)
    assert all(one["draft"] and one["unverified"] and "expired" in one["draft_reasons"][0] for one in told)
    title = openpyxl.load_workbook(tmp_path / "drafts" / "test" / "newton.xlsx").properties.title
    assert "DRAFT, NOT APPROVED: m15-r2: expired" in title


def test_a_file_far_beyond_the_calibrated_range_has_no_correction(tmp_path):
    # Columns in lbf under the name of a machine whose cells read mV/V: twenty times its range and more.
    folder = tmp_path / "archive" / "test"
    folder.mkdir(parents=True)
    (folder / "test.toml").write_text('machine = "m15-virtual"\ndate = 2026-05-01\n')
    write(folder / "lbf.xlsx", recording())
    made = audit_archive(tmp_path / "archive", REGISTRY, known_at=dt.date(2026, 11, 1))
    (file,) = made.files
    assert (file.grade, file.repair) == ("unknown", None)
    assert write_copies(made, REGISTRY, tmp_path / "fixed") == ()
