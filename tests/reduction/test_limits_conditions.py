"""Conditions outside those at which tires are tested, and the unit that was meant."""

import pytest

from toolkit.channels import CHANNELS
from toolkit.declared import Quantity
from toolkit.reduction.limits import CONDITIONS, condition_finding, condition_of
from toolkit.units import to_si, unit

# What laboratories test: none of it may be told.
USUAL = [
    ("P", 34, "psi"), ("P", 2.4, "bar"), ("P", 12, "psi"), ("P", 850, "kPa"), ("P", 110, "psi"),
    ("P", 0.9, "MPa"),
    ("V", 7.66, "km/h"), ("V", 0.05, "m/s"), ("V", 186, "mph"), ("rated_load", 3700, "N"),
    ("rated_load", 9000, "lbf"), ("SA", -30, "deg"), ("IA", 60, "deg"), ("T", 23, "degC"), ("T", 296, "K"),
    ("T", 140, "degF"), ("FZ", 0, "N"), ("FZ", 60, "kN"),
]  # fmt: skip
# A unit that was taken for another: what is said, and the unit that was meant with its value.
TAKEN = [
    ("P", 34, "bar", "34 bar (3400 kPa)", "34 psi would be 234 kPa"),
    ("P", 34, "kPa", "34 kPa", "34 psi would be 234 kPa"),
    ("P", 2.4, "kPa", "2.4 kPa", "2.4 bar would be 240 kPa"),
    ("P", 240, "psi", "240 psi (1655 kPa)", "240 kPa would be within it"),
    ("P", 240, "Pa", "240 Pa (0.24 kPa)", "240 kPa would be within it"),
    ("V", 250, "m/s", "250 m/s (900 km/h)", "250 km/h would be within it"),
    ("rated_load", 3.7, "N", "3.7 N", "3.7 kN would be 3700 N"),
    ("rated_load", 3700, "kN", "3700 kN (3700000 N)", "3700 N would be within it"),
    ("T", 23, "K", "23 K (-250 degC)", "23 degC would be within it"),
    ("SA", 2, "rad", "2 rad (115 deg)", "2 deg would be within it"),
]


@pytest.mark.parametrize(("name", "value", "text"), USUAL)
def test_what_laboratories_test_is_not_told(name, value, text):
    assert condition_finding(name, float(to_si(value, text)), where="here", stated_in=text) is None


@pytest.mark.parametrize(("name", "value", "text", "stated", "meant"), TAKEN)
@pytest.mark.parametrize("remembered", [True, False])
def test_a_unit_taken_for_another_is_told_with_the_one_that_was_meant(
    name, value, text, stated, meant, remembered
):
    si = float(to_si(value, text))
    finding = (
        condition_finding(name, Quantity(si, value=value, unit=text), where="here")
        if remembered
        else condition_finding(name, si, where="here", stated_in=text)
    )
    assert finding.rule == "unusual-condition"
    assert finding.level == "warning"
    low, high, usual = CONDITIONS[name].low, CONDITIONS[name].high, CONDITIONS[name].units[0]
    bounds = f"{low:g} to {high:g} {usual}, the range of tires of road vehicles"
    assert finding.message.startswith(f"{CONDITIONS[name].name} {stated} is outside {bounds}")
    assert finding.message.endswith(f"; {meant}")


def test_a_value_that_fits_in_no_unit_is_told_without_one():
    finding = condition_finding("P", 4e9, where="here", stated_in="kPa")
    assert "would be" not in finding.message


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_condition_is_stated_in_units_of_its_channel(name):
    dimension = "force" if name == "rated_load" else CHANNELS[name].dimension
    assert {unit(text).dimension for text in CONDITIONS[name].units} == {dimension}


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_edges_of_a_range_belong_to_it_in_every_unit(name):
    condition = CONDITIONS[name]
    for edge in (condition.low, condition.high):
        for text in condition.units:
            si = float(to_si(edge, condition.units[0]))
            written = (si - unit(text).offset) / unit(text).factor
            assert condition.holds(float(to_si(written, text)))


@pytest.mark.parametrize(
    ("symbol", "text", "condition"),
    [("T_TREAD", "degC", "T"), ("T_AMBIENT", "K", "T"), ("SA", "deg", "SA"), ("P_OIL", "bar", None)],
)
def test_a_temperature_is_known_by_its_unit_whatever_its_name(symbol, text, condition):
    assert condition_of(symbol, text) == condition
