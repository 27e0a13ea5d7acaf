"""Units of fitted parameters as people write them, and as the toolkit itself reads them again."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pint
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.answer.model_text import model_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.simulation.model_file import read_model


@pytest.mark.parametrize(
    "text",
    [
        "m/s^2/(m/s^2*s)", "m/s*s", "N/((N*m))", "N/(N)", "1/1", "1/1^2", "(lbf*ft)/(lbf)", "N/(m/s*s)^3",
        "N/(m/s)^2", "1/(N*m)^2", "kg", "1/min", "1/min/1", "mV/V/K", "V/s/(m)^3",
    ],
)  # fmt: skip
def test_a_reduced_unit_is_the_same_unit(text):
    registry = pint.UnitRegistry()
    before, after = (
        registry.parse_expression(one.replace("lbf", "force_pound")) for one in (text, reduced(text))
    )
    assert (1.0 * before / after).to_base_units().magnitude == pytest.approx(1.0, rel=1e-12)
    assert registry.Quantity(before / after).dimensionless


@pytest.mark.parametrize(
    ("text", "told"),
    [("m/s^2/(m/s^2*s)", "1/s"), ("m/s*s", "m"), ("N/((N*m))", "1/m"), ("1/1^2", "1"), ("lbf ft", "lbf ft")],
)
def test_what_cancels_in_a_unit_is_not_written(text, told):
    assert reduced(text) == told


def test_a_model_of_an_output_without_unit_is_read_again(tmp_path):
    # A cell whose reading is a ratio bends by 2 % over its range: the cube's unit would be 1/1^2.
    frames = {}
    for i in range(2):
        L = np.linspace(0.1, 2.0, 40)
        noise = np.random.default_rng(i).normal(0, 1e-3, 40)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": np.arange(40.0), "L": L, "F": L - 0.02 * L**2 + noise})
    text = case_text(
        "python", parameters={"gain": (1.0, "1", 0.01)}, inputs={"L": "1"}, outputs={"F": "1"}, runs=2
    )
    read = read_case(write_case(tmp_path, text, simulator=CELL, **frames))
    found = diagnose(read, None)
    (bent,) = found.diagnosis.effects
    assert bent.name == "nonlinearity"
    assert {one.unit for one in bent.parameters} == {"1"}
    made = model_text(read, found.search, found.diagnosis, tmp_path)
    assert made is not None
    (tmp_path / "again.toml").write_text(made, encoding="utf-8")
    (again,) = read_model(tmp_path / "again.toml").effects
    assert again.applied.effect.name == "nonlinearity"
