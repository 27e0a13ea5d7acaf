"""`toolkit compare --laboratories`: answer, figures, and every refusal with exit code 2."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.cli.test_calibrate import run as run_command
from toolkit.cli import compare
from toolkit.errors import ToolkitError
from toolkit.report.word.toc_pages import pdf_text

TEXT = """measurand,laboratory,value [N],U [N]
conicity,A,10.1,0.4
conicity,A,9.9,0.4
conicity,B,10.4,0.5
conicity,B,10.2,0.5
conicity,C,9.7,0.3
conicity,C,9.9,0.3
conicity,D,10.0,
plysteer,A,101,4
plysteer,B,99,4
plysteer,C,104,4
"""


def run(*arguments: object) -> tuple[int, str]:
    return run_command(*arguments, of=compare.command)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "laboratories.csv"
    path.write_text(TEXT)
    return path


def test_every_measurand_is_answered_and_drawn(path: Path, tmp_path: Path) -> None:
    code, said = run("--laboratories", path, "--figures", tmp_path / "figures", "--json")
    answer = json.loads(said)
    assert code == 0
    assert answer["schema"] == 1
    assert [measurand["name"] for measurand in answer["measurands"]] == ["conicity", "plysteer"]
    conicity = answer["measurands"][0]
    assert conicity["precision"]["n"] == 7
    assert [score["laboratory"] for score in conicity["scores"]] == ["A", "B", "C", "D"]
    assert conicity["scores"][3]["En"] is None
    assert answer["measurands"][1]["precision"]["s_r"] is None
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {
        "laboratories_1.png", "laboratories_2.png", "laboratories_h.png", "laboratories_k.png"
    }  # fmt: skip


def test_people_get_scores_and_precision(path: Path) -> None:
    code, said = run("--laboratories", path, "--reference", "A", "--sigma", "0.2")
    assert code == 0
    assert "s_R" in said
    rows = [line.split() for line in said.splitlines()]
    assert ["measurand", "laboratory", "n", "mean", "U", "z", "zeta", "En", "signal"] in rows
    # B read 10.4 N and 10.2 N, and states U = 0.5 N: the document prints them to its last place.
    assert ["conicity", "B", "2", "10.30", "0.50"] in [row[:5] for row in rows]
    assert "few-laboratories" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ("--sigma", "0"),
        ("--sigma", "nan"),
        ("--reference", "D"),
        ("--reference", "nobody"),
        ("--template", "laboratories.docx"),
        ("other",),
    ],
)
def test_what_cannot_be_compared_is_an_error(path: Path, arguments: tuple[str, ...]) -> None:
    with pytest.raises(ToolkitError) as refused:
        run("--laboratories", path, *arguments)
    assert refused.value.exit_code == 2
    assert refused.value.next_step


@pytest.mark.skipif(not shutil.which("soffice"), reason="LibreOffice is not installed")
def test_its_report_is_a_word_file_and_a_verified_pdf(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    _, said = run("--laboratories", path, "--out", out, "--known-at", "2026-11-24", "--json")
    document = json.loads(said)["document"]
    assert {file.name for file in out.iterdir()} == {"laboratories.docx", "laboratories.pdf"}
    assert document["warnings"] == []
    text = pdf_text(out / "laboratories.pdf")
    assert "Interlaboratory comparison: conicity, plysteer" in " ".join(text.split())
    assert "2026-11-24" in text


def test_a_file_that_cannot_be_compared_leaves_no_document(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    path.write_text("laboratory,value [N]\nA,1\nB,2\n")
    with pytest.raises(ToolkitError):
        run("--laboratories", path, "--out", tmp_path / "out", "--figures", tmp_path / "figures")
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "figures").exists()


def test_nothing_to_compare_is_an_error() -> None:
    with pytest.raises(ToolkitError):
        run()
    with pytest.raises(ToolkitError):
        run("A", "B", "--sigma", "1")
