"""Signals between the stages of the forward chain, time-resolved, float64 in SI, all of one length."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from toolkit.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """What the tire is driven by, SAE signs of the slip angle; each field has shape (n,).

    ``friction``, ``stiffness`` and ``trail`` scale the steady tire by its similarity: peak force, slope at
    zero slip, and the moment beyond what its force gives (Pacejka, Tire and Vehicle Dynamics, 2012, 4.2.1).
    ``FY`` and ``MZ`` are forces and moments that come on top [N, N·m], in the machine's axes.
    """

    t: Array
    SA: Array
    FZ: Array
    IA: Array
    V: Array
    pressure_error: Array
    friction: Array
    stiffness: Array
    trail: Array
    FY: Array
    MZ: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TireForces:
    """FY [N] and MZ [N·m] in the machine's axes, each of shape (n,)."""

    FY: Array
    MZ: Array


Tire = Callable[[Drive], TireForces]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting:
    """One run: its conditions, its other channels in SI under their names, and what is nominal.

    ``elapsed_s`` is the time since the case's first row; ``first`` the values of channels at that row, to
    which temperatures are counted; ``slip_work_before_kJ`` what earlier runs put into the tire.
    ``travel`` is +1 with the drum forward and -1 reversed (or +1 where the axes follow the travel);
    ``facing`` is the sign with which a force that is fixed to the tire's sides shows: -1 for a tire that
    was turned round on the hub.
    """

    t: Array
    elapsed_s: Array
    channels: Mapping[str, Array] = field(default_factory=dict)
    conditions: Mapping[str, str] = field(default_factory=dict)
    first: Mapping[str, float] = field(default_factory=dict)
    slip_work_before_kJ: float = 0.0
    nominal_load_N: float = 4000.0
    nominal_speed_m_s: float = 2.128
    travel: float = 1.0
    facing: float = 1.0

    def channel(self, *names: str) -> Array | None:
        """Return the first of these channels that was recorded, None where none was."""
        return next((self.channels[name] for name in names if name in self.channels), None)


def drive(
    t: Array,
    SA: Array,
    FZ: Array,
    *,
    IA: Array | float = 0.0,
    V: Array | float = 2.128,
    pressure_error: Array | float = 0.0,
) -> Drive:
    """Return a drive that no effect has touched."""
    zero, unity = np.zeros(len(t)), np.ones(len(t))
    return Drive(
        t=t,
        SA=SA,
        FZ=FZ,
        IA=zero + IA,
        V=zero + V,
        pressure_error=zero + pressure_error,
        friction=unity,
        stiffness=unity,
        trail=unity,
        FY=zero,
        MZ=zero,
    )
