"""`toolkit fit` where a table varies more than its model reads: the true stiffness, and what was left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.test_fit import run
from tests.tires.tire_factory import CAR, Columns, cornering_stiffness, crossed, measured, write_table
from toolkit.errors import ToolkitError

ANGLES = np.radians(np.arange(-12.0, 12.5, 1.0))
LOADS = [2000.0, 4000.0, 6000.0]
VARIED: dict[str, dict[str, Any]] = {
    "slip": {"KAPPA": [-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15]},
    "camber": {"IA": np.radians([-4.0, -2.0, 0.0, 2.0, 4.0])},
    "pressure": {"P": [180e3, 220e3, 260e3]},
    "all": {"KAPPA": [-0.1, 0.0, 0.1], "IA": np.radians([0.0, 3.0]), "P": [180e3, 220e3, 260e3]},
}


def answer(path: Path, *arguments: str) -> tuple[int, dict[str, Any]]:
    code, out = run(path, "--axes", "ISO-W", "--json", *arguments)
    return code, json.loads(out)


def stiffnesses(fits: dict[str, Any]) -> dict[float, float]:
    return {
        round(fit["load_N"]): fit["cornering_stiffness_N_per_rad"]["value"]
        for fit in fits["fits"]
        if fit["channel"] == "FY"
    }


def rules(fits: dict[str, Any]) -> dict[str, str]:
    return {finding["rule"]: finding["message"] for finding in fits["findings"] if finding["level"] != "note"}


@pytest.mark.parametrize("kind", VARIED)
def test_the_stiffness_of_each_load_is_the_pure_one(tmp_path: Path, kind: str) -> None:
    columns = measured(CAR, crossed(FZ=LOADS, **VARIED[kind], SA=ANGLES), noise=1e-3)
    code, fits = answer(write_table(tmp_path / "tire.csv", columns))
    assert code == 1
    found = rules(fits)
    assert set(found) == {"other-conditions"}
    assert all(symbol in found["other-conditions"] for symbol in VARIED[kind])
    assert f"{len(LOADS) * len(ANGLES)} of {len(columns['SA'])} rows" in found["other-conditions"]
    for load, stiffness in stiffnesses(fits).items():
        assert stiffness == pytest.approx(cornering_stiffness(CAR, load), rel=0.02)
    # Errors are those of the rows that were fitted.
    for row in fits["comparison"]["rows"]:
        assert row["n"] == len(LOADS) * len(ANGLES)
        assert row["error_percent"] < 1.0


def test_speeds_are_told_apart(tmp_path: Path) -> None:
    columns = crossed(FZ=LOADS, V=[10.0, 20.0], SA=ANGLES)
    made = measured(CAR, columns, noise=1e-3)
    slow = columns["V"] < 15.0
    for channel in ("FY", "MZ"):
        made[channel] = np.where(slow, 1.3, 1.0) * made[channel]
    extra = {name: np.concatenate([column, column[~slow][:6]]) for name, column in made.items()}
    code, fits = answer(write_table(tmp_path / "tire.csv", extra))
    assert code == 1
    assert "V 36 km/h, kept 72 km/h" in rules(fits)["other-conditions"]
    assert stiffnesses(fits)[4000.0] == pytest.approx(cornering_stiffness(CAR, 4000.0), rel=0.02)


def test_models_side_by_side_are_each_fitted_to_what_they_read(tmp_path: Path) -> None:
    columns = measured(
        CAR, crossed(FZ=LOADS, P=[180e3, 220e3, 260e3], SA=ANGLES[::2]), noise=1e-3, channels=("FY",)
    )
    models = ("magic_formula", "mf52", "mf61")
    code, fits = answer(
        write_table(tmp_path / "tire.csv", columns), *(word for name in models for word in ("--model", name))
    )
    assert code == 1
    rows = {row["model"]: row for row in fits["comparison"]["rows"]}
    assert {name: rows[name]["n"] for name in models} == {"magic_formula": 39, "mf52": 39, "mf61": 117}
    assert all(row["error_percent"] < 1.0 for row in rows.values())
    told = [finding["message"] for finding in fits["findings"] if finding["rule"] == "other-conditions"]
    assert [text.partition(":")[0] for text in told] == ["magic_formula", "mf52"]


def test_figures_and_a_tire_file_are_of_the_rows_that_were_fitted(tmp_path: Path) -> None:
    columns = measured(CAR, crossed(FZ=LOADS, P=[180e3, 220e3, 260e3], SA=ANGLES[::3]), channels=("FY",))
    tir = tmp_path / "tire.tir"
    run(
        write_table(tmp_path / "tire.csv", columns), "--axes", "ISO-W", "--model", "mf52", "--tir", tir,
        "--figures", tmp_path / "figures",
    )  # fmt: skip
    assert "27 rows, 3 loads" in tir.read_text()
    assert (tmp_path / "figures" / "mf52_FY_curves.png").exists()


@pytest.mark.parametrize("model", ["magic_formula", "pacejka94", "mf61"])
def test_a_table_without_pure_slip_is_refused(tmp_path: Path, model: str) -> None:
    columns: Columns = measured(CAR, crossed(FZ=LOADS, KAPPA=[0.1], SA=ANGLES))
    with pytest.raises(ToolkitError) as caught:
        run(write_table(tmp_path / "tire.csv", columns), "--axes", "ISO-W", "--model", model)
    assert (caught.value.exit_code, caught.value.rule) == (2, "no-pure-slip")


def test_a_condition_that_leaves_too_few_angles_is_refused_with_what_was_left_out(tmp_path: Path) -> None:
    columns = measured(
        CAR, crossed(FZ=LOADS, SA=np.radians([-4.0, 0.0, 4.0]), KAPPA=np.linspace(-0.2, 0.2, 9))
    )
    with pytest.raises(ToolkitError) as caught:
        run(write_table(tmp_path / "tire.csv", columns), "--axes", "ISO-W")
    assert caught.value.exit_code == 2
    assert "KAPPA" in str(caught.value)


def test_a_load_that_scatters_is_one_load_and_loads_that_were_set_are_two(tmp_path: Path) -> None:
    load = 700.0 * 4.4482216152605
    scattered = load * np.where(np.arange(len(ANGLES)) % 2, 1.03, 0.97)
    for shares in (scattered, load * (1 + np.random.default_rng(2).choice([-0.04, 0.04], len(ANGLES)))):
        columns = measured(CAR, {"SA": ANGLES, "FZ": shares}, noise=1e-3, channels=("FY",))
        _, fits = answer(write_table(tmp_path / "one.csv", columns))
        assert [round(fit["load_N"] / load, 2) for fit in fits["fits"]] == [pytest.approx(1.0, abs=0.02)]
    columns = measured(CAR, crossed(FZ=[0.96 * load, 1.04 * load], SA=ANGLES), noise=1e-3, channels=("FY",))
    _, fits = answer(write_table(tmp_path / "two.csv", columns))
    assert len(fits["fits"]) == 2


def test_a_load_that_is_swept_is_no_load_of_a_curve(tmp_path: Path) -> None:
    columns = measured(
        CAR, {"SA": np.tile(ANGLES, 8), "FZ": np.linspace(1000.0, 7000.0, 8 * len(ANGLES))}, channels=("FY",)
    )
    path = write_table(tmp_path / "swept.csv", columns)
    with pytest.raises(ToolkitError) as caught:
        run(path, "--axes", "ISO-W")
    assert (caught.value.exit_code, caught.value.rule) == (2, "load-varies")
    _, fits = answer(path, "--model", "mf61")
    stiffness = fits["fits"][0]["cornering_stiffness_N_per_rad"]["value"]
    assert stiffness == pytest.approx(cornering_stiffness(CAR, fits["fits"][0]["nominal_load_N"]), rel=0.02)
