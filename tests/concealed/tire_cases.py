"""Cases of the tire machine: steering sweeps on the drum, as kinds `machine`, `python` and `columns`."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pandas as pd

from tests.concealed import specs, tire_truth
from tests.concealed import tire_steady as steady
from tests.concealed.model import Array, Channel, Effects, EffectSpec, Noise, Parameter, Params, Run, Scenario
from tests.concealed.noise import anti_alias, jittered
from tests.concealed.simulators import brush as brush_simulator

RATE_Hz = 20.0
OVER = 8
CUTOFF_Hz = 20.0
ROLLING_RADIUS, DRUM_RADIUS = 0.306, 1.353
SIGNALS = ("SA", "FZ", "V", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "T_AMBIENT", "P_INFL")
UNITS = {"SA": "deg", "FZ": "N", "V": "m/s", "TIRE_ANGLE": "deg", "DRUM_ANGLE": "deg", "T_TREAD": "degC",
         "T_AMBIENT": "degC", "P_INFL": "kPa"}  # fmt: skip


def _sweep(t: Array, peak: float, rate: float) -> Array:
    """Return a triangle from 0 to +peak, -peak and on, its corners rounded by the actuator (0.15 s)."""
    x = (t - t[0]) * rate / peak
    triangle = peak * (np.abs(np.mod(x - 1, 4) - 2) - 1)
    kernel = np.hanning(int(0.3 / (t[1] - t[0])) | 1)
    padded = np.concatenate([np.full(kernel.size, triangle[0]), triangle, np.full(kernel.size, triangle[-1])])
    return np.convolve(padded, kernel / kernel.sum(), mode="same")[kernel.size : -kernel.size]


def _heat(
    power: Array, start: tuple[float, float], ambient: Array, h: float
) -> tuple[Array, tuple[float, float]]:
    """Return the tread's temperature: tread and carcass as two capacities, three resistances."""
    tread, inner = start
    out = np.empty_like(power)
    for i in range(power.size):
        exchange = 6.0 * (tread - inner)
        tread += h * (0.6 * power[i] - exchange - 9.0 * (tread - ambient[i])) / 250.0
        inner += h * (exchange - 4.0 * (inner - ambient[i])) / 1800.0
        out[i] = tread
    return out, (tread, inner)


def _run(
    name: str,
    start: float,
    seconds: float,
    *,
    sa: tuple[float, float],
    loads: tuple[float, ...],
    speed: float,
    rng: np.random.Generator,
    conditions: dict[str, str],
) -> Run:
    """Return a run that sweeps the slip angle while the load takes the given levels in turn."""
    t = start + np.arange(round(seconds * RATE_Hz) * OVER + 1) / (RATE_Hz * OVER)
    tau = t - start
    level = np.array(loads)[np.minimum((tau / seconds * len(loads)).astype(int), len(loads) - 1)]
    kernel = np.hanning(int(0.8 * RATE_Hz * OVER) | 1)
    padded = np.concatenate([np.full(kernel.size, level[0]), level, np.full(kernel.size, level[-1])])
    load = np.convolve(padded, kernel / kernel.sum(), mode="same")[kernel.size : -kernel.size]
    angle = np.degrees(speed * tau / ROLLING_RADIUS) + rng.uniform(0, 360)
    drum = np.degrees(speed * tau / DRUM_RADIUS) + rng.uniform(0, 360)
    load = load * (1 + 0.006 * np.cos(np.radians(angle)) + 0.004 * np.cos(np.radians(drum)))
    ambient = 24 + 3 * np.sin(2 * math.pi * (tau / seconds * rng.uniform(0.6, 1.4) + rng.random()))
    fine = {
        "t": t, "SA": _sweep(t, *sa), "FZ": load, "V": np.full(t.size, speed), "TIRE_ANGLE": angle,
        "DRUM_ANGLE": drum, "T_AMBIENT": ambient, "P_INFL": 220 + 4 * np.sin(tau / 3.1 + rng.uniform(0, 6)),
    }  # fmt: skip
    rows = jittered(t[::OVER], 0.05, rng)
    return Run(name=name, fine=fine, rows=rows, conditions=conditions)


def _plan(
    rng: np.random.Generator, *, reverse: bool, surfaces: bool, seconds: float
) -> tuple[list[Run], list[Run]]:
    """Return training runs at two speeds, three steering rates and several loads, and two untouched ones."""
    load = lambda share: 4000 * share * rng.uniform(0.95, 1.05)  # noqa: E731
    slow, fast = 2.128 * rng.uniform(0.5, 0.65), 2.128
    rows: list[tuple[tuple[float, float], tuple[float, ...], float, bool]] = [
        ((8.0, 4.0), (load(0.6),), fast, False),
        ((9.0, 2.0), (load(1.1),), fast, False),
        ((5.0, 8.0), (load(0.9),), slow, False),
        ((3.0, 1.0), (load(0.4), load(1.3), load(0.7), load(1.0)), fast, False),
        ((8.0, 5.0), (load(0.9),), fast, reverse),
        ((6.0, 4.0), (load(1.2), load(0.5)), slow, reverse),
    ]
    ahead = [
        ((7.0, 6.0), (load(0.8), load(1.15)), fast, False),
        ((4.0, 3.0), (load(1.0),), slow * 1.2, False),
    ]
    out, start = [], 0.0
    for i, (sa, loads, speed, turned) in enumerate(rows + ahead):
        conditions = {"rotation": "reverse" if turned else "forward"}
        if surfaces:
            conditions["surface"] = "sandpaper" if i % 2 else "steel"
        name = f"run{i + 1:02d}.csv" if i < len(rows) else f"more{i + 1 - len(rows):02d}.csv"
        out.append(
            _run(name, start, seconds, sa=sa, loads=loads, speed=speed, rng=rng, conditions=conditions)
        )
        start += seconds + 25.0
    return out[: len(rows)], out[len(rows) :]


def _plan_single_rate(
    rng: np.random.Generator, *, reverse: bool, surfaces: bool, seconds: float
) -> tuple[list[Run], list[Run]]:
    """Return runs with one small sine of the slip angle, all alike."""
    out = []
    for i in range(5):
        run = _run(f"run{i + 1:02d}.csv" if i < 4 else "more01.csv", i * (seconds + 25.0), seconds,
            sa=(1.0, 1.0),
                   loads=(4000.0,), speed=2.128, rng=rng, conditions={"rotation": "forward"})  # fmt: skip
        f = dict(run.fine)
        tau = f["t"] - f["t"][0]
        f["SA"] = 0.8 * np.sin(2 * math.pi * 0.2 * tau) * np.clip(tau / 2.5, 0, 1)
        out.append(Run(name=run.name, fine=f, rows=run.rows, conditions=run.conditions))
    return out[:4], out[4:]


def _warmed(runs: list[Run], tire: tire_truth.Tire) -> list[Run]:
    """Return the runs with the tread's temperature and the slip work done before each."""
    state, work, last, out = (27.0, 25.0), 0.0, 0.0, []
    for run in runs:
        f = dict(run.fine)
        h = float(f["t"][1] - f["t"][0])
        rest = int((f["t"][0] - last) / h)
        _, state = _heat(np.zeros(rest), state, np.full(rest, 24.0), h)
        slip = np.radians(f["SA"])
        power = np.abs(tire.forces(slip, f["FZ"], steady.Scales())[0] * f["V"] * np.sin(slip))
        f["T_TREAD"], state = _heat(power, state, f["T_AMBIENT"], h)
        f["work_before_kJ"] = np.full(f["t"].size, work)
        work += float(power.sum() * h / 1e3)
        last = float(f["t"][-1])
        out.append(Run(name=run.name, fine=f, rows=run.rows, conditions=run.conditions))
    return out


def effects(rng: np.random.Generator, *, peak_N: float) -> dict[str, EffectSpec]:
    """Return what a tire case may conceal, at typical sizes."""
    sign = lambda: float(rng.choice([-1.0, 1.0]))  # noqa: E731
    phase = lambda: float(rng.uniform(-180, 180))  # noqa: E731

    spec, same = specs.spec, specs.same
    fy, mz = {"channel": "FY"}, {"channel": "MZ"}
    full = {"channel": "FY", "full_scale": peak_N}
    angle = "pseudo_slip_angle"
    pull = "force_at_nominal_load"
    uneven = {"amplitude_1": 25.0, "phase_1": phase(), "amplitude_2": 8.0, "phase_2": phase()}
    warm = {"coefficient": 0.4 * sign(), "from": "T_AMBIENT", "reference": 23.0}
    rows = [
        *specs.on("FY", [
            spec("channel_delay", fy | {"delay": 0.05}, "delay", reported=same("delay")),
            spec("filter_lag", fy | {"time_constant": 0.06}, "time_constant", reported=same("time_constant")),
            spec("zero_offset", fy | {"offset": 30 * sign()}, "offset", reported=same("offset")),
            spec("zero_drift", fy | {"rate": 12 * sign()}, "rate", reported=same("rate")),
            spec("creep", fy | {"fraction": 0.02, "time_constant": 4.0}, "fraction", largest=20,
                 reported=same("fraction", "time_constant")),
            spec("hysteresis", full | {"width": 60.0}, "width", reported=same("width")),
            spec("nonlinearity", full | {"quadratic": 0.01 * sign(), "cubic": 0.0}, "quadratic"),
            spec("sensitivity_error", fy | {"gain_error": 0.02 * sign()}, "gain_error",
                reported=same("gain_error")),
            spec("saturation", fy | {"cut": 0.12, "level": peak_N}, "cut", largest=5, reported=specs.level),
            spec("quantisation", fy | {"step": 60.0}, "step", largest=20, reported=same("step")),
        ]),
        *specs.on("MZ", [
            spec("thermal_drift", mz | warm, "coefficient", reported=same("coefficient")),
            spec("crosstalk", mz | {"coefficient": 4e-4 * sign(), "from": "FZ"}, "coefficient",
                 reported=same("coefficient")),
            spec("dead_band", mz | {"width": 5.0}, "width", reported=same("width")),
            spec("rectification", mz, ""),
            spec("unit_error", mz | {"factor": 1 / 1.3558179483314004}, "", reported=same("factor")),
            spec("channel_sign", mz, ""),
        ]),
        spec("relaxation", {"relaxation_length": 0.25}, "relaxation_length", largest=4,
             reported=same("relaxation_length")),
        spec("steer_offset", {"offset": 0.12 * sign()}, "offset", reported=same("offset"), either_sign=True),
        spec("plysteer", {angle: 0.12 * sign()}, angle, reported=same(angle), either_sign=True),
        spec("steer_compliance", {"compliance": 4e-5}, "compliance", reported=same("compliance")),
        spec("backlash", {"gap": 0.15}, "gap", reported=same("gap")),
        spec("conicity", {pull: 40 * sign()}, pull, reported=same(pull)),
        spec("thermal_friction", {"peak_per_K": -0.002, "stiffness_per_K": -0.004},
            "peak_per_K stiffness_per_K"),
        spec("wear", {"rate": 0.002}, "rate"),
        spec("load_friction", {"sensitivity": -0.04 * sign()}, "sensitivity", largest=8,
             reported=same("sensitivity")),
        spec("speed_friction", {"sensitivity": 0.15}, "sensitivity"),
        spec("viscoelastic_settling", {"fraction": 0.04, "time_constant": 3.0}, "fraction", largest=8),
        spec("nonuniformity", uneven, "amplitude_1 amplitude_2", reported=same("amplitude_1")),
        spec("drum_runout", {"amplitude_1": 25.0, "phase_1": phase()}, "amplitude_1",
            reported=same("amplitude_1")),
        spec("turn_slip", {"force": 900.0}, "force", reported=same("force"), either_sign=True),
        spec("drum_curvature", {"reduction": 0.04}, "reduction", largest=6, reported=same("reduction")),
        spec("surface_friction", {"change": -0.04}, "change", largest=8,
             reported=lambda p: {"mu_factor": 1 + p["change"]}),
        spec("pressure_change", {"pressure_error": 8.0 * sign()}, "pressure_error", largest=7,
             reported=same("pressure_error"), either_sign=True),
        spec("hidden_ambient", {"bump": 0.04 * sign(), "at": float(rng.uniform(23, 25))}, "bump", largest=8),
        spec("hidden_resonance", {"share": 0.05, "frequency": float(rng.uniform(1.6, 2.4))}, "share"),
        spec("hidden_line", {"amplitude": 25.0, "frequency": float(rng.uniform(1.9, 2.9))}, "amplitude"),
        spec("hidden_pulse", {"force": 60.0 * sign(), "from": 50.0, "to": 63.0}, "force"),
    ]  # fmt: skip
    return {row.name: row for row in rows}


def one_rate(rng: np.random.Generator) -> Scenario:
    """Return small steering at one frequency, one speed and one load, with FY alone recorded."""
    made = build(rng, kind="columns", single_rate=True)
    fy_only = {k: c for k, c in made.channels.items() if k != "MZ"}
    keep = lambda rows: {"FY": rows["FY"]}  # noqa: E731
    return dataclasses.replace(
        made, outputs=("FY",), channels=fy_only, simulated={"FY": "FY_sim"},
        nominal=lambda df, run, p: keep(made.nominal(df, run, p)),
        truth=lambda run, p, e: keep(made.truth(run, p, e)),
    )  # fmt: skip


def build(
    rng: np.random.Generator,
    *,
    kind: str,
    needs: frozenset[str] = frozenset(),
    single_rate: bool = False,
) -> Scenario:
    """Return a tire scenario of the kind; `needs` names effects that the plan must allow to be seen."""
    reverse = kind == "machine" and (bool(rng.random() < 0.6) or "reverse" in needs)
    reverse = reverse and "forward" not in needs
    surfaces = "surface_friction" in needs or bool(rng.random() < 0.25)
    pressure = kind == "machine" and ("pressure_change" in needs or bool(rng.random() < 0.3))
    stiffness_known = "drum_curvature" in needs or "stiffness_known" in needs or bool(rng.random() < 0.25)
    tire: tire_truth.Tire = (
        steady.draw_brush(rng) if kind == "python" else steady.draw_magic_formula(rng, pressure=pressure)
    )
    seconds = float(rng.choice([14.0, 18.0, 22.0]))
    plan = _plan_single_rate if single_rate else _plan
    training, ahead = plan(rng, reverse=reverse, surfaces=surfaces, seconds=seconds)
    runs = _warmed(training + ahead, tire)
    signals = tuple(s for s in SIGNALS if s != "P_INFL" or pressure)

    def scatter(sd: float) -> float:
        return float(np.clip(rng.normal(0, sd), -1.8 * sd, 1.8 * sd))

    rows: list[tuple[str, float, float | None]]
    if kind == "python":
        rows = [(k, v, None) for k, v in tire.c.items()]
        free = {"mu": 0.03} if stiffness_known else {"mu": 0.03, "cp": 0.04, "trail": 0.05}
        rows = [(k, v, v * free[k] if k in free else None) for k, v, _ in rows]
    else:
        rows = [("LMUY", 1.0, 0.03)] + ([] if stiffness_known else [("LKY", 1.0, 0.04), ("LTR", 1.0, 0.05)])
    units = {"FZ0": "N", "a0": "m", "cp": "N/m^2"}
    parameters = () if kind == "columns" else tuple(
        Parameter(name=k, declared=v, unit=units.get(k, "1"), true=v + scatter(sd) if sd else v, sd=sd)
        for k, v, sd in rows
    )  # fmt: skip

    def base(p: Params, fine: dict[str, Array] | None) -> steady.Scales:
        press = fine["P_INFL"] if fine is not None and pressure else steady.NOMINAL_PRESSURE
        if kind == "python":
            c = tire.c
            return steady.Scales(
                mu=p["mu"] / c["mu"], stiffness=p["cp"] / c["cp"], trail=p["trail"] / c["trail"]
            )
        return steady.Scales(
            mu=p.get("LMUY", 1.0), stiffness=p.get("LKY", 1.0), trail=p.get("LTR", 1.0), pressure=press
        )

    def inputs(run: Run) -> pd.DataFrame:
        t = run.fine["t"]
        wide = {s: np.interp(run.rows, t, anti_alias(t, run.fine[s], CUTOFF_Hz)) for s in signals}
        return pd.DataFrame({"t": run.rows, **wide})

    def nominal(df: pd.DataFrame, run: Run, p: Params) -> dict[str, Array]:
        if kind == "python":
            out = brush_simulator.simulate(df, p)
            return {"FY": out["FY"].to_numpy(), "MZ": out["MZ"].to_numpy()}
        sign = -1.0 if run.conditions["rotation"] == "reverse" else 1.0
        slip, load = np.radians(df["SA"].to_numpy()), df["FZ"].to_numpy()
        fine = {"P_INFL": df["P_INFL"].to_numpy()} if pressure else None
        fy, mz = tire.forces(slip, load, base(p, fine))
        return {"FY": sign * fy, "MZ": mz}

    peak = {"FY": 0.0, "MZ": 0.0}
    for run in runs:
        fy, mz = tire.forces(np.radians(run.fine["SA"]), run.fine["FZ"], steady.Scales())
        peak = {
            "FY": max(peak["FY"], float(np.abs(fy).max())),
            "MZ": max(peak["MZ"], float(np.abs(mz).max())),
        }

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        scales = base(p, dict(run.fine))
        return tire_truth.measured(run, tire, scales, e, CUTOFF_Hz)

    ar: tuple[float, ...] = [(), (0.5,), (0.9,), (1.1, -0.3)][int(rng.integers(4))]
    share = float(rng.uniform(0.004, 0.012))
    noise = {
        name: Noise(sd=share * peak[name], ar=ar, outliers=0.003 if rng.random() < 0.3 else 0.0)
        for name in peak
    }
    stated = bool(rng.random() < 0.5)
    role = {"SA": "input", "FZ": "input", "V": "input"}
    channels = {"t": Channel(unit="s", role="time")}
    channels |= {s: Channel(unit=UNITS[s], role=role.get(s, "covariate")) for s in signals}
    channels["FY"] = Channel(unit="N", role="output", sd=noise["FY"].sd if stated else None)
    channels["MZ"] = Channel(unit="N*m", role="output", sd=noise["MZ"].sd if stated else None)
    files: dict[str, str] = {}
    simulation: dict[str, object] = {"kind": kind}
    simulated: dict[str, str] = {}
    if kind == "machine":
        simulation |= {"machine": "m15", "tire": "tire.tir"}
        files["tire.tir"] = steady.tir_text(tire, fittyp=61 if pressure else 52)  # type: ignore[arg-type]
    elif kind == "python":
        simulation |= {"path": "sim.py", "function": "simulate"}
        files["sim.py"] = Path(str(brush_simulator.__file__)).read_text(encoding="utf-8")
    else:
        simulated = {"FY": "FY_sim", "MZ": "MZ_sim"}
    table = effects(rng, peak_N=peak["FY"])
    return Scenario(
        family=f"tire-{kind}", kind=kind, title="Steering sweeps of a tire on the drum",
            simulation=simulation,
        files=files, parameters=parameters, channels=channels, outputs=("FY", "MZ"),
        runs=tuple(runs[: len(training)]), predict=tuple(runs[len(training) :]), noise=noise, inputs=inputs,
        nominal=nominal, truth=truth, effects=table, axes="machine" if kind == "machine" else "SAE",
        simulated=simulated,
    )  # fmt: skip
