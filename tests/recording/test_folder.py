"""A test folder: test.toml, strictly; recordings, by what belongs to them."""

from __future__ import annotations

import json

import pytest

from tests.recording.workbook_factory import members, packed, workbook
from toolkit.errors import ConfigError, RecordingError, ToolkitError
from toolkit.machine import load_machine
from toolkit.recording.folder import nearest_test_toml, read_test_folder
from toolkit.recording.marks import is_own_output, machine_of, mark_workbook, output_keywords

FULL = """
schema = 1
date = 2009-05-14
machine = "m15"
operator = "second person"
requestor = "R. Roe"
surface = "steel"
special = "none"
rotation = "forward"
speed = { value = 7.66, unit = "km/h" }
pressure = { value = 30, unit = "psi" }
rated_load = { value = 1400, unit = "lb" }
[tire]
size = "P205/55R16"
company = "Maker"
DOT = "XXXX"
series = 55
construction = "radial"
rim = "16x6.5"
[rotations]
"b" = "reverse"
"sub/c.xlsx" = "reverse"
[tare]
values = { D51 = { value = 4.4482216152605, unit = "N" }, D52 = 0.5, E5 = -2 }
"""


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "test 1"
    (home / "sub").mkdir(parents=True)
    (home / "other test").mkdir()
    (home / "test.toml").write_text(FULL)
    for name in ("a.xlsx", "b", "sub/c.xlsx", "other test/d"):
        (home / name).write_bytes(workbook())
    (home / "other test" / "test.toml").write_text('machine = "m15"')
    return home


def refused(folder, kind: type[ToolkitError] = ConfigError) -> ToolkitError:
    with pytest.raises(kind) as caught:
        read_test_folder(folder)
    assert caught.value.next_step
    assert caught.value.exit_code == 2
    return caught.value


def edited(folder, old: str, new: str) -> None:
    assert old in FULL
    (folder / "test.toml").write_text(FULL.replace(old, new))


def test_everything(folder):
    test = read_test_folder(folder)
    info = test.info
    assert (info.name, info.machine, info.date, info.operator) == (
        "test 1",
        "m15",
        "2009-05-14",
        "second person",
    )
    assert info.speed_m_s == pytest.approx(7.66 / 3.6)
    assert info.pressure_Pa == pytest.approx(30 * 6894.757293168)
    assert info.rated_load_N == pytest.approx(1400 * 4.4482216152605)
    assert (info.tire_size, info.tire_series, info.tire_rim) == ("P205/55R16", "55", "16x6.5")
    assert not info.simulated
    assert [path.relative_to(folder).as_posix() for path in test.files] == ["a.xlsx", "b", "sub/c.xlsx"]
    assert [test.rotation_of(path) for path in test.files] == ["forward", "reverse", "reverse"]
    assert test.tare_file is None
    assert test.tare_values == (("D51", pytest.approx(1.0), "lbf"), ("D52", 0.5, "lbf"), ("E5", -2.0, "lbf"))


def test_a_bare_name_may_stand_for_a_file_in_a_sub_folder(folder):
    edited(folder, "sub/c.xlsx", "c.xlsx")
    assert read_test_folder(folder).rotation_of(folder / "sub" / "c.xlsx") == "reverse"


def test_the_whole_test_may_be_reversed(folder):
    edited(folder, 'rotation = "forward"', 'rotation = "reverse"')
    assert read_test_folder(folder).rotation_of(folder / "a.xlsx") == "reverse"


def test_a_minimal_test(folder):
    test = read_test_folder(folder / "other test")
    assert test.info.date is None
    assert len(test.files) == 1
    (folder / "other test" / "test.toml").write_text('machine = "m15-virtual"\ndate = "2020-02-29"')
    info = read_test_folder(folder / "other test").info
    assert info.simulated
    assert info.date == "2020-02-29"


def test_a_machine_definition_of_the_laboratorys_own(folder):
    (folder / "own.toml").write_text(
        'schema = 1\nname = "own"\nextends = "m15"\ntitle = "Own"\nkind = "real"'
    )
    edited(folder, 'machine = "m15"', 'machine = "own.toml"')
    test = read_test_folder(folder)
    assert load_machine(test.info.machine).name == "own"
    assert folder / "own.toml" not in test.files


def test_a_recording_belongs_to_the_nearest_test_toml(folder):
    assert nearest_test_toml(folder / "sub" / "c.xlsx") == folder / "test.toml"
    assert nearest_test_toml(folder / "other test" / "d") == folder / "other test" / "test.toml"
    assert nearest_test_toml(folder) == folder / "test.toml"


def test_the_tare_file_is_no_load_recording(folder):
    (folder / "zero").write_bytes(workbook())
    values = FULL[FULL.index("values =") :]
    edited(folder, values, 'file = "zero"')
    test = read_test_folder(folder)
    assert test.tare_file == folder / "zero"
    assert folder / "zero" not in test.files


def test_what_is_no_recording(folder, tmp_path):
    files = read_test_folder(folder).files
    (folder / ".hidden").write_bytes(workbook())
    (folder / "~$a.xlsx").write_bytes(b"lock")
    (folder / "link").symlink_to(folder / "a.xlsx")
    (folder / "linked folder").symlink_to(folder / "other test", target_is_directory=True)
    (folder / "truth.json").write_text(json.dumps({"generator": "toolkit", "tire": {}}))
    (folder / "reduced").write_bytes(packed(members(keywords=output_keywords(simulated=True))))
    (folder / "report.pdf").write_bytes(b"%PDF-1.7\n<pdf:Keywords>toolkit-output</pdf:Keywords>")
    hexed = "toolkit-output".encode("utf-16-be").hex().upper().encode()
    (folder / "other.pdf").write_bytes(b"%PDF-1.7\n/Keywords<FEFF" + hexed + b">")
    assert read_test_folder(folder).files == files
    # Somebody else's files stay, and the reader will name them.
    (folder / "notes.json").write_text(json.dumps({"generator": "another"}))
    (folder / "paper.pdf").write_bytes(b"%PDF-1.7")
    assert len(read_test_folder(folder).files) == len(files) + 2


def test_a_recording_of_the_toolkit_is_one(folder):
    path = folder / "a.xlsx"
    path.write_bytes(packed(members(keywords="toolkit-recording; machine=m15-virtual; simulated")))
    assert not is_own_output(path)
    assert machine_of(path) == "m15-virtual"
    assert path in read_test_folder(folder).files


def test_marks_never_raise(tmp_path):
    for index, data in enumerate((b"", b"PK\x03\x04", b"{", b"[" * 100_000, b"{" + b'"a":[' * 100_000)):
        path = tmp_path / str(index)
        path.write_bytes(data)
        assert not is_own_output(path)
        assert machine_of(path) is None
    assert not is_own_output(tmp_path)
    assert machine_of(tmp_path / "none") is None


def test_a_marked_workbook_is_known_again(tmp_path):
    from openpyxl import Workbook

    book = Workbook()
    mark_workbook(book, simulated=True, machine="m15-virtual")
    book.save(tmp_path / "x")
    assert is_own_output(tmp_path / "x")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("operator =", "operater =", "operator"),
        ("DOT =", "dot =", "DOT"),
        ('rotation = "forward"', 'rotation = "foward"', "forward or reverse"),
        ('= "reverse"\n"sub', '= "backward"\n"sub', "forward or reverse"),
        ('"sub/c.xlsx" =', '"sub/d.xlsx" =', "sub/c.xlsx"),
        ("date = 2009-05-14", 'date = "14.5.2009"', "a date such as 2026-03-31"),
        ("date = 2009-05-14", "date = 5", "a date such as 2026-03-31"),
        ("schema = 1", "schema = 2", "1"),
        ("value = 30", 'value = "30"', "a finite number in psi"),
        ("value = 30", "value = -30", '{ value = NUMBER, unit = "kPa" } above 0 kPa'),
        ("value = 30", "value = nan", "a finite number in psi"),
        ("value = 30", "vaule = 30", "value"),
        ('{ value = 30, unit = "psi" }', "30", '{ value = NUMBER, unit = "kPa" } above 0 kPa'),
        ('unit = "psi"', "unit = 5", '{ value = NUMBER, unit = "kPa" } above 0 kPa'),
        ('"second person"', "true", "a text"),
        ('"second person"', '["second person"]', "a text"),
        ("E5 = -2", "E6 = -2", "D52, D51, E5"),
        ("E5 = -2", 'E5 = "x"', '{ value = NUMBER, unit = "..." }, or a number'),
        ("values =", 'file = "x"\nvalues =', "one of the two"),
        ('machine = "m15"', "", 'machine = "m15", or the path of a machine definition'),
        ('machine = "m15"', 'machine = "m16"', "m15, m15-virtual"),
        ("schema = 1", "simulated = 1", "true or false"),
        ("schema = 1", 'tare = "zero"', None),
    ],
)
def test_bad_lines(folder, old, new, expected):
    if old.startswith("date") or expected is not None:
        edited(folder, old, new)
        assert refused(folder).expected == expected
    else:
        (folder / "test.toml").write_text(f'machine = "m15"\n{new}')
        assert refused(folder).expected == "a table [tare] with file, values, u"


def test_units(folder):
    for unit in ("furlong/psi", "mV/V", "N"):
        edited(folder, 'unit = "psi"', f'unit = "{unit}"')
        refused(folder, ToolkitError)
    edited(folder, 'unit = "N"', 'unit = "mV/V"')
    refused(folder, ToolkitError)


def test_tare_files_that_are_not_there(folder, tmp_path):
    values = FULL[FULL.index("values =") :]
    (tmp_path / "outside").write_bytes(workbook())
    for name in ("zero", "../outside", str(tmp_path / "outside")):
        edited(folder, values, f'file = "{name}"')
        assert refused(folder).rule == "no-file"


def test_missing_things(folder, tmp_path):
    assert refused(tmp_path / "none").rule == "no-test"
    assert refused(folder / "a.xlsx").rule == "no-test"
    assert refused(folder / "sub").rule == "no-test"
    (folder / "test.toml").write_text("machine = ")
    refused(folder)
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "test.toml").write_text('machine = "m15"')
    assert refused(empty, RecordingError).rule == "no-recordings"


def test_a_tare_that_lacks_a_cell_is_refused(folder):
    toml = folder / "test.toml"
    toml.write_text(toml.read_text().replace("D52 = 0.5, ", ""))
    with pytest.raises(ConfigError) as caught:
        read_test_folder(folder)
    assert caught.value.rule == "tare-incomplete"
    assert caught.value.got == "D51, E5"


@pytest.mark.parametrize("u", ["u = { D51 = 0.1 }", "u = { D51 = 0.1, D52 = -0.1, E5 = 0.1 }"])
def test_the_u_of_a_tare_names_every_cell_and_is_not_negative(tmp_path, u):
    (tmp_path / "run.xlsx").write_bytes(b"x")
    values = "values = { D51 = 1, D52 = 0.5, E5 = -2 }"
    (tmp_path / "test.toml").write_text(f'schema = 1\nmachine = "m15"\n[tare]\n{values}\n{u}\n')
    with pytest.raises(ToolkitError):
        read_test_folder(tmp_path)


def test_the_u_of_a_tare_is_read_in_the_cells_unit(tmp_path):
    (tmp_path / "run.xlsx").write_bytes(b"x")
    lines = ["values = { D51 = 1, D52 = 0.5, E5 = -2 }",
             'u = { D51 = { value = 4.4482216152605, unit = "N" }, D52 = 0.1, E5 = 0.2 }']  # fmt: skip
    (tmp_path / "test.toml").write_text("\n".join(['schema = 1\nmachine = "m15"\n[tare]', *lines]))
    assert dict(read_test_folder(tmp_path).tare_u) == pytest.approx({"D51": 1.0, "D52": 0.1, "E5": 0.2})
