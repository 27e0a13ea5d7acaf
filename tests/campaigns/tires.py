"""Readings of a tire that is known by its equations: every load, every slip angle, in SAE axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.reduction.physics import Readings

Force = Callable[[NDArray[np.float64], float], Any]


def sweep(
    SA: NDArray[np.float64],
    loads_N: Sequence[float],
    *,
    FY: Force,
    MZ: Force,
    trail_m: float,
    reverse: bool = False,
    signed: bool = True,
) -> Readings:
    """Return readings of FY(SA, FZ) [N] and MZ(SA, FZ) [N·m] at slip angles [rad] and loads."""
    places, blocks = [], []
    for load in loads_N:
        places += [f"{np.degrees(a):+.1f} deg, {load:.0f} N" for a in SA]
        blocks += [(float(a), float(load)) for a in SA]
    FZ = np.repeat(np.asarray(loads_N, dtype=np.float64), len(SA))
    none = np.zeros(len(FZ))
    return Readings(
        place=tuple(places), FZ=FZ, SA=np.tile(SA, len(loads_N)),
        FY=np.concatenate([np.asarray(FY(SA, load)) for load in loads_N]),
        MZ=np.concatenate([np.asarray(MZ(SA, load)) for load in loads_N]),
        reverse=np.full(len(FZ), reverse), block=tuple(blocks), u_FY=none, u_MZ=none, FX=none, IA=none,
        trail_m=trail_m, signed=signed,
    )  # fmt: skip
