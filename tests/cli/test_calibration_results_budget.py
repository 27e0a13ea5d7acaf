"""`toolkit calibration budget`: keys, exit codes, refusals and the picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests import commands
from toolkit.lab.home import packaged_home

RECORD = "m15-virtual-r1"


def run(*words: object, record: str = RECORD) -> tuple[int, dict[str, Any]]:
    folder = packaged_home() / "calibrations"
    return commands.answer("calibration", "budget", record, *words, "--calibrations", folder)


def test_every_load_by_default() -> None:
    code, found = run()
    assert code == 0
    assert list(found["loads"]) == ["FY", "MZ", "MX"]
    one = found["loads"]["FY"]
    assert one["U"] == pytest.approx(one["k"] * one["u"])
    assert sum(part["share"] for part in one["components"]) == pytest.approx(1.0)
    assert one["not_stated"] == [part["name"] for part in one["components"] if not part["stated"]]
    # The session's own statement: U = 0.1798 lbf with k = 2.
    assert next(p["u"] for p in one["components"] if p["name"] == "reference") == pytest.approx(0.0899)
    assert len(one["U_rounded"].replace(".", "").lstrip("0")) == 2


def test_a_load_value_in_another_unit() -> None:
    _, found = run("--load", "FY", "--at", "4448.2216152605 N")
    assert found["loads"]["FY"]["value"] == pytest.approx(1000.0)


def test_a_prediction_and_its_extrapolation() -> None:
    code, found = run("--load", "MZ", "--indications", "D51=-0.31,D52=0.3065,E5=0")
    assert code == 0
    # -233.784 * -0.31 + 244.488 * 0.3065, the record's own sensitivities
    assert found["loads"]["MZ"]["value"] == pytest.approx(147.409, abs=0.01)
    code, found = run("--load", "MZ", "--indications", "D51=-0.31,D52=0.3065,E5=9")
    assert code == 1
    assert [one["rule"] for one in found["findings"]] == ["beyond-range"]


def test_monte_carlo_says_whether_the_budget_holds() -> None:
    code, found = run("--load", "FY", "--monte-carlo", 50_000)
    result = found["loads"]["FY"]["monte_carlo"]
    assert result["trials"] == 50_000
    assert result["validated"] == (
        max(result["low_difference"], result["high_difference"]) <= result["delta"]
    )
    assert code == (0 if result["validated"] else 1)


def test_the_temperature_in_use() -> None:
    _, found = run("--load", "FY", "--temperature-range", 5, "--temperature-coefficient", 1e-4)
    part = next(p for p in found["loads"]["FY"]["components"] if p["name"] == "temperature")
    assert part["u"] == pytest.approx(1e-4 * 5 * 1393.8 / 3**0.5)


@pytest.mark.parametrize("name", ["b.png", "b.svg", "b.pdf"])
def test_the_picture(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    code, found = run("--load", "FY", "--figure", path)
    assert (code, found["figure"]) == (0, str(path))
    assert path.read_bytes()[:4] in (b"\x89PNG", b"<?xm", b"%PDF")


@pytest.mark.parametrize(
    "words",
    [
        ("--load", "FX"),
        ("--at", "5"),
        ("--load", "FY", "--at", "5 K"),
        ("--load", "FY", "--at", "five"),
        ("--load", "FY", "--at", "1e9"),
        ("--load", "FY", "--indications", "D51=1"),
        ("--load", "FY", "--indications", "D51=1,D51=1,D52=1,E5=1"),
        ("--load", "FY", "--indications", "D51=x"),
        ("--load", "FY", "--indications", "D51=nan,D52=1,E5=1"),
        ("--load", "FY", "--indications", "D51=1e300,D52=1,E5=1"),
        ("--load", "FY", "--at", "5", "--indications", "D51=1,D52=1,E5=1"),
        ("--load", "FY", "--monte-carlo", "5"),
        ("--load", "FY", "--temperature-coefficient", "1e-5"),
        ("--load", "FY", "--temperature-range", "nan"),
        ("--figure", "b.png"),
        ("--load", "FY", "--figure", "b.txt"),
    ],
)
def test_what_cannot_be_answered_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, found = run(*words)
    assert code == 2
    assert all(found["error"].values()), found
    assert not list(tmp_path.iterdir())


def test_a_legacy_record_has_no_budget() -> None:
    code, found = run(record="m15-r1")
    assert (code, found["error"]["rule"]) == (2, "budget")
    assert "calibrate" in found["error"]["next_step"]
