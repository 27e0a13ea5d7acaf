"""Reading a declared format: every type and mark; every fault with key, line and what was expected."""

from __future__ import annotations

import copy
import datetime as dt
import math
import pickle
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.declared.sample import MINIMAL, WHOLE, Check, Constant, Sample, Sweep
from toolkit.declared import Quantity, Source, attempt, build, read, read_text, table_of
from toolkit.errors import ConfigError


def sample(text: str) -> Sample:
    return read_text(Sample, text.encode(), where="sample.toml")


def refused(text: str) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        sample(text)
    assert caught.value.next_step
    assert pickle.loads(pickle.dumps(caught.value)).as_dict() == caught.value.as_dict()  # noqa: S301
    return caught.value


def test_every_entry_as_it_is_held() -> None:
    sample_file = sample(WHOLE)
    assert sample_file.day == dt.date(2026, 3, 31)
    assert sample_file.since == "2026-01-01"
    assert sample_file.speed_m_s == 72 * (1 / 3.6)
    assert isinstance(sample_file.speed_m_s, Quantity)
    assert (sample_file.speed_m_s.value, sample_file.speed_m_s.unit) == (72, "km/h")
    assert sample_file.angles_rad == tuple(angle * (math.pi / 180) for angle in (0, 1.5, -2))
    assert sample_file.number == "17"
    assert sample_file.pitch_m == 0.2
    assert sample_file.folder == Path("data/raw")
    assert sample_file.bounds == (-1.0, 2.5)
    assert sample_file.signs == {"FY": 1, "MZ": -1}
    assert [channel.unit for channel in sample_file.channels] == ["lbf", "deg"]
    assert (sample_file.cells[0].name, sample_file.cells[0].u) == ("D51", 15 * 0.45359237 * 9.80665)
    assert isinstance(sample_file.rate, Sweep)
    assert sample_file.rate.limits == (1.0, 20.0)
    assert isinstance(sample_file.check, Check)
    assert [name for name, _ in sample_file.check.tolerance] == ["FY", "MZ"]
    assert sample_file.extra == {"any": ["thing"]}


def test_defaults_and_forms() -> None:
    short = sample(MINIMAL)
    assert (short.share, short.count, short.since, short.rate, short.channels[0].unit) == (
        0.5,
        1,
        None,
        None,
        "N",
    )
    assert sample('check = "check.csv"\n' + MINIMAL).check == Path("check.csv")
    constant = '[rate]\nkind = "constant"\nrate = { value = 2, unit = "kHz" }\n'
    assert sample(MINIMAL + constant).rate == Constant(kind="constant", rate=2000.0)
    assert sample(MINIMAL.replace("speed =", "velocity =")).speed_m_s == 72 * (1 / 3.6)


def test_a_quantity_is_a_float_that_remembers() -> None:
    speed = sample(MINIMAL).speed_m_s
    assert isinstance(speed, Quantity)
    for twin in (copy.deepcopy(speed), pickle.loads(pickle.dumps(speed))):  # noqa: S301
        assert (twin, twin.value, twin.unit) == (speed, 72, "km/h")
    assert repr(speed) == repr(float(speed))
    assert hash(speed) == hash(float(speed))
    assert type(speed * 2) is float


@pytest.mark.parametrize(
    ("old", "new", "rule", "key", "expected"),
    [
        ('title = "whole"', "title = 3", "wrong-value", "title", "a text"),
        ('title = "whole"', 'title = " "', "wrong-value", "title", "a text"),
        ('loads = ["FY", "MZ"]', "loads = []", "wrong-value", "loads", "at least one"),
        ('loads = ["FY", "MZ"]', 'loads = ["FY", "FY", "MZ"]', "wrong-value", "loads", "each once"),
        ('loads = ["FY", "MZ"]', 'loads = "FY"', "wrong-value", "loads", "a list"),
        ('day = "2026-03-31"', 'day = "31.3.2026"', "wrong-value", "day", "a date such as 2026-03-31"),
        ('day = "2026-03-31"', 'day = "2026-02-30"', "wrong-value", "day", "a date"),
        ('day = "2026-03-31"', "day = 2026-03-31T10:00:00", "wrong-value", "day", "a date"),
        ('{ value = 72, unit = "km/h" }', "72", "no-unit", "speed", "value = NUMBER"),
        ('value = 72, unit = "km/h"', "value = 72", "no-unit", "speed", 'unit = "km/h"'),
        ('value = 72, unit = "km/h"', 'value = 72, unit = "kg"', "unit-dimension", "speed", "m/s"),
        ('value = 72, unit = "km/h"', 'value = 72, unit = "kmph/"', "unknown-unit", "speed", "km/h"),
        ('value = 72, unit = "km/h"', 'value = "72", unit = "km/h"', "wrong-value",
         "speed", "a finite number"),
        ('value = 72, unit = "km/h"', 'value = nan, unit = "km/h"', "wrong-value",
         "speed", "a finite number"),
        ('value = 72, unit = "km/h"', 'value = true, unit = "km/h"', "wrong-value",
         "speed", "a finite number"),
        ("value = 72", f"value = {10**400}", "wrong-value", "speed", "a number of at most 1e+100 in size"),
        ("value = 72", "value = 0", "wrong-value", "speed", "above 0 km/h"),
        ("value = 72, unit", "valeu = 72, unit", "unknown-key", "speed.valeu", "value"),
        ("value = [0, 1.5, -2]", "value = [0, 95]", "wrong-value", "angles.value[2]", "below 90 deg"),
        ("value = [0, 1.5, -2]", 'value = [0, "1"]', "wrong-value", "angles.value[2]", "a finite number"),
        ("value = [0, 1.5, -2]", "value = []", "wrong-value", "angles", "at least one"),
        ("value = [0, 1.5, -2]", "value = [1, 1]", "wrong-value", "angles", "each once"),
        ('-2], unit = "deg"', '-2], unit = "N"', "unit-dimension", "angles.unit", "angle"),
        ('-2], unit = "deg"', "-2]", "no-unit", "angles", "unit"),
        ("number = 17", "number = 1.5", "wrong-value", "number", "a text"),
        ("switched = true", "switched = 1", "wrong-value", "switched", "true or false"),
        ("share = 1", "share = 1.01", "wrong-value", "share", "from 0 and up to 1"),
        ("share = 1", "share = true", "wrong-value", "share", "a number"),
        ("count = 3", "count = 3.0", "wrong-value", "count", "a whole number from 1"),
        ("count = 3", "count = 0", "wrong-value", "count", "a whole number from 1"),
        ("pitch = 200", 'pitch = "200"', "wrong-value", "pitch", "or a number in mm"),
        ('folder = "data/raw"', 'folder = "a\\u0000b"', "wrong-value", "folder", "path"),
        ("bounds = [-1, 2.5]", "bounds = [-1]",
         "wrong-value", "bounds", "[a finite number, a finite number]"),
        ("bounds = [-1, 2.5]", "bounds = [3, 2.5]", "bounds", "bounds", "the lower bound first"),
        ("MZ = -1", "MZ = 2", "wrong-value", "signs.MZ", "1 or -1"),
        ("MZ = -1", "MZ = true", "wrong-value", "signs.MZ", "1 or -1"),
        ("signs = { FY", "signs = { fy", "unknown-key", "signs.fy", "FY"),
        ('symbol = "SA"', 'symbol = "D51"', "wrong-value", "channel[2].symbol", "each symbol once"),
        ('symbol = "SA"', 'symbol = "sa"', "wrong-value", "channel[2].symbol", "[A-Z]"),
        ('unit = "deg"\nrole', 'unit = "degg"\nrole', "unknown-unit", "channel[2].unit", "deg"),
        ('unit = "deg"\nrole', 'unit = "kg"\nrole', "unit-dimension", "channel[2].unit", "force or angle"),
        ('role = "angle"', 'role = "angel"', "wrong-value", "channel[2].role", "load or angle"),
        ("[cells.D51]", "[cells.D52]", "unknown-key", "cells.D52", "D51"),
        ("gain = 2.5", "", "missing-key", "cells.D51.gain", "a positive number"),
        ('u = 15\nunit = "lbf"', "u = 15", "no-unit", "cells.D51.unit", "a unit such as N"),
        ('u = 15\nunit = "lbf"', 'u = 15\nunit = "s"', "unit-dimension", "cells.D51.unit", "force"),
        ('u = 15\nunit = "lbf"', 'u = -15\nunit = "lbf"', "wrong-value", "cells.D51.u", "from 0"),
        ('kind = "chirp"', 'kind = "chrip"', "wrong-value", "rate.kind", "constant, sweep, chirp"),
        ('kind = "chirp"', "", "missing-key", "rate.kind", "constant, sweep, chirp"),
        ('kind = "chirp"', 'kind = "constant"', "unknown-key", "rate.limits", "kind, rate"),
        ('[check]\nfile = "check.csv"', "[check]", "missing-key", "check.file", "path of a file"),
        ("FY = { value = 2,", "FX = { value = 2,", "unknown-key", "check.tolerance.FX", "FY"),
        ("[rate]", "[raet]", "unknown-key", "raet", "rate"),
        ('country = "DE"', 'country = "Germany"', "wrong-value",
         "country", 'an ISO 3166-1 code, such as "US"'),
        ("schema = 2", "schema = 3", "wrong-value", "schema", "1 or 2"),
        ("schema = 2", 'schema = "2"', "wrong-value", "schema", "1 or 2"),
    ],
)  # fmt: skip
def test_one_fault_has_its_rule_its_key_its_line_and_what_was_expected(
    old: str, new: str, rule: str, key: str, expected: str
) -> None:
    assert WHOLE.count(old) == 1
    text = WHOLE.replace(old, new)
    _, faults = attempt(Sample, tomllib.loads(text))
    assert (faults[0].name, faults[0].rule_id) == (key, rule)
    assert expected in faults[0].expected
    if len(faults) == 1 and "u0000" not in new:  # which no settings file may hold, whatever it declares
        error = refused(text)
        assert error.rule == rule
        assert expected in str(error.expected)
        assert rule == "unknown-key" or error.where == f"sample.toml: {key}"
        assert error.line is not None


def test_the_line_is_that_of_the_entry() -> None:
    error = refused(WHOLE.replace("gain = 2.5", "gain = -2.5"))
    line = next(n for n, text in enumerate(WHOLE.splitlines(), start=1) if text == "gain = 2.5")
    assert error.line == f"{line} | gain = -2.5"
    assert str(error) == (
        "cells.D51.gain has a value that cannot be used\n"
        "  where:    sample.toml: cells.D51.gain\n"
        f"  line:     {line} | gain = -2.5\n"
        "  got:      -2.5\n"
        "  expected: a positive number\n"
        "  next:     correct cells.D51.gain; nothing was written"
    )


def test_all_faults_are_told_at_once() -> None:
    text = (
        WHOLE.replace("count = 3", 'count = "3"')
        .replace("gain = 2.5", "gian = 2.5")
        .replace("switched", "swiched")
    )
    error = refused(text)
    assert error.what == "3 entries cannot be used"
    assert [line.strip() for line in str(error.got).splitlines()] == [
        "swiched: unknown key; did you mean 'switched'?",
        "8 | swiched = true",
        'count: "3" cannot be used; expected a whole number from 1',
        '10 | count = "3"',
        "cells.D51.gian: unknown key; did you mean 'gain'?",
        "29 | gian = 2.5",
    ]  # fmt: skip
    assert error.expected == "what stands with each of them"
    assert error.next_step == "correct every entry that is named; nothing was written"
    assert error.rule == "wrong-value"


@pytest.mark.parametrize("text", ["1e400", "-1e400", "inf"])
def test_a_number_beyond_every_double_is_told_as_it_was_written(text: str) -> None:
    assert refused(WHOLE.replace("gain = 2.5", f"gain = {text}")).got == text


def test_an_entry_of_many_characters_is_told_by_its_beginning() -> None:
    error = refused(WHOLE.replace("gain = 2.5", f'gain = "{"x" * 100_000}"'))
    assert max(map(len, str(error).splitlines())) < 1200


def test_of_names_that_are_themselves_at_fault_nothing_is_said() -> None:
    _, faults = attempt(Sample, tomllib.loads(WHOLE.replace('["FY", "MZ"]', "3")))
    assert [fault.name for fault in faults] == ["loads"]


def test_an_older_schema_is_read_and_a_newer_one_says_so() -> None:
    assert sample(MINIMAL.replace("schema = 2", "schema = 1").replace("title", "heading")).title == "short"
    assert sample(MINIMAL.replace("schema = 2\n", "")).title == "short"
    error = refused(MINIMAL.replace("schema = 2", "schema = 7"))
    assert "newer version" in error.what


@pytest.mark.parametrize("table", [[], "text", 3, None])
def test_a_file_that_is_no_table(table: object) -> None:
    with pytest.raises(ConfigError):
        build(Sample, table, "sample.json")


def test_json_and_toml_files(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("\ufeff" + MINIMAL)
    (tmp_path / "a.json").write_text(
        '{"title": "short", "loads": ["FY", "MZ"], "day": "2026-03-31", "channel": [{"symbol": "D51"}],'
        ' "speed": {"value": 72, "unit": "km/h"}}'
    )
    assert read(Sample, tmp_path / "a.toml") == read(Sample, tmp_path / "a.json")
    (tmp_path / "b.json").write_text("{")
    with pytest.raises(ConfigError, match="not JSON"):
        read(Sample, tmp_path / "b.json")


def test_a_fault_in_what_was_taken_from_another_file_names_that_file() -> None:
    base = Source(where="base.toml", text="[check]\nfile = 3\n")
    source = Source(where="own.toml", text=MINIMAL, base=base, inherited=frozenset({("check",)}))
    with pytest.raises(ConfigError) as caught:
        build(Sample, tomllib.loads(MINIMAL) | {"check": {"file": 3}}, source)
    assert (caught.value.where, caught.value.line) == ("base.toml: check.file", "2 | file = 3")


def test_what_no_declaration_can_hold_is_an_error_of_the_program() -> None:
    @dataclass(frozen=True)
    class Wrong:
        value: complex

    with pytest.raises(TypeError, match=r"Wrong\.value"):
        _ = table_of(Wrong).fields
    with pytest.raises(TypeError, match="no dataclass"):
        table_of(int)


def test_a_text_with_control_characters_is_told_so() -> None:
    """Seen on a terminal it looks like a text: what is wrong with it does not show."""
    error = refused(MINIMAL.replace('title = "short"', 'title = "short\\u001b[2K"'))
    assert error.rule == "unprintable"
    assert str(error.expected).startswith("a printable text: no control characters")
    assert "\\u001b" in str(error.line)
