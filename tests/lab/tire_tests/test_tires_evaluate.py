"""`Tire.evaluate` refuses and finds what `toolkit evaluate` refuses and finds."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import pandas as pd
import pytest

import toolkit
from tests.cli import one_command
from tests.cli.test_evaluate import TIRE
from toolkit.cli import evaluate

run = functools.partial(one_command.run, evaluate.command)

GRIDS: dict[str, dict[str, list[float]]] = {
    "within the file's range": {"SA [deg]": [2.0], "FZ [N]": [3000.0]},
    "a load of no tire": {"SA [deg]": [2.0], "FZ [N]": [1e9]},
    "an angle beyond the file's range": {"SA [deg]": [80.0], "FZ [N]": [3000.0]},
    "an angle in another unit": {"SA [rad]": [4.0], "FZ [N]": [3000.0]},
    "an unknown column": {"SA [deg]": [2.0], "FZ [N]": [3000.0], "foo [N]": [0.1]},
    "loads of both signs": {"SA [deg]": [2.0, 2.0], "FZ [N]": [3000.0, -3000.0]},
    "forces of its own": {"SA [deg]": [2.0], "FZ [N]": [3000.0], "FY [N]": [1.0]},
    "no load": {"SA [deg]": [2.0]},
    "a pressure that the file has no terms for": {"SA [deg]": [2.0], "FZ [N]": [3e3], "P [kPa]": [200.0]},
}


@pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS)
@pytest.mark.parametrize("friction", ["1", "9"])
def test_both_doors_judge_alike(tmp_path: Path, grid: dict[str, list[float]], friction: str) -> None:
    tire, rows = tmp_path / "x.tir", tmp_path / "g.csv"
    tire.write_text(TIRE.replace("PDY1 = 1\n", f"PDY1 = {friction}\n"))
    pd.DataFrame(grid).to_csv(rows, index=False)
    try:
        _, printed = run(tire, rows, "--json")
    except toolkit.ToolkitError as error:
        refusal = error
        with pytest.raises(type(refusal)) as caught:
            toolkit.read_tire(tire).evaluate(pd.DataFrame(grid))
        row = caught.value.what.replace("row 1,", "row 2,")  # of a file the header is its first row
        assert (caught.value.rule, row) == (refusal.rule, refusal.what)
        return
    answer = json.loads(printed)
    forces = toolkit.read_tire(tire).evaluate(pd.DataFrame(grid))
    assert forces["FY [N]"].tolist() == [row["FY"] for row in answer["rows"]]
    expected = [(entry["rule"], entry["message"]) for entry in answer["findings"]]
    assert [(entry["rule"], entry["message"]) for entry in forces.attrs["findings"]] == expected
