"""The Parquet table: what the JSON answer says, row by row, as numbers, dates and nested columns."""

from __future__ import annotations

import datetime as dt
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests import commands
from tests.audit.archive_made import FY, dated, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.audit.serial import check_parquet, write_parquet
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError, OutputError
from toolkit.recording.marks import is_own_output

HOME = Path(__file__).resolve().parents[2]
KNOWN = dt.date(2026, 1, 1)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    root = tmp_path_factory.mktemp("parquet") / "archive"
    dated(root / "test", "2019-06-01")
    write(root / "test" / "right.xlsx", recording())
    write(root / "test" / "sign.xlsx", recording(seed=2, FY=(*FY[:2], -FY[2], FY[3])))
    write(root / "test" / "unknown.xlsx", recording(seed=3, FY=(1.3, 0.7, 0.9, 5.0)))
    mixed = recording(seed=4)
    mixed["FY"] = np.concatenate(
        [mixed["FY"][:20], recording(seed=4, FY=(*FY[:2], -FY[2], FY[3]))["FY"][20:]]
    )
    write(root / "test" / "mixed.xlsx", mixed)
    write(root / "undated.xlsx", recording(seed=5))
    (root / "cut.xlsx").write_bytes(b"PK\x03\x04 and no more")
    (root / "caf\udce9 \N{GREEK SMALL LETTER ALPHA}").write_bytes(b"")
    return root


def as_json(row):
    """A row of the table under the shapes of the JSON answer: maps as objects, days as text."""
    row = {k: v.isoformat() if isinstance(v, dt.date) else v for k, v in row.items()}
    for key in ("to_SAE", "units"):
        row[key] = dict(row[key])
    if row["estimate"] is not None:
        row["estimate"]["equations"] = {
            load: one | {"coefficients": dict(one["coefficients"])}
            for load, one in row["estimate"]["equations"]
        }
    return row


def test_the_table_says_what_the_answer_says(archive, tmp_path):
    target = tmp_path / "audit.parquet"
    home = ("--calibrations", str(HOME / "calibrations"))
    done = commands.result(
        "audit", str(archive), *home, "--known-at", "2026-01-01", "--parquet", str(target), "--json"
    )
    assert done.return_value == 1
    answer = json.loads(done.stdout)
    assert answer["written"] == [str(target)]
    rows = [as_json(row) for row in pq.read_table(target).to_pylist()]
    assert {row["grade"] for row in rows} == {"exact", "sign_variant", "unknown", "undated", "unreadable"}
    for row, one in zip(rows, answer["files"], strict=True):
        if "\udce9" in one["path"]:
            assert row.pop("path") == "caf\\xe9 \N{GREEK SMALL LETTER ALPHA}"
            one.pop("path")
        assert row == one


def test_numbers_are_numbers_and_days_are_days(archive, tmp_path):
    target = tmp_path / "audit.parquet"
    made = audit_archive(archive, Registry(HOME / "calibrations"), known_at=KNOWN)
    write_parquet(target, made.files.plain(), known_at=KNOWN)
    schema = pq.read_schema(target)
    assert schema.field("date").type == pa.date32()
    assert schema.field("rows").type == schema.field("size").type == pa.int64()
    assert schema.field("repair").type.field("FY_max_abs_N").type == pa.float64()
    assert schema.metadata[b"known_at"] == b"2026-01-01"
    worst = pq.read_table(target, columns=["path", "repair"], filters=[("grade", "=", "sign_variant")])
    assert worst.num_rows == 2
    assert all(one["FY_max_abs_N"].as_py() > 1.0 for one in worst["repair"])


def test_more_rows_than_are_held_at_once(archive, tmp_path):
    made = audit_archive(archive, Registry(HOME / "calibrations"), known_at=KNOWN)
    one = next(iter(made.files.plain()))
    many = ({**one, "path": f"{n:05d}"} for n in range(2500))
    write_parquet(tmp_path / "many.parquet", many, known_at=KNOWN)
    file = pq.ParquetFile(tmp_path / "many.parquet")
    assert file.metadata.num_row_groups == 3
    assert file.read(["path"])["path"].to_pylist() == [f"{n:05d}" for n in range(2500)]


def test_the_table_is_known_again_and_no_part_of_an_archive(archive, tmp_path):
    target = archive / "audit.parquet"
    made = audit_archive(archive, Registry(HOME / "calibrations"), known_at=KNOWN)
    write_parquet(target, made.files.plain(), known_at=KNOWN)
    assert is_own_output(target)
    again = audit_archive(archive, Registry(HOME / "calibrations"), known_at=KNOWN)
    assert [one.path for one in again.files] == [one.path for one in made.files]
    write_parquet(target, made.files.plain(), known_at=KNOWN)  # its own result may be replaced
    target.unlink()


def test_another_file_is_never_replaced_and_nothing_is_audited(archive, tmp_path):
    for name, data, rule in (("other.parquet", b"PAR1 of someone else PAR1", "original"),
                             ("table.csv", None, "output-name")):  # fmt: skip
        target = tmp_path / name
        if data is not None:
            target.write_bytes(data)
        with pytest.raises(OutputError) as caught:
            check_parquet(target)
        assert caught.value.rule == rule
        assert (target.read_bytes() if data is not None else None) == data


def test_a_result_that_fails_leaves_nothing(tmp_path):
    def broken():
        yield {"path": "a"}

    with pytest.raises(KeyError):
        write_parquet(tmp_path / "audit.parquet", broken(), known_at=KNOWN)
    assert list(tmp_path.iterdir()) == []


def test_an_absent_library_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(ConfigError) as caught:
        check_parquet(tmp_path / "audit.parquet")
    assert caught.value.rule == "missing-extra"
    assert caught.value.next_step == 'pip install "tire-lab-toolkit[parquet]"'
