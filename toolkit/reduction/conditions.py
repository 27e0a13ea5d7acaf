"""The conditions under which tires are tested: the range of each, and the finding outside of it.

A condition is stated by people or read by a sensor that is no part of the calibration, so a slip of the unit
stays in it unseen and acts on what rests on it: the pressure's part of U, friction over load, what models of
speed and pressure are fitted to. The ranges hold for tires of vehicles on roads, from bicycles to trucks;
what a machine is set to is narrower and its own (`toolkit.reduction.remarks`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from toolkit.declared import Quantity
from toolkit.findings import Finding
from toolkit.units import from_si, to_si, unit


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
