"""Designs: rows, minutes, order."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import spearmanr

from toolkit.channels import Axes
from toolkit.machine import load_machine
from toolkit.planning.design import Design, Pace, ordered, pace_of, standard, steps_of

M15 = load_machine("m15")


def test_the_protocol_of_the_machine_is_13_angles_5_loads_2_directions() -> None:
    design = standard(M15, M15.rotations)
    assert (design.rows, design.recordings) == (130, 26)


def test_minutes_are_those_of_conditions_and_of_recordings() -> None:
    design = Design(slip_angles_rad=(0.0, 0.1), loads_N=(1e3, 2e3, 3e3), rotations=("forward",))
    assert Pace(condition_s=5.0, between_files_s=15.0).minutes(design) == pytest.approx((6 * 5 + 2 * 15) / 60)


def test_a_condition_takes_the_turns_of_the_protocol() -> None:
    # 3.5 turns of a tire of 0.316 m x 0.97 at 7.66 km/h, and 2.5 s for the actuator.
    turn = 2 * math.pi * 0.316 * 0.97 / (7.66 / 3.6)
    assert pace_of(M15).condition_s == pytest.approx(3.5 * turn + 2.5)
    by_drum = dataclasses.replace(M15, protocol=dataclasses.replace(M15.protocol, revolutions_of="drum"))
    slower = pace_of(by_drum, between_files_s=7.0)
    assert slower.condition_s == pytest.approx(3.5 * 8.5 / (7.66 / 3.6) + 2.5)
    assert slower.between_files_s == 7.0


def test_the_machine_stands_at_multiples_of_its_smallest_step() -> None:
    protocol = dataclasses.replace(
        M15.protocol, slip_angles_rad=tuple(map(math.radians, (-3.0, 0.0, 1.5, 4.5)))
    )
    machine = dataclasses.replace(M15, protocol=protocol)
    np.testing.assert_allclose(np.degrees(steps_of(machine)), [-3, -1.5, 0, 1.5, 3, 4.5], atol=1e-9)


@pytest.mark.parametrize("axes", ["ISO-W", "adapted-SAE"])
def test_a_design_is_in_SAE_whatever_the_machine_shows(axes: Axes) -> None:
    shown = dataclasses.replace(
        M15.protocol, slip_angles_rad=tuple(map(math.radians, (0.0, 1.0, -1.0, 3.0, 6.0)))
    )
    machine = dataclasses.replace(M15, axes=axes, protocol=shown)
    design = standard(machine, machine.rotations)
    np.testing.assert_allclose(np.degrees(design.slip_angles_rad), [0, -1, 1, -3, -6], atol=1e-9)
    np.testing.assert_allclose(np.degrees(steps_of(machine)), np.arange(-6, 2), atol=1e-9)


@pytest.mark.parametrize("count", [7, 9, 13])
def test_the_order_follows_neither_the_angle_nor_its_size(count: int) -> None:
    angles = tuple(math.radians(a) for a in np.linspace(-10, 10, count).round())
    order = ordered(angles, seed=1)
    assert sorted(order) == sorted(angles)
    time = range(count)
    assert abs(spearmanr(time, order).statistic) < 0.25
    # The protocol of the source document: 0.992.
    assert abs(spearmanr(time, np.abs(order)).statistic) < 0.25
