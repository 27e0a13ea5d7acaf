"""Parameters of models over all loads as a table of text, one line each: the one form of all models.

A line has name, unit, default, low, high, size, stage, needs, text; a table of one unit or one stage leaves
that column out and names it. ``needs`` are marks, ``-`` for none: ``2`` and ``3`` loads, ``c`` camber, ``p``
pressure, ``P`` three pressures, ``v`` speed, ``s`` both signs of slip, ``k`` longitudinal slip, ``K`` of both
signs, ``a`` slip angle and longitudinal slip together. What each column means stands in `global_model`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from toolkit.tires.global_model import GlobalParameter

if TYPE_CHECKING:
    from toolkit.tires.global_model import Channel, Need

_NEEDS: dict[str, str] = {
    "2": "two_loads", "3": "three_loads", "c": "camber", "p": "pressure", "P": "three_pressures",
    "v": "speed", "s": "both_signs", "k": "kappa", "K": "both_kappas", "a": "alpha_and_kappa",
}  # fmt: skip

SHIFT = """
SH    rad    0.0  -0.1   0.1   0.001  FY  s  equivalent slip angle of plysteer and steering zero
"""
CAMBER = """
K_IA  1      0.0  -0.5   1.0   0.02   FY  c  equivalent slip angle of camber, per rad
"""
OFFSETS = """
SV    1      0.0  -0.2   0.2   0.01   FY  s  offset of FY over load (conicity)
SM    m      0.0  -0.05  0.05  0.001  MZ  s  offset of MZ over load
"""


def parameters(
    text: str, *, stage: Channel | None = None, unit: str | None = None
) -> tuple[GlobalParameter, ...]:
    """Return the parameters of a table; ``stage`` or ``unit`` stand for the column that it leaves out.

    >>> one, = parameters("MU 1 1.0 0.05 5.0 0.05 FY 2c friction at FNOMIN")
    >>> one.low, one.needs, one.text
    (0.05, ('two_loads', 'camber'), 'friction at FNOMIN')
    """
    rows = []
    for line in filter(None, text.splitlines()):
        name, line = line.split(maxsplit=1)
        own_unit, line = (unit, line) if unit is not None else line.split(maxsplit=1)
        default, low, high, size, line = line.split(maxsplit=4)
        own_stage, line = (stage, line) if stage is not None else line.split(maxsplit=1)
        needs, words = line.split(maxsplit=1)
        rows.append(
            GlobalParameter(
                name=name,
                unit=own_unit,
                default=float(default),
                low=float(low),
                high=float(high),
                size=float(size),
                text=words,
                stage=cast("Channel", own_stage),
                needs=tuple(cast("Need", _NEEDS[mark]) for mark in needs.replace("-", "")),
            )
        )
    return tuple(rows)
