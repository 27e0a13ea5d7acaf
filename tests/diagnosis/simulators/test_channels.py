"""Where effects on channels could act: places follow from what is measured, not from how it is read."""

from __future__ import annotations

import pytest

from toolkit.diagnosis.simulators.channels import channel_places
from toolkit.effects.catalogue import effects

LOADS = [("FX", "N"), ("FZ", "lbf"), ("MZ", "N*m"), ("T", "degC")]


@pytest.mark.parametrize("reading", ["N", "mV/V", "count", "V", "mV", "1", "mA", "ohm", "pF"])
def test_a_load_leaks_into_a_sensor_of_several_loads_in_whatever_it_is_read(reading):
    places = channel_places(effects()["crosstalk"], [("s", reading)], LOADS, set())
    assert places == [("s", "FX"), ("s", "FZ"), ("s", "MZ")]


def test_a_signal_that_one_load_makes_has_no_other_that_leaks():
    assert channel_places(effects()["crosstalk"], [("s", "V")], LOADS[2:], set()) == []


def test_what_is_no_signal_of_a_load_has_no_crosstalk():
    assert channel_places(effects()["crosstalk"], [("x", "m")], LOADS, set()) == []
