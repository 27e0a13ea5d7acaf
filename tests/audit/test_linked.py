"""Reports of past years: by manifest, by hash, by the name of the test; the rest are unknown."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from pathlib import Path

import pytest

from tests import commands
from tests.audit.archive_made import FY, dated, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.audit.linked import RestingReport, link, read_reports
from toolkit.calibration.registry.registry import Registry
from toolkit.declared import json_value
from toolkit.errors import ConfigError
from toolkit.files import sha256_file

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("archive")
    for seed, name in enumerate(("2018/tire A", "2019/tire A", "2019/tire A2", "2019/tire B")):
        dated(root / name, f"{name[:4]}-06-01")
        write(root / name / "one.xlsx", recording(seed=20 + seed))
    write(root / "2019/tire B" / "wrong.xlsx", recording(seed=5, FY=(*FY[:2], -FY[2], FY[3])))
    write(root / "loose.xlsx", recording(seed=7))
    return root


@pytest.fixture(scope="module")
def made(archive):
    return audit_archive(archive, Registry(CALIBRATIONS), known_at=dt.date(2026, 1, 1))


def by_name(linked):
    return {one.report: json_value(one) for one in linked.reports}


def test_documents_are_linked_where_their_name_has_the_tests_as_whole_words(made, tmp_path):
    for name in ("Report tire B.docx", "2018/final_TIRE-A.pdf", "holiday.pdf", "notes tire A2.bin"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    linked = link(made, read_reports(tmp_path, []))
    told = by_name(linked)
    assert told["Report tire B.docx"]["tests"] == ["2019/tire B"]
    assert (told["Report tire B.docx"]["files"], told["Report tire B.docx"]["not_clean"]) == (2, 1)
    assert told["Report tire B.docx"]["to_amend"]
    # "tire A" is a test of two years: the folder decides; "tire A2" is another word.
    assert told["2018/final_TIRE-A.pdf"]["tests"] == ["2018/tire A"]
    assert told["holiday.pdf"]["linked_by"] == []
    assert "notes tire A2.bin" not in told
    assert linked.unknown == ("2019/tire A", "2019/tire A2")


def test_recordings_of_the_archive_are_no_reports_where_both_stand_in_one_folder(made, archive):
    (archive / "2019/tire B" / "tire B.pdf").write_bytes(b"x")
    try:
        linked = link(made, read_reports(archive, []))
    finally:
        (archive / "2019/tire B" / "tire B.pdf").unlink()
    assert list(by_name(linked)) == ["2019/tire B/tire B.pdf"]
    assert linked.unknown == ("2018/tire A", "2019/tire A", "2019/tire A2")


def test_a_manifest_names_the_recordings_and_hides_its_own_outputs(made, archive, tmp_path):
    sha = sha256_file(archive / "2019/tire A" / "one.xlsx")
    folder = tmp_path / "tire B"
    folder.mkdir()
    for name in ("report.docx", "report.pdf"):
        (folder / name).write_bytes(b"x")
    manifest = {
        "generator": "toolkit", "schema": 1, "report": "T-17",
        "inputs": {"files": [{"name": "a", "sha256": sha}]},
        "calibrations": [{"id": "m15-r1", "sha256": "0" * 64}],
        "outputs": [{"name": "report.docx", "sha256": "0" * 64}, {"name": "report.pdf", "sha256": "0" * 64}],
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / "other.json").write_text("[1, 2")
    told = by_name(link(made, read_reports(tmp_path, [])))
    assert list(told) == ["tire B"]
    # What it says of its files is believed, not what its folder is called.
    assert told["tire B"]["tests"] == ["2019/tire A"]
    assert (told["tire B"]["id"], told["tire B"]["linked_by"]) == ("T-17", ["manifest"])
    assert told["tire B"]["calibrations"] == ["m15-r1"]


def test_a_list_links_by_test_by_path_and_by_hash(made, archive, tmp_path):
    sha = sha256_file(archive / "loose.xlsx").upper()
    (tmp_path / "list.csv").write_text(
        f"report,test,sha256\nR 1,tire B,\nR 2,2018/tire A,\nR 3,,{sha}\nR 4,no such test,\n",
        encoding="utf-8-sig",
    )  # fmt: skip
    told = by_name(link(made, read_reports(tmp_path / "list.csv", [])))
    assert told["R 1"]["tests"] == ["2019/tire B"]
    assert told["R 2"]["tests"] == ["2018/tire A"]
    assert (told["R 3"]["tests"], told["R 3"]["files"], told["R 3"]["not_clean"]) == ([], 1, 1)  # undated
    assert told["R 4"]["linked_by"] == []


def test_a_copy_of_a_recording_in_another_test_does_not_make_the_report_rest_on_that(archive, tmp_path):
    shutil.copytree(archive, tmp_path / "archive")
    first = tmp_path / "archive" / "2018/tire A"
    write(first / "two.xlsx", recording(seed=31))
    shutil.copy(first / "one.xlsx", tmp_path / "archive" / "2019/tire A" / "copy.xlsx")
    shutil.copy(first / "one.xlsx", tmp_path / "archive" / "copy of no test.xlsx")
    hashes = [sha256_file(first / name) for name in ("one.xlsx", "two.xlsx")]
    (tmp_path / "list.csv").write_text("report,sha256\n" + "".join(f"R,{sha}\n" for sha in hashes))
    made = audit_archive(tmp_path / "archive", Registry(CALIBRATIONS), known_at=dt.date(2026, 1, 1))
    told = by_name(link(made, read_reports(tmp_path / "list.csv", [])))
    assert (told["R"]["tests"], told["R"]["files"]) == (["2018/tire A"], 2)


def test_a_name_that_tests_of_two_years_have_is_told(made, tmp_path):
    (tmp_path / "list.csv").write_text("report,test\nR 1,tire A\nR 2,2018/tire A\n")
    told = by_name(link(made, read_reports(tmp_path / "list.csv", [])))
    assert (told["R 1"]["tests"], told["R 1"]["alike"]) == (["2018/tire A", "2019/tire A"], 2)
    assert (told["R 2"]["tests"], "alike" in told["R 2"]) == (["2018/tire A"], False)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("report,tset\nR,a\n", "test"),
        ("report\nR\n", "the columns report and test"),
        ("", "the columns report"),
        ("report,test\nR,\n", "row 2"),
        ("report,sha256\nR,abc\n", "64 hexadecimal"),
        ('report,test\nR,"open\n', "separated by commas"),
    ],
)
def test_a_list_that_cannot_be_used_is_refused(tmp_path, text, said):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_reports(tmp_path / "list.csv", [])
    assert said in str(caught.value)


def test_links_are_not_followed(made, tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "tire B.pdf").write_bytes(b"x")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "tire B.pdf").symlink_to(tmp_path / "real" / "tire B.pdf")
    (tmp_path / "folder" / "sub").symlink_to(tmp_path / "real")
    assert read_reports(tmp_path / "folder", []) == ()


def test_there_is_no_such_list(tmp_path):
    with pytest.raises(ConfigError):
        read_reports(tmp_path / "none.csv", [])


@pytest.mark.parametrize(
    ("identity", "calibrations", "not_clean", "amend"),
    [
        ("T", ("m15-r2",), 3, False),  # computed from the cells by the record in force: it stands
        ("T", ("m15-r1",), 0, True),
        (None, (), 3, True),  # nothing is known but the files' own columns
        (None, (), 0, False),
    ],
)
def test_what_is_to_be_amended(identity, calibrations, not_clean, amend):
    one = RestingReport(
        report="R", id=identity, calibrations=calibrations, not_clean=not_clean, in_force={"m15-r2"}
    )
    assert one.to_amend is amend


def test_an_archive_and_a_folder_of_reports_that_are_the_test_itself_are_called_by_their_names(
    tmp_path, monkeypatch
):
    test, out = tmp_path / "tire C", tmp_path / "report of tire C"
    for folder in (test, out):
        folder.mkdir()
    dated(test, "2019-06-01")
    written = test / "one.xlsx"
    write(written, recording(seed=7))
    manifest = {
        "generator": "toolkit", "schema": 1, "report": "T-18",
        "inputs": [{"name": "a", "sha256": sha256_file(written)}],
        "calibrations": [{"id": "m15-r1", "sha256": "0" * 64}], "outputs": [],
    }  # fmt: skip
    (out / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / "none").mkdir()
    monkeypatch.chdir(test)
    _, said, _ = commands.said(
        "audit", ".", "--reports", "../report of tire C", "--calibrations", CALIBRATIONS
    )
    assert "report report of tire C (tire C): to be amended" in said
    _, said, _ = commands.said("audit", ".", "--reports", "../none", "--calibrations", CALIBRATIONS)
    assert "report unknown: 1 test, tire C" in said
