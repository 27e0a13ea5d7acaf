"""A case that is put together field by field is the case that a reader reads, and no other file's."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest

from tests.workbench.test_diagnosis_page import CASE_FILES
from toolkit.diagnosis.case.reader import read_case
from toolkit.errors import ToolkitError
from toolkit.lab.desk.built_case import (
    CHANNELS,
    add_entry,
    add_files,
    begin_case,
    drop_entry,
    is_open,
    kinds,
    open_case,
    read_whole,
    state_entry,
)
from toolkit.lab.laboratory import example

FILES = dict(CASE_FILES)
RECORDINGS = [(name, FILES[name]) for name in ("r0.csv", "r1.csv")]
OWN = [("sim.py", FILES["sim.py"])]
TIRE = b"t [s],SA [deg],FZ [N],FY [N],FY_other,T [degC],note\n" + b"".join(
    f"{i},{i % 5},3000,{-900 * (i % 5) + i % 3},{-890 * (i % 5)},20,1\n".encode() for i in range(60)
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / begin_case(tmp_path, "python", RECORDINGS, OWN)


def test_built_field_by_field_it_is_the_case_that_somebody_writes(folder: Path) -> None:
    for column, role in (("L", "input"), ("F", "output")):
        add_entry(folder, CHANNELS, column)
        state_entry(folder, f"{CHANNELS}.{column}.unit", "N")
        state_entry(folder, f"{CHANNELS}.{column}.role", role)
    state_entry(folder, f"{CHANNELS}.F.sd", "0,4")
    add_entry(folder, "simulation.parameters", "gain")
    for key, text in (("value", "1"), ("unit", "1"), ("sd", "0.001")):
        state_entry(folder, f"simulation.parameters.gain.{key}", text)
    add_files(folder, [("more.csv", FILES["more.csv"])])
    add_entry(folder, "recording.predict", "more.csv")
    written = folder.parent / "written"
    written.mkdir()
    for name, data in CASE_FILES:
        (written / name).write_bytes(data)
    built, other = read_whole(folder), read_case(written / "case.toml")
    assert built.channels == other.channels
    assert built.parameters == other.parameters
    assert [run.sha256 for run in (*built.runs, *built.predict)] == [
        run.sha256 for run in (*other.runs, *other.predict)
    ]
    assert built.simulation.path == folder / "sim.py"
    # What is left out again leaves the rest as it is.
    drop_entry(folder, "recording.predict.0")
    drop_entry(folder, "recording.run.0")
    assert [run.name for run in read_whole(folder).runs] == ["r1.csv"]


def test_headers_and_units_are_the_first_guess_and_every_match_can_be_changed(tmp_path: Path) -> None:
    folder = tmp_path / begin_case(tmp_path, "columns", [("run.csv", TIRE)], [])
    case = read_whole(folder)
    assert {channel.name: (channel.unit, channel.role) for channel in case.channels} == {
        "t": ("s", "time"), "SA": ("deg", "input"), "FZ": ("N", "input"), "FY": ("N", "output"),
        "T": ("degC", "covariate"),
    }  # fmt: skip
    assert case.simulation.simulated == (("FY", "FY_other"),)
    assert open_case(folder).offers[CHANNELS] == ("FY_other", "note")
    state_entry(folder, f"{CHANNELS}.T.role", "input")
    drop_entry(folder, f"{CHANNELS}.SA")
    assert [channel.role for channel in read_whole(folder).channels] == ["time", "input", "output", "input"]


def test_the_recordings_of_the_machine_have_its_channels(tmp_path: Path) -> None:
    rows = "".join(f"{i},0,3000,0.1,0.2,0.3,0\n" for i in range(9))
    own = f"t [s],SA [deg],FZ [N],D51 [N],D52 [lbf],E5 [lbf],FY [N]\n{rows}".encode()
    folder = tmp_path / begin_case(tmp_path, "machine", [("run.csv", own)], [])
    roles = {channel.name: channel.role for channel in read_whole(folder).channels}
    assert {name: roles[name] for name in ("t", "SA", "FZ", "D51", "D52", "E5")} == {
        "t": "time", "SA": "input", "FZ": "input", "D51": "output", "D52": "output", "E5": "output",
    }  # fmt: skip


def test_a_workbook_of_the_machine_is_a_case_without_a_word_typed(tmp_path: Path) -> None:
    recording = Path(example("fig4_4"))
    folder = tmp_path / begin_case(tmp_path, "machine", [(recording.name, recording.read_bytes())], [])
    case = read_whole(folder)
    # What the rig computed is none of the simulation's; the units are those of the machine's definition.
    assert {channel.name: (channel.unit, channel.role) for channel in case.channels} == {
        "FZ": ("lbf", "input"), "SA": ("deg", "input"), "D51": ("lbf", "output"), "D52": ("lbf", "output"),
        "E5": ("lbf", "output"),
    }  # fmt: skip
    assert case.runs[0].own


def test_another_kind_of_simulation_has_its_own_entries(folder: Path) -> None:
    assert set(kinds()) == {"machine", "python", "ode", "fmu", "columns"}
    assert state_entry(folder, "simulation.kind", "ode")
    names = {entry.name for group in open_case(folder).groups for entry in group.statements}
    assert "simulation.states" in names
    assert "simulation.function" not in names
    assert not state_entry(folder, "title", "Another")


@pytest.mark.parametrize("typed", ["/etc/passwd", "..", "../case-1/r0.csv", "../../cases"])
@pytest.mark.parametrize("name", ["simulation.path", "recording.run.0.file", "title"])
def test_no_entry_leads_out_of_the_case(folder: Path, name: str, typed: str) -> None:
    before = (folder / "case.toml").read_bytes()
    with pytest.raises(ToolkitError, match="of this case"):
        state_entry(folder, name, typed)
    assert (folder / "case.toml").read_bytes() == before


@pytest.mark.parametrize(("kind", "recordings", "own", "got"), [
    ("python", [], OWN, "sim.py"), ("fortran", RECORDINGS, [], "fortran"),
    ("python", [("case.toml", b"schema = 1")], [], "case.toml"),
    ("python", [("../r.csv", b"L\n1\n")], [], "../r.csv"),
    ("python", [("r.csv", b"1,2\n3,4\n")], [], "r.csv"),
    ("python", [RECORDINGS[0]], [RECORDINGS[0]], "r0.csv"),
])  # fmt: skip
def test_what_is_no_case_leaves_nothing(
    tmp_path: Path, kind: str, recordings: list[tuple[str, bytes]], own: list[tuple[str, bytes]], got: str
) -> None:
    with pytest.raises(ToolkitError) as caught:
        begin_case(tmp_path, kind, recordings, own)
    assert got in str(caught.value)
    assert ".toolkit" not in str(caught.value)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_run_that_is_no_recording_is_told_by_the_reader_and_can_be_left_out(folder: Path) -> None:
    add_files(folder, [("notes.csv", b"1,2\n3,4\n")])
    add_entry(folder, "recording.run", "notes.csv")
    assert open_case(folder).offers[CHANNELS] == ("L", "F")
    with pytest.raises(ToolkitError):
        read_whole(folder)
    drop_entry(folder, "recording.run.2")
    assert "notes.csv" not in open_case(folder).text


@pytest.mark.parametrize(("text", "is_toml"), [
    ("title = [", False), ("\x00", False), ("recording = 3\n", True),
    ("simulation = []\nrecording.run = 1", True),
])  # fmt: skip
def test_a_text_that_somebody_spoiled_is_shown_where_it_is_toml(
    folder: Path, text: str, is_toml: bool
) -> None:  # fmt: skip
    (folder / "case.toml").write_text(text)
    with contextlib.nullcontext() if is_toml else pytest.raises(ToolkitError, match=r"case\.toml"):
        assert open_case(folder).text == text
    with pytest.raises(ToolkitError):
        read_whole(folder)


def test_no_file_takes_the_place_of_another(folder: Path) -> None:
    for files in ([("r0.csv", b"L,F\n1,2\n")], [("case.toml", b"")], []):
        with pytest.raises(ToolkitError):
            add_files(folder, files)
    assert (folder / "r0.csv").read_bytes() == FILES["r0.csv"]


def test_cases_that_lie_elsewhere_are_changed_in_their_own_files(tmp_path: Path) -> None:
    assert is_open(tmp_path, "cases/case-1")
    assert not is_open(tmp_path, "work/case")
