"""Legacy imports: a source is demanded, the record stays unverified, its source is its reference."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.calibration.registry.candidate import import_legacy
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import ConfigError, RecordError, ToolkitError

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
    assert [(row.id, row.ok, row.verified) for row in verify_registry(registry)] == [("old-r1", True, False)]


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


def test_all_faults_are_named_at_once_with_their_lines(tmp_path: Path) -> None:
    text = GOOD.replace('"included"', '"run"').replace("title", "titel").replace("S = 2", 'S = "2"')
    with pytest.raises(ConfigError) as caught:
        enter(tmp_path, text)
    named = ("zero", "included or tared", "did you mean 'title'?", "loads[1].coefficients.S", "| coeff")
    for words in named:
        assert words in str(caught.value)


TWO = GOOD.replace(
    '[{ name = "S", unit = "mV/V" }]', '[{ name = "S", unit = "mV/V" }, { name = "T", unit = "counts" }]'
).replace("{ S = 2,", "{ S = 2, T = 0,")
MOMENT = '[[loads]]\nload = "MZ"\nunit = "N*m"\ncoefficients = { S = 1.0, T = 2.0 }\n'


def test_zero_is_a_coefficient_where_it_is_written(tmp_path: Path) -> None:
    record = enter(tmp_path, TWO + MOMENT).load("old-r1")
    assert record.load("F").coefficients == (2.0, 0.0, 1.0)
    assert record.load("F").polarity == (1, 0, 1)


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        ('"N*m"', '"N"', "unit-dimension"), ('unit = "N"\n', 'unit = "N*m"\n', "unit-dimension"),
        ('load = "F"', 'load = "MY"', "unit-dimension"), ('load = "F"', 'load = "drag"', None),
        ('load = "F"\nunit = "N"', 'load = "drag"\nunit = "degC"', "unit-dimension"),
        ('load = "MZ"\nunit = "N*m"', 'load = "F"\nunit = "N"', "legacy"),
        ("T = 0, ", "", "legacy"), (", T = 2.0", "", "legacy"),
        ("S = 2, T = 0", '"S^2" = 2, T = 0', "legacy"),
        ('"counts"', '"zork"', "unknown-unit"), ('"counts"', '"1"', "unit-dimension"),
        ('"counts"', '"deg"', "unit-dimension"), ('"counts"', '"degC"', "unit-dimension"),
        ('name = "T"', 'name = "S"', "legacy"), ("F", "S", "legacy"),
        ('name = "T"', 'name = "T 1"', "legacy"),
        ("S = 2,", "S = 2, S* = 1,", "not-toml"), ("S = 2,", 'S = 2, "S*" = 1,', "legacy"),
    ],
)  # fmt: skip
def test_what_no_calibration_can_have_given(tmp_path: Path, old: str, new: str, rule: str | None) -> None:
    text = TWO + MOMENT
    assert old in text
    if rule is None:
        enter(tmp_path, text.replace(old, new))
        return
    with pytest.raises(ToolkitError) as caught:
        enter(tmp_path, text.replace(old, new))
    assert (caught.value.exit_code, caught.value.rule) == (2, rule)
    assert all(caught.value.as_dict().values())
    assert not (tmp_path / "cal").exists()
