"""Poison in an archive is set aside, exactly that, each with its rule; the rest is audited."""

from __future__ import annotations

import datetime as dt
import io
import multiprocessing
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.audit.archive_made import dated, factory, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry

REGISTRY = Registry(Path(__file__).resolve().parents[2] / "calibrations")
SHEET = "xl/worksheets/sheet1.xml"


def parts(path):
    with zipfile.ZipFile(path) as source:
        return {name: source.read(name) for name in source.namelist()}


def packed(members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in members.items():
            target.writestr(name, content)
    return stream.getvalue()


def changed(path, old, new):
    members = parts(path)
    assert old in members[SHEET]
    return packed(members | {SHEET: members[SHEET].replace(old, new, 1)})


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("poison") / "archive"
    dated(root, "2019-06-01")
    for number in range(20):
        write(root / f"good {number:02d}.xlsx", recording(seed=number))
    good = root / "good 00.xlsx"
    data = good.read_bytes()
    (root / "far-cell").write_bytes(
        changed(good, b"</sheetData>", b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>')
    )
    members = parts(good)
    (root / "inflation.xlsx").write_bytes(packed(members | {SHEET: members[SHEET] + b" " * (300 << 20)}))
    # The directory claims two gigabytes of rows, or a little more than there are.
    at = data.rindex(b"PK\x01\x02")
    size = struct.unpack("<L", data[at + 24 : at + 28])[0]
    for name, claim in (("claims 2 GB", 2**31), ("claims more", size + 1)):
        lie = data[: at + 24] + struct.pack("<L", claim) + data[at + 28 :]
        (root / f"{name}.xlsx").write_bytes(lie)
    (root / "zip-truncated.xlsx").write_bytes(data[: len(data) * 2 // 3])
    ole = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 504 + "EncryptedPackage".encode("utf-16-le")
    (root / "encrypted.xlsx").write_bytes(ole + b"\0" * 4096)
    (root / "no-data.xlsx").write_bytes(factory.workbook(np.empty((0, 7))))
    # A dimension that says one row, and one that says a million: both sheets are read whole.
    for name, said in (("one row", b"A1:G1"), ("million", b"A1:G1048576")):
        tag = b'<dimension ref="' + said + b'"/><sheetData>'
        (root / f"dimension {name}.xlsx").write_bytes(changed(good, b"<sheetData>", tag))
    return root


def test_exactly_the_poison_is_set_aside(archive):
    made = audit_archive(archive, REGISTRY, known_at=dt.date(2026, 1, 1), workers=2)
    aside = {one.path: one.reason.partition(":")[0] for one in made.files if one.grade == "unreadable"}
    assert aside == {
        "far-cell": "far-cell",
        "inflation.xlsx": "inflation",
        "zip-truncated.xlsx": "zip-truncated",
        "encrypted.xlsx": "encrypted",
        "no-data.xlsx": "no-data",
        "claims 2 GB.xlsx": "inflation",
        "claims more.xlsx": "zip-damaged",
    }
    rest = {one.path: (one.grade, one.rows) for one in made.files if one.grade != "unreadable"}
    assert set(rest.values()) == {("exact", 50)}
    assert {"dimension one row.xlsx", "dimension million.xlsx"} <= set(rest)


def test_a_worker_killed_in_mid_run_loses_nothing(archive):
    whole = audit_archive(archive, REGISTRY, known_at=dt.date(2026, 1, 1))
    done = []

    def kill(name):
        done.append(name)
        if len(done) == 5:
            multiprocessing.active_children()[0].kill()

    again = audit_archive(archive, REGISTRY, known_at=dt.date(2026, 1, 1), workers=2, step=kill)
    assert again == whole
    assert len(done) == len(set(done)) == len(whole.files)


def test_a_file_that_meets_its_limit_of_time_is_not_called_unreadable(tmp_path, monkeypatch):
    from toolkit.audit import archive as module
    from toolkit.audit.workers import TIMEOUT_S, Lost, late

    limits = {}

    def run(make, todo, *, workers, timeout_s):
        limits.update({name: timeout_s(name) for name in todo})
        return [(name, Lost(reason=late(timeout_s(name)))) for name in todo]

    monkeypatch.setattr(module, "run_isolated", run)
    (tmp_path / "short.csv").write_bytes(b"1,2\n")
    with (tmp_path / "long.csv").open("wb") as stream:
        stream.truncate(200 << 20)
    told = audit_archive(tmp_path, REGISTRY, known_at=dt.date(2026, 1, 1))
    assert [finding.rule for finding in told.findings] == ["timeout", "timeout"]
    assert limits["long.csv"] > 3 * TIMEOUT_S > limits["short.csv"] >= TIMEOUT_S
    assert f"within {limits['long.csv']:.3g} s" in told.findings[0].message
