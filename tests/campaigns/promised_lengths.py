"""What `toolkit plan test` promises of a relaxation length, against what its sweeps then say of drawn tires.

    python -m tests.campaigns.promised_lengths [--plans 5] [--times 20] [--seed 2600] [--noise 1]

A plan is asked for by a tire file that is drawn, with a demand that is drawn. Its sweeps are then steered
on tires that the planner has not seen: curve, length and form of the answer are drawn (a constant length, a
carcass as a spring, a stretched string), integrated apart from the toolkit; so are a delay between the
channels that nobody states, the load at which the actuator stops and how the length goes with it, an error
of the speed's scale, noise of any colour, and lines of tire and drum, whose angles are recorded. Held
against the truth: U reached over U promised, and errors within the U that the sweeps state. ``--noise``
times the density that the planner's earlier test has.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from tests.campaigns.promised_tests import drawn_tire
from tests.coverage.rows import exact_interval
from toolkit.characteristics.sweep_fit import SweepFit, fit_sweep
from toolkit.characteristics.sweep_length import relaxation_length
from toolkit.declared import answer as declared_answer
from toolkit.lab.plans.protocol_plan import ProtocolOrder, plan_test
from toolkit.machine import load_machine
from toolkit.reduction.sweep import Sweep

MACHINE = load_machine("m15-virtual")
FORMS = ("constant", "spring", "string")
ROW_S = 0.02
SPEED_U = 0.002
DENSITY = 0.003  # of the virtual machine's side force [N^2 s], as its settled blocks have it


@dataclass(frozen=True, slots=True, kw_only=True)
class Tire:
    """A drawn tire at its nominal load: stiffness [N/rad], peak [N], shape, offset [N], length [m], form."""

    stiffness: float
    peak: float
    shape: float
    offset: float
    length: float
    half_contact: float
    form: str
    with_load: float

    def steady(self, angle: np.ndarray | float) -> np.ndarray:
        x = self.stiffness / (self.peak * self.shape) * np.asarray(angle)
        return -self.peak * np.sin(self.shape * np.arctan(x)) + self.offset

    def falls(self, angle: float) -> float:
        x = self.stiffness / (self.peak * self.shape) * angle
        return math.cos(self.shape * math.atan(x)) / (1 + x * x)

    @property
    def lag(self) -> float:
        """The mean distance by which it is late, turn slip while steering among it."""
        return self.length + (self.half_contact if self.form == "string" else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One tire: error, U that its sweeps state, U promised, and the form of its answer."""

    error: float
    U: float
    promised: float
    form: str


def drawn(rng: np.random.Generator, stiffness: float) -> Tire:
    own = stiffness * rng.uniform(0.7, 1.2)
    return Tire(
        stiffness=own, peak=4000.0 * rng.uniform(0.8, 1.2), shape=rng.uniform(1.2, 1.5),
        offset=rng.uniform(-150, 150), length=rng.uniform(0.2, 0.65), half_contact=rng.uniform(0.04, 0.07),
        form=str(rng.choice(FORMS)), with_load=rng.uniform(0, 1),
    )  # fmt: skip


def answer(tire: Tire, s: np.ndarray, SA: np.ndarray, factor: float) -> np.ndarray:
    """Return FY [N] over the distance rolled [m], the lengths times a factor."""

    def steered(place: np.ndarray | float) -> np.ndarray:
        return np.interp(place, s, SA)

    length = tire.length * factor
    if tire.form != "string":

        def rate(place: float, angle: np.ndarray) -> np.ndarray:
            falls = tire.falls(float(angle[0])) if tire.form == "spring" else 1.0
            return (steered(place) - angle) / (length * falls)

        solved = solve_ivp(rate, (s[0], s[-1]), [0.0], t_eval=s, rtol=1e-6, atol=1e-9, max_step=0.1)
        return tire.steady(solved.y[0])
    a = tire.half_contact * factor

    def entering(place: float, y: np.ndarray) -> np.ndarray:
        return steered(place) - (y - a * steered(place)) / length

    path = solve_ivp(entering, (0, s[-1]), [0.0], rtol=1e-6, atol=1e-10, max_step=0.1, dense_output=True).sol
    x = np.linspace(-a, a, 21)
    places = s[:, None] - a + x
    y = np.where(places > 0, path(np.maximum(places, 0).ravel())[0].reshape(places.shape), 0.0)
    inside = y - SA[:, None] * x
    effective = np.trapezoid(inside, x, axis=1) + length * (inside[:, 0] + inside[:, -1])
    return tire.steady(effective / (2 * (length + a) ** 2))


def recorded(
    tire: Tire, asked: dict[str, Any], rng: np.random.Generator, *, tau: float, scale: float, density: float
) -> Sweep:
    """Return one planned sweep as the machine records it; ``density`` of the noise [N^2 s]."""
    V, rate = asked["speed_m_s"], math.radians(asked["steer_rate_deg_s"])
    amplitude = math.radians(asked["amplitude_deg"])
    t = np.arange(0.0, asked["cycles"] * 4 * amplitude / rate, ROW_S)
    SA = 2 / np.pi * amplitude * np.arcsin(np.sin(np.pi / 2 * rate / amplitude * t))
    load = asked["loads_N"][0] * (1 + 0.03 * rng.uniform(-1, 1))
    FY = answer(tire, V * t, SA, (load / asked["loads_N"][0]) ** tire.with_load)
    FY = np.interp(t - tau, t, FY)
    rho = rng.uniform(0.0, 0.9)
    # Of this density at low frequency: a first-order autoregression of (1 + rho) / (1 - rho) repeated rows.
    white = rng.standard_normal(len(t) + 200) * math.sqrt(density / ROW_S) * (1 - rho)
    FY = FY + lfilter([1.0], [1.0, -rho], white)[200:]
    wheel, drum = V * t / 0.306, V * t / 1.353
    for angle, size in ((wheel, 15.0), (2 * wheel, 5.0), (drum, 5.0)):
        FY = FY + size * rng.uniform(0, 1) * np.cos(angle + rng.uniform(0, 2 * np.pi))
    waves = [wave(n * angle) for angle in (wheel, drum) for n in (1, 2) for wave in (np.cos, np.sin)]
    return Sweep(
        file=f"{V}", file_sha256="", rotation="forward", first_row=1, last_row=len(t), t=t,
        SA=SA + math.radians(0.003) * rng.standard_normal(len(t)), FY=FY, FZ=np.full_like(t, load),
        V=np.full_like(t, V * (1 + scale)), stretches=(slice(0, len(t)),),
        explained=np.column_stack(waves), speed_u=SPEED_U,
    )  # fmt: skip


def outcomes(number: int, times: int, seed: int, noise: float) -> Iterator[Outcome]:
    """Yield what a plan promised, and what each tire's sweeps say."""
    rng = np.random.default_rng([seed, number])
    load = float(rng.choice(MACHINE.protocol.loads_N[1:]))
    U = float(rng.choice([25.0, 40.0, 60.0]))
    with tempfile.TemporaryDirectory() as place:
        order = ProtocolOrder(
            like=(drawn_tire(Path(place), rng),), demands=(f"relaxation_length={U:g} mm",),
            loads=(f"{load:.1f} N",),
        )  # fmt: skip
        plan = declared_answer(plan_test(order)[0])
    (value,) = plan["values"]
    sys.stderr.write(f"{number}: {U:g} mm at {load:.0f} N: {plan['sweeps']['recordings']}\n")
    for time in range(times):
        draws = np.random.default_rng([seed, number, time])
        tire = drawn(draws, 14.0 * load)
        tau, scale = 0.01 * draws.standard_normal(), SPEED_U * draws.standard_normal()
        density = noise * DENSITY * draws.uniform(0.7, 1.4) ** 2
        fits = [
            fit_sweep(recorded(tire, asked, draws, tau=tau, scale=scale, density=density), MACHINE.sweeping)
            for asked in plan["sweeps"]["recordings"]
        ]
        sure: list[SweepFit] = [fit for fit in fits if fit is not None]
        number_of = relaxation_length(sure, load_N=load, owner="m", test="t") if sure else None
        if number_of is None:
            sys.stderr.write(f"{number}, {time}: no length\n")
            continue
        estimate = number_of.estimate()
        yield Outcome(
            error=estimate.value - tire.lag, U=estimate.expanded()[0], promised=value["planned_U"],
            form=tire.form,
        )  # fmt: skip


def table(every: list[Outcome]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield (
        "| answer | tires | within its own U, % | 95 % of it | U reached / promised, median (5 to 95 %) "
        "| mean error, mm | median U, mm |"
    )
    yield "|---|---|---|---|---|---|---|"
    for form in ("all", *FORMS):
        mine = [one for one in every if form in ("all", one.form)]
        held = sum(abs(one.error) <= one.U for one in mine)
        low, high = exact_interval(held, len(mine))
        ratios = np.quantile([one.U / one.promised for one in mine], [0.5, 0.05, 0.95])
        yield (
            f"| {form} | {len(mine)} | {100 * held / len(mine):.1f} | {100 * low:.1f} to {100 * high:.1f} | "
            f"{ratios[0]:.2f} ({ratios[1]:.2f} to {ratios[2]:.2f}) | "
            f"{1e3 * np.mean([one.error for one in mine]):+.1f} | "
            f"{1e3 * np.median([one.U for one in mine]):.0f} |"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.promised_lengths", description=__doc__)
    parser.add_argument("--plans", type=int, default=5)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=2600)
    parser.add_argument("--noise", type=float, default=1.0)
    given = parser.parse_args()
    every = [
        one for number in range(given.plans) for one in outcomes(number, given.times, given.seed, given.noise)
    ]
    sys.stdout.write("\n".join(table(every)) + "\n")


if __name__ == "__main__":
    main()
