"""Which name was meant: alike is suggested, another number or another word never."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import toolkit
from toolkit.spelling import nearest


@pytest.mark.parametrize(
    ("name", "candidates", "meant"),
    [
        ("operatr", ["operator", "date"], "operator"),
        ("dot", ["DOT"], "DOT"),
        ("FM_run_6.xlsx", ["FM_run_3.xlsx", "FM_run_5.xlsx"], None),
        ("FM_rnu_3.xlsx", ["FM_run_3.xlsx", "FM_run_5.xlsx"], "FM_run_3.xlsx"),
        ("v", ["v1"], "v1"),
        ("speed", ["load", "title"], None),
        ("x", [], None),
    ],
)
def test_only_a_misspelt_name_is_suggested(name: str, candidates: list[str], meant: str | None) -> None:
    assert nearest(name, candidates) == meant


def test_every_suggestion_comes_from_one_threshold() -> None:
    root = Path(toolkit.__file__).parent
    own = [
        f"{path.relative_to(root)}: {match}"
        for path in root.rglob("*.py")
        for match in re.findall(r"get_close_matches\([^)]*cutoff=(?!LIKE)[^)]*\)", path.read_text())
    ]
    # Which kind of table was meant is asked of a misspelt header: nothing is suggested by it.
    assert [line for line in own if not line.startswith("comparison/maker_table.py")] == []
