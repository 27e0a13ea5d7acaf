"""A tire, a drive and a setting for effects, written apart from the toolkit's own tires.

FY = -D tanh(C SA / D) with C and D in proportion to the load, MZ = a sixth of a 0.12 m patch times -FY where
the patch adheres: any odd, saturating curve does for what effects promise.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from toolkit.effects.forward import similar
from toolkit.effects.signals import Drive, Setting, Tire, TireForces, drive

PEAK, SLOPE, TRAIL = 1.0, 15.0, 0.02  # of the load: friction [1], stiffness [1/rad]; trail [m]
NOMINAL = 4000.0
SPEED = 2.0


def steady(SA, d: Drive) -> TireForces:
    load = np.maximum(d.FZ, 0.0)
    FY = -PEAK * load * np.tanh(SLOPE * SA / PEAK)
    return TireForces(FY=FY + 8000.0 * d.IA * load / NOMINAL, MZ=-TRAIL * FY / np.cosh(SLOPE * SA))


def tire(d: Drive) -> TireForces:
    return similar(steady, d)


def driven(SA=0.02, FZ=NOMINAL, *, t=None, V=SPEED, n=50) -> Drive:
    t = np.linspace(0.0, 5.0, n) if t is None else t
    zero = np.zeros(len(t))
    return drive(t, zero + SA, zero + FZ, V=V)


def setting(t, **changed) -> Setting:
    zero = np.zeros(len(t))
    base = Setting(
        t=t,
        elapsed_s=t - (t[0] if len(t) else 0.0),
        channels={
            "TIRE_ANGLE": 7.0 * t,
            "DRUM_ANGLE": 1.5 * t,
            "T_AMBIENT": zero + 294.0 + 0.2 * t,
            "T_TREAD": zero + 294.0 + 2.0 * t,
            "from": 3.0 * np.sin(t),
        },
        first={"T_AMBIENT": 294.0, "T_TREAD": 294.0},
        nominal_load_N=NOMINAL,
        nominal_speed_m_s=SPEED,
    )
    return dataclasses.replace(base, **changed)


def forces(effect, values, d: Drive, **changed) -> TireForces:
    """Return the tire's forces with one effect on its drive."""
    rig: Tire = tire
    return tire(effect.drive(d, values, setting(d.t, **changed), rig))
