"""Remarks on a test's files: a speed of the other sign, a slip angle that moves within a block."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reduction.belt_factory import processed, write_belt
from tests.reduction.hub_factory import record
from toolkit.findings import Finding


def findings(test: Path, rule: str) -> list[Finding]:
    return [one for one in processed(test, record()).reduced.findings if one.rule == rule]


def with_column(path: Path, header: str, cells: list[str]) -> None:
    head, *rows = path.read_text().splitlines()
    lines = [f"{head},{header}", *(f"{row},{cell}" for row, cell in zip(rows, cells, strict=True))]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("speed", "said"),
    [
        ("60", []),
        ("-60", ["the speed is -60.00 km/h in a run that is declared forward"]),
        ("-66", ["speed 66.00 km/h is outside", "the speed is -66.00 km/h in a run"]),
    ],
)
def test_a_speed_of_the_other_sign_contradicts_a_run_that_is_declared_forward(
    tmp_path: Path, speed: str, said: list[str]
) -> None:
    test = write_belt(tmp_path)
    for path in test.glob("*.csv"):
        with_column(path, "V [km/h]", [speed] * 80)
    told = findings(test, "speed")
    assert [one.message.startswith(begin) for one, begin in zip(told, said, strict=True)] == [True] * len(
        said
    )


def test_an_angle_that_moves_within_a_block_is_told(tmp_path: Path) -> None:
    test = write_belt(tmp_path)
    assert not findings(test, "swept-block")
    path = test / "run_3.csv"
    head, *rows = path.read_text().splitlines()
    swept = []
    for number, row in enumerate(rows):
        load, angle, rest = row.split(",", 2)
        moved = float(angle) + (0.05 * (number % 40) if number >= 40 else 0.0)
        swept.append(f"{load},{moved:.4f},{rest}")
    path.write_text("\n".join([head, *swept]) + "\n")
    (told,) = findings(test, "swept-block")
    assert told.where == "run_3.csv"
    # Means of fifths of 40 rows that rise by 0.05 deg: 32 rows apart.
    assert told.message.startswith("the slip angle moves by 1.60 deg within a load block: 40 of its 40 rows")
