"""Cases with a mechanical motion: a driven pendulum, a positioning drive, and its motor force.

True friction is a LuGre bristle (Canudas de Wit, Olsson, Astrom, Lischinsky 1995) with an inner state,
    never a
sign function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd

from proof import ode, specs
from proof.instruments import sampled
from proof.model import Array, Channel, Effects, EffectSpec, Noise, Parameter, Params, Run, Scenario
from proof.noise import anti_alias
from proof.plans import source, walk, wave
from proof.simulators import drive as drive_simulator
from proof.simulators import drive_force as force_simulator
from proof.simulators import pendulum as pendulum_simulator

OVER = 5
COLOURS: tuple[tuple[float, ...], ...] = ((), (0.5,), (0.9,), (1.1, -0.3))


def bristle(v: float, z: float, coulomb: float, presliding: float) -> tuple[float, float]:
    """Return the LuGre friction and the rate of its bristle: sigma_0 = coulomb / presliding."""
    stiffness = coulomb / presliding
    rate = v - abs(v) * z / presliding
    return stiffness * z + 0.02 * stiffness * rate * presliding, rate


def left_out(x: float, v: float, z: float, e: Effects, presliding: float) -> tuple[float, float]:
    """Return the acceleration that the nominal leaves out, and the bristle's rate."""
    a, rate = 0.0, 0.0
    if "constant_force" in e:
        a += e["constant_force"]["force"]
    if "viscous_damping" in e:
        a -= e["viscous_damping"]["viscous"] * v
    if "quadratic_drag" in e:
        a -= e["quadratic_drag"]["drag"] * v * abs(v)
    if "cubic_stiffness" in e:
        a -= e["cubic_stiffness"]["k3"] * x**3
    if "periodic_ripple" in e:
        p = e["periodic_ripple"]
        a += p["amplitude"] * math.sin(2 * math.pi * x / p["period"] + p["phase"])
    if "coulomb_friction" in e:
        force, rate = bristle(v, z, e["coulomb_friction"]["coulomb"], presliding)
        a -= force
    return a, rate


def _motion(
    run: Run,
    e: Effects,
    *,
    rates: Callable[[float, float, dict[str, float]], float],
    inputs: Mapping[str, Array],
    presliding: float,
) -> tuple[Array, Array]:
    """Return true position and velocity; a hidden oscillator rides on the mass where the effect asks for
    one."""
    hidden, gust = e.get("hidden_resonance"), e.get("hidden_gust")

    def rhs(time: float, state: Array, u: dict[str, float]) -> Array:
        x, v, z, q, w = state.tolist()
        added, bristle_rate = left_out(x, v, z, e, presliding)
        a = rates(x, v, u) + added + u.get("push", 0.0)
        if gust:
            a += gust["force"] * sum(math.exp(-(((time - at) / gust["seconds"]) ** 2)) for at in gust["at"])
        q_rate, w_rate = 0.0, 0.0
        if hidden:
            omega = 2 * math.pi * hidden["frequency"]
            pull = omega * omega * q + 0.06 * omega * w
            a += hidden["share"] * pull
            q_rate, w_rate = w, -pull - a
        return np.array([v, a, bristle_rate, q_rate, w_rate])

    t = run.fine["t"]
    driven = dict(inputs) | {k: run.fine[k] for k in ("push",) if k in run.fine}
    x = ode.truth(rhs, np.zeros(5), t, driven, longest=float(t[1] - t[0]) * 2)
    return x[:, 0], x[:, 1]


def _runs(
    rng: np.random.Generator,
    *,
    rate: float,
    seconds: float,
    count: int,
    signals: Callable[[Array, int], dict[str, Array]],
) -> list[Run]:
    """Return runs whose inputs are held linear between the recorded rows."""
    out, start = [], 0.0
    for i in range(count):
        n = round(seconds * rate) + 8  # a little longer than the rows: the filter's delay is compensated
        knots = start + np.arange(n + 1) / rate
        t = start + np.arange(n * OVER + 1) / (rate * OVER)
        fine = {k: np.interp(t, knots, y) for k, y in signals(knots, i).items()}
        name = f"run{i + 1:02d}.csv" if i < count - 2 else f"more{i - count + 3:02d}.csv"
        out.append(Run(name=name, fine={"t": t} | fine, rows=knots[:-8]))
        start += seconds + 12.0
    return out


def _scenario(
    rng: np.random.Generator,
    *,
    family: str,
    kind: str,
    title: str,
    sim: ModuleType,
    simulation: dict[str, Any],
    parameters: tuple[Parameter, ...],
    runs: list[Run],
    inputs: dict[str, Channel],
    outputs: dict[str, str],
    truth: Callable[[Run, Params, Effects], dict[str, Array]],
    effects: Callable[[dict[str, float]], dict[str, Any]],
    substeps: int = 3,
    share: tuple[float, float] = (0.004, 0.012),
    cutoff_Hz: float | None = None,
) -> Scenario:
    """Return the scenario: noise from the outputs' own spread, nominal by the case's file.

    `cutoff_Hz`: the inputs pass the same anti-alias filter as the outputs; None: they are set, not measured.
    """
    p = {q.name: q.true for q in parameters}
    spread, peak = dict.fromkeys(outputs, 0.0), dict.fromkeys(outputs, 0.0)
    for run in runs:
        for k, y in truth(run, p, {}).items():
            spread[k] = max(spread[k], float(np.ptp(y)) / 2)
            peak[k] = max(peak[k], float(np.abs(y).max()))
    ar = COLOURS[int(rng.integers(len(COLOURS)))]
    level = float(rng.uniform(*share))
    rate = 0.003 if rng.random() < 0.3 else 0.0
    noise = {k: Noise(sd=level * spread[k], ar=ar, outliers=rate) for k in outputs}
    stated = bool(rng.random() < 0.5)
    channels = {"t": Channel(unit="s", role="time"), **inputs}
    channels |= {
        k: Channel(unit=unit, role="output", sd=noise[k].sd if stated else None)
        for k, unit in outputs.items()
    }

    def recorded(run: Run) -> pd.DataFrame:
        t = run.fine["t"]
        passed = {k: anti_alias(t, run.fine[k], cutoff_Hz) if cutoff_Hz else run.fine[k] for k in inputs}
        return pd.DataFrame({"t": run.rows} | {k: np.interp(run.rows, t, y) for k, y in passed.items()})

    def nominal(df: pd.DataFrame, run: Run, q: Params) -> dict[str, Array]:
        if kind == "ode":
            found = ode.nominal(sim, df, q, tuple(inputs), substeps)
            return {k: found[k] for k in outputs}
        table = sim.simulate(df, q)
        return {k: table[k].to_numpy(float) for k in outputs}

    return Scenario(
        family=family, kind=kind, title=title, simulation={"kind": kind, "path": "sim.py", **simulation},
        files={"sim.py": source(sim)}, parameters=parameters, channels=channels, outputs=tuple(outputs),
        runs=tuple(runs[:-2]), predict=tuple(runs[-2:]), noise=noise, inputs=recorded, nominal=nominal,
        truth=truth, effects=effects(peak),
    )  # fmt: skip


def gusts(rng: np.random.Generator, runs: list[Run], force: float) -> EffectSpec:
    """Return pushes of a moment each in two of the recorded runs."""
    starts = [
        float(rng.uniform(*np.quantile(runs[i].rows, (0.2, 0.8)))) for i in rng.permutation(len(runs) - 2)[:2]
    ]
    return specs.spec("hidden_gust", {"force": force, "at": starts, "seconds": 0.8}, "force")


def _prior(rng: np.random.Generator, name: str, value: float, unit: str, share: float) -> Parameter:
    sd = abs(value) * share
    off = float(np.clip(rng.normal(0, sd), -1.8 * sd, 1.8 * sd)) if sd else 0.0
    return Parameter(name=name, declared=value, unit=unit, true=value + off, sd=sd or None)


def pendulum(rng: np.random.Generator) -> Scenario:
    """Return a driven pendulum, kind `ode`: the angle is recorded."""
    rate, seconds = 20.0, float(rng.choice([12.0, 16.0]))
    parameters = (
        _prior(rng, "k", float(rng.uniform(18, 30)), "1/s^2", 0.03),
        _prior(rng, "c", 0.6, "1/s", 0.0),
        _prior(rng, "b", 1.0, "1/(kg*m^2)", 0.04),
    )
    drive = lambda t, i: {"M": wave(rng, t, low=0.2, high=1.1, rms=2.2 + 0.6 * (i % 3))}  # noqa: E731
    runs = _runs(rng, rate=rate, seconds=seconds, count=6, signals=drive)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        def rates(x: float, v: float, u: dict[str, float]) -> float:
            return -p["k"] * math.sin(x) - p["c"] * v + p["b"] * u["M"]

        th, _ = _motion(run, e, rates=rates, inputs={"M": run.fine["M"]}, presliding=0.004)
        return sampled(run, {"TH": th}, e, cutoff_Hz=25.0, compensated=True)

    return _scenario(
        rng, family="pendulum", kind="ode", title="A driven pendulum", sim=pendulum_simulator,
        simulation={"states": ["th", "om"], "force_terms": {"om": "1/s^2"}}, parameters=parameters, runs=runs,
        inputs={"M": Channel(unit="N*m", role="input")}, outputs={"TH": "rad"}, truth=truth,
        effects=lambda peak: specs.motion(rng, coulomb=0.25, viscous=0.08, drag=0.06, cubic=2.0,
            constant=0.15,
                                          ripple=(0.4, 0.25)) | specs.channel(rng, "TH", peak["TH"])
            | {"hidden_gust": gusts(rng, runs, 0.5)},
    )  # fmt: skip


def drive(rng: np.random.Generator) -> Scenario:
    """Return a positioning drive in its loop, kind `ode`: position and control voltage are recorded."""
    rate, seconds = 25.0, float(rng.choice([10.0, 14.0]))
    parameters = (
        _prior(rng, "mass", 95.0, "kg", 0.03),
        _prior(rng, "viscous", 205.0, "N*s/m", 0.06),
        _prior(rng, "gain", 35.15, "N/V", 0.0),
        _prior(rng, "kv", 60.0, "V*s/m", 0.0),
        _prior(rng, "kp", 6.0, "1/s", 0.0),
    )
    reference = lambda t, i: {"R": walk(rng, t, peak=0.12 + 0.04 * (i % 3), hold=1.4)}  # noqa: E731
    runs = _runs(rng, rate=rate, seconds=seconds, count=6, signals=reference)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        def rates(x: float, v: float, u: dict[str, float]) -> float:
            volt = p["kv"] * (p["kp"] * (u["R"] - x) - v)
            return (p["gain"] * volt - p["viscous"] * v) / p["mass"]

        x, v = _motion(run, e, rates=rates, inputs={"R": run.fine["R"]}, presliding=1e-4)
        volt = p["kv"] * (p["kp"] * (run.fine["R"] - x) - v)
        return sampled(run, {"X": x, "U": volt}, e, cutoff_Hz=None, compensated=False)

    return _scenario(
        rng, family="drive", kind="ode", title="A positioning drive under its controller",
            sim=drive_simulator,
        simulation={"states": ["x", "v"], "force_terms": {"v": "N/kg"}}, parameters=parameters, runs=runs,
        inputs={"R": Channel(unit="m", role="input")}, outputs={"X": "m", "U": "V"}, truth=truth, substeps=4,
        effects=lambda peak: specs.motion(rng, coulomb=0.05, viscous=0.4, drag=4.0, cubic=40.0, constant=0.05,
                                          ripple=(0.06, 0.02)) | specs.channel(rng, "U", peak["U"])
            | {"hidden_gust": gusts(rng, runs, 0.15)},
    )  # fmt: skip


def drive_force(rng: np.random.Generator, *, one_speed: bool = False) -> Scenario:
    """Return the motor force of a measured motion, kind `python`; `one_speed`: only +v and -v occur."""
    rate, seconds = 25.0, float(rng.choice([10.0, 14.0]))
    parameters = (
        _prior(rng, "mass", 95.0, "kg", 0.03),
        _prior(rng, "viscous", 205.0, "N*s/m", 0.0 if one_speed else 0.08),
    )

    def motion(t: Array, i: int) -> dict[str, Array]:
        if one_speed:
            v = 0.15 * np.sign(np.sin(2 * np.pi * (t - t[0] + 0.013) / 4.0))
            a = np.zeros_like(v)
        else:
            v = wave(rng, t, low=0.1, high=0.8, rms=0.12 + 0.04 * (i % 3))
            a = np.gradient(v, t)
        return {"v": v, "a": a, "x": np.cumsum(v) / rate}

    runs = _runs(rng, rate=rate, seconds=seconds, count=6, signals=motion)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        f = run.fine
        z, force = 0.0, np.empty_like(f["t"])
        notch = e.get("hidden_detent")
        h = float(f["t"][1] - f["t"][0])
        for i, (x, v) in enumerate(zip(f["x"].tolist(), f["v"].tolist(), strict=True)):
            added, _ = left_out(x, v, z, e, 5e-5)
            if notch:
                u = (x - notch["at"]) / notch["width"]  # pushed back before it, pulled on behind it
                added -= notch["force"] * math.sqrt(2 * math.e) * u * math.exp(-(u**2))
            rest = math.copysign(5e-5, v)  # the bristle's exact relaxation towards sliding
            z = rest + (z - rest) * math.exp(-abs(v) * h / 5e-5)
            force[i] = -added
        fine = {"F": p["mass"] * f["a"] + p["viscous"] * f["v"] + force}
        if one_speed:  # no filter over a force that steps
            rows = np.interp(run.rows, f["t"], fine["F"])
            return {"F": rows}
        return sampled(run, fine, e, cutoff_Hz=10.0, compensated=False)

    def table(peak: dict[str, float]) -> dict[str, Any]:
        found = specs.motion(
            rng, coulomb=11.0, viscous=90.0, drag=450.0, cubic=1.0, constant=6.0, ripple=(9.0, 0.02)
        )
        scaled = {k: v for k, v in found.items() if k not in ("cubic_stiffness", "periodic_ripple")}
        path = np.concatenate([run.fine["x"] for run in runs[:-2]])
        at = float(np.quantile(path, rng.uniform(0.3, 0.7)))
        notch = {"force": 12.0, "at": at, "width": 0.06 * float(np.ptp(path))}
        scaled["hidden_detent"] = specs.spec("hidden_detent", notch, "force")
        return scaled | specs.channel(rng, "F", peak["F"])

    inputs = {"v": Channel(unit="m/s", role="input"), "a": Channel(unit="m/s^2", role="input")}
    return _scenario(
        rng, family="drive-force", kind="python", title="The motor force of a measured motion",
        sim=force_simulator, simulation={"function": "simulate"}, parameters=parameters, runs=runs,
            inputs=inputs,
        outputs={"F": "N"}, truth=truth, effects=table, share=(0.006, 0.015),
        cutoff_Hz=None if one_speed else 10.0,
    )  # fmt: skip
