"""`toolkit plan test` refuses what it is asked for before it simulates any test."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.errors import ConfigError
from toolkit.lab.plans import protocol_plan
from toolkit.lab.plans.protocol_plan import ProtocolOrder, plan_test


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (ProtocolOrder(loads=("833",)), "a force with its unit"),
        (ProtocolOrder(loads=("100 kg",)), "a force with its unit"),
        (ProtocolOrder(loads=("100 kN",)), "833"),
        (ProtocolOrder(demands=("conicty=2 N",)), "conicity"),
        (ProtocolOrder(minutes=-5.0), "minutes above 0"),
        (ProtocolOrder(demands=("FY@25deg=40 N",)), "one of -10, -9"),
        (ProtocolOrder(demands=("relaxation_length",)), "relaxation_length=NUMBER UNIT"),
    ],
)
def test_nothing_is_simulated_for_what_cannot_be_planned(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, order: ProtocolOrder, said: str
) -> None:
    def simulated(*_: object) -> None:
        raise AssertionError("a test was simulated")

    monkeypatch.setattr(protocol_plan, "_virtual", simulated)
    with pytest.raises(ConfigError) as refused:
        plan_test(order, tmp_path / "out")
    assert said in str(refused.value.expected)
