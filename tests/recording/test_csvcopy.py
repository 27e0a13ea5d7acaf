"""A copy of a CSV file differs from it in the numbers of two columns, and in no other byte."""

from __future__ import annotations

import codecs
import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from toolkit.machine import Machine, load_machine
from toolkit.recording.csvcopy import with_numbers
from toolkit.recording.csvfile import read_csv
from toolkit.recording.table import read_table

HERE = Path("d.csv")
HEADERS = ("FZ load", "D52 (Filtered)", "D51 (Filtered)", "E5 (Filtered)", "SA (Filtered)", "Fy", "Mz")
ROWS = (
    ("1250.50", "98.612", "-86.1", "-182.415", "-1.00030", "-3.50", "7.25"),
    ("1250.7", "98.6", "-86.15", "-182.4", "-1.0", "-3.512", "7.2500"),
)
NEW = {"FY": [-0.1, 1e-7], "MZ": [123456.78901234567, -2 / 3]}
DIALECTS = list(itertools.product(
    ((",", "."), (";", ","), (";", "."), ("\t", ",")), ("\n", "\r\n", "\r"),
    ("utf-8", "cp1252", "utf-8-sig", "utf-16-le", "utf-16-be"),
))  # fmt: skip


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("m15")


def table(separator: str, decimal: str, end: str, *, tail: str = "", more: str = "T [°C]") -> str:
    lines = [separator.join((*HEADERS, more)) + tail]
    lines += [separator.join((*row, "21.5")).replace(".", decimal) + tail for row in ROWS]
    return end.join(lines) + end


def encoded(text: str, encoding: str) -> bytes:
    marks = {"utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}
    return marks.get(encoding, b"") + text.encode(encoding)


def numbers(data: bytes, machine: Machine) -> dict[str, list[float]]:
    return {one.symbol: one.values.tolist() for one in read_table(read_csv(data, HERE, machine), machine)}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("empty", ["", "separators"])
def test_every_dialect_is_kept(
    dialect: tuple[tuple[str, str], str, str], empty: str, machine: Machine
) -> None:
    (separator, decimal), end, encoding = dialect
    tail = separator * 2 if empty else ""
    text = table(separator, decimal, end, tail=tail)
    copy = with_numbers(encoded(text, encoding), NEW, machine, where=HERE)
    # By hand: the sixth and seventh cell of each row, as the shortest decimals of the doubles.
    expected = text
    for old, new in (
        ("-3.50|7.25|", "-0.1|123456.78901234567|"),
        ("-3.512|7.2500|", "1e-07|-0.6666666666666666|"),
    ):
        old, new = (words.replace(".", decimal).replace("|", separator) for words in (old, new))
        assert expected.count(old) == 1
        expected = expected.replace(old, new)
    assert copy == encoded(expected, encoding)
    before, after = numbers(encoded(text, encoding), machine), numbers(copy, machine)
    assert after == before | NEW


def test_quotes_spaces_blank_lines_and_a_hint_stay(machine: Machine) -> None:
    head = "sep=;\r\n\r\n" + ";".join(f'"{cell}"' for cell in HEADERS)
    body = '\r\n1250,5;98,6;86,1;-182,4;-1,0;" -3,5 ";  7,25 \r\n;;;;;;\r\n\r\n'
    copy = with_numbers((head + body).encode(), {"FY": [2.5], "MZ": [-7.125]}, machine, where=HERE)
    assert copy.decode() == head + body.replace('" -3,5 "', '" 2,5 "').replace("  7,25 ", "  -7,125 ")


def test_a_header_that_looks_like_a_formula_is_made_a_text_and_no_other(machine: Machine) -> None:
    data = table(",", ".", "\n", more='"=cmd [1]"').encode()
    copy = with_numbers(data, NEW, machine, where=HERE).decode()
    assert copy.splitlines()[0] == table(",", ".", "\n", more='"\'=cmd [1]"').splitlines()[0]


@pytest.mark.parametrize("seed", range(20))
def test_every_number_is_read_as_it_was_given(seed: int, machine: Machine) -> None:
    rng = np.random.default_rng(seed)
    given = {name: (rng.normal(size=2) * 10.0 ** rng.integers(-12, 12, 2)).tolist() for name in ("FY", "MZ")}
    copy = with_numbers(table(";", ",", "\r\n").encode("cp1252"), given, machine, where=HERE)
    read = numbers(copy, machine)
    assert {name: read[name] for name in given} == given
    assert not re.search(rb"[0-9]\.[0-9]", copy)
