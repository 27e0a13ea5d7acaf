"""What a tire and the carriage that holds it can do: the bounds of every check of physics, and their sources.

A bound is no typical value: it stands beyond every published tire, and a number beyond the bound is a fault
of the measurement. Where sources differ the wider one counts, with a margin of a quarter or more over the
largest value of the public sets: SAE 870421 (passenger), Goodyear G275 (truck), Schwalbe Energizer (bicycle),
FSAE TTC (racing, its amplitude obscured).

The conditions under which tires are tested have ranges too, with a finding outside of each. A condition is
stated by people or read by a sensor that is no part of the calibration, so a slip of the unit stays in it
unseen and acts on what rests on it: the pressure's part of U, friction over load, what models of speed and
pressure are fitted to. The ranges hold for tires of vehicles on roads, from bicycles to trucks; what a
machine is set to is narrower and its own (`toolkit.reduction.remarks`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from toolkit.declared import Quantity
from toolkit.findings import Finding
from toolkit.units import from_si, to_si, unit

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """``low`` to ``high`` in the first of its ``units``, those that laboratories state it in."""

    name: str
    low: float
    high: float
    units: tuple[str, ...]
    source: str

    def holds(self, si: float) -> bool:
        """Tell whether a value [SI] is within the range, edges included however their unit rounds."""
        low, high = to_si([self.low, self.high], self.units[0])
        room = 1e-9 * (high - low)
        return bool(low - room <= si <= high + room)


CONDITIONS = {
    "P": Condition(
        name="inflation pressure", low=50, high=1100, units=("kPa", "bar", "psi", "MPa"),
        source="racing and off-road tires from 70 kPa, passenger tires 180 to 350, truck tires to 900 "
        "(ETRTO, TRA), racing bicycles to 1000",
    ),
    "V": Condition(
        name="speed", low=0.1, high=450, units=("km/h", "m/s", "mph"),
        source="from a plank that creeps by centimetres a second to endurance drums for speed symbol (Y)",
    ),
    "rated_load": Condition(
        name="rated load", low=300, high=1e5, units=("N", "kN", "lbf", "kgf"),
        source="a bicycle's tire 500 N, truck tires to load index 180: 78 kN (ETRTO)",
    ),
    "FZ": Condition(
        name="load", low=0, high=2e5, units=("N", "kN", "lbf", "kgf"),
        source="twice and more of the largest rated load of a road tire",
    ),
    "SA": Condition(
        name="slip angle", low=-45, high=45, units=("deg", "rad"),
        source="flat belts steer by 30 deg; beyond some 20 deg every tire slides",
    ),
    "IA": Condition(
        name="inclination angle", low=-70, high=70, units=("deg", "rad"),
        source="motorcycles lean by 60 deg; cars by less than 15",
    ),
    "T": Condition(
        name="temperature", low=-60, high=250, units=("degC", "K", "degF"),
        source="from a climatic chamber for winter tires to the tread of a racing tire",
    ),
}  # fmt: skip
"""By the channel's symbol; ``rated_load`` is an entry of test.toml."""


def condition_of(symbol: str, unit_name: str) -> str | None:
    """Return the entry of `CONDITIONS` that judges a channel, None where none does.

    Whatever its name, a channel in a unit of temperature is one of the air, the tread or a bearing, and one
    range holds them all. Other units do not say what is measured: a pressure may be that of the hydraulics,
    an angle that of a shaft, a force that of a cell.

    >>> condition_of("T_TREAD", "degC"), condition_of("P_OIL", "bar"), condition_of("P", "bar")
    ('T', None, 'P')
    """
    if symbol in CONDITIONS:
        return symbol
    return "T" if unit(unit_name).dimension == "temperature" else None


def condition_finding(
    name: str, si: float, *, where: str, stated_in: str | None = None, called: str | None = None
) -> Finding | None:
    """Return what is to be said of a condition [SI] outside its range, None inside and for what has none.

    Parameters
    ----------
    stated_in : its unit, where the value does not say it itself (`Quantity`)
    called : the channel's name, where that is not the condition's

    >>> condition_finding("P", 3.4e6, where="test.toml", stated_in="bar").message.split("; ")[1]
    '34 psi would be 234 kPa'
    """
    condition = CONDITIONS.get(name)
    if condition is None or condition.holds(si):
        return None
    usual = condition.units[0]
    stated = si.unit if isinstance(si, Quantity) else stated_in or usual
    number = float(si.value) if isinstance(si, Quantity) else float(from_si(si, stated))
    written = _written(number, stated)
    reading = written if stated == usual else f"{written} ({_written(float(from_si(si, usual)), usual)})"
    low, high = condition.low, condition.high
    quantity = condition.name if called is None else f"{condition.name} {called}"
    message = (
        f"{quantity} {reading} is outside {low:g} to {high:g} {usual}, the range of tires of road vehicles"
    )
    for alternative in condition.units:
        converted = float(to_si(number, alternative))
        if alternative != stated and condition.holds(converted):
            inside = (
                "within it" if alternative == usual else _written(float(from_si(converted, usual)), usual)
            )
            message += f"; {_written(number, alternative)} would be {inside}"
            break
    return Finding(rule="unusual-condition", where=where, message=message)


def farthest(name: str, values: Iterable[float]) -> float | None:
    """Return the value [SI] that lies farthest outside a condition's range, None where all are within."""
    condition = CONDITIONS.get(name)
    outside = [value for value in values if condition is not None and not condition.holds(value)]
    return max(outside, key=abs, default=None)


def _written(number: float, unit: str) -> str:
    return f"{number:.3g} {unit}" if abs(number) < 1000 else f"{number:.0f} {unit}"
