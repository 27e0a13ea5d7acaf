"""Cases without inertia: a tank, a chain of warm bodies, a beam with its gauges (kinds `ode`, `python`,
`columns`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from proof import ode, specs
from proof.dynamic_cases import _prior, _runs, _scenario
from proof.instruments import sampled
from proof.model import Array, Channel, Effects, Params, Run, Scenario
from proof.plans import cycles, steps
from proof.simulators import beam as beam_simulator
from proof.simulators import tank as tank_simulator
from proof.simulators import thermal as thermal_simulator


def tank(rng: np.random.Generator) -> Scenario:
    """Return a tank with an outlet, kind `ode`: the level is recorded."""
    rate, seconds = 0.5, float(rng.choice([400.0, 600.0]))
    level0 = 0.25
    parameters = (
        _prior(rng, "area", 0.5, "m^2", 0.03),
        _prior(rng, "outlet", 2.4e-3, "m^2.5/s", 0.03),
        _prior(rng, "level0", level0, "m", 0.0),
    )
    runs = _runs(
        rng, rate=rate, seconds=seconds, count=6,
        signals=lambda t, i: {"Q": steps(rng, t, low=0.4, high=2.2 + 0.2 * (i % 3), hold=70, rise=6)},
    )  # fmt: skip

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        weir = e.get("overflow")
        hatch = e.get("hidden_hatch")

        def rhs(time: float, x: Array, u: dict[str, float]) -> Array:
            out = p["outlet"] * math.sqrt(max(x[0], 0.0))
            if weir:  # a sharp-crested weir: flow with the head to the power 3/2
                out += 4.0 * max(x[0] - weir["level"] * (1 - weir["cut"]), 0.0) ** 1.5
            if hatch and any(at < time < at + hatch["seconds"] for at in hatch["at"]):
                out += hatch["outlet"] * math.sqrt(max(x[0], 0.0))
            return np.array([(u["Q"] * 1e-3 - out) / p["area"] + u.get("push", 0.0)])

        t = run.fine["t"]
        driven = {k: run.fine[k] for k in ("Q", "push") if k in run.fine}
        x = ode.truth(rhs, np.array([level0]), t, driven, longest=1.0)
        return sampled(run, {"H": x[:, 0]}, e, cutoff_Hz=0.4, compensated=True)

    def table(peak: dict[str, float]) -> dict[str, Any]:
        top = max(float(truth(run, {q.name: q.true for q in parameters}, {})["H"].max()) for run in runs[:-2])
        out = specs.channel(rng, "H", top, second=20.0, cell=False)
        level = {"level": top, "cut": 0.1}
        reported = lambda p: {"level": p["level"] * (1 - p["cut"])}  # noqa: E731
        out["overflow"] = specs.spec("overflow", level, "cut", largest=5, reported=reported)
        starts = [
            run.rows[0] + seconds * rng.uniform(0.15, 0.6)
            for run in [runs[i] for i in rng.permutation(len(runs) - 2)[:2]]
        ]
        hatch = {"outlet": 1e-4, "at": starts, "seconds": 0.15 * seconds}
        out["hidden_hatch"] = specs.spec("hidden_hatch", hatch, "outlet")
        return out

    return _scenario(
        rng, family="tank", kind="ode", title="A tank with an outlet", sim=tank_simulator,
        simulation={"states": ["h"]}, parameters=parameters, runs=runs,
        inputs={"Q": Channel(unit="l/s", role="input")}, outputs={"H": "m"}, truth=truth, effects=table,
    )  # fmt: skip


def thermal(rng: np.random.Generator) -> Scenario:
    """Return a chain of three warm bodies, kind `ode`: the first and the last are measured."""
    rate, seconds = 0.1, float(rng.choice([2400.0, 3600.0]))
    parameters = (
        _prior(rng, "g", 2.0, "W/K", 0.04),
        _prior(rng, "h", 0.25, "W/K", 0.05),
        _prior(rng, "C", 400.0, "J/K", 0.03),
    )

    def signals(t: Array, i: int) -> dict[str, Array]:
        ambient = 20 + 1.5 * np.sin(2 * np.pi * (t - t[0]) / 2900 + i) - 1.5 * math.sin(i)
        return {"P": steps(rng, t, low=0, high=45, hold=420, rise=20), "TA": ambient}

    runs = _runs(rng, rate=rate, seconds=seconds, count=5, signals=signals)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        radiation = e.get("hidden_radiation")
        mass = e.get("hidden_mass")

        def rhs(_t: float, x: Array, u: dict[str, float]) -> Array:
            flow = np.array([u["P"] + p["C"] * u.get("push", 0.0), 0.0, 0.0, 0.0])
            for a, b in ((0, 1), (1, 2)):
                q = p["g"] * (x[a] - x[b])
                flow[a] -= q
                flow[b] += q
            flow[:3] -= p["h"] * (x[:3] - u["TA"])
            if radiation:  # across the gap from the first body to the last, with the fourth power
                q = radiation["share"] * 5.67e-8 * ((x[0] + 273.15) ** 4 - (x[2] + 273.15) ** 4)
                flow[0] -= q
                flow[2] += q
            if mass:  # an unknown body hangs on the middle one
                q = mass["conductance"] * (x[1] - x[3])
                flow[1] -= q
                flow[3] += q
            return flow / np.array([p["C"], p["C"], p["C"], 900.0])

        f = run.fine
        driven = {k: f[k] for k in ("P", "TA", "push") if k in f}
        x = ode.truth(rhs, np.full(4, 20.0), f["t"], driven, longest=20.0)
        return sampled(run, {"T1": x[:, 0], "T3": x[:, 2]}, e, cutoff_Hz=0.1, compensated=True)

    def table(peak: dict[str, float]) -> dict[str, Any]:
        out = specs.channel(rng, "T1", peak["T1"], second=150.0, cell=False)
        out["sensitivity_error"] = specs.spec(
            "sensitivity_error", {"channel": "T3", "gain_error": 0.01}, "gain_error", channel="T3",
            reported=specs.same("gain_error"),
        )  # fmt: skip
        out["channel_swap"] = specs.spec("channel_swap", {"channel": "T1", "with": "T3"}, "", channel="T1")
        out["hidden_radiation"] = specs.spec("hidden_radiation", {"share": 0.02}, "share", largest=20)
        out["hidden_mass"] = specs.spec("hidden_mass", {"conductance": 0.05}, "conductance")
        out.pop("saturation")
        out.pop("channel_sign")
        return out

    return _scenario(
        rng, family="thermal", kind="ode", title="Three warm bodies in a row", sim=thermal_simulator,
        simulation={"states": ["T1", "T2", "T3"]}, parameters=parameters, runs=runs,
        inputs={"P": Channel(unit="W", role="input"), "TA": Channel(unit="degC", role="input")},
        outputs={"T1": "degC", "T3": "degC"}, truth=truth, effects=table, substeps=2,
    )  # fmt: skip


def beam(rng: np.random.Generator, *, kind: str, steady_warming: bool = False) -> Scenario:
    """Return a cantilever with a bridge and a gauge under load cycles; `columns`: no parameters at all."""
    rate, seconds = 2.0, float(rng.choice([90.0, 120.0]))
    known = kind == "columns"
    length = 1.2
    parameters = (
        _prior(rng, "EI", 21000.0, "N*m^2", 0.0 if known else 0.01),
        _prior(rng, "sensitivity", 1.0, "mV/V/kN", 0.0 if known else 0.005),
        _prior(rng, "length", length, "m", 0.0),
    )

    def signals(t: Array, i: int) -> dict[str, Array]:
        if i % 2:
            force = steps(rng, t, low=-1500, high=1900, hold=15, rise=3)
        else:
            force = cycles(t, peak=2000 - 100 * i, seconds=seconds / 4, floor=-500)
        warm = 22 + (0.01 * t if steady_warming else 3 * np.sin(2 * np.pi * (t - t[0]) / 77 + 2.1 * i))
        return {"P": force, "T": warm}

    runs = _runs(rng, rate=rate, seconds=seconds, count=6, signals=signals)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        f = run.fine
        # the deflection from the curvature, summed over 400 slices, and not from the closed formula
        s = (np.arange(400) + 0.5) / 400 * p["length"]
        per_N = float(np.sum((p["length"] - s) ** 2) * p["length"] / 400) / p["EI"]
        fine = {"S": p["sensitivity"] * f["P"] * 1e-3, "W": f["P"] * per_N * 1e3}
        if "hidden_slip" in e:  # the clamp gives way for good at one moment and is set right at another
            q = e["hidden_slip"]
            fine["S"] = fine["S"] + q["step"] * ((f["t"] > q["from"]) & (f["t"] < q["to"]))
        if "hidden_ambient" in e:
            q = e["hidden_ambient"]
            fine["S"] = fine["S"] * (1 + q["bump"] * np.exp(-(((f["T"] - 22.5) / 0.5) ** 2)))
        return sampled(run, fine, e, cutoff_Hz=0.8, compensated=False)

    def table(peak: dict[str, float]) -> dict[str, Any]:
        out = specs.channel(rng, "S", peak["S"], temperature="T", delay=False)
        sign = float(rng.choice([-1.0, 1.0]))
        slip = {"step": 0.02 * peak["S"] * sign, "from": 0.3 * seconds, "to": 0.55 * seconds}
        out["hidden_slip"] = specs.spec("hidden_slip", slip, "step")
        out["hidden_ambient"] = specs.spec("hidden_ambient", {"bump": 0.03 * sign}, "bump")
        return out

    made = _scenario(
        rng, family=f"beam-{kind}", kind="python", title="A beam with a strain bridge and a deflection gauge",
        sim=beam_simulator, simulation={"function": "simulate"}, parameters=parameters, runs=runs,
        inputs={"P": Channel(unit="N", role="input"), "T": Channel(unit="degC", role="covariate")},
        outputs={"S": "mV/V", "W": "mm"}, truth=truth, effects=table, share=(0.001, 0.004), cutoff_Hz=0.8,
    )  # fmt: skip
    return as_columns(made) if known else made


def as_columns(made: Scenario) -> Scenario:
    """Return the scenario with the other program's output beside the recording, and nothing free."""
    import dataclasses

    return dataclasses.replace(
        made, kind="columns", simulation={"kind": "columns"}, files={},
        simulated={k: f"{k}_sim" for k in made.outputs},
    )  # fmt: skip
