"""Legacy imports: a source is demanded, the record stays unverified, its source is its reference."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.calibration.legacy import import_legacy
from toolkit.calibration.registry import Registry
from toolkit.errors import RecordError, ToolkitError

GOOD = """
schema = 1
instrument = "old"
date = 1999-01-01
entered_by = "legacy import"
zero = "included"
indications = [{ name = "S", unit = "mV/V" }]
[source]
title = "a sheet"
text = "F = 2 S + 1"
[[loads]]
load = "F"
unit = "N"
coefficients = { S = 2, intercept = 1.0 }
"""


def enter(folder: Path, text: str) -> Registry:
    path = folder / "legacy.toml"
    path.write_text(text)
    registry = Registry(folder / "cal")
    import_legacy(path, registry)
    return registry


def test_a_legacy_record_is_unverified_and_entered_once(tmp_path: Path) -> None:
    registry = enter(tmp_path, GOOD)
    record = registry.load("old-r1")
    assert (record.verified, record.loads[0].coefficients, record.loads[0].covariance) == (
        False,
        (2.0, 1.0),
        (),
    )
    assert registry.ids("old") == ("old-r1",)
    assert enter(tmp_path, GOOD).ids("old") == ("old-r1",)
    assert [(row.id, row.ok, row.verified) for row in registry.verify()] == [("old-r1", True, False)]


def test_the_source_beside_it_is_what_it_is_compared_with(tmp_path: Path) -> None:
    registry = enter(tmp_path, GOOD)
    source = tmp_path / "cal" / "old" / "old-r1.source.toml"
    source.write_text(source.read_text().replace("S = 2", "S = -2"))
    with pytest.raises(RecordError) as caught:
        registry.load("old-r1")
    assert caught.value.rule == "data"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("zero =", "zeroo ="), ('title = "a sheet"', ""), ("S = 2", 'S = "2"'), ("S = 2", "T = 2"),
        ("S = 2", "S = nan"),
        ('unit = "N"', 'unit = "Q"'), ("1999-01-01", '"then"'), ('"included"', '"some"'),
        ('"old"', '"../old"'),
        ("schema = 1", "schema = 3"), ("intercept = 1.0", "abs(S) = 1"), ("[[loads]]", "[loads]"),
        ('entered_by = "legacy import"', ""), ("{ S = 2, intercept = 1.0 }", "{ intercept = 1.0, S = 2 }"),
    ],
)  # fmt: skip
def test_bad_files_write_nothing(tmp_path: Path, old: str, new: str) -> None:
    assert old in GOOD
    with pytest.raises(ToolkitError) as caught:
        enter(tmp_path, GOOD.replace(old, new, 1))
    assert caught.value.exit_code == 2
    assert not (tmp_path / "cal").exists()
