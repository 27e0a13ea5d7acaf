"""A thousand curves of one load, with their truth, and an oracle: fifty random bounded starts by scipy.

Truths: the Magic Formula, an analytic brush, and MF 5.2 (Pacejka's book, table A3.1: 205/60R15); loads
of bicycle, passenger and truck tires; 9 to 500 points; noise of 0.5 to 5 % of the peak, white or of a
first-order autoregression; some curves of one sign, some that end before their peak.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.tires.model import Curve
from toolkit.tires.models.magic_formula import jacobian, value

# Pacejka (2012), table A3.1, pure lateral part; ISO sign definition.
_BOOK = {
    "PCY1": 1.193, "PDY1": 0.990, "PDY2": -0.145, "PDY3": 11.23, "PEY1": 1.003, "PEY2": 0.537,
    "PEY3": 0.083, "PEY4": 4.787, "PKY1": -14.95, "PKY2": 2.130, "PKY3": 0.028, "PHY1": 0.003,
    "PHY2": 0.001, "PVY1": 0.045, "PVY2": -0.024,
}  # fmt: skip
_LOADS = {"bicycle": (200.0, 600.0), "passenger": (1100.0, 6100.0), "truck": (8000.0, 40000.0)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A curve with the truth at its rows, its slope and value at SA = 0, and what kind it is.

    ``theta`` are the six parameters of a Magic Formula truth, None for the others.
    """

    curve: Curve
    truth: np.ndarray
    slope: float
    level: float
    theta: tuple[float, ...] | None
    kind: str
    noise: str
    one_sided: bool


def samples(count: int, seed: int = 4) -> list[Sample]:
    """Return ``count`` curves of a seed."""
    rng = np.random.default_rng(seed)
    return [_sample(rng, index) for index in range(count)]


def _sample(rng: np.random.Generator, index: int) -> Sample:
    kind = ("magic", "brush", "mf52")[index % 3]
    load = rng.uniform(*_LOADS[("bicycle", "passenger", "truck")[int(rng.integers(3))]])
    channel = "MZ" if kind == "magic" and rng.random() < 0.4 else "FY"
    n = int(np.round(np.exp(rng.uniform(np.log(9), np.log(500)))))
    reach = np.radians(rng.uniform(4.0, 15.0))  # a third of them ends before the peak
    one_sided = bool(rng.random() < 0.12)
    SA = np.sort(rng.uniform(0.0 if one_sided else -reach, reach, n)) if n > 40 else None
    if SA is None:
        SA = np.linspace(np.radians(0.3) if one_sided else -reach, reach, n)
    theta = None
    if kind == "magic":
        theta = _magic(rng, load, channel)
        make = _of(theta)
    elif kind == "brush":
        make = _brush(rng, load)
    else:
        make = _mf52(load)
    y = make(SA)
    sd = rng.uniform(0.005, 0.05) * np.abs(y).max()
    colour = "AR" if n > 60 and rng.random() < 0.5 else "white"
    noise = rng.normal(0.0, sd, n)
    if colour == "AR":
        rho = rng.uniform(0.5, 0.9)
        for k in range(1, n):
            noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho**2) * noise[k]
    h = 1e-5
    ends = make(np.array([-h, 0.0, h]))
    return Sample(
        curve=Curve(SA=SA, y=y + noise, channel=channel, load_N=load),
        truth=y,
        slope=float((ends[2] - ends[0]) / (2 * h)),
        level=float(ends[1]),
        theta=theta,
        kind=kind,
        noise=colour,
        one_sided=one_sided,
    )


def _magic(rng: np.random.Generator, load: float, channel: str) -> tuple[float, ...]:
    Sh = rng.normal(0, 0.004)
    if channel == "FY":
        D = -load * rng.uniform(0.7, 1.2)
        return rng.uniform(6, 18), rng.uniform(1.1, 1.6), D, rng.uniform(-3, 0.7), Sh, 0.02 * D * rng.normal()
    D = load * rng.uniform(0.01, 0.04)
    return rng.uniform(6, 16), rng.uniform(1.8, 2.7), D, rng.uniform(-4, 0.5), Sh, 0.02 * D * rng.normal()


def _of(theta: tuple[float, ...]):  # type: ignore[no-untyped-def]
    return lambda SA: value(theta, SA)


def _brush(rng: np.random.Generator, load: float):  # type: ignore[no-untyped-def]
    stiffness, mu, shift = rng.uniform(8, 22) * load, rng.uniform(0.7, 1.1), rng.normal(0, 0.004)

    def make(SA: np.ndarray) -> np.ndarray:
        # Pacejka (2012) eq. 3.11: parabolic pressure, until all slides.
        s = np.tan(SA + shift)
        t = np.minimum(stiffness * np.abs(s) / (3 * mu * load), 1.0)
        return -np.sign(s) * mu * load * (1 - (1 - t) ** 3)

    return make


def _mf52(load: float):  # type: ignore[no-untyped-def]
    # The book's tire is one of 4000 N; a truck's or a bicycle's is it, scaled by its load.
    scale = load / float(np.clip(load, 1500.0, 6500.0))
    FZ = load / scale
    from toolkit.tires.models.mf52 import side
    from toolkit.tires.slip import state

    def make(SA: np.ndarray) -> np.ndarray:
        return scale * np.asarray(side(_BOOK, state(_BOOK, SA=SA, FZ=FZ, FNOMIN=4000.0)).FY)

    return make


def box(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the files contract for B, C, D, E, Sh, Sv."""
    top, span, shift = np.abs(curve.y).max(), np.ptp(curve.SA), np.radians(10.0)
    low = np.array([0.05 / span, 1e-3, -3 * top, -20.0, -shift, -top])
    return low, np.array([50.0 / span, 4.0, 3 * top, 1.0, shift, top])


def cost(theta: np.ndarray, curve: Curve) -> float:
    """Return the sum of squares of a parameter set [channel's unit squared]."""
    return float(np.sum((value(theta, curve.SA) - curve.y) ** 2))


def oracle(curve: Curve, rng: np.random.Generator, starts: int = 50) -> float:
    """Return the lowest cost of random bounded starts in the box, by scipy's trust region."""
    from scipy.optimize import least_squares

    low, high = box(curve)
    best = np.inf
    for _ in range(starts):
        share = rng.random(6)
        x = low + share * (high - low)
        x[0] = low[0] * (high[0] / low[0]) ** share[0]
        found = least_squares(
            lambda p: value(p, curve.SA) - curve.y,
            x,
            jac=lambda p: jacobian(p, curve.SA).T,
            bounds=(low, high),
            x_scale=(high - low) / 10,
            max_nfev=200,
        )
        best = min(best, 2 * float(found.cost))
    return best
