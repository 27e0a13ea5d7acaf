"""What somebody hands in through a page enters the home whole and readable, or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.workbench.conftest import ROOT
from tests.workbench.test_diagnosis_page import SIMULATOR, TOML
from toolkit.errors import ToolkitError
from toolkit.lab.desk.built_case import add_files
from toolkit.lab.desk.previews import template_findings
from toolkit.lab.desk.uploads import claimed_folder, hand_in_case, hand_in_template

ORG = (ROOT / "report_templates" / "org.docx").read_bytes()
STYLE = (ROOT / "report_templates" / "org.toml").read_bytes()
ROWS = "".join(f"{load},{load * 1.001:.6f}\n" for load in range(1, 40))
CASE = [
    ("case.toml", TOML.encode()), ("sim.py", SIMULATOR.encode()), ("r0.csv", f"L,F\n{ROWS}".encode()),
    ("r1.csv", f"L,F\n50,50.2\n{ROWS}".encode()), ("more.csv", b"L\n100\n200\n"),
]  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def changed(name: str, data: bytes | None, renamed: str = "") -> list[tuple[str, bytes]]:
    """Return the case with another file in the place of one; without it where there is none."""
    return [
        (renamed or each if each == name else each, content if each != name else data or b"")
        for each, content in CASE
        if each != name or data is not None
    ]


def test_a_template_enters_with_its_style_byte_for_byte(tmp_path: Path) -> None:
    name = hand_in_template(tmp_path, [("own.docx", ORG), ("own.toml", STYLE)], replace=False)
    assert contents(tmp_path) == {"report_templates/own.docx": ORG, "report_templates/own.toml": STYLE}
    assert template_findings(tmp_path / "report_templates" / name) == template_findings(
        ROOT / "report_templates" / "org.docx"
    )


@pytest.mark.parametrize(("files", "got"), [
    ([], "no file"), ([("own.toml", STYLE)], "own.toml"), ([("a.docx", ORG), ("b.toml", STYLE)], "b.toml"),
    ([("a.docx", ORG), ("a.dotx", ORG)], "a.dotx"), ([("../a.docx", ORG)], "../a.docx"),
    ([("a.docx", ORG), ("a.docx", ORG)], "a.docx"), ([(".a.docx", ORG)], ".a.docx"),
    ([("a.docx", b"no zip")], "a.docx"), ([("a.docx", ORG[:-400])], "a.docx"),
    ([("a.docx", ORG), ("a.toml", b"nothing = [")], "a.toml"),
    ([("a.docx", ORG), ("a.toml", b"unheard_of = 1")], "a.toml"),
])  # fmt: skip
def test_what_is_no_template_leaves_nothing(tmp_path: Path, files: list[tuple[str, bytes]], got: str) -> None:
    with pytest.raises(ToolkitError) as caught:
        hand_in_template(tmp_path, files, replace=True)
    assert got in str(caught.value)
    assert ".toolkit" not in str(caught.value)
    assert contents(tmp_path) == {}


def test_a_template_takes_the_place_of_another_with_consent_alone(tmp_path: Path) -> None:
    (tmp_path / "report_templates").mkdir()
    (tmp_path / "report_templates" / "own.docx").write_bytes(b"before")
    (tmp_path / "report_templates" / "other.docx").write_bytes(b"other")
    with pytest.raises(ToolkitError, match="a file of this name"):
        hand_in_template(tmp_path, [("own.docx", ORG)], replace=False)
    assert contents(tmp_path)["report_templates/own.docx"] == b"before"
    hand_in_template(tmp_path, [("own.docx", ORG)], replace=True)
    assert contents(tmp_path) == {"report_templates/own.docx": ORG, "report_templates/other.docx": b"other"}


@pytest.mark.parametrize("replace", [False, True])
@pytest.mark.parametrize("name", ["Own.docx", "OWN.DOCX"])
def test_a_template_that_differs_by_case_alone_is_refused(tmp_path: Path, name: str, replace: bool) -> None:
    """A disk that tells no case, where a copy of the home may lie, would hold one of the two."""
    (tmp_path / "report_templates").mkdir()
    (tmp_path / "report_templates" / "own.docx").write_bytes(b"before")
    with pytest.raises(ToolkitError) as caught:
        hand_in_template(tmp_path, [(name, ORG)], replace=replace)
    assert "own.docx, which differs by case alone" in str(caught.value)
    assert contents(tmp_path) == {"report_templates/own.docx": b"before"}


def test_files_of_a_case_that_differ_by_case_alone_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ToolkitError, match="names of their own"):
        hand_in_case(tmp_path, [*CASE, ("R0.csv", b"L,F\n1,2\n")])
    place = tmp_path / hand_in_case(tmp_path, CASE)
    with pytest.raises(ToolkitError, match="new files"):
        add_files(place, [("R0.csv", b"L,F\n1,2\n")])


def test_a_case_enters_as_it_was_handed_in(tmp_path: Path) -> None:
    assert hand_in_case(tmp_path, CASE) == "cases/case-1"
    assert contents(tmp_path / "cases" / "case-1") == dict(CASE)
    other = [("bench.toml" if name == "case.toml" else name, data) for name, data in CASE]
    assert hand_in_case(tmp_path, other) == "cases/case-2"
    assert contents(tmp_path / "cases" / "case-2") == dict(CASE)


def outside(tmp_path: Path) -> bytes:
    """Return a case whose recording lies outside of what is handed in."""
    (tmp_path / "secret.csv").write_text(f"L,F\n60,60.2\n{ROWS}")
    return TOML.replace('"r1.csv"', f'"{tmp_path}/secret.csv"').encode()


@pytest.mark.parametrize(("name", "data", "got"), [
    ("case.toml", None, "files"), ("case.toml", b"schema = 1\n", "case.toml"), ("r1.csv", None, "r1.csv"),
    ("sim.py", None, "sim.py"), ("r0.csv", b"L,F\n1,x\n", "r0.csv"), ("case.toml", b"\xff\x00", "case.toml"),
])  # fmt: skip
def test_a_case_that_cannot_be_read_leaves_nothing(
    tmp_path: Path, name: str, data: bytes | None, got: str
) -> None:
    with pytest.raises(ToolkitError) as caught:
        hand_in_case(tmp_path, changed(name, data))
    assert got in str(caught.value)
    assert ".toolkit" not in str(caught.value)
    assert contents(tmp_path) == {}
    assert [*(tmp_path / "cases").glob("*")] == []


def test_a_case_reads_no_file_that_was_not_handed_in(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    with pytest.raises(ToolkitError, match="not a whole case") as caught:
        hand_in_case(home, changed("case.toml", outside(tmp_path)))
    assert "secret.csv" in str(caught.value.got)
    # It is refused before it is opened: not a cell of it is told.
    (tmp_path / "secret.csv").write_text("L,F\n1,hunter2\n")
    secret = TOML.replace('"r1.csv"', f'"{tmp_path}/secret.csv"').encode()
    with pytest.raises(ToolkitError, match="not a whole case"):
        hand_in_case(home, changed("case.toml", secret))
    sim = TOML.replace('"sim.py"', '"../../../sim.py"').encode()
    (tmp_path / "sim.py").write_text(SIMULATOR)
    with pytest.raises(ToolkitError):
        hand_in_case(home, changed("case.toml", sim))
    assert contents(home) == {}


def test_folders_are_numbered_after_the_last(tmp_path: Path) -> None:
    for name in ("case-2", "case-10", "case-x", "cases-99"):
        (tmp_path / name).mkdir()
    assert claimed_folder(tmp_path, "case") == "case-11"
    assert claimed_folder(tmp_path / "new", "case") == "case-1"
    with pytest.raises(ToolkitError, match="cannot be made"):
        claimed_folder(tmp_path / "absent" / "below", "case")
