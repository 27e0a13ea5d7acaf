"""Units of a plan of a test: those of its protocol, by definition of the pound-force and the degree."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tests.characteristics.tire_factory import M15
from toolkit.characteristics.catalogue import by_name
from toolkit.planning.demands import PrintedUnits, title_of, units_of

POUNDS = PrintedUnits(force="lbf", moment="lbf*ft")
LBF, FOOT = 4.4482216152605, 0.3048  # N, exact by definition; m


@pytest.mark.parametrize(
    ("value", "unit", "size", "printed"),
    [
        (LBF, "N", 1.0, "lbf"),
        (LBF * FOOT, "N*m", 1.0, "lbf*ft"),
        (LBF, "N/rad", math.pi / 180, "lbf/deg"),
        (LBF * FOOT, "N*m/rad", math.pi / 180, "lbf*ft/deg"),
        (math.pi, "rad", 180.0, "deg"),
        (0.3, "m", 300.0, "mm"),
        (7.0, "1/s", 7.0, "1/s"),
    ],
)
def test_forces_moments_and_stiffnesses(value: float, unit: str, size: float, printed: str) -> None:
    shown = POUNDS.shown(value, unit)
    assert shown == (pytest.approx(size, rel=1e-12), printed)


def test_the_units_are_those_of_the_protocols_loads() -> None:
    assert units_of(M15.protocol) == POUNDS
    plain = dataclasses.replace(M15.protocol, loads_N=(1000.0, 2000.0))
    assert units_of(plain) == PrintedUnits(force="N", moment="N*m")


def test_every_characteristic_has_a_title_that_people_read() -> None:
    for name, declared in by_name().items():
        title = title_of(f"{name}@8deg" if declared.scope == "angle" else name)
        assert "_" not in title
        assert title
    assert title_of("MZ@-4deg") == "aligning moment at -4 deg"
