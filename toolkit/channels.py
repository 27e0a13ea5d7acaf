"""Nomenclature: every channel's symbol, name, unit, sign and aliases, and the axis systems.

| system      | z    | y     | SA > 0 gives             | used by                                   |
|-------------|------|-------|--------------------------|-------------------------------------------|
| SAE         | down | right | FY < 0, MZ > 0           | SAE J670; the toolkit's own results       |
| adapted-SAE | down | right | FY > 0, MZ < 0 (SA flips)| Pacejka's book, Pacejka '94               |
| ISO-W       | up   | left  | FY < 0, MZ > 0           | ISO 8855, .tir files                      |
| machine     | the load cells in the carriage: equal to SAE with the drum forward; with the drum reversed  |
|             | x and y point the other way (a half turn about z), so FY changes sign and MZ and SA do not  |

FZ is the load on the tire and positive in every system. The sign of SA in ISO-W follows from ISO 8855:
the lateral velocity changes sign with y, the slip angle with it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

Axes = Literal["SAE", "adapted-SAE", "ISO-W", "machine"]
Rotation = Literal["forward", "reverse"]
Reversal = Literal["drum", "tire"]

_FORCE, _MOMENT = re.compile(r"F[XYZ]?\Z"), re.compile(r"M[XYZ]\Z")
AXES: tuple[Axes, ...] = get_args(Axes)
ROTATIONS: tuple[Rotation, ...] = get_args(Rotation)
REVERSALS: tuple[Reversal, ...] = get_args(Reversal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One quantity of the field."""

    symbol: str
    name: str
    si: str
    dimension: str
    tydex: str | None = None
    aliases: tuple[str, ...] = ()


_ALL = (
    Channel(symbol="t", name="time", si="s", dimension="time", aliases=("time",)),
    Channel(symbol="FX", name="longitudinal force", si="N", dimension="force", tydex="FX"),
    Channel(symbol="FY", name="lateral force", si="N", dimension="force", tydex="FYW", aliases=("Fy",)),
    Channel(
        symbol="FZ", name="normal force", si="N", dimension="force", tydex="FZW", aliases=("FZ load", "Fz")
    ),
    Channel(symbol="MX", name="overturning moment", si="N*m", dimension="moment", tydex="MXW"),
    Channel(symbol="MY", name="rolling resistance moment", si="N*m", dimension="moment", tydex="MYW"),
    Channel(symbol="MZ", name="aligning moment", si="N*m", dimension="moment", tydex="MZW", aliases=("Mz",)),
    Channel(
        symbol="SA",
        name="slip angle",
        si="rad",
        dimension="angle",
        tydex="SLIPANGL",
        aliases=("SA (Filtered)",),
    ),
    Channel(symbol="IA", name="inclination angle", si="rad", dimension="angle", tydex="INCLANGL"),
    Channel(symbol="KAPPA", name="longitudinal slip", si="1", dimension="ratio", tydex="LONGSLIP"),
    Channel(symbol="P", name="inflation pressure", si="Pa", dimension="pressure", tydex="INFLPRES"),
    Channel(symbol="V", name="speed", si="m/s", dimension="speed", tydex="LONGVEL"),
    Channel(symbol="T", name="temperature", si="K", dimension="temperature"),
    Channel(
        symbol="TIRE_ANGLE",
        name="tire revolution angle",
        si="rad",
        dimension="angle",
        aliases=("tire angle", "tire rotation angle", "wheel angle"),
    ),
    Channel(
        symbol="DRUM_ANGLE",
        name="drum revolution angle",
        si="rad",
        dimension="angle",
        aliases=("drum angle", "drum rotation angle"),
    ),
)

CHANNELS: dict[str, Channel] = {channel.symbol: channel for channel in _ALL}


def channel_of(text: str) -> Channel | None:
    """Return the channel that is called so, by its symbol, name or an alias; None where none is.

    `t` is time and `T` temperature: the exact symbol goes first, then the spelling in any case.

    >>> [channel_of(text).symbol for text in ("T", "Time", "slip angle")]
    ['T', 't', 'SA']
    """
    name = " ".join(text.split())
    return CHANNELS.get(name) or _BY_NAME.get(name.casefold())


_BY_NAME = {
    text.casefold(): channel
    for channel in reversed(_ALL)  # the first of two keeps a name that both have
    for text in (channel.symbol, channel.name, *channel.aliases)
}


def signs(source: Axes, target: Axes, rotation: Rotation = "forward") -> dict[str, int]:
    """Return the factor (+1 or -1) of each signed channel from one axis system to another.

    ``rotation`` matters only where one of the two is ``machine``. Channels that are not named keep
    their sign: FX, FZ, IA and KAPPA are the same in all four (the systems differ by half turns about x,
    which keep a rotation about x, and FZ is the load).

    >>> signs("machine", "SAE", "reverse")
    {'SA': 1, 'FY': -1, 'MZ': 1}
    >>> signs("ISO-W", "adapted-SAE")
    {'SA': 1, 'FY': -1, 'MZ': -1}
    """
    from_source, from_target = _from_sae(source, rotation), _from_sae(target, rotation)
    return {symbol: from_source[symbol] * from_target[symbol] for symbol in from_source}


def hub_signs(source: Axes, rotation: Rotation = "forward") -> dict[str, int]:
    """Return the factor (+1 or -1) of FX, FZ, MX and MY of a hub from an axis system to SAE.

    As vectors: unlike an angle or slip, the hub's forces turn with the half turn of a reversed drum.

    >>> hub_signs("ISO-W")
    {'FX': 1, 'FZ': 1, 'MX': 1, 'MY': -1}
    >>> hub_signs("machine", "reverse")
    {'FX': -1, 'FZ': 1, 'MX': -1, 'MY': -1}
    """
    along = -1 if source == "machine" and rotation == "reverse" else 1
    across = -1 if source == "ISO-W" else along
    return {"FX": along, "FZ": 1, "MX": along, "MY": across}


def seen_by_cells(rotation: Rotation, reversal: Reversal) -> Rotation:
    """Return the direction of a run as cells in the carriage see it.

    A tire can roll backwards in two ways: the drum is reversed, or the tire is turned round on the hub
    and the drum goes on. In the second the axes of the cells still follow the travel.

    >>> seen_by_cells("reverse", "tire")
    'forward'
    """
    return "forward" if reversal == "tire" else rotation


def _from_sae(axes: Axes, rotation: Rotation) -> dict[str, int]:
    if axes == "SAE":
        return {"SA": 1, "FY": 1, "MZ": 1}
    if axes == "adapted-SAE":
        return {"SA": -1, "FY": 1, "MZ": 1}
    if axes == "ISO-W":
        return {"SA": -1, "FY": -1, "MZ": -1}
    if axes == "machine":
        return {"SA": 1, "FY": 1 if rotation == "forward" else -1, "MZ": 1}
    raise ValueError(f"unknown axis system {axes!r}; one of {', '.join(AXES)}")


def load_dimension(name: str) -> Literal["force", "moment"] | None:
    """Return what a load of a name is; None where it may be either.

    >>> load_dimension("FZ"), load_dimension("MZ"), load_dimension("preload")
    ('force', 'moment', None)
    """
    return "force" if _FORCE.match(name) else "moment" if _MOMENT.match(name) else None
