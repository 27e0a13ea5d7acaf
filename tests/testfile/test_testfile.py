"""The whole test in one file: the same result back, numbers as numbers, and edits told."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import hashlib
import json
import re
import resource
import string
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import openpyxl
import pytest
import python_calamine

from toolkit.characteristics.model import Characteristics, Row
from toolkit.errors import ConfigError, OutputError, RecordingError, ToolkitError
from toolkit.findings import Finding
from toolkit.machine import load_machine
from toolkit.machine.definition import machine_file
from toolkit.pipeline import TestResult, process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.testfile import read_test_file, write_test_file
from toolkit.testfile.layout import content_hash

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.recording.model import Recording

Made = tuple[TestResult, dict[str, "Recording"]]


@pytest.fixture(scope="module")
def made(virtual_test: Path, virtual_record: CalibrationRecord) -> Made:
    test = read_test_folder(virtual_test)
    recordings = read_test(test)
    return process(test, recordings, virtual_record), {one.name: one for one in recordings}


@pytest.fixture(scope="module")
def file(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("file") / "test.xlsx"
    write_test_file(path, *made)
    return path


@pytest.fixture(scope="module")
def light(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of few rows, none of its recordings, for tests that change it and write it again."""
    path = tmp_path_factory.mktemp("light") / "test.xlsx"
    write_test_file(path, short(made[0]))
    return path


def short(result: TestResult) -> TestResult:
    """Return a result of eight conditions and eight characteristics."""
    return dataclasses.replace(
        result,
        reduced=dataclasses.replace(result.reduced, conditions=result.reduced.conditions[:8]),
        characteristics=dataclasses.replace(result.characteristics, rows=result.characteristics.rows[:8]),
    )


def test_a_full_folder_for_temporary_files_is_named_and_nothing_else_is_printed(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Unfinished sheets that fail once more at their end are printed as "Exception ignored in ...".
    ignored: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", ignored.append)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot be put together") as caught:
            write_test_file(tmp_path / "test.xlsx", *made)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert tempfile.gettempdir() in str(caught.value.where)
    del caught
    gc.collect()
    assert ignored == []


def test_it_reads_back_to_the_same_result(made: Made, file: Path) -> None:
    assert read_test_file(file) == made[0]


def test_it_reads_back_whatever_is_missing(tmp_path: Path, made: Made) -> None:
    result = made[0]
    reduced = dataclasses.replace(
        result.reduced,
        conditions=tuple(
            dataclasses.replace(c, FY_file=None, step_FZ=None) for c in result.reduced.conditions
        ),
        findings=(Finding(rule="no-tare", where="=1+1", message="+cmd|' /C calc'!A0 <&> ёж 🛞"),),
        info=dataclasses.replace(result.reduced.info, special="=HYPERLINK(0)", date=None, operator="12"),
    )
    first, *others = result.characteristics.rows
    lacking = Row(
        name=first.name, load_N=first.load_N, rotation=first.rotation, lacking="the data do not determine it"
    )
    fits = (dataclasses.replace(result.characteristics.fits[0], MZ=None), *result.characteristics.fits[1:])
    changed = TestResult(
        reduced=reduced,
        characteristics=dataclasses.replace(result.characteristics, rows=(lacking, *others), fits=fits),
    )
    path = tmp_path / "x.xlsx"
    write_test_file(path, changed)
    assert read_test_file(path) == changed


def test_numbers_are_numbers_and_texts_are_never_formulas(tmp_path: Path, made: Made) -> None:
    info = dataclasses.replace(made[0].reduced.info, special="=1+1", operator="@SUM(A1)")
    result = dataclasses.replace(made[0], reduced=dataclasses.replace(made[0].reduced, info=info))
    path = tmp_path / "x.xlsx"
    name = next(iter(made[1]))  # one recording stands for all
    write_test_file(path, result, {name: made[1][name]})
    book = openpyxl.load_workbook(path)
    kinds = {cell.data_type for sheet in book for row in sheet.iter_rows() for cell in row}
    assert "f" not in kinds
    reduced = book["reduced"]
    heads = [cell.value for cell in reduced[1]]
    assert reduced.cell(2, heads.index("FY [N]") + 1).value == made[0].reduced.conditions[0].FY
    assert book["raw"].max_row == 1 + made[1][name].rows


def test_rows_beyond_a_worksheets_last_go_on_in_another(
    tmp_path: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    from toolkit.testfile import write

    recordings = dict(list(made[1].items())[:3])
    rows = sum(one.rows for one in recordings.values())
    whole, parted = tmp_path / "whole.xlsx", tmp_path / "parted.xlsx"
    write_test_file(whole, made[0], recordings)
    monkeypatch.setattr(write, "_SHEET_ROWS", rows // 2 + 1)
    monkeypatch.setattr(write, "_AT_A_TIME", 7)
    write_test_file(parted, made[0], recordings)
    expected = python_calamine.load_workbook(whole).get_sheet_by_name("raw").to_python()
    book = python_calamine.load_workbook(parted)
    first, second = (book.get_sheet_by_name(name).to_python() for name in ("raw", "raw 2"))
    assert first[0] == second[0] == expected[0]
    assert len(first) == rows // 2 + 2
    assert first[1:] + second[1:] == expected[1:]
    assert read_test_file(parted) == made[0]


def test_it_says_that_it_is_simulated(file: Path) -> None:
    book = openpyxl.load_workbook(file, read_only=True)
    assert any(row[0] == "SIMULATED" for row in book["provenance"].iter_rows(values_only=True))


def test_an_edited_number_is_told(tmp_path: Path, light: Path) -> None:
    book = openpyxl.load_workbook(light)
    heads = [cell.value for cell in book["reduced"][1]]
    cell = book["reduced"].cell(5, heads.index("FY_common [N]") + 1)
    cell.value = float(str(cell.value)) * 1.0001
    path = tmp_path / "edited.xlsx"
    book.save(path)
    with pytest.raises(RecordingError) as caught:
        read_test_file(path)
    assert caught.value.rule == "test-file-changed"


@pytest.mark.parametrize("sheet", ["provenance", "reduced", "characteristics"])
def test_a_lost_sheet_is_told(tmp_path: Path, light: Path, sheet: str) -> None:
    book = openpyxl.load_workbook(light)
    del book[sheet]
    book.save(tmp_path / "x.xlsx")
    with pytest.raises(RecordingError) as caught:
        read_test_file(tmp_path / "x.xlsx")
    assert caught.value.rule == "not-a-test-file"


def test_a_lost_column_is_told(tmp_path: Path, light: Path) -> None:
    book = openpyxl.load_workbook(light)
    book["reduced"].delete_cols(4)
    book.save(tmp_path / "x.xlsx")
    with pytest.raises(ToolkitError):
        read_test_file(tmp_path / "x.xlsx")


def test_the_hash_is_that_of_the_content(made: Made) -> None:
    result = made[0]
    again = dataclasses.replace(result, reduced=dataclasses.replace(result.reduced))
    assert content_hash(again) == content_hash(result)
    other = dataclasses.replace(result, reduced=dataclasses.replace(result.reduced, code_version="x"))
    assert content_hash(other) != content_hash(result)


def test_what_the_machine_states_is_in_the_file(made: Made, file: Path) -> None:
    stated = {one.symbol: one for one in read_test_file(file).reduced.stated}
    m15 = load_machine("m15")  # the zero of the cells is not used: the test has a tare
    assert stated == {symbol: m15.stated_uncertainty(symbol) for symbol in ("FZ", "SA", "SA_scale", "P")}


PULL = """conicity plysteer CRAT PRAT PRAT_at_FY_zero thesis_CRAT thesis_PRAT thesis_PRAT_at_FY_zero
residual_forward residual_reverse""".split()
STIFFNESS = "secant_cornering secant_aligning slope_cornering slope_aligning".split()


def first_form(found: Characteristics) -> dict[str, Any]:
    """Characteristics as the first files hashed them: an entry a load, with a key for each characteristic."""

    def entry(names: Sequence[str], **place: Any) -> dict[str, Any]:
        key = (place["load_N"], place.get("rotation", "both"), place.get("SA_rad"))
        rows = [found.at(name, *key) for name in names]
        return place | {
            name: None if row is None or row.estimate is None else dataclasses.asdict(row.estimate)
            for name, row in zip(names, rows, strict=True)
        }

    directions = [(fit.load_N, fit.rotation) for fit in found.fits]
    angles = dict.fromkeys((r.load_N, r.rotation, r.SA_rad) for r in found.rows if r.SA_rad is not None)
    return {
        "fits": [dataclasses.asdict(fit) for fit in found.fits],
        "findings": [dataclasses.asdict(finding) for finding in found.findings],
        "points": [dataclasses.asdict(point) for point in found.points],
        "stiffness": [entry(STIFFNESS, load_N=load, rotation=way) for load, way in directions],
        "pull": [entry(PULL, load_N=load) for load in found.loads_N],
        "at_angles": [
            entry(("FY", "MZ"), load_N=load, rotation=way, SA_rad=angle) for load, way, angle in angles
        ],
        "budgets": [
            {"load_N": r.load_N, "rotation": r.rotation, "name": r.name, "unit": r.estimate.unit,
             "sources": r.sources}
            for r in found.rows if r.estimate is not None and r.SA_rad is None
        ],
    }  # fmt: skip


def test_a_file_from_before_anything_was_stated_keeps_its_hash(made: Made) -> None:
    """Its hash was made of a reduced test that had no such field."""
    use = dataclasses.replace(made[0].reduced.calibration, draft_reasons=())
    bare = dataclasses.replace(
        made[0], reduced=dataclasses.replace(made[0].reduced, stated=(), calibration=use)
    )
    content = {
        "reduced": dataclasses.asdict(bare.reduced),
        "characteristics": first_form(bare.characteristics),
    }
    for name in ("stated", "definition"):
        del content["reduced"][name]
    for name in ("rows", "borrowed"):
        del content["reduced"]["tare"][name]
    for condition in content["reduced"]["conditions"]:
        del condition["hub"]
    for name in ("draft_reasons", "since", "signature"):
        del content["reduced"]["calibration"][name]
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    assert content_hash(bare) == hashlib.sha256(text.encode()).hexdigest()


def test_a_result_that_no_registry_was_asked_about_is_a_draft_and_stays_one(
    tmp_path: Path, made: Made
) -> None:
    use = made[0].reduced.calibration
    assert use.draft_reasons == ("no registry was asked whether it is in force",)
    two = dataclasses.replace(use, draft_reasons=("one; two", "=three"), since=("four",))
    result = dataclasses.replace(made[0], reduced=dataclasses.replace(made[0].reduced, calibration=two))
    write_test_file(tmp_path / "x.xlsx", result)
    assert read_test_file(tmp_path / "x.xlsx").reduced.calibration == two


def test_a_test_of_an_own_machine_holds_its_definition(tmp_path: Path, made: Made) -> None:
    text = machine_file("m15-virtual").read_text()
    # Blank lines, umlauts, a line that looks like a number or a formula: every one is a line of the text.
    text = text.replace('name = "m15-virtual"', '# Prüfstand\n\n# =1+1\nname = "rig 7"\n')
    own = dataclasses.replace(made[0], reduced=dataclasses.replace(made[0].reduced, definition=text))
    write_test_file(tmp_path / "x.xlsx", own)
    back = read_test_file(tmp_path / "x.xlsx")
    assert back == own
    assert back.reduced.machine().name == "rig 7"
    assert back.reduced.machine().protocol == load_machine("m15-virtual").protocol


def test_a_machine_that_is_not_where_the_test_was_reduced_is_an_error_that_says_so(made: Made) -> None:
    info = dataclasses.replace(made[0].reduced.info, machine="gone/rig.toml")
    reduced = dataclasses.replace(made[0].reduced, info=info, definition="")
    with pytest.raises(ConfigError, match="not where the test was reduced from") as caught:
        reduced.machine()
    assert caught.value.rule == "unknown-machine"
    assert "process the recordings again" in caught.value.next_step


def cells_of(path: Path) -> list[tuple[str, str, str]]:
    """Return cells of every sheet, as member, reference and text: the last head, number and text of each."""
    chosen: dict[tuple[str, bool, bool], tuple[str, str, str]] = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            if not member.startswith("xl/worksheets/sheet"):
                continue
            for place, kind, value in CELL.findall(archive.read(member).decode()):
                if any(letter.isalnum() for letter in value):
                    chosen[member, place[-2:] in HEADS, kind == "v"] = (member, place, value)
    return list(chosen.values())


HEADS = {f"{letter}1" for letter in string.ascii_uppercase}
CELL = re.compile(r'<c r="([A-Z]+[0-9]+)"[^>]*>(?:<is>)?<([vt])[^>]*>([^<]+)<')


def edited(source: Path, target: Path, member: str, place: str, new: str) -> None:
    """Write a copy of a workbook in which one cell has other digits or letters, and no other byte differs."""
    pattern = re.compile(rf'(<c r="{place}"[^>]*>(?:<v>|<is><t[^>]*>))[^<]+<')
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as copy:
        for name in old.namelist():
            text = old.read(name)
            if name == member:
                text = pattern.sub(rf"\g<1>{new}<", text.decode(), count=1).encode()
            copy.writestr(name, text)


def test_any_changed_cell_of_any_sheet_is_an_edit(tmp_path: Path, made: Made) -> None:
    one = next(iter(made[1]))
    recording = dataclasses.replace(
        made[1][one],
        series=tuple(dataclasses.replace(s, values=s.values[:5]) for s in made[1][one].series),
    )
    finding = Finding(rule="no-tare", where="here", message="a text")
    few = short(made[0])
    few = dataclasses.replace(
        few, characteristics=dataclasses.replace(few.characteristics, findings=(finding,))
    )
    source, path = tmp_path / "source.xlsx", tmp_path / "edited.xlsx"
    write_test_file(source, few, {one: recording})
    assert read_test_file(source) == few
    cells = cells_of(source)
    assert len({member for member, _, _ in cells}) == len(openpyxl.load_workbook(source).sheetnames)
    accepted = []
    for member, place, value in cells:
        at = next(i for i, letter in enumerate(value) if letter.isalnum())
        other = str((int(value[at]) + 3) % 10) if value[at].isdigit() else value[at].swapcase()
        edited(source, path, member, place, value[:at] + other + value[at + 1 :])
        with contextlib.suppress(RecordingError):
            read_test_file(path)
            accepted.append((member, place, value))
    assert not accepted


def test_a_formula_beside_its_value_is_an_edit(tmp_path: Path, light: Path) -> None:
    """The next program that opens the file computes it, and shows another value than what was read."""
    path = tmp_path / "x.xlsx"
    with zipfile.ZipFile(light) as old, zipfile.ZipFile(path, "w") as copy:
        for name in old.namelist():
            text = old.read(name)
            if name == "xl/worksheets/sheet3.xml":
                assert b"<v>" in text
                text = text.replace(b"<v>", b"<f>1+1</f><v>", 1)
            copy.writestr(name, text)
    with pytest.raises(RecordingError, match="formula") as caught:
        read_test_file(path)
    assert caught.value.rule == "test-file-changed"


def test_a_file_that_calls_itself_older_is_an_edit(tmp_path: Path, light: Path) -> None:
    member = f"xl/worksheets/sheet{len(openpyxl.load_workbook(light).sheetnames)}.xml"
    with zipfile.ZipFile(light) as archive:
        cells = CELL.findall(archive.read(member).decode())
    place = next(place for place, _, value in cells if value == "schema")
    edited(light, tmp_path / "x.xlsx", member, place.replace("A", "B"), "1")
    with pytest.raises(RecordingError) as caught:
        read_test_file(tmp_path / "x.xlsx")
    assert caught.value.rule == "test-file-changed"


def test_a_file_saved_again_without_an_edit_is_read(tmp_path: Path, light: Path) -> None:
    """A program may write numbers in its own form, texts elsewhere and sheets in another order."""
    path = tmp_path / "x.xlsx"
    with zipfile.ZipFile(light) as old, zipfile.ZipFile(path, "w") as copy:
        for name in old.namelist():
            text = old.read(name).decode()
            if name.startswith("xl/worksheets/sheet"):
                text = re.sub(
                    r'(t="n"[^>]*><v>)(-?[0-9.e+-]+)<', lambda m: f"{m[1]}{float(m[2]):.17E}<", text
                )
            if name == "xl/workbook.xml":
                sheets = re.findall(r"<sheet [^>]*/>", text)
                text = text.replace("".join(sheets), "".join(reversed(sheets)))
            copy.writestr(name, text)
    assert python_calamine.load_workbook(path).sheet_names[-1] == "test"
    assert read_test_file(path) == read_test_file(light)


def test_a_program_that_rounds_numbers_is_told_as_what_it_is(tmp_path: Path, light: Path) -> None:
    """LibreOffice Calc 7.4 writes 15 digits of a number, and TRUE as a formula, though nobody typed."""
    path = tmp_path / "x.xlsx"
    with zipfile.ZipFile(light) as old, zipfile.ZipFile(path, "w") as copy:
        for name in old.namelist():
            text = old.read(name).decode()
            if name.startswith("xl/worksheets/sheet"):
                text = re.sub(
                    r'(t="n"[^>]*><v>)(-?[0-9.e+-]+)<', lambda m: f"{m[1]}{float(m[2]):.15g}<", text
                )
                text = re.sub(
                    r't="b"([^>]*)><v>([01])<',
                    lambda m: f't="b"{m[1]}><f aca="false">{("FALSE", "TRUE")[int(m[2])]}()</f><v>{m[2]}<',
                    text,
                )
            copy.writestr(name, text)
    with pytest.raises(RecordingError, match="15 digits") as caught:
        read_test_file(path)
    assert caught.value.rule == "test-file-changed"
    assert "saved again" in caught.value.what
    book = openpyxl.load_workbook(light)
    book["reduced"]["F5"] = book["reduced"]["F5"].value * 1.001
    book.save(tmp_path / "edited.xlsx")
    with pytest.raises(RecordingError, match="changed after it was written"):
        read_test_file(tmp_path / "edited.xlsx")
