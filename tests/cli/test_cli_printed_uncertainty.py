"""What people read: two digits of an uncertainty, and the value to its last place (GUM 7.2.6, ILAC-P14)."""

from __future__ import annotations

import json
import re
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from toolkit.cli.main import run
from toolkit.lab.home import packaged_home
from toolkit.tires.models.magic_formula import value

CALIBRATIONS = packaged_home() / "calibrations"
PAIR = re.compile(r"(-?\d[\d.]*(?:e-?\d+)?) ± (\d[\d.]*(?:e-?\d+)?)")


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    with pytest.raises(SystemExit) as caught:
        run([*map(str, words)])
    assert caught.value.code in (0, 1, None)
    return capsys.readouterr().out


def misprinted(text: str) -> list[str]:
    """Return the pairs of a text whose uncertainty has not two digits, or whose value ends elsewhere."""
    wrong = []
    for shown, U in PAIR.findall(text):
        exponent = Decimal(U).as_tuple().exponent
        assert isinstance(exponent, int)
        if exponent:
            digits = len(Decimal(U).as_tuple().digits)
            same = Decimal(shown).as_tuple().exponent == exponent or Decimal(shown) == 0
        else:  # a whole number: zeros at its end may stand for places
            digits = max(2, len(U.rstrip("0")))
            place = max(len(U) - 2, 0)
            same = "." not in shown and int(shown) % 10**place == 0
        if digits != 2 or not same:
            wrong.append(f"{shown} ± {U}")
    return wrong


def test_the_judge_knows_right_from_wrong() -> None:
    assert not misprinted(
        "-119 ± 97, 1300 ± 110, 0.00 ± 0.10, 45.0 ± 1.7, 8.98e-9 ± 8.7e-10, 0 ± 120, 3 ± 10"
    )
    wrong = "-118.7 ± 97.2 1301.2 ± 112.8 1301 ± 110 0.1 ± 0.10 5 ± 118 0.3 ± 0.01".replace(" ±", "_±")
    texts = wrong.replace("_±", " ±")
    assert len(misprinted(texts)) == 6


@pytest.mark.parametrize("units", ["SI", "lbf"])
def test_a_processed_test(units: str, virtual_test: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "process", virtual_test, "--units", units, "--calibrations", CALIBRATIONS)
    assert len(PAIR.findall(text)) >= 30
    assert misprinted(text) == []


def test_a_processed_test_keeps_its_digits_in_json(
    virtual_test: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer: dict[str, Any] = json.loads(
        printed(capsys, "process", virtual_test, "--calibrations", CALIBRATIONS, "--json")
    )
    for one in answer["characteristics"]["pull"]:
        assert len(repr(one["plysteer"]["value"]).replace("-", "").replace(".", "")) > 10


@pytest.fixture
def tire(tmp_path: Path) -> Path:
    rng, lines = np.random.default_rng(1), ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for FZ in (2000.0, 4000.0, 6000.0):
        SA = np.radians(np.arange(-12.0, 12.1, 0.5))
        FY = value(np.array([11.0, 1.3, -FZ, -0.5, 0.002, 10.0]), SA) + rng.normal(0, 4e-3 * FZ, len(SA))
        MZ = value(np.array([10.0, 2.3, 0.03 * FZ, -1.0, 0.002, 1.0]), SA) + rng.normal(0, 2e-4 * FZ, len(SA))
        lines += [f"{np.degrees(a):.1f},{FZ},{y:.3f},{m:.4f}" for a, y, m in zip(SA, FY, MZ, strict=True)]
    path = tmp_path / "tire.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.campaign("models of a table: tests and comparisons are printed with their digits in every run")
def test_fitted_models(tire: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "fit", tire, "--model", "magic_formula", "--model", "mf52")
    assert len(PAIR.findall(text)) >= 10
    assert misprinted(text) == []
    # The parameters of a model over all loads stand in two columns of a table.
    rows = [line.split() for line in text.splitlines() if re.match(r"P[CDEKHV]Y\d +-?\d", line)]
    pairs = [f"{row[1]} ± {row[2]}" for row in rows if row[2] != "-"]
    assert len(pairs) >= 4
    assert misprinted("; ".join(pairs)) == []


def test_a_comparison_with_a_maker_s_table(
    tire: Path, virtual_test: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(capsys, "compare", virtual_test, tire, "--calibrations", CALIBRATIONS)
    assert len(PAIR.findall(text)) >= 10
    assert misprinted(text) == []


def test_a_budget(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(
        capsys, "calibration", "budget", "m15-virtual-r1", "--load", "FY", "--calibrations", CALIBRATIONS
    )
    found = re.search(r"expanded uncertainty +U = (\S+) (\S+),", text)
    u = re.search(r"combined standard uncertainty +u = (\S+) ", text)
    at = re.search(r"FY = (\S+) ", text)
    assert found is not None
    assert u is not None
    assert at is not None
    assert misprinted(f"{at[1]} ± {found[1]}; {u[1]} ± {u[1]}") == []
