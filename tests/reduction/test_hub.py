"""Loads of a hub: a wrench at the contact patch, seen from the spindle in any axes, comes back as it was."""

from __future__ import annotations

import dataclasses
import math
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reduction.hub_factory import ARM, LOADS, record
from toolkit.channels import Axes, Rotation
from toolkit.errors import ConfigError, RecordError
from toolkit.machine import Hub, Machine, load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.machine.definition import machine_file, machine_of_text
from toolkit.reduction.hub import HubBlock, check_hub, hub_means


def belt(*, axes: Axes = "SAE", arm: float | None = ARM, u_arm: float = 0.0) -> Machine:
    hub = Hub(loads=("FX", "FZ", "MX", "MY"), arm_m=arm, u_arm_m=u_arm)
    return dataclasses.replace(load_machine(DEFAULT_MACHINE), axes=axes, hub=hub)


def measured(vector: NDArray[np.float64], rows: int = 40, u_zero: tuple[float, ...] = ()) -> HubBlock:
    """Return a block whose loads are constant: (FX, FY, FZ, MX, MY, MZ) as the record gives them."""
    return HubBlock(
        loads={load: np.full(rows, value) for load, value in zip(LOADS, vector, strict=True)},
        cells=np.array(vector), u_zero=u_zero, tared=True, explained=np.zeros((0, rows)),
    )  # fmt: skip


def at_spindle(force: NDArray[np.float64], moment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the moment about the spindle of a wrench at the contact patch: SAE J670, z down."""
    return moment + np.cross([0.0, 0.0, ARM], force)


# From SAE vectors to those of another system: half a turn about x; about z of a reversed drum.
TURNS: dict[tuple[Axes, Rotation], NDArray[np.float64]] = {
    (axes, rotation): np.diag([1.0, 1.0, 1.0]) for axes in get_args(Axes) for rotation in get_args(Rotation)
}
TURNS |= {("ISO-W", rotation): np.diag([1.0, -1.0, -1.0]) for rotation in get_args(Rotation)}
TURNS["machine", "reverse"] = np.diag([-1.0, -1.0, 1.0])


@pytest.mark.parametrize(("axes", "rotation"), list(TURNS))
def test_a_wrench_at_the_contact_patch_comes_back(axes: Axes, rotation: Rotation) -> None:
    force, moment = np.array([310.0, -1900.0, -4100.0]), np.array([-37.0, 21.0, 44.0])
    turn = TURNS[axes, rotation]
    seen_force, seen_moment = turn @ force, turn @ at_spindle(force, moment)
    load = 4100.0  # FZ is the load on the tire, positive in every system
    vector = np.array([*seen_force[:2], load, *seen_moment])
    values = hub_means(
        measured(vector), machine=belt(axes=axes), record=record(), covariance={}, seen=rotation
    )
    assert {entry.load: entry.value for entry in values} == pytest.approx(
        {"FX": 310.0, "FZ": 4100.0, "MX": -37.0, "MY": 21.0}
    )
    assert [entry.u for entry in values] == [0.0] * 4


def test_without_an_arm_moments_stay_at_the_spindle() -> None:
    vector = np.array([310.0, -1900.0, 4100.0, 500.0, -80.0, 44.0])
    values = hub_means(
        measured(vector), machine=belt(arm=None), record=record(), covariance={}, seen="forward"
    )
    assert [(entry.load, entry.value) for entry in values] == [
        ("FX", 310.0), ("FZ", 4100.0), ("MX", 500.0), ("MY", -80.0)
    ]  # fmt: skip


def test_no_side_force_no_change() -> None:
    vector = np.array([0.0, 0.0, 4100.0, 12.0, 7.0, 0.0])
    values = hub_means(measured(vector), machine=belt(), record=record(), covariance={}, seen="forward")
    assert [entry.value for entry in values] == [0.0, 4100.0, 12.0, 7.0]


def test_the_arm_and_the_cells_zeros_enter_a_carried_moment() -> None:
    vector = np.array([300.0, -2000.0, 4000.0, 500.0, -80.0, 44.0])
    zeros = (1.0, 2.0, 4.0, 0.3, 0.2, 0.1)
    block = measured(vector, u_zero=zeros)
    values = hub_means(block, machine=belt(u_arm=0.002), record=record(), covariance={}, seen="forward")
    # By the law of propagation: MX = MX_H + h FY, MY = MY_H - h FX.
    assert {entry.load: entry.u for entry in values} == pytest.approx(
        {
            "FX": 1.0,
            "FZ": 4.0,
            "MX": math.hypot(0.3, ARM * 2.0, 0.002 * 2000.0),
            "MY": math.hypot(0.2, ARM * 1.0, 0.002 * 300.0),
        }
    )


def test_the_records_coefficients_enter() -> None:
    vector = np.array([300.0, -2000.0, 4000.0, 500.0, -80.0, 44.0])
    spread = {load: np.diag([1e-6 * (at == i) for i in range(7)]) for at, load in enumerate(LOADS)}
    values = hub_means(
        measured(vector), machine=belt(), record=record(1e-3), covariance=spread, seen="forward"
    )
    # A slope of 1 with u = 0.001: a thousandth of each load, and of the part that the arm brings.
    assert {entry.load: entry.u for entry in values} == pytest.approx(
        {"FX": 0.3, "FZ": 4.0, "MX": math.hypot(0.5, ARM * 2.0), "MY": math.hypot(0.08, ARM * 0.3)}
    )


def test_scatter_common_to_force_and_moment_is_counted_once() -> None:
    # The moment at the spindle follows the force exactly: what is carried to the patch has no scatter left.
    noise = np.random.default_rng(3).normal(0.0, 20.0, 200)
    vector = np.array([0.0, -2000.0, 4000.0, 640.0, 0.0, 0.0])
    block = measured(vector, rows=200)
    loads = dict(block.loads) | {"FY": -2000.0 + noise, "MX": 640.0 - ARM * noise}
    block = dataclasses.replace(block, loads=loads)
    (_, _, MX, _) = hub_means(block, machine=belt(), record=record(), covariance={}, seen="forward")
    assert MX.value == pytest.approx(0.0, abs=1e-9)
    assert MX.u == pytest.approx(0.0, abs=1e-9)


def test_a_machine_without_a_hub_has_no_loads_of_it() -> None:
    machine = dataclasses.replace(belt(), hub=None)
    vector = np.zeros(6)
    assert hub_means(measured(vector), machine=machine, record=record(), covariance={}, seen="forward") == ()
    assert load_machine(DEFAULT_MACHINE).hub is None


def test_a_record_without_a_load_of_the_hub_is_refused() -> None:
    whole = record()
    part = dataclasses.replace(whole, loads=tuple(fit for fit in whole.loads if fit.load not in ("FX", "MY")))
    check_hub(whole, belt())
    with pytest.raises(RecordError, match="no FX and no MY") as caught:
        check_hub(part, belt())
    assert caught.value.rule == "record-loads"


@pytest.mark.parametrize(
    ("hub", "says"),
    [
        ('loads = ["FY"]', "FX"),
        ("loads = []", "loads"),
        ('loads = ["FX", "FX"]', "loads"),
        ('loads = ["FX"]\narm = { value = 320, unit = "mm" }', "carries no moment"),
        ('loads = ["MY"]\narm = { value = 320, unit = "mm" }', "carried to the contact patch by FX"),
        ('loads = ["MX"]\nu_arm = { value = 2, unit = "mm" }', "has no arm"),
        ('loads = ["MX"]\narm = { value = 320, unit = "kg" }', "arm"),
    ],
)
def test_a_hub_that_cannot_be(hub: str, says: str) -> None:
    path = machine_file(DEFAULT_MACHINE)
    text = path.read_text() + f"\n[hub]\n{hub}\n"
    with pytest.raises(ConfigError, match=says):
        machine_of_text(text.encode(), path)
