"""By what a number is wrong where another unit of its dimension was meant."""

from __future__ import annotations

from functools import cache

from toolkit.units import is_unit, unit, unit_examples

# Further units that people record in, beside those of the machine's own files.
_ALSO = (
    "kgf", "g", "kg", "MN", "cm", "µm", "km", "inch", "ft", "min", "h", "µs", "mph", "MPa", "mbar", "hPa",
    "atm", "mmHg", "N*mm", "lbf*in", "kgf*m", "mV", "V", "kV", "mA", "A", "mW", "W", "kW", "turn", "mrad",
    "%", "rad/s", "rpm", "ml", "liter", "m^3", "l/min", "m^3/h", "cm/s", "mm/s", "cm/s^2", "m/s^2",
    "standard_gravity",
)  # fmt: skip
_TENS = range(1, 7)
_ALIKE = 1e-3  # two ratios of units as near as that are told apart by no recording


@cache
def unit_ratios(text: str) -> dict[str, float]:
    """Return by what a number is too large where another unit of its dimension was meant, or a power of ten.

    Units first, both ways: the recording may be in the other unit, or the simulation may expect it.

    >>> {name: round(ratio, 6) for name, ratio in unit_ratios("bar").items() if "kPa" in name}
    {'kPa read as bar': 100.0, 'bar read as kPa': 0.01}
    """
    stated = unit(text)
    ratios: dict[str, float] = {}

    def add(name: str, ratio: float) -> None:
        if all(abs(ratio / known - 1) > _ALIKE for known in (1.0, *ratios.values())):
            ratios[name] = ratio

    others = () if stated.offset else (*unit_examples(text), *_ALSO)
    for other in others:
        right = unit(other)
        if right.dimension == stated.dimension and not right.offset:
            add(f"{right.text} read as {stated.text}", stated.factor / right.factor)
            add(f"{stated.text} read as {right.text}", right.factor / stated.factor)
    for power in () if stated.is_interval else _TENS:
        add(f"{10**power} times the value", 10.0**power)
        add(f"1/{10**power} of the value", 10.0**-power)
    return ratios


def near_ratio(low: float, high: float, text: str) -> str | None:
    """Return which other unit makes numbers too large by a ratio in an interval, None where none does."""
    ratios = unit_ratios(text) if is_unit(text) else {}
    return next(
        (name for name, ratio in ratios.items() if low * (1 - _ALIKE) <= ratio <= high * (1 + _ALIKE)), None
    )
