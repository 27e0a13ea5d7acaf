"""Answers of a diagnosis: cases of every kind of simulation, their predictions, and model files in use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.golden.cases import CASES, QUICK
from tests.golden.entries import golden
from tests.golden.surface import CALIBRATIONS
from tests.golden.workplace import Workplace, csv_columns, toml_values


def diagnosed(place: Workplace, case: Path, *words: object, calibrations: Path = CALIBRATIONS) -> Any:
    """Return the answer to a case in ``answer`` of this place; what was not found stands by its name."""
    answer = place.answer(
        "diagnose", case, "--out", "answer", "--budget", 3600, *words, calibrations=calibrations
    )
    return _by_name(answer)


def _by_name(answer: dict[str, Any]) -> dict[str, Any]:
    # The order of the catalogue is no result.
    document = answer["answer"]
    if "not_found" in document:
        document["not_found"] = {row["name"]: row for row in document["not_found"]}
    return answer


def _numbers(path: Path) -> dict[str, list[float | None]]:
    """Return the columns of a CSV file as numbers; an empty cell is None."""
    columns = csv_columns(path).items()
    return {name: [float(cell) if cell else None for cell in cells] for name, cells in columns}


def _model(place: Workplace) -> dict[str, Any] | None:
    path = place.folder / "answer" / "model.toml"
    return toml_values(path) if path.exists() else None


def _register_cases() -> None:
    for name, files in CASES.items():

        def question(place: Workplace, files: Any = files) -> Any:
            answer = diagnosed(place, place.write(files(), "case") / "CASE.toml")
            predicted = sorted((place.folder / "answer" / "predictions").glob("*.csv"))
            answer["predictions"] = {path.name: _numbers(path) for path in predicted}
            answer["model"] = _model(place)
            return answer

        golden(f"diagnosis/{name}", quick=name in QUICK)(question)


_register_cases()


@golden("diagnosis/model-file")
def model_file(place: Workplace) -> Any:
    """What was named goes back into use: diagnosed again with it, and simulated."""
    files = CASES["ode-drag"]()
    case = place.write(files, "case") / "CASE.toml"
    diagnosed(place, case)
    model = place.folder / "answer" / "model.toml"
    again = _by_name(place.packaged("diagnose", case, "--out", "again", "--model", model))
    inputs = place.folder / "case" / "r0.csv"
    simulated = place.answer(
        "simulate", model, "--inputs", inputs, "--out", "simulated", calibrations=CALIBRATIONS
    )
    columns = {path.name: _numbers(path) for path in sorted((place.folder / "simulated").glob("*.csv"))}
    return {"again": again, "simulated": simulated, "columns": columns}
