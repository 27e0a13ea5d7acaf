"""What a tire and the carriage that holds it can do: the bounds of every check of physics, and their sources.

A bound is no typical value: it stands beyond every published tire, and a number beyond the bound is a fault
of the measurement. Where sources differ the wider one counts, with a margin of a quarter or more over the
largest value of the public sets: SAE 870421 (passenger), Goodyear G275 (truck), Schwalbe Energizer (bicycle),
FSAE TTC (racing, its amplitude obscured).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

LEAST_LOAD_N = 25.0
"""The least load of any tire test, of a bicycle's some 200: below are kilonewtons named newtons."""
LARGEST_TRAIL_M = 0.5
"""In a table of any tire, those of aircraft and earth movers among them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One bound in SI: ``low`` to ``high``, what it bounds, and where it comes from."""

    low: float
    high: float
    unit: str
    text: str
    source: str


FRICTION = Limit(
    low=0.0,
    high=2.0,
    unit="1",
    text="force in the road's plane over load",
    source="road tires reach 0.8 to 1.2 on dry laboratory surfaces (Gillespie, Fundamentals of Vehicle "
    "Dynamics, 1992, ch. 10; the public sets 0.45 to 1.14), the racing tire of the FSAE TTC set 1.54",
)
SLIDING = Limit(
    low=0.3,
    high=FRICTION.high,
    unit="1",
    text="side force over load at 8 deg of slip and more, mean of all loads, on a dry laboratory surface",
    source="rubber on dry steel, sandpaper or asphalt slides at 0.5 and more (Gillespie 1992, ch. 10); the "
    "public sets 0.54 to 0.98. Ice and a flooded surface have less: a warning, no impossibility",
)
STIFFNESS = Limit(
    low=1.0,
    high=40.0,
    unit="1/rad",
    text="cornering stiffness over load",
    source="0.08 to 0.19 per degree for car tires and 0.30 for low ones (Gillespie 1992, pp. 347-355), that "
    "is 5 to 17 per rad; SAE 870421 22 at light load, a truck tire past its load 3, the FSAE TTC tire 32",
)
PULL = Limit(
    low=0.0,
    high=0.15,
    unit="1",
    text="side force over load at zero slip angle",
    source="conicity and plysteer: 0.04 of the load for a truck tire (Goodyear G275), 0.08 for a bicycle "
    "tire; a plysteer of 0.4 deg on the stiffest car tire 0.15",
)
CAMBER = Limit(
    low=0.0,
    high=1.5,
    unit="1/rad",
    text="camber stiffness over load",
    source="about 1 per rad, tan(IA) of the load, for motorcycle tires and less for car tires (Pacejka, Tire "
    "and Vehicle Dynamics, ch. 11)",
)
STEER_ZERO = Limit(
    low=0.0,
    high=math.radians(0.5),
    unit="rad",
    text="error of the slip angle's zero",
    source="rack and pinion steering in 1 deg steps, its zero set anew for each test: 0.1 to 0.5 deg",
)
TRAIL = Limit(
    low=0.0,
    high=0.15,
    unit="m",
    text="pneumatic trail",
    source="no longer than half the contact length, where the pressure ends; a third of that at small slip "
    "(brush model: Pacejka, Tire and Vehicle Dynamics, ch. 3). The public sets: 8 to 77 mm",
)
TRAIL_PER_RADIUS = Limit(
    low=0.0,
    high=0.3,
    unit="1",
    text="pneumatic trail over free radius",
    source="half the contact length is 0.31 of the radius at a deflection of 5 % of it (chord of a circle); "
    "the public sets reach 0.23, far beyond their rated load",
)
RESIDUAL_MOMENT = Limit(
    low=0.0,
    high=0.02,
    unit="m",
    text="aligning moment over load where there is no side force",
    source="over twice the largest that an angle error of 0.5 deg and a residual moment make in the public "
    "sets",
)
LEVER = Limit(
    low=0.10,
    high=0.70,
    unit="m",
    text="overturning moment at the hub over side force",
    source="the loaded radius, 0.15 (kart) to 0.6 m (truck), less the load times the tire's lateral "
    "compliance; 0.23 m over the rows of Figure 4.4",
)
LEVER_PER_RADIUS = Limit(
    low=0.4,
    high=1.3,
    unit="1",
    text="overturning moment at the hub over side force and free radius",
    source="the loaded radius is 0.85 to 0.98 of the free one, a tire's lateral deflection takes some 0.1 of "
    "it; 0.72 over the rows of Figure 4.4, were its tire a 205/55R16",
)
