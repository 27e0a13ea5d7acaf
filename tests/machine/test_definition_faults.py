"""Malformed machine definitions: each ends as an error with the key, its line, and what was expected."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.machine.definition import machine_file

M15 = machine_file("m15").read_text()
CIRCUMFERENCE = 'circumference = { value = 8.5, unit = "m" }'
LEVERS = "overturning_lever = { D51 = 0.05, D52 = 0.05, E5 = -0.10 }   # m"
DRUM_SPEED = 'speed = { value = 7.66, unit = "km/h" }'
FZ = next(line for line in M15.splitlines() if line.startswith("FZ = "))


def refused(tmp_path: Path, text: str, name: str = "own.toml") -> ConfigError:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_machine(str(path))
    assert caught.value.exit_code == 2
    assert caught.value.next_step
    assert caught.value.rule
    return caught.value


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        # the wrong type
        ('name = "m15"', "name = 15", "name", "a text"),
        ('name = "m15"', 'name = ""', "name", "a text"),
        ('title = "Michelin', 'title = ["Michelin"]\n#', "title", "a text"),
        ('rotations = ["forward", "reverse"]', 'rotations = "forward"', "rotations", "a list"),
        ('rotations = ["forward", "reverse"]', "rotations = []", "rotations", "at least one"),
        ('["forward", "reverse"]', '["forward", "forward"]', "rotations", "each once"),
        ('["forward", "reverse"]', '["forward", 1]', "rotations[2]", "forward or reverse"),
        ('rotations = ["forward", "reverse"]', "rotations = [[]]", "rotations[1]", "forward or reverse"),
        ('kind = "real"', 'kind = ["real"]', "kind", "real or simulated"),
        ('kind = "real"', 'kind = "reel"', "kind", "real or simulated"),
        ('axes = "machine"', "axes = 3", "axes", "SAE, adapted-SAE, ISO-W, machine"),
        ("schema = 1", "schema = 2", "schema", "1"),
        ("schema = 1", 'schema = "one"', "schema", "1"),
        ("schema = 1", "schema = 1\nversion = 0", "version", "a whole number from 1"),
        ("schema = 1", "schema = 1\nversion = true", "version", "a whole number from 1"),
        ("schema = 1", "schema = 1\nsupersedes = 3", "supersedes", "a text"),
        ("schema = 1", "schema = 1\nsample_rate = 100", "sample_rate", 'unit = "Hz"'),
        ("schema = 1", 'schema = 1\nsample_rate = { value = -1, unit = "Hz" }', "sample_rate", "above 0 Hz"),
        ("schema = 1", 'schema = 1\nindication_unit = "mV/Vv"', "indication_unit", "mV/V"),
        ("schema = 1", "schema = 1\nindication_unit = 3", "indication_unit", "a unit"),
        # columns
        ('role = "slip_angle"', 'role = "slip"', "column[5].role", "slip_angle"),
        ('role = "slip_angle"', "", "column[5].role", "slip_angle"),
        ('symbol = "SA"', 'symbol = "E5"', "column[5].symbol", "each symbol once"),
        ('symbol = "SA"', "symbol = 5", "column[5].symbol", "a text"),
        ('header = "SA (Filtered)"', 'header = "Fy"', "column[6].header", "each header once"),
        ('unit = "deg"\nrole', 'unit = "degg"\nrole', "column[5].unit", "deg"),
        ('unit = "deg"\nrole', 'unit = "lbf"\nrole', "column[5].unit", "a unit of angle"),
        ('unit = "deg"\nrole', "unit = 3\nrole", "column[5].unit", "a unit"),
        # drum
        (CIRCUMFERENCE, "circumference = 8.5", "drum.circumference", 'unit = "m"'),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", "-8.5"), "drum.circumference", "above 0 m"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", "0"), "drum.circumference", "above 0 m"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", "nan"), "drum.circumference", "a finite number"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", "inf"), "drum.circumference", "a finite number"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", '"8.5"'), "drum.circumference", "a finite number"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace("8.5", "1" + "0" * 400),
         "drum.circumference", "a number of at most 1e+100 in size"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace('"m"', '"kg"'),
         "drum.circumference", "length: a unit such as m"),
        (CIRCUMFERENCE, CIRCUMFERENCE.replace('"m"', "3"), "drum.circumference", 'unit = "m"'),
        (DRUM_SPEED, "", "drum.speed", 'unit = "km/h"'),
        (DRUM_SPEED, DRUM_SPEED.replace("km/h", "km"), "drum.speed", "speed: a unit such as km/h, m/s"),
        (DRUM_SPEED, DRUM_SPEED.replace("7.66", "-7.66"), "drum.speed", "above 0 km/h"),
        ('surface = "convex"', "surface = 1", "drum.surface", "a text"),
        # cells and what is stated of them
        ("pitch_diameter = { value = 200", "pitch_diameter = { value = -200",
         "cells.pitch_diameter", "above 0"),
        (LEVERS, "overturning_lever = 0.1", "cells.overturning_lever", "a table"),
        (LEVERS, LEVERS.replace("0.05, D52", "true, D52"), "cells.overturning_lever.D51", "number"),
        (LEVERS, LEVERS.replace("0.05, D52", "nan, D52"), "cells.overturning_lever.D51", "finite"),
        ("polarity = { FY = 1, MX = -1 }", "polarity = { FY = 2 }", "cell[3].polarity.FY", "1 or -1"),
        ("polarity = { FY = 1, MX = -1 }", "polarity = {}", "cell[3].polarity", "a table"),
        ('name = "E5"', 'name = "E6"', "cell[3].name", "D52, D51, E5"),
        ('name = "E5"', 'name = "D51"', "cell[3].name", "each name once"),
        ('FY = { value = 1372, unit = "lbf" }', 'FY = { value = 0, unit = "lbf" }',
         "rated_load.FY", "above 0"),
        ('FY = { value = 1372, unit = "lbf" }', 'FY = { value = 1, unit = "m" }',
         "rated_load.FY", "force or moment"),
        # protocol
        ("settle_revolutions = 2.5", "", "protocol.settle_revolutions", "a number from 0"),
        ("load_tolerance = 0.05", "load_tolerance = 0", "protocol.load_tolerance", "a positive number"),
        ("[250, 567, 833, 1101, 1372]", "[]", "protocol.loads", "at least one"),
        ("[250, 567, 833, 1101, 1372]", '[250, "567"]', "protocol.loads.value[2]", "a finite number"),
        # stated uncertainties
        (FZ, "FZ = 0.005", "type_b.FZ", "a table [type_b.FZ]"),
        (FZ, "FZ = { relative = 0.005 }", "type_b.FZ.source", "a text"),
        (FZ, 'FZ = { relative = -1, source = "s" }', "type_b.FZ.relative", "a number from 0"),
        (FZ, 'FZ = { u = 15, source = "s" }', "type_b.FZ.unit", "a unit such as N"),
        (FZ, 'FZ = { u = 15, unit = "deg", source = "s" }', "type_b.FZ.unit", "a unit of force"),
        (FZ, 'FZ = { u = 15, unit = "Nn", source = "s" }', "type_b.FZ.unit", "N"),
        (FZ, 'FZ = { relative = 0.1, effect = 1, source = "s" }', "type_b.FZ.effect", "u, relative"),
        (FZ, 'FZ = { relative = 0.1, common = "all", source = "s" }', "type_b.FZ.common", "machine or test"),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, key: str, expected: str
) -> None:
    assert M15.count(old) >= 1
    error = refused(tmp_path, M15.replace(old, new, 1))
    assert error.where == f"{tmp_path / 'own.toml'}: {key}"
    assert expected in str(error.expected)
    # Where an entry is missing, the line is that of its table.
    last = re.findall(r"[A-Za-z_0-9]+", key.split("[", maxsplit=1)[0] if key.endswith("]") else key)[-1]
    assert error.line is not None or new == ""
    if new:
        line_text = str(error.line).split(" | ", 1)[1]
        assert last in line_text or key.split(".")[-2].split("[", maxsplit=1)[0] in line_text


@pytest.mark.parametrize(
    ("old", "new", "key", "near"),
    [
        ("[drum]", "[drums]", "drums", "drum"),
        ("[cells]", "[cell_layout]", "cell_layout", "cell"),
        ("circumference =", "circumfrence =", "circumfrence", "circumference"),
        ('symbol = "SA"', 'symbl = "SA"', "symbl", "symbol"),
        ("[type_b]\n", "[type_b]\nSA_scal = { relative = 1 }\n", "SA_scal", "SA_scale"),
        ("overturning_lever = { D51", "overturning_lever = { D53", "D53", "D51"),
        ("load_tolerance =", "load_tolerence =", "load_tolerence", "load_tolerance"),
        ('unit = "m" }', 'units = "m" }', "units", "unit"),
    ],
)
def test_an_unknown_key_has_the_nearest_known_one(
    tmp_path: Path, old: str, new: str, key: str, near: str
) -> None:
    error = refused(tmp_path, M15.replace(old, new, 1))
    text = f"{error.got}\n{error.expected}\n{error.next_step}"
    assert error.rule in ("unknown-key", "wrong-value")
    assert key in text
    assert near in text


@pytest.mark.parametrize(
    ("pattern", "key"),
    [
        (r"\[\[column\]\].*?(?=\n\[drum\])", "column"),
        (r"\[drum\].*?(?=\n\[cells\])", "drum"),
        (r"\[protocol\].*?(?=\n# Standard unc)", "protocol"),
        (r'name = "m15"\n', "name"),
        (r'axes = "machine"', "axes"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, pattern: str, key: str) -> None:
    text = re.sub(pattern, "", M15, count=1, flags=re.DOTALL)
    error = refused(tmp_path, text)
    assert f"{key}: missing" in str(error.got) or error.what == f"{key} is missing"


@pytest.mark.parametrize("key", ["drum", "cells", "protocol", "type_b", "rated_load"])
@pytest.mark.parametrize("value", ['"text"', "3", "[]", "true", "2026-03-01"])
def test_a_text_stands_where_a_table_should(tmp_path: Path, key: str, value: str) -> None:
    text = f'name = "own"\nextends = "m15"\n{key} = {value}\n'
    error = refused(tmp_path, text)
    assert error.where == f"{tmp_path / 'own.toml'}: {key}"
    assert error.line == f"3 | {key} = {value}"


@pytest.mark.parametrize("key", ["column", "cell", "correction"])
@pytest.mark.parametrize("value", ['"text"', "3", "{}", "[1]", "[[]]"])
def test_no_list_of_tables(tmp_path: Path, key: str, value: str) -> None:
    error = refused(tmp_path, f'name = "own"\nextends = "m15"\n{key} = {value}\n')
    assert error.where == f"{tmp_path / 'own.toml'}: {key}"


def test_no_columns(tmp_path: Path) -> None:
    error = refused(tmp_path, 'name = "own"\nextends = "m15"\ncolumn = []\n')
    assert "at least one" in str(error.expected)


def test_extends_names_a_packaged_machine(tmp_path: Path) -> None:
    for text in ('"m16"', '"own"', '"../machine/m15"', '"own.toml"', "3", "[]", '""', "{}"):
        error = refused(tmp_path, f'name = "own"\nextends = {text}\n')
        assert error.where == f"{tmp_path / 'own.toml'}: extends"
        assert error.line == f"2 | extends = {text}"
        assert "m15, m15-virtual" in str(error.expected)


def test_definitions_that_extend_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from toolkit.machine import definition

    monkeypatch.setattr(definition, "_PACKAGED", tmp_path)
    (tmp_path / "first.toml").write_text('name = "first"\nextends = "second"\n')
    (tmp_path / "second.toml").write_text('name = "second"\nextends = "first"\n')
    (tmp_path / "itself.toml").write_text('name = "itself"\nextends = "itself"\n')
    for name in ("first", "itself"):
        with pytest.raises(ConfigError) as caught:
            load_machine(str(tmp_path / f"{name}.toml"))
        assert "extends itself" in caught.value.what
        assert caught.value.line


def test_all_faults_of_a_definition_at_once(tmp_path: Path) -> None:
    text = (
        M15.replace('kind = "real"', 'kind = "reel"')
        .replace("8.5", "-8.5")
        .replace("[drum]", "[drum]\nspeeed = 1")
    )
    error = refused(tmp_path, text)
    assert error.what == "3 entries cannot be used"
    for part in ("kind: ", "drum.speeed: unknown key", "drum.circumference: -8.5 m", " | kind = "):
        assert part in str(error.got)


def test_a_fault_of_the_extended_definition_names_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from toolkit.machine import definition

    monkeypatch.setattr(definition, "_PACKAGED", tmp_path)
    (tmp_path / "base.toml").write_text(M15.replace("8.5", "-8.5"))
    error = refused(tmp_path, 'name = "own"\nextends = "base"\n')
    assert error.where == f"{tmp_path / 'base.toml'}: drum.circumference"
    assert "circumference = { value = -8.5" in str(error.line)
