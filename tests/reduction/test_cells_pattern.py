"""A turned, exchanged or dead cell is seen in a virtual test; every effect of its typical size is not."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from tests.campaigns import physics_gate as campaign
from toolkit.simulation.run import VirtualTest, simulate

CELLS = campaign.CELLS
SINGLE = [f"{c} turned" for c in CELLS] + [
    f"{a} and {b} exchanged" for a, b in itertools.combinations(CELLS, 2)
]


@pytest.fixture(scope="module")
def test() -> VirtualTest:
    """Both directions at seven of the protocol's thirteen slip angles."""
    plan = campaign.base_plan(rows=8)
    few = tuple(
        angle for angle in plan.slip_angles_rad if round(math.degrees(angle)) in (0, 1, -1, 4, -4, 10, -10)
    )
    return simulate(dataclasses.replace(plan, slip_angles_rad=few))


def found(test: VirtualTest, fault: str) -> list[tuple[str, str]]:
    edit = campaign.faults(dict(test.tare))[fault]
    alarms = campaign.alarms(campaign.reduced(test, campaign.virtual_record(), edit))
    assert all(one.level == "error" for one in alarms if one.rule != "implausible-friction")
    return [(one.rule, one.message) for one in alarms]


def test_a_sound_test_has_no_alarm(test: VirtualTest) -> None:
    assert campaign.alarms(campaign.reduced(test, campaign.virtual_record())) == []


@pytest.mark.parametrize("fault", SINGLE)
def test_one_cell_wrong_is_seen_and_named(test: VirtualTest, fault: str) -> None:
    alarms = found(test, fault)
    assert alarms
    cell, _, rest = fault.partition(" ")
    cure = f"{cell} turned round after its tare" if rest == "turned" else fault
    assert alarms[0][1].endswith(f"all is possible with {cure}")


@pytest.mark.parametrize("cell", CELLS)
def test_a_cell_turned_before_its_tare_is_named_so(test: VirtualTest, cell: str) -> None:
    turned = campaign.faults({})[f"{cell} turned"]
    tare = tuple((name, -value if name == cell else value) for name, value in test.tare)
    other = dataclasses.replace(test, tare=tare)
    alarms = campaign.alarms(campaign.reduced(other, campaign.virtual_record(), turned))
    assert f"all is possible with {cell} turned round" in alarms[0].message


@pytest.mark.parametrize("cell", CELLS)
def test_a_dead_cell_is_seen(test: VirtualTest, cell: str) -> None:
    rules = {rule for rule, _ in found(test, f"{cell} dead")}
    assert "impossible-cells" in rules


@pytest.mark.parametrize("cell", CELLS)
def test_a_cell_that_is_turned_between_the_directions_is_seen(test: VirtualTest, cell: str) -> None:
    turned = campaign.faults({})[f"{cell} turned"]
    alarms = campaign.alarms(
        campaign.reduced(
            test,
            campaign.virtual_record(),
            lambda columns, file: turned(columns, file) if file.rotation == "reverse" else None,
        )
    )
    assert any("during the test" in one.message for one in alarms)


def test_an_exchange_without_any_change_of_FY_shows_in_the_trail(test: VirtualTest) -> None:
    # D51 and D52 have nearly equal FY terms: only MZ changes, and its sign.
    alarms = found(test, "D51 and D52 exchanged")
    assert {rule for rule, _ in alarms} == {"impossible-slope"}
    assert all("trail" in message for _, message in alarms)


def test_cells_in_another_unit_show_where_the_tire_slides(test: VirtualTest) -> None:
    # 0.9 of the load divided by 4.448 is a friction of 0.2: ice, or pounds for newtons.
    edit = campaign.faults(dict(test.tare))["all cells in lbf read as N"]
    (alarm,) = campaign.alarms(campaign.reduced(test, campaign.virtual_record(), edit))
    assert (alarm.rule, alarm.level) == ("implausible-friction", "warning")


# What three cells cannot tell by themselves: values stay within what tires do. The calibration's own gates
# and the protocol's load tolerance are for these.
@pytest.mark.parametrize("fault", ["D51 times 1.3", "D52 times 1.3", "E5 times 0.7"])
def test_what_the_gate_cannot_see(test: VirtualTest, fault: str) -> None:
    assert found(test, fault) == []


DRAWN, MORE = (0, 9, 18, 27, 200, 206), pytest.mark.campaign("more draws of the same effects")


@pytest.mark.parametrize(
    "index",
    [
        index if index in DRAWN else pytest.param(index, marks=MORE)
        for index in (*range(0, 36, 3), *range(200, 212))
    ],
)
def test_effects_of_typical_size_raise_no_alarm(index: int) -> None:
    record = campaign.virtual_record()
    texts, other = campaign.virtual(index, 18, record)
    assert campaign.alarms(campaign.reduced(other, record)) == [], texts
