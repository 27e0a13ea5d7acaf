"""Pull: conicity, plysteer, CRAT and PRAT from a forward and a reversed run.

By symmetry conicity keeps FY and flips MZ under x -> -x; plysteer flips FY and keeps MZ under a half turn
about z. With F and R the values at SA = 0 in machine-fixed axes (cells in the carriage, the drum reversed):

    conicity = (F + R)/2   plysteer = (F - R)/2   of FY
    CRAT     = (F - R)/2   PRAT     = (F + R)/2   of MZ

In axes that follow the travel, and where the tire is turned round on the hub in place of the drum, FY of the
reversed run has the other sign and MZ the same, so the same physics reads conicity = (F - R)/2 there. The
source document's own formulas take (F + R)/2 for CRAT and (F - R)/2 for PRAT on machine-fixed values; they
are given apart under its name. PRAT has two definitions there too: MZ at 0 deg, and MZ at FY = 0, which an
error of the steering zero does not move; each is given by symmetry and by the source document's formula.

Which zero cancels follows from the axes. A zero of the slip angle moves FY of both runs by dFY/dSA in axes
that follow the travel: it is whole in plysteer = (F + R)/2 and cancels in conicity = (F - R)/2. A zero of
the cells, fixed in the machine, is turned with the axes of the reversed run: it cancels in plysteer and is
whole in conicity. With the tire turned round on the hub nothing turns the cells: both zeros are whole in
plysteer, and cancel in conicity.
"""

from __future__ import annotations

from toolkit.characteristics.direction import CHANNELS
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.uncertain import Uncertain, weighted

NAMES = (
    "conicity",
    "plysteer",
    "CRAT",
    "PRAT",
    "PRAT_at_FY_zero",
    "thesis_CRAT",
    "thesis_PRAT",
    "thesis_PRAT_at_FY_zero",
    "residual_forward",
    "residual_reverse",
)


def pull(forward: Reader | None, reverse: Reader | None) -> dict[str, Uncertain]:
    """Return the pull characteristics of one load by name; those that a direction lacks are left out.

    Parameters
    ----------
    forward, reverse : curves in SAE axes that follow the travel, at one common load
    """
    found: dict[str, Uncertain | None] = {}
    sides = [one for one in (forward, reverse) if one is not None and one.covers_zero()]
    at_zero = {c: [one.value(c, 0.0) for one in sides] for c in CHANNELS}
    if len(sides) == 2:
        found["conicity"] = _half(at_zero["FY"], -1.0)
        found["plysteer"] = _half(at_zero["FY"], 1.0)
        found["CRAT"] = _half(at_zero["MZ"], -1.0)
        found["PRAT"] = _half(at_zero["MZ"], 1.0)
        # MZ is the same in machine-fixed axes and in those that follow the travel: the source document's
        # pair for MZ is this pair with the names exchanged.
        found["thesis_CRAT"], found["thesis_PRAT"] = found["PRAT"], found["CRAT"]
    residual = [None if one is None else one.moment_without_force() for one in (forward, reverse)]
    found["residual_forward"], found["residual_reverse"] = residual
    found["PRAT_at_FY_zero"] = _half(residual, 1.0)
    found["thesis_PRAT_at_FY_zero"] = _half(residual, -1.0)
    return {name: one for name in NAMES if (one := found.get(name)) is not None}


def _half(pair: list[Uncertain | None], sign: float) -> Uncertain | None:
    one, other = pair
    return None if one is None or other is None else weighted([(0.5, one), (sign / 2, other)])
