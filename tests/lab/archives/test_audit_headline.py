"""An audit's first line: how many files are wrong, by how much, why, since when."""

from __future__ import annotations

from typing import Any

import pytest

from toolkit.declared import json_value
from toolkit.lab.archives.audit_headline import headline_of
from toolkit.listing import table


def file(grade: str, day: str | None = "2014-03-09", **changes: Any) -> dict[str, Any]:
    repair = None if grade in ("unreadable", "unknown") else {"FY_max_abs_N": 10.0, "MZ_max_abs_Nm": 0.0}
    line = {"grade": grade, "variant": None, "record": "m15-r1", "date": day, "repair": repair}
    return line | changes


def wrong(day: str, FY: float, *, variant: str = "E5 negative") -> dict[str, Any]:
    repair = {"FY_max_abs_N": FY, "MZ_max_abs_Nm": 0.0}
    return file("sign_variant", day, variant=variant, repair=repair)


IMPOSSIBLE = [{"rule": "impossible-force", "message": "no tire has it"}]


def test_it_answers_how_many_how_wrong_why_and_since_when() -> None:
    files = [wrong("2014-03-09", 18885.7), wrong("2019-06-04", 980.5), file("exact"), file("rounding")]
    found = headline_of(files)
    assert found.sentence.replace("\N{NARROW NO-BREAK SPACE}", " ") == (
        "2 files carry a wrong Fy, up to 18 886 N; cause: E5 negative; from 2014-03 to 2019-06"
    )
    assert json_value(found) == {
        "sentence": found.sentence, "files": 4, "wrong": 2, "FY_max_abs_N": 18885.7, "MZ_max_abs_Nm": 0.0,
        "causes": [{"cause": "E5 negative", "files": 2}], "from": "2014-03", "to": "2019-06", "unjudged": 0,
        "unreadable": 0, "impossible": 0, "altered_cells": 0, "undecided": 0, "small": 0, "stepping": 0,
        "corrected_copies": 0, "no_recording": 0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ([], "No file could be read as a recording"),
        ([file("unreadable")], "No file could be read as a recording"),
        ([file("exact")] * 3, "All 3 files carry the values of the record in force"),
        (
            [file("exact"), file("unreadable")],
            "The file carries the values of the record in force; 1 file cannot be read",
        ),
        (
            [file("unknown", notes=IMPOSSIBLE), file("exact", notes=IMPOSSIBLE), file("exact")],
            "2 files hold an Fy or Mz that no tire has; "
            "1 file cannot be judged: no record in force is known or fits",
        ),
        (
            [wrong("2014-03-01", 5.25) | {"notes": IMPOSSIBLE}],
            "1 file carries a wrong Fy, up to 5.2 N; cause: E5 negative; in 2014-03",
        ),
        (
            [file("unknown", repair={"FY_max_abs_N": None, "MZ_max_abs_Nm": None})] * 2,
            "2 files hold no Fy and no Mz of their own",
        ),
        (
            [file("exact"), file("unknown", repair={"FY_max_abs_N": None, "MZ_max_abs_Nm": None})],
            "The file carries the values of the record in force; "
            "1 more file holds no Fy and no Mz of its own",
        ),
        ([file("unknown")], "1 file cannot be judged: no record in force is known or fits"),
        (
            [file("stale", None), file("unknown")],
            "1 file carries a wrong Fy, up to 10.0 N; cause: computed by m15-r1, which was not in force; "
            "since when is unknown: no test date; 1 more file cannot be judged: "
            "no record in force is known or fits",
        ),
        (
            [wrong("2014-03-01", 5.25, variant="D51<->D52"), *[wrong("2014-03-02", 1.0)] * 2],
            "3 files carry a wrong Fy, up to 5.2 N; cause: E5 negative (2), D51<->D52 (1); in 2014-03",
        ),
        (
            # of more causes than the sentence has room for, those of the sizes that it states are named
            [
                *[file("stale", record=record) for record in ("m15-r1", "m15-r2", "m15-r3", "m15-r4")] * 2,
                wrong("2014-03-09", 2173.7),
            ],
            "9 files carry a wrong Fy, up to 2\N{NARROW NO-BREAK SPACE}174 N; "
            "cause: computed by m15-r1, which was not in force (2), "
            "computed by m15-r2, which was not in force (2), E5 negative (1), others (4); in 2014-03",
        ),
        (
            [file("stale", repair={"FY_max_abs_N": 0.0, "MZ_max_abs_Nm": 0.125})],
            "1 file carries a wrong Mz, up to 0.12 N·m; cause: computed by m15-r1, which was not in force; "
            "in 2014-03",
        ),
        (
            # which of its candidates computed it is open, and by none of them is a value wrong
            [
                file("ambiguous", candidates=["m15-r1"], repair={"FY_max_abs_N": 0.01, "MZ_max_abs_Nm": 0.0}),
                file("stale", repair={"FY_max_abs_N": 0.0, "MZ_max_abs_Nm": 0.002}),
            ],
            "2 files were computed otherwise than by the record in force, or may have been, which changes "
            "less than 0.1 N and 0.01 N·m",
        ),
    ],
)  # fmt: skip
def test_each_kind_of_archive_has_its_sentence(files: list[dict[str, Any]], sentence: str) -> None:
    assert headline_of(files).sentence == sentence


def test_a_table_fits_the_width_and_keeps_numbers_and_the_ends_of_names() -> None:
    rows = [
        [f"archive/of/many/years/2014-03-09/FM_run_{n}.xlsx", "why " * 20, f"{n * 1e6:.1f}"] for n in (1, 2)
    ]
    text = table(["file", "how", "dFY [N]"], rows, align="<<>", width=60)
    assert max(map(len, text.splitlines())) == 60
    assert "1000000.0" in text
    assert "2000000.0" in text
    assert "_1.xlsx" in text
    assert "_2.xlsx" in text


def test_files_stay_told_apart_where_a_line_is_short() -> None:
    names = [f"{test}/{name}.xlsx" for test in ("d2019", "d2022b") for name in ("r1", "r2", "swap")]
    rows = [[name, "column_swap", "m15-r5", "D51->D52->E5->D51", "m15-r5", "122.0"] for name in names]
    text = table(
        ["file", "grade", "computed by", "how", "in force", "dFY [N]"], rows, align="<<<<<>", width=60
    )
    assert len({line.split()[0] for line in text.splitlines()[2:]}) == len(names)
