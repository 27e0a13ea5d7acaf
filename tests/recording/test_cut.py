"""A text file that ends within a number is told, and one that is whole is not."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from toolkit.machine import load_machine
from toolkit.recording.cut import cut_findings, cut_number
from toolkit.recording.read import read_recording

HEADERS = ("FZ load", "D51 (Filtered)", "D52 (Filtered)", "E5 (Filtered)", "SA (Filtered)", "Fy", "Mz")
ROWS = [[245.25 + row, 0.125, -0.375, 0.0625, -0.3125, 11.125 + row, -24.0625 - row] for row in range(40)]


def table(separator: str = ",", decimal: str = ".", end: str = "\n") -> str:
    lines = [separator.join(HEADERS)]
    lines += [separator.join(f"{value:.5f}".replace(".", decimal) for value in row) for row in ROWS]
    return end.join(lines) + end


def read(path: Path, data: bytes) -> str | None:
    path.write_bytes(data)
    return read_recording(path, load_machine("m15-virtual")).cut


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_file_that_ends_within_a_number_is_told(
    tmp_path: Path, separator: str, decimal: str, end: str, encoding: str
) -> None:
    text = table(separator, decimal, end)
    assert read(tmp_path / "whole.csv", text.encode(encoding)) is None
    without_end = text.removesuffix(end)
    assert read(tmp_path / "open.csv", without_end.encode(encoding)) is None
    cut = without_end[:-3]
    number = read(tmp_path / "cut.csv", cut.encode(encoding))
    assert number == cut.rpartition(separator)[2]
    (finding,) = cut_findings(number, "cut.csv")
    assert finding.rule == "cut-number"
    assert str(number) in finding.message


@pytest.mark.parametrize("last", ["1", "1.", "-0.1"])
def test_numbers_of_any_length_are_compared_by_their_places(last: str) -> None:
    rows = "".join(f"{row},{row / 7:.4f}\n" for row in range(20))
    assert cut_number(f"x,y\n{rows}20,{last}", ",") == last


def test_last_zeros_that_a_program_drops_are_no_cut() -> None:
    values = [f"{row / 8:.6g}" for row in range(400)]  # an eighth of them whole, as a last number may be
    assert cut_number("x\n" + "\n".join(values), "\t") is None
    exact = [f"{20 + math.sin(row):.6g}" for row in range(700)]
    assert min(len(text) for text in exact[1:]) < 6
    assert cut_number("x\n" + "\n".join([*exact, "20.9"]), "\t") == "20.9"


@pytest.mark.parametrize("last", ["3", "0.5", "", "x", "1e-5"])
def test_whole_numbers_short_tables_and_texts_tell_nothing(last: str) -> None:
    whole = "".join(f"{row},{row}\n" for row in range(20))
    assert cut_number(f"x,y\n{whole}20,{last}", ",") is None
    short = "".join(f"{row},{row / 7:.4f}\n" for row in range(5))
    assert cut_number(f"x,y\n{short}5,{last}", ",") is None
