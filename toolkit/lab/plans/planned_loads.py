"""The loads that a plan of a test is asked for: texts with their units, and the nominal loads they mean."""

from __future__ import annotations

from collections.abc import Sequence

from toolkit.errors import ConfigError

_NEAR = 0.15  # a load that is asked for is the nominal one within this part of it


def nominal_loads(texts: Sequence[str], known_N: Sequence[float]) -> tuple[float, ...]:
    """Return the nominal loads that are asked for, of those that are known [N]; all by default.

    Raises
    ------
    ConfigError
        ``plan-load``: one that cannot be read, or is none of them
    """
    from toolkit.units import in_both

    if not texts:
        return tuple(known_N)
    loads = []
    for text in texts:
        asked = load_of(text)
        nearest = min(known_N, key=lambda load: abs(load - asked))
        if abs(nearest - asked) > _NEAR * nearest:
            raise _wrong_load(text, in_both(list(known_N), "lbf", ".0f"))
        loads.append(nearest)
    return tuple(sorted(set(loads)))


def load_of(text: str) -> float:
    """Return a load [N] that a text states with its unit.

    Raises
    ------
    ConfigError
        ``plan-load``
    """
    import re

    from toolkit.errors import UnitError
    from toolkit.units import si_scale

    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(\S.*?)\s*", text)
    if match is None:
        raise _wrong_load(text, "a number with its unit: '833 lbf', '3700 N'")
    try:
        return float(match[1]) * si_scale(match[2], "force", where="--load")
    except UnitError as error:
        raise _wrong_load(text, "a force with its unit: '833 lbf', '3700 N'") from error


def _wrong_load(actual: str, expected: str) -> ConfigError:
    return ConfigError(
        "a load cannot be planned", where="--load", got=actual, expected=expected,
        next_step="name a load that the earlier test measured, or another test", rule="plan-load",
    )  # fmt: skip
