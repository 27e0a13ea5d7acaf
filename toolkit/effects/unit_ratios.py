"""By what a number is wrong where another unit of its dimension was meant."""

from __future__ import annotations

from functools import cache

from toolkit.units import RECORDED_IN, is_unit, unit, units_alike

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

    for right in () if stated.offset else map(unit, units_alike(text)):
        if not right.offset:
            add(f"{right.text} read as {stated.text}", stated.factor / right.factor)
            add(f"{stated.text} read as {right.text}", right.factor / stated.factor)
    for power in () if stated.is_interval else _TENS:
        add(f"{10**power} times the value", 10.0**power)
        add(f"1/{10**power} of the value", 10.0**-power)
    return ratios


@cache
def units_mistaken() -> dict[str, float]:
    """Return by what a number is too large for every two units of one dimension, by the words for them.

    >>> round(units_mistaken()["N read as lbf"], 6)
    4.448222
    """
    return {
        f"{right} read as {wrong}": unit(wrong).factor / unit(right).factor
        for right in RECORDED_IN
        if not unit(right).offset
        for wrong in units_alike(right)
        if wrong != right and not unit(wrong).offset
    }


def near_ratio(low: float, high: float, text: str) -> str | None:
    """Return which other unit makes numbers too large by a ratio in an interval, None where none does."""
    ratios = unit_ratios(text) if is_unit(text) else {}
    return next(
        (name for name, ratio in ratios.items() if low * (1 - _ALIKE) <= ratio <= high * (1 + _ALIKE)), None
    )
