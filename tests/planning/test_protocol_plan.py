"""What a plan of a test says of itself."""

from __future__ import annotations

import dataclasses

import pytest

from tests.characteristics.tire_factory import M15
from tests.planning.planning_factory import LOADS, earlier
from toolkit.planning import protocol_search
from toolkit.planning.demands import parse_demand
from toolkit.planning.design import Pace
from toolkit.planning.expectation import EarlierTest
from toolkit.planning.protocol_plan import plan_protocol
from toolkit.planning.tread import Tread


@pytest.fixture(autouse=True)
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan is a little longer at most."""
    monkeypatch.setattr(protocol_search, "_STARTS", 2)


def assumed(known: EarlierTest, demand: str) -> list[str]:
    tread = Tread(tires=(known,), pace=Pace(condition_s=5.0, between_files_s=30.0), speed_m_s=20.0)
    plan = plan_protocol(
        (known,), (parse_demand(demand),), LOADS[1:3], machine=M15, tread=tread, like="a test"
    )
    return [text for text in plan.assumptions if "conicity at" in text]


def test_a_plan_of_conicity_says_at_which_loads_and_what_is_taken_for_it() -> None:
    """What the machine adds to FY keeps its side when the drum is reversed: docs/physics.md."""
    known = earlier(LOADS[1:4])
    (by_drum,) = assumed(known, "conicity=10 N")
    loads = ", ".join(f"{load / 4.4482216152605:.0f}" for load in LOADS[1:3])
    assert by_drum.startswith(f"conicity at {loads} lbf is by reversing the drum, the tire not turned round")
    assert "crosstalk of the load into FY are taken for conicity and are in no U" in by_drum
    turned = dataclasses.replace(known, shared=dataclasses.replace(known.shared, reversal="tire"))
    (by_tire,) = assumed(turned, "conicity=10 N")
    assert "turning the tire round on its hub" in by_tire
    assert "zeros are whole in plysteer" in by_tire


def test_a_plan_without_conicity_says_nothing_of_it() -> None:
    assert assumed(earlier(LOADS[1:4]), "slope_cornering=5 %") == []
