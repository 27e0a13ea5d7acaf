"""Tire models: fits of one table by every model, tire files, and forces on a grid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.entries import golden
from tests.golden.simulation import packaged_test
from tests.golden.surface import PLANS
from tests.golden.workplace import Workplace, csv_columns

GLOBAL = ("pacejka94", "mf52", "mf61", "mf62", "tmeasy", "treadsim", "lugre", "brush")
QUICK = ("mf52", "brush")
TIRE_FILES = ("mf52", "mf61", "mf62")
FITTED_AS = ("--rated-load", 3700, "--radius", 0.316, "--side", "LEFT")
AXES = ("ISO-W", "SAE", "adapted-SAE", "machine")


def table_text() -> str:
    """Return a table in SAE axes: four loads, 21 slip angles, noise of a seeded generator.

    The curves are a Magic Formula with numbers of this file, so that no other code makes the table.
    """
    rng = np.random.default_rng(870421)
    lines = ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for load in (1100.0, 2500.0, 3700.0, 4900.0):
        peak, bend = load * (1.05 - 4e-5 * load), 0.19 * np.exp(-load / 9000)
        for degrees in np.arange(-10.0, 10.5, 1.0).tolist():
            x = bend * (degrees + 0.1)
            FY = (
                -peak * np.sin(1.35 * np.arctan(x + 0.4 * (x - np.arctan(x))))
                - 30
                + rng.normal(0, 0.002 * load)
            )
            trail = 0.035 * (load / 4000) ** 0.5 * np.cos(1.1 * np.arctan(1.8 * x)) - 0.004
            MZ = -trail * (FY + 30) + 0.3 + rng.normal(0, 1e-4 * load)
            lines.append(f"{degrees},{load},{FY:.4f},{MZ:.5f}")
    return "\n".join(lines) + "\n"


def grid_text(columns: tuple[str, ...]) -> str:
    """Return a grid with the columns named, besides SA and FZ."""
    values = {
        "IA [deg]": (-3.0, 2.0),
        "KAPPA [1]": (-0.1, 0.0),
        "P [kPa]": (200.0, 240.0),
        "V [km/h]": (50.0, 80.0),
    }
    lines = [",".join(("SA [deg]", "FZ [N]", *columns))]
    for number, degrees in enumerate(np.linspace(-12, 12, 13).tolist()):
        for load in (900.0, 3000.0, 5200.0):
            more = [values[column][number % 2] for column in columns]
            lines.append(",".join(map(repr, (degrees, load, *more))))
    return "\n".join(lines) + "\n"


def _table(place: Workplace) -> Path:
    return place.write({"tire.csv": table_text()}) / "tire.csv"


@golden("tires/per-load", quick=True)
def per_load(place: Workplace) -> Any:
    """Magic Formula of every load, by least squares and by the robust loss."""
    table = _table(place)
    return {
        loss: place.packaged("fit", table, "--model", "magic_formula", "--loss", loss)
        for loss in ("linear", "robust")
    }


def _register_global() -> None:
    for model in GLOBAL:

        def question(place: Workplace, model: str = model) -> Any:
            words = ["--tir", "tire.tir"] if model in TIRE_FILES else []
            answer = place.packaged("fit", _table(place), "--model", model, *FITTED_AS, *words)
            if words:
                tire = place.folder / "tire.tir"
                answer["tire_file"] = _tire_lines(tire)
                answer["evaluated"] = {axes: _evaluated(place, tire, (), "--axes", axes) for axes in AXES}
            return answer

        golden(f"tires/global/{model}", quick=model in QUICK)(question)


def _tire_lines(path: Path) -> list[str]:
    """Return a tire file without the lines that name the software and the day."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        line for line in lines if not any(word in line.lower() for word in ("toolkit", "created", "date"))
    ]


def _evaluated(place: Workplace, tire: Path, columns: tuple[str, ...], *words: object) -> dict[str, Any]:
    grid = place.write({"grid.csv": grid_text(columns)}) / "grid.csv"
    return place.answer(
        "evaluate", tire, grid, "--out", f"forces-{len(list(place.folder.iterdir()))}.csv", *words
    )


_register_global()


@golden("tires/noise-weights")
def noise_weights(place: Workplace) -> Any:
    """A global model weighted by the noise of each load, and the robust loss of it."""
    table = _table(place)
    return {
        "noise": place.packaged("fit", table, "--model", "mf61", "--weights", "noise", *FITTED_AS),
        "robust": place.packaged("fit", table, "--model", "mf52", "--loss", "robust", *FITTED_AS),
    }


@golden("tires/evaluate", quick=True)
def evaluate(place: Workplace) -> Any:
    """The packaged tire file on grids with and without camber, slip ratio, pressure and speed."""
    tire = PLANS / "tire.tir"
    every = ("IA [deg]", "KAPPA [1]", "P [kPa]", "V [km/h]")
    return {
        "plain": {axes: _evaluated(place, tire, (), "--axes", axes) for axes in AXES},
        "every column": {axes: _evaluated(place, tire, every, "--axes", axes) for axes in AXES},
        "raw angles": _evaluated(place, tire, every, "--angles", "raw"),
    }


@golden("tires/convert", quick=True)
def convert(place: Workplace) -> Any:
    """Tire file, TYDEX and table, one into the other."""
    table = _table(place)
    answers = {
        "csv to tdx": place.packaged("convert", table, "table.tdx"),
        "tdx to csv": place.packaged("convert", place.folder / "table.tdx", "back.csv", "--axes", "ISO-W"),
        "tir to tir": place.packaged("convert", PLANS / "tire.tir", "copy.tir"),
    }
    return answers | {
        "table": csv_columns(place.folder / "back.csv"),
        "tydex": [
            line for line in (place.folder / "table.tdx").read_text().splitlines()
            if not line.startswith(("RELEASE", "MEASID", "SUPPLIER", "DATE", "CLCKTIME"))
        ],
        "tire_file": _tire_lines(place.folder / "copy.tir"),
    }  # fmt: skip


@golden("tires/fit-of-a-test")
def fit_of_a_test(place: Workplace) -> Any:
    """Models of the packaged virtual test, forward and reversed, and its tire file."""
    test, _ = packaged_test(place)
    answer = place.packaged("fit", test, "--model", "magic_formula", "--model", "mf61", "--tir", "tire.tir")
    return answer | {"tire_file": _tire_lines(place.folder / "tire.tir")}
