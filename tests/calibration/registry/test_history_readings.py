"""A recalibration that never was: the readings of an earlier record, entered again under another date."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.calibration.virtual_factory import Change, failed, judged, rules, write_virtual
from toolkit.calibration.registry.registry import Registry

AGAIN = "readings-again"


@pytest.fixture
def before(tmp_path: Path) -> Registry:
    """A registry whose record in force has the packaged readings."""
    (tmp_path / "cal").mkdir()
    registry = Registry(tmp_path / "cal")
    _, decision = judged(registry, write_virtual(tmp_path / "first", session=dated("2025-11-03")))
    assert decision.done
    return registry


def dated(day: str) -> Change:
    return lambda text: text.replace("2026-11-01", day)


def shuffled(text: str) -> str:
    """Return the rows in another order, each number written with another number of digits."""
    header, *rows = text.strip().split("\n")
    random.Random(1).shuffle(rows)
    return "\n".join([header, *rows]) + "\n"


def read_anew(text: str) -> str:
    """Return the same loads with the cells' noise drawn anew: 0.1 uV/V."""
    noise = random.Random(2)
    header, *rows = text.strip().split("\n")
    cells = [name.split()[0] in ("D51", "D52", "E5") for name in header.split(",")]
    lines = [header]
    for row in rows:
        values = row.split(",")
        lines.append(
            ",".join(
                f"{float(value) + noise.gauss(0, 1e-4):.6f}" if is_cell else value
                for value, is_cell in zip(values, cells, strict=True)
            )
        )
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("change", [str, shuffled], ids=["the same file", "rows in another order"])
def test_readings_of_another_day_are_told_and_written_down(
    before: Registry, tmp_path: Path, change: Change
) -> None:
    made, decision = judged(before, write_virtual(tmp_path / "again", change))
    assert AGAIN in rules(made)
    assert decision.done, "an honest reason is possible, as a wrong date that is corrected"
    (line,) = [text for text in decision.evidence if text.startswith(AGAIN)]
    assert "m15-virtual-r1" in line
    assert "2025-11-03" in line


def test_an_evaluation_of_the_same_day_is_no_second_reading(before: Registry, tmp_path: Path) -> None:
    that_day = dated("2025-11-03")
    path = write_virtual(tmp_path / "other", session=lambda text: that_day(text).replace("0.2213", "0.25"))
    made, _ = judged(before, path)
    assert AGAIN not in rules(made)


def test_loads_that_were_applied_anew_are_not_taken_for_copies(before: Registry, tmp_path: Path) -> None:
    made, decision = judged(before, write_virtual(tmp_path / "anew", read_anew))
    assert AGAIN not in rules(made)
    assert not failed(decision)


def test_what_a_withdrawn_record_was_made_of_may_come_again(before: Registry, tmp_path: Path) -> None:
    from toolkit.calibration.registry.approval import withdraw

    withdraw(before, "m15-virtual-r1", on=before.today(), reason="the date was wrong", by="Z")
    made, _ = judged(before, write_virtual(tmp_path / "again"))
    assert AGAIN not in rules(made)
