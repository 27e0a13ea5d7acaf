"""A tire file without one of the coefficients that FY stands on: evaluated with it as zero, and told."""

import pytest

from toolkit.tires.tir import parse_tir
from toolkit.tires.tir_evaluate import evaluate_tir

ENTRIES = {"PCY1": 1.3, "PDY1": 1.0, "PKY1": -15.0, "PKY2": 1.7}


def evaluated(without):
    lateral = "".join(f"{name} = {value}\n" for name, value in ENTRIES.items() if name != without)
    text = "[MODEL]\nFITTYP = 61\n[VERTICAL]\nFNOMIN = 4000\nUNLOADED_RADIUS = 0.3\n[LATERAL_COEFFICIENTS]\n"
    made, findings = evaluate_tir(parse_tir(text + lateral), SA=0.05, FZ=4000.0)
    return float(made.FY), [one for one in findings if one.level == "warning"]


@pytest.mark.parametrize("name", ENTRIES)
def test_each_coefficient_that_fy_stands_on_is_named_when_it_is_absent(name):
    FY, findings = evaluated(name)
    assert pytest.approx(0.0, abs=1e-6) == FY
    assert [one.rule for one in findings] == ["tir-no-coefficients"]
    assert f"no {name}" in findings[0].message


def test_with_all_of_them_there_is_a_force_and_no_warning():
    FY, findings = evaluated(None)
    assert FY < -1000
    assert findings == []
