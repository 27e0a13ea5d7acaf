"""`zero = "tared"` is a claim that zero rows and the intercept must bear out."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.virtual_factory import Change, columns, failed, judged, rules, shifted, write_virtual
from toolkit.calibration.apply import apply_record
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry


@pytest.fixture
def empty(tmp_path: Path) -> Registry:
    (tmp_path / "cal").mkdir()
    return Registry(tmp_path / "cal")


def without_zero_rows(text: str) -> str:
    header, *rows = text.strip().split("\n")
    loaded = [row for row in rows if any(float(cell) for cell in row.split(",")[3:6])]
    return "\n".join([header, *loaded]) + "\n"


def included(text: str) -> str:
    return text.replace('zero = "tared"', 'zero = "included"')


def test_a_bridge_that_was_not_tared_blocks(empty: Registry, tmp_path: Path) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s", shifted("D51", 0.7)))
    # What it would read of nothing is in U, too.
    assert rules(made) == {"tared", "coarse-uncertainty"}
    assert failed(decision) == {"tared", "coarse-uncertainty"}
    assert {one.where for one in decision.failed} >= {"FY, intercept", "D51"}
    # What it would have cost: a tared test of an unloaded machine reads the intercept.
    record = made.record
    units = dict.fromkeys(record.indications, "mV/V")
    unloaded = {name: np.zeros(1) for name in record.indications}
    zero = apply_record(record, unloaded, units=units, tare=dict.fromkeys(units, 0.0))
    assert abs(zero["FY"][0]) > 3000


def test_without_zero_rows_the_intercept_is_what_tells(empty: Registry, tmp_path: Path) -> None:
    _, decision = judged(empty, write_virtual(tmp_path / "s", without_zero_rows, shifted("E5", 0.05)))
    assert failed(decision) == {"tared"}
    assert {one.where for one in decision.failed} == {"FY, intercept", "MX, intercept", "MZ, intercept"}


@pytest.mark.parametrize("change", [str, without_zero_rows])
def test_a_session_that_was_tared_passes(empty: Registry, tmp_path: Path, change: Change) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s", change))
    assert "tared" not in rules(made)
    assert decision.done, decision.findings


def test_an_untared_session_that_says_so_passes(empty: Registry, tmp_path: Path) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s", shifted("D51", 0.7), session=included))
    assert "tared" not in rules(made)
    assert decision.done, decision.findings


def test_one_run_that_was_not_tared_is_found_by_its_zero_rows(empty: Registry, tmp_path: Path) -> None:
    def one_run(text: str) -> str:
        header, *rows = text.strip().split("\n")
        out = [header]
        for row in rows:
            cells = row.split(",")
            if len(cells) > 6 and cells[6] == "2":
                cells[2] = repr(float(cells[2]) + 0.05)
            out.append(",".join(cells))
        return "\n".join(out) + "\n"

    _, decision = judged(empty, write_virtual(tmp_path / "s", one_run))
    assert ("tared", "E5") in {(one.rule, one.where) for one in decision.failed}


def test_without_zero_rows_and_intercept_nothing_shows_the_tare(empty: Registry, tmp_path: Path) -> None:
    def dropped(text: str) -> str:
        return text.replace("schema = 1", 'schema = 1\ndrop = ["intercept"]')

    made, decision = judged(empty, write_virtual(tmp_path / "s", without_zero_rows, session=dropped))
    assert "tared" in rules(made)
    assert decision.done
    assert any("cannot be seen to hold" in text for text in decision.evidence)


def test_an_intercept_beyond_its_own_uncertainty_blocks(empty: Registry, tmp_path: Path) -> None:
    # 2e-4 mV/V of 1.6 is 0.012 % of full scale, inside the tolerance of 0.1 % and far outside the scatter.
    _, decision = judged(empty, write_virtual(tmp_path / "s", shifted("D51", 2e-4)))
    assert failed(decision) == {"tared"}


def test_what_a_standard_may_show_of_nothing_is_no_offset(empty: Registry, tmp_path: Path) -> None:
    # 5e-5 mV/V is 0.005 % of full scale, half of a tenth of the check loads' tolerance.
    path = write_virtual(tmp_path / "s", shifted("D51", 5e-5))
    made = calibrate(path, empty)
    day = dt.date(2026, 11, 1)
    assert approve(empty, made.record.id, in_force_from=day, checked_by="Z").done
    assert "tared" not in rules(made)


def test_the_claim_is_judged_in_any_unit(empty: Registry, tmp_path: Path) -> None:
    def volts(text: str) -> str:
        return columns(D51=1e-3, D52=1e-3, E5=1e-3)(shifted("D51", 0.7)(text)).replace("mV/V", "V/V")

    _, decision = judged(empty, write_virtual(tmp_path / "s", volts))
    assert failed(decision) == {"tared", "coarse-uncertainty"}
