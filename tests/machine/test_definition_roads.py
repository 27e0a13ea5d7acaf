"""Roads: outside and inside a drum, flat. The contact patch by the geometry of two circles."""

from __future__ import annotations

import math

import pytest

from toolkit.errors import ConfigError
from toolkit.machine import Drum
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.machine.definition import Road, load_machine, machine_file, machine_of_text

DRUM_RADIUS, TIRE_RADIUS = 1.5, 0.32


def drum(road: Road | None, radius_m: float | None = DRUM_RADIUS) -> Drum:
    around = None if radius_m is None else 2 * math.pi * radius_m
    return Drum(surface="steel", road=road, circumference_m=around, speed_m_s=10.0, speed_tolerance_m_s=1.0)


def chord(distance: float, drum_radius: float, tire_radius: float) -> float:
    """Return the chord that two circles have in common whose centres are so far apart: Euclid, no limit."""
    along = (distance**2 + tire_radius**2 - drum_radius**2) / (2 * distance)
    return 2 * math.sqrt(tire_radius**2 - along**2)


@pytest.mark.parametrize("depth", [1e-5, 1e-6])
def test_the_contact_patch_is_the_chord_of_two_circles(depth: float) -> None:
    flat = 2 * math.sqrt(TIRE_RADIUS**2 - (TIRE_RADIUS - depth) ** 2)
    outside = chord(DRUM_RADIUS + TIRE_RADIUS - depth, DRUM_RADIUS, TIRE_RADIUS)
    inside = chord(DRUM_RADIUS - TIRE_RADIUS + depth, DRUM_RADIUS, TIRE_RADIUS)
    assert drum("convex").contact_length_factor(TIRE_RADIUS) == pytest.approx(outside / flat, rel=1e-4)
    assert drum("concave").contact_length_factor(TIRE_RADIUS) == pytest.approx(inside / flat, rel=1e-4)
    assert outside < flat < inside


def test_a_flat_road_has_no_curvature() -> None:
    road = drum("flat", None)
    assert (road.curvature_per_m, road.contact_length_factor(TIRE_RADIUS)) == (0.0, 1.0)


def test_signs_and_the_limit_of_a_large_drum() -> None:
    assert drum("convex").curvature_per_m == -drum("concave").curvature_per_m > 0
    for road in ("convex", "concave"):
        assert drum(road, 1e9).contact_length_factor(TIRE_RADIUS) == pytest.approx(1.0, abs=1e-9)


def test_what_the_road_is_where_nobody_says() -> None:
    assert drum(None).curvature_per_m == drum("convex").curvature_per_m
    assert drum(None, None).curvature_per_m == 0.0


def test_a_tire_that_does_not_fit_into_the_drum() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        drum("concave", 0.3).contact_length_factor(TIRE_RADIUS)


@pytest.mark.parametrize(
    ("road", "says"), [("flat", "the road is flat"), ("hollow", "convex, concave, flat")]
)
def test_a_road_that_cannot_be(road: str, says: str) -> None:
    path = machine_file(DEFAULT_MACHINE)
    text = path.read_text().replace("[drum]\n", f'[drum]\nroad = "{road}"\n')
    with pytest.raises(ConfigError, match=says):
        machine_of_text(text.encode(), path)


def test_a_drum_without_its_circumference() -> None:
    path = machine_file(DEFAULT_MACHINE)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("circumference")]
    text = "\n".join(lines).replace("[drum]\n", '[drum]\nroad = "concave"\n')
    with pytest.raises(ConfigError, match="a concave road is a drum's"):
        machine_of_text(text.encode(), path)


def test_the_packaged_machine_runs_outside_its_drum() -> None:
    assert load_machine(DEFAULT_MACHINE).drum.curvature_per_m > 0
