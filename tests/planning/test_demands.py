"""Demands as people write them."""

from __future__ import annotations

import math

import pytest

from toolkit.errors import ConfigError
from toolkit.planning.demands import parse_demand


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("conicity=5 N", 5.0),
        ("conicity = 1 lbf", 4.4482216152605),  # the international pound-force
        ("CRAT=0.5N*m", 0.5),
        ("slope_cornering=20 N/deg", 20 * 180 / math.pi),
        ("slope_cornering=1 kN/rad", 1000.0),
        ("FY@-8deg=40 N", 40.0),
    ],
)
def test_a_size_is_held_in_SI(text: str, size: float) -> None:
    assert parse_demand(text).U == pytest.approx(size, rel=1e-12)


def test_a_share_is_of_the_value_whatever_its_sign() -> None:
    assert parse_demand("slope_aligning=2 %").limit(-150.0) == pytest.approx(3.0)


@pytest.mark.parametrize(
    "text",
    [
        "conicity=5", "conicity=5 N*m", "conicity=0 N", "conicity=-1 N", "conicity=5 furlong", "conicty=5 N",
        "slope_cornering=5 N", "conicity=5 N/deg", "FY=40 N", "conicity@8deg=4 N", "FY@95deg=4 N",
        "peak@8deg=1 %", "FY@..deg=4 N", "conicity=.. N", "", "=", "5 N",
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused(text: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_demand(text)
    assert error.value.rule == "plan-demand"
    assert error.value.next_step


def test_a_misspelt_name_is_answered_by_the_nearest() -> None:
    with pytest.raises(ConfigError) as error:
        parse_demand("plysteeer=5 N")
    assert "plysteer" in str(error.value.next_step)
