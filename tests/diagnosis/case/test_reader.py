"""A case file: every entry checked, with its place and the nearest known word; nothing guessed."""

import io
import os
import re
import tomllib

import numpy as np
import pytest
from openpyxl import Workbook

from tests.diagnosis.cases import HEAD, ONE, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.errors import CellError, ColumnError, ConfigError, ToolkitError, UnitError, UnreadableError
from toolkit.lab.rules import RULES_FILE


@pytest.mark.parametrize(
    ("old", "new", "what", "nearest"),
    [
        ("title =", "titel =", "unknown key", "title"),
        ("function =", "functon =", "unknown key", "function"),
        ("sd = 5.0", "std = 5.0", "unknown key", "sd"),
        ('time = "t"', 'tyme = "t"', "unknown key", "time"),
        ('role = "time"', 'rol = "time"', "unknown key", "role"),
        ('"python"', '"pyhton"', "kind", "python"),
        ('role = "input" }\na', 'role = "inputs" }\na', "role", "input"),
        ("[recording]\n", '[recording]\naxes = "iso-w"\n', "recording.axes", "ISO-W"),
        ('file = "r1.csv"', 'file = "r1.csv"\nrotation = "foward"', "condition", "forward"),
        ('file = "r1.csv"', 'file = "r1.csv"\nphase = "tar"', "condition", "tare"),
    ],
)
def test_a_word_that_is_not_known_names_the_nearest_one(tmp_path, old, new, what, nearest):
    assert old in HEAD + TWO
    with pytest.raises(ConfigError, match=what) as caught:
        read_case(write_case(tmp_path, (HEAD + TWO).replace(old, new)))
    assert f"did you mean {nearest!r}?" in str(caught.value)
    assert "CASE.toml" in str(caught.value.where)


@pytest.mark.parametrize(
    ("old", "new", "what", "where"),
    [
        ('unit = "m/s", ', "", "is missing", "recording.channels.v.unit"),
        ('unit = "m/s", ', 'unit = "mm/sx", ', "unknown unit 'mm/sx'", "recording.channels.v.unit"),
        ('unit = "m/s", ', "unit = 3, ", 'unit = "N"', "recording.channels.v.unit"),
        ('role = "output"', 'role = "output", sd = 0', "a positive number", "recording.channels.F.sd"),
        ('role = "output"', "role = 1", "time, input, output", "recording.channels.F.role"),
        ('F = { unit = "N", role = "output" }', "F = 3", "unit, role, sd", "recording.channels.F"),
        ("[recording.channels]", "[recording.channel]", "did you mean 'channels'", "recording"),
        ('unit = "kg"\n', "", "is missing", "simulation.parameters.mass.unit"),
        ('unit = "kg"\n', 'unit = "kgg"\n', "unknown unit 'kgg'", "simulation.parameters.mass.unit"),
        ("value = 94.0", 'value = "94"', "a finite number", "simulation.parameters.mass.value"),
        ("value = 94.0", "value = inf", "a finite number", "simulation.parameters.mass.value"),
        (
            "value = 94.0",
            f"value = {10**400}",
            "a number of at most 1e+100 in size",
            "simulation.parameters.mass.value",
        ),
        ("value = 94.0", "value = true", "a finite number", "simulation.parameters.mass.value"),
        ("value = 94.0", "", "is missing", "simulation.parameters.mass.value"),
        ("sd = 5.0", "sd = 0.0", "a number above zero", "simulation.parameters.mass.sd"),
        ("[80.0, 110.0]", "[110.0, 80.0]", "not below the upper", "simulation.parameters.mass.bounds"),
        ("[80.0, 110.0]", "[95.0, 110.0]", "outside its bounds", "simulation.parameters.mass.bounds"),
        ("[80.0, 110.0]", "[80.0]", "a finite number, a finite", "simulation.parameters.mass.bounds"),
        ("[80.0, 110.0]", '["80", 110.0]', "a finite number", "simulation.parameters.mass.bounds[1]"),
        ("schema = 1", "schema = 2", "newer version", "schema"),
        ("schema = 1", "", "schema = 1", "schema"),
        ('title = "A carriage"', 'title = ["x"]', "a text", "title"),
        ('kind = "python"', "", "is missing", "simulation.kind"),
        ('kind = "python"', 'kind = ["python"]', "machine, python, ode, fmu, columns", "simulation.kind"),
        ('kind = "python"', 'kind = "ode"', "unknown key 'function'", "simulation"),
        ('path = "sim.py"', "", "is missing", "simulation.path"),
        ('path = "sim.py"', "path = 3", 'path = "FILE"', "simulation.path"),
        ('function = "simulate"', "function = 3", "a text", "simulation.function"),
        ('time = "t"', "time = 3", "a text", "recording.time"),
        ('time = "t"', 'time = "v"', "not declared", "recording.time"),
        ('time = "t"\n', "axes = 3\n", "machine", "recording.axes"),
        ('unit = "s"', 'unit = "m"', "unit of time", "recording.channels.t"),
        ('role = "output"', 'role = "input"', "judged", "recording.channels"),
        ('file = "r1.csv"', 'file = "r0.csv"', "stands twice", "recording.run[2].file"),
        ('file = "r1.csv"', 'file = ""', "no file", "recording.run[2].file"),
        ('file = "r1.csv"', "file = 3", "no file", "recording.run[2].file"),
        ('file = "r1.csv"', "", "no file", "recording.run[2].file"),
        (
            'file = "r1.csv"',
            'file = "r1.csv"\nmounting = ["x"]',
            "normal, turned",
            "recording.run[2].mounting",
        ),
        (TWO, ONE + 'phase = "tare"\n', "every recording is a tare", "recording.run"),
        (TWO, "", "is missing", "recording.run"),
        (TWO, ONE + "[[recording.predict]]\n", "no file", "recording.predict[1].file"),
        (TWO, "[recording.run]\n", "[[recording.run]]", "recording.run"),
    ],
)
def test_a_wrong_entry_is_refused_at_its_place(tmp_path, old, new, what, where):
    assert old in HEAD + TWO
    with pytest.raises(ConfigError, match=re.escape(what)) as caught:
        read_case(write_case(tmp_path, (HEAD + TWO).replace(old, new)))
    error = caught.value
    assert str(error.where).endswith(f"CASE.toml: {where}")
    assert error.line or where in ("schema", "recording.run")
    assert error.got is not None
    assert error.expected
    assert "toolkit explain case" in str(error.next_step)
    assert error.rule == ("unknown-key" if "unknown key" in what or "did you mean" in what else "case")


@pytest.mark.parametrize(
    ("simulation", "what", "where"),
    [
        ("simulation = 3", "a table with kind", "simulation"),
        ('[simulation]\nkind = "ode"\npath = "sim.py"\nstates = "x"', "a list", "simulation.states"),
        ('[simulation]\nkind = "ode"\npath = "sim.py"\nstates = ["x", "x"]', "twice", "simulation.states"),
        ('[simulation]\nkind = "ode"\npath = "sim.py"\nstates = [1]', "a text", "simulation.states[1]"),
        ('[simulation]\nkind = "ode"\npath = "sim.py"\nforce_terms = { v = "N/kgg" }', "unknown unit",
         "simulation.force_terms.v"),
        ('[simulation]\nkind = "columns"', "is missing", "simulation.simulated"),
        ('[simulation]\nkind = "columns"\nsimulated = {}', "FY_sim", "simulation.simulated"),
        ('[simulation]\nkind = "columns"\nsimulated = { FY = 3 }', "a text", "simulation.simulated.FY"),
        ('[simulation]\nkind = "machine"\ntire = 3', "path of a file", "simulation.tire"),
        ('[simulation]\nkind = "machine"\nmachine = 3', "a text", "simulation.machine"),
        ("[simulation]\nmodel = 3", "path of a file", "simulation.model"),
        ('[simulation]\nmodel = "m.toml"\nparameters = []', "a table", "simulation.parameters"),
    ],
)  # fmt: skip
def test_a_wrong_simulation_is_refused_at_its_place(tmp_path, simulation, what, where):
    channels = HEAD[HEAD.index("[recording]") :]
    with pytest.raises(ConfigError, match=re.escape(what)) as caught:
        read_case(write_case(tmp_path, f"schema = 1\n{simulation}\n{channels}{TWO}"))
    assert str(caught.value.where).endswith(f"CASE.toml: {where}")
    assert caught.value.line
    assert caught.value.rule == "case"


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b"schema = 1\nschema = 1\n", b"schema = 1\nsimulation = 3\n"]
)
def test_what_is_no_case_is_refused(tmp_path, content):
    with pytest.raises(ConfigError):
        read_case(write_case(tmp_path, content))


def test_a_pipe_a_folder_and_nothing_are_no_recording(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for name, rule in (("pipe.csv", "no-file"), (".", "folder-for-file"), ("absent.csv", "no-file")):
        case = write_case(tmp_path, HEAD + f'[[recording.run]]\nfile = "{name}"\n')
        with pytest.raises(ConfigError, match=r"cannot be read|is a folder") as caught:
            read_case(case)
        assert caught.value.rule == rule


def test_a_simulator_that_is_a_pipe_is_refused_not_waited_for(tmp_path):
    case = write_case(tmp_path, simulator=None)
    os.mkfifo(tmp_path / "sim.py")
    with pytest.raises(ConfigError, match="cannot be read"):
        read_case(case)


def test_a_missing_column_names_the_nearest_one(tmp_path):
    case = write_case(tmp_path, r1__csv=carriage().rename(columns={"a": "acc"}))
    with pytest.raises(ColumnError, match="'a'") as caught:
        read_case(case)
    assert caught.value.rule == "case-column"
    assert "t, v, acc, F" in str(caught.value.got)


def test_columns_that_nobody_names_may_hold_anything(tmp_path):
    df = carriage()
    df.insert(1, "note", 'said "so, or so"')
    df["when"] = "2024-05-01 10:00"
    read = read_case(write_case(tmp_path, r0__csv=df))
    np.testing.assert_allclose(read.runs[0].columns["F"], df["F"])
    assert set(read.runs[0].columns) == {"t", "v", "a", "F"}


ROWS = "".join(f"{i},{0.1 * i},{i % 3},{i % 5}\n" for i in range(20))
TABLE = "t,v,a,F\n" + ROWS


def _xlsx(rows: list[list[object]]) -> bytes:
    book, stream = Workbook(), io.BytesIO()
    for row in rows:
        book.active.append(row)
    book.save(stream)
    return stream.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        TABLE.encode("utf-16"),
        TABLE.replace(",", ";").replace(".", ","),
        TABLE.replace(",", "\t"),
        TABLE.replace("t,v,a,F", "t [s],v (m/s),a / m/s^2,F_N"),
        TABLE.replace("t,v,a,F", "t,v,a,F [kN]"),
        _xlsx(
            [
                ["t [s]", "v [m/s]", "a [m/s^2]", "F [N]"],
                *[[*map(float, line.split(","))] for line in ROWS.split()],
            ]
        ),
    ],
    ids=["UTF-16", "semicolons", "tabs", "units", "kN", "workbook"],
)
def test_a_run_is_read_from_whatever_program_saved_it(tmp_path, content, request):
    run = read_case(write_case(tmp_path, HEAD + ONE, r0__csv=content)).runs[0]
    scale = 1000.0 if request.node.callspec.id == "kN" else 1.0
    np.testing.assert_allclose(run.columns["v"], 0.1 * np.arange(20))
    np.testing.assert_allclose(run.columns["F"], scale * (np.arange(20) % 5))


@pytest.mark.parametrize(
    ("content", "error", "said"),
    [
        ("", UnreadableError, "no rows"),
        ("t,v,a,F\n", UnreadableError, "no rows"),
        ("t,v,a,F\n\n \n", UnreadableError, "no rows"),
        (b"t,v,a,F\n0,1,1,\x81\n", UnreadableError, "UTF-8"),
        (TABLE + "30,1,1," + "9" * 200_000 + "\n", UnreadableError, "field"),
        (TABLE.replace("\n7,", "\n7\0,", 1), CellError, "line 9, column t"),
        (TABLE + "30,1\n", CellError, "line 22"),
        (TABLE + "30,1,1,inf\n", CellError, "column F"),
        (TABLE + "30,1,1,1e308\n", CellError, "column F"),
        (TABLE + "30,1,1,1_0\n", CellError, "column F"),
        (TABLE + "30,1,1,=1+1\n", CellError, "column F"),
        (TABLE + "30,1,1,٣\n", CellError, "column F"),
        (TABLE + "30,1,1,1\n29,1,1,1\n", CellError, "does not rise"),
        (TABLE + "30,1,1,1\n30,1,1,1\n", CellError, "a time stands twice"),
        (TABLE + ",1,1,1\n", CellError, "no time"),
        (TABLE.replace("t,v,a,F", "t,v,F,F"), ColumnError, "twice"),
        (TABLE.replace(",", ";").replace("t;v", "t;v1"), ColumnError, "did you mean 'v1'"),
        ("t;v;a;F\n" + "".join(f"{i};1,234;0;0\n" for i in range(9)), UnreadableError, "1,234"),
        (TABLE.replace("t,v,a,F", "t [s],v [m/s],a,F [mm]"), UnitError, "mm"),
        ("t,v,a,F\n" + "".join(f"{i},,1,2\n" for i in range(9)), ColumnError, "no value at all"),
        (b"PK\x03\x04rest", UnreadableError, "workbook"),
    ],
)
def test_a_hostile_table_is_refused_with_its_place(tmp_path, content, error, said):
    with pytest.raises(error) as caught:
        read_case(write_case(tmp_path, HEAD + ONE, r0__csv=content))
    assert said in str(caught.value)
    assert isinstance(caught.value, ToolkitError)
    assert caught.value.next_step


@pytest.mark.parametrize(
    "content",
    [
        TABLE,
        TABLE.replace("\n", "\r\n"),
        TABLE.replace("\n", "\r").encode(),
        "\ufeff" + TABLE,
        TABLE + "\n\n,,,\n",
        TABLE.replace("t,v,a,F", '"t", "v","a",F'),
        "t,v,a,F,\n" + ROWS.replace("\n", ",\n"),
    ],
)
def test_line_ends_marks_and_blank_rows_change_nothing(tmp_path, content):
    run = read_case(write_case(tmp_path, HEAD + ONE, r0__csv=content)).runs[0]
    assert run.rows == 20
    np.testing.assert_array_equal(run.columns["F"], np.arange(20) % 5)


def test_a_copy_of_a_recording_under_another_name_is_refused(tmp_path):
    table = carriage(seed=3)
    with pytest.raises(ConfigError, match="stands twice") as caught:
        read_case(write_case(tmp_path, HEAD + TWO, r0__csv=table, r1__csv=table))
    assert str(caught.value.where).endswith("recording.run[2].file")
    assert "r1.csv, the same bytes as r0.csv" in str(caught.value.got)
    # What stands still may repeat itself: a case without variation is one that is judged.
    still = table.assign(F=1.0)
    assert len(read_case(write_case(tmp_path / "b", HEAD + TWO, r0__csv=still, r1__csv=still)).runs) == 2


def test_links_in_a_circle_are_told_as_a_file_that_cannot_be_read(tmp_path):
    case = write_case(tmp_path, HEAD + TWO)
    (tmp_path / "r1.csv").unlink()
    (tmp_path / "r1.csv").symlink_to("r1.csv")
    with pytest.raises(ConfigError, match="cannot be read") as caught:
        read_case(case)
    assert str(caught.value.where).endswith("r1.csv")


def test_missing_samples_stay_missing_in_outputs_and_are_counted_in_inputs(tmp_path):
    text = TABLE.replace("\n3,0.30000000000000004,0,3", "\n3,,0,3").replace("\n5,0.5,2,0", "\n5,0.5,2,NaN")
    run = read_case(write_case(tmp_path, HEAD + ONE, r0__csv=text)).runs[0]
    assert run.columns["v"][3] == pytest.approx(0.3)  # linear between 0.2 and 0.4
    assert run.filled == (("v", 1),)
    assert np.flatnonzero(np.isnan(run.columns["F"])).tolist() == [5]


def test_the_hash_covers_the_case_and_every_file_that_it_names(tmp_path):
    first = read_case(write_case(tmp_path / "a")).sha256
    assert read_case(write_case(tmp_path / "b")).sha256 == first
    changed = [
        write_case(tmp_path / "c", r1__csv=carriage(seed=5)),
        write_case(tmp_path / "d", simulator="def simulate(inputs, p): pass\n"),
        write_case(tmp_path / "e", HEAD.replace("A carriage", "Another") + TWO),
    ]
    assert first not in {read_case(one).sha256 for one in changed}


def test_conditions_of_any_key_are_kept(tmp_path):
    told = 'date = 2024-01-02\norder = 2\ncolour = "blue"\npressure = { value = 200, unit = "kPa" }\n'
    run = read_case(write_case(tmp_path, HEAD + TWO + told)).runs[1]
    assert run.conditions == {"date": "2024-01-02", "order": "2", "colour": "blue", "pressure": "200 kPa"}


def test_the_case_that_explain_shows_is_one_that_is_read(tmp_path):
    shown = tomllib.loads(RULES_FILE.read_text(encoding="utf-8"))["case"]["do"]
    lines = [line.removeprefix("    ") for line in shown.splitlines() if line.startswith("    ")]
    case = write_case(tmp_path, "\n".join(lines), run01__csv=carriage())
    assert [(one.name, one.role) for one in read_case(case).channels] == [
        ("t", "time"), ("a", "input"), ("F", "output"),
    ]  # fmt: skip
