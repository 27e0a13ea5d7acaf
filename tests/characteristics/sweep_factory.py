"""Steered tires that are integrated apart from the toolkit: relaxation, a carcass as a spring, a string."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.integrate import solve_ivp

from toolkit.reduction.sweep import Sweep

STIFFNESS, PEAK, SHAPE, CONICITY = 60_000.0, 4000.0, 1.3, 40.0
LOAD = 4000.0
Form = Literal["constant", "spring"]


def curve(angle: np.ndarray | float) -> np.ndarray:
    """Return FY of the steady tire [N], SAE."""
    x = STIFFNESS / (PEAK * SHAPE) * np.asarray(angle)
    return -PEAK * np.sin(SHAPE * np.arctan(x)) + CONICITY


def curve_slope(angle: float) -> float:
    x = STIFFNESS / (PEAK * SHAPE) * angle
    return float(np.cos(SHAPE * np.arctan(x)) / (1 + x * x))


def triangle(t: np.ndarray, *, amplitude: float, rate: float) -> np.ndarray:
    """Return a slip angle that is steered up and down at a rate, from zero [rad]."""
    return amplitude * (2 / np.pi) * np.arcsin(np.sin(np.pi / 2 * rate / amplitude * t))


def relaxing(
    t: np.ndarray, steered: Callable[[np.ndarray], np.ndarray], *, length: float, V: float, form: Form
) -> np.ndarray:
    """Return FY [N] of a tire whose slip angle follows over a length, by an integrator of its own."""

    def rate(time: float, angle: np.ndarray) -> np.ndarray:
        falls = curve_slope(float(angle[0])) if form == "spring" else 1.0
        return V / (length * falls) * (steered(np.array([time])) - angle)

    solved = solve_ivp(
        rate, (t[0], t[-1]), [0.0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=float(t[1] - t[0])
    )
    return curve(solved.y[0])


def string(
    t: np.ndarray,
    steered: Callable[[np.ndarray], np.ndarray],
    *,
    length: float,
    half_contact: float,
    V: float,
) -> np.ndarray:
    """Return FY [N] of a stretched string that adheres to the road (Pacejka 2012, 5.3).

    Points that have entered stay where they are; the string leaves the contact without a kink, and decays
    outside over ``length``. Its force is that of all its deflection.
    """
    c = STIFFNESS / (2 * (length + half_contact) ** 2)
    s = V * t

    def entering(place: float, y: np.ndarray) -> np.ndarray:
        psi = steered(np.array([place / V]))
        return psi - (y - half_contact * psi) / length

    dense = solve_ivp(
        entering, (0.0, s[-1]), [0.0], rtol=1e-8, atol=1e-12, dense_output=True, max_step=half_contact / 2
    ).sol

    def entered(place: np.ndarray) -> np.ndarray:
        return np.where(place > 0, dense(np.maximum(place, 0.0))[0], 0.0)

    x = np.linspace(-half_contact, half_contact, 41)
    psi = steered(t)
    inside = entered((s[:, None] - half_contact + x).ravel()).reshape(len(s), -1) - psi[:, None] * x
    ends = inside[:, 0] + inside[:, -1]
    return -c * (np.trapezoid(inside, x, axis=1) + length * ends)


def sweep(
    t: np.ndarray, SA: np.ndarray, FY: np.ndarray, *, V: float | np.ndarray = 2.128, load: float = LOAD,
    stretches: tuple[slice, ...] | None = None, name: str = "sweep", rotation: str = "forward",
    speed_u: float = 0.0,
) -> Sweep:  # fmt: skip
    """Return signals as the reduction hands them on."""
    return Sweep(
        file=name, file_sha256="", rotation="reverse" if rotation == "reverse" else "forward", first_row=1,
        last_row=len(t), t=t, SA=SA, FY=FY, FZ=np.full_like(t, load), V=np.broadcast_to(V, t.shape) * 1.0,
        stretches=(slice(0, len(t)),) if stretches is None else stretches,
        explained=np.zeros((len(t), 0)), speed_u=speed_u,
    )  # fmt: skip


def swept(length: float, *, speeds: tuple[float, ...] = (2.0, 4.0), tau: float = 0.0, load: float = LOAD,
          rotation: str = "forward", noise: float = 5.0, seed: int = 1) -> tuple[Sweep, ...]:  # fmt: skip
    """Return sweeps of a tire at several speeds, FY late by tau."""
    rng, sweeps = np.random.default_rng(seed), []
    for V in speeds:
        t = np.arange(0.0, 24.0 * 2.0 / V, 0.02)

        def steered(at: np.ndarray, V: float = V) -> np.ndarray:
            return triangle(at, amplitude=np.radians(1.5), rate=np.radians(V / 2.0))

        FY = relaxing(t, steered, length=length, V=V, form="constant")
        late = np.interp(t - tau, t, FY) + noise * rng.standard_normal(len(t))
        sweeps.append(sweep(t, steered(t), late, V=V, load=load, rotation=rotation, name=f"{V} m per s"))
    return tuple(sweeps)
