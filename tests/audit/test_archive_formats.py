"""An archive of other formats: the grades of the same rows in CSV, in any depth; corrected copies in kind."""

from __future__ import annotations

import dataclasses
import datetime as dt
import json
from pathlib import Path

import numpy as np
import pytest

from tests import commands
from tests.audit.archive_made import FY, MZ, dated, recording
from tests.audit.audit_factory import record
from tests.recording.format_factory import csv, every, lvm, tdms
from toolkit.audit import resume
from toolkit.audit.archive import audit_archive
from toolkit.audit.corrected import write_copies
from toolkit.audit.identify import identify_columns
from toolkit.audit.model import Identification, columns_of
from toolkit.audit.one_file import unreadable
from toolkit.calibration.registry.registry import Registry
from toolkit.files import sha256_file
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording

IDENTIFIED = [field.name for field in dataclasses.fields(Identification)]
HOME = Path(__file__).resolve().parents[2]
REGISTRY = Registry(HOME / "calibrations")
KNOWN = dt.date(2026, 1, 1)
SIGN = (*FY[:2], -FY[2], FY[3])
TABLES = {
    "right": recording(seed=1),
    "sign": recording(seed=2, FY=SIGN),
    "swap": recording(seed=3) | {"D51": recording(seed=3)["D52"], "D52": recording(seed=3)["D51"]},
    "unknown": recording(seed=4, FY=(1.3, 0.7, 0.9, 5.0)),
}
GRADES = {"right": "exact", "sign": "sign_variant", "swap": "column_swap", "unknown": "unknown"}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("formats") / "archive"
    dated(root, "2019-06-01")
    for depth, (name, table) in enumerate(TABLES.items()):
        for file, data in every(table).items():
            place = root.joinpath(*(f"level {n}" for n in range(depth + 1)), name, file)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)
    return root


@pytest.fixture(scope="module")
def audited(archive):
    return audit_archive(archive, REGISTRY, known_at=KNOWN, workers=2)


def test_every_format_has_the_grade_of_the_same_rows_in_csv(audited):
    found = {}
    for one in audited.files:
        name, file = one.path.split("/")[-2:]
        found.setdefault(name, {})[file] = one
    for name, files in found.items():
        assert len(files) == 7
        for one in files.values():
            assert one.grade == GRADES[name], one.path
            assert [getattr(one, key) for key in IDENTIFIED] == [
                getattr(files["run.csv"], key) for key in IDENTIFIED
            ]
            assert one.rows == 50


def test_two_copies_of_the_same_rows_are_told_whatever_the_format(audited):
    told = {one.where for one in audited.findings if one.rule == "duplicate-file"}
    assert {path.rpartition("/")[2] for path in told} >= {"run.mat", "table.mat", "run.tdms"}


def test_corrected_copies_are_in_the_format_of_their_originals(archive, audited, tmp_path):
    before = {path: sha256_file(path) for path in archive.rglob("*") if path.is_file()}
    copies = write_copies(audited, REGISTRY, tmp_path / "fixed")
    assert {one.reason for one in copies} == {None}
    assert {path: sha256_file(path) for path in archive.rglob("*") if path.is_file()} == before
    again = audit_archive(tmp_path / "fixed", REGISTRY, known_at=KNOWN)
    assert {one.grade for one in again.files} == {"exact"}
    machine = load_machine("m15")
    for one in copies:
        old, new = (read_recording(root / one.path, machine) for root in (archive, tmp_path / "fixed"))
        assert new.format == old.format
        assert [s.symbol for s in new.series] == [s.symbol for s in old.series]
        for series in old.series:
            assert new[series.symbol].unit == series.unit
            if series.symbol not in ("FY", "MZ"):
                np.testing.assert_array_equal(new[series.symbol].values, series.values)


def test_single_precision_is_rounding_and_not_another_calibration(tmp_path):
    # 24 binary digits of each number: the bound is half of their last one, and a wrong sign is still seen.
    for name, coefficients in (("right", FY), ("sign", SIGN)):
        rng = np.random.default_rng(5)
        table = recording(seed=5)
        cells = {cell: rng.uniform(-400, 400, 50).astype(np.float32) for cell in ("D51", "D52", "E5")}
        x = np.column_stack([cells[c].astype(float) for c in ("D51", "D52", "E5")])
        table |= cells | {"FY": x @ coefficients[:3] + coefficients[3], "MZ": x @ MZ[:3] + MZ[3]}
        (tmp_path / f"{name}.tdms").write_bytes(tdms(table, kind=np.float32))
    dated(tmp_path, "2019-06-01")
    found = audit_archive(tmp_path, REGISTRY, known_at=KNOWN)
    assert {one.path: one.grade for one in found.files} == {
        "right.tdms": "exact",
        "sign.tdms": "sign_variant",
    }


CLOSE = (FY[0] + 2e-5, *FY[1:])


@pytest.mark.parametrize(
    "written", [float, str, "{:.15g}".format, "{:.9g}".format], ids=["all", "shortest", "15", "9"]
)
def test_single_precision_written_out_separates_sets_two_in_a_hundred_thousand_apart(tmp_path, written):
    # An acquisition in single precision, its numbers written as text or doubles: nothing says so but they.
    rng = np.random.default_rng(6)
    table = recording(seed=6)
    x = rng.uniform(-400, 400, (50, 3))
    table |= dict(zip(("D51", "D52", "E5"), x.T, strict=True))
    table |= {"FY": x @ CLOSE[:3] + CLOSE[3], "MZ": x @ MZ[:3] + MZ[3]}
    table = {
        name: np.array([float(written(one if written is str else float(one))) for one in values])
        for name, values in ((name, np.asarray(values, dtype=np.float32)) for name, values in table.items())
    }
    machine, judged = load_machine("m15"), []
    for file, data in every(table).items():
        (tmp_path / file).write_bytes(data)
        columns = columns_of(read_recording(tmp_path / file, machine))
        found = identify_columns(
            columns, (record("m15-r1", CLOSE, MZ), record("m15-r2", FY, MZ)), on=dt.date(2019, 6, 4),
            in_force=record("m15-r1", CLOSE, MZ), void=(),
        )  # fmt: skip
        judged.append((file, found.grade, found.record))
    assert len(judged) > 5
    assert {(grade, one) for _, grade, one in judged} == {("exact", "m15-r1")}


@pytest.mark.parametrize("file", sorted(every(TABLES["right"])))
def test_inspect_reads_every_format(tmp_path, file):
    (tmp_path / file).write_bytes(every(TABLES["sign"])[file])
    dated(tmp_path, "2019-06-01")
    done = commands.result(
        "inspect", str(tmp_path / file), "--calibrations", str(HOME / "calibrations"), "--json"
    )
    assert done.return_value == 1, done.output
    assert "E5 negative in FY" in json.dumps(json.loads(done.stdout))


def test_a_test_in_another_format_reduces_to_the_same_numbers(tmp_path):
    answers = []
    for name, make in (("run.csv", csv), ("run.tdms", tdms), ("run.lvm", lambda table: lvm(table, x="No"))):
        folder = tmp_path / name.partition(".")[2] / "test"
        dated(folder, "2019-06-01")
        (folder / name).write_bytes(make(recording(seed=6, angle=1.0)))
        code, answer = commands.answer("process", folder, "--calibrations", HOME / "calibrations")
        assert code in (0, 1), answer
        answers.append(json.dumps(answer).replace(name, "run"))
    first = json.loads(answers[0])["conditions"]
    assert first
    for other in answers[1:]:
        assert json.loads(other)["conditions"] == first


def test_a_missing_library_is_told_and_asked_again():
    kept = resume.done(unreadable("a.tdms", "missing-extra: a library is not installed", sha256="0" * 64))
    assert kept.sha256 is None  # never used again: it may be installed by then
    kept = resume.done(unreadable("a.tdms", "truncated: the end is missing", sha256="0" * 64))
    assert kept.sha256 == "0" * 64
