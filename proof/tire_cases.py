"""Cases of the tire machine: steering sweeps on the drum, as kinds `machine`, `python` and `columns`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from proof import tire_plans, tire_truth
from proof import tire_steady as steady
from proof.model import Array, Channel, Effects, Noise, Parameter, Params, Run, Scenario
from proof.noise import anti_alias
from proof.simulators import brush as brush_simulator
from proof.tire_effects import effects

CUTOFF_Hz = 20.0
SIGNALS = ("SA", "FZ", "V", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "T_AMBIENT", "P_INFL")
UNITS = {"SA": "deg", "FZ": "N", "FZ_CMD": "N", "V": "m/s", "TIRE_ANGLE": "deg", "DRUM_ANGLE": "deg",
         "T_TREAD": "degC", "T_AMBIENT": "degC", "P_INFL": "kPa"}  # fmt: skip
FORCES = ("FY", "MZ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What a test of the machine has beside its sweeps; drawn for nulls too, so that it tells nothing."""

    reverse: bool = False
    surfaces: bool = False
    pressure: bool = False
    turned: bool = False
    """Some runs have the tire turned round on the hub."""
    camber: bool = False
    """The tire file knows camber."""
    load: str = "measured"
    """`measured`, or `judged` as an output that the command drives, or `commanded` and not recorded."""
    stiffness_known: bool = False


def _layout(rng: np.random.Generator, *, kind: str, needs: frozenset[str], cells: bool) -> Layout:
    """Return the layout: what the effects need, and now and then what they do not."""
    machine = kind == "machine"
    by_chance = dict(zip(
        ("reverse", "surfaces", "pressure", "turned", "camber", "stiffness_known"),
        rng.random(6) < (0.6, 0.25, 0.3, 0.15, 0.25, 0.25), strict=True,
    ))  # fmt: skip
    load = str(rng.choice(["measured", "judged", "commanded"], p=[0.8, 0.1, 0.1]))
    if "load_lag" in needs:
        load = str(rng.choice(["judged", "commanded"]))
    elif not machine or cells or "pull" in needs:
        load = "measured"
    # a tire without shifts, so that turning it round changes nothing but its pull
    turned = machine and not cells and ("turned" in needs or bool(by_chance["turned"]))
    turned = turned and not needs & {"pull", "steer_offset", "plysteer"}
    pressure = machine and ("pressure_change" in needs or bool(by_chance["pressure"]))
    camber = machine and not cells and ("camber_offset" in needs or bool(by_chance["camber"]))
    return Layout(
        reverse=machine and (bool(by_chance["reverse"]) or "reverse" in needs) and "forward" not in needs,
        surfaces="surface_friction" in needs or bool(by_chance["surfaces"]),
        pressure=pressure and "camber_offset" not in needs,
        turned=turned,
        camber=camber and (not pressure or "camber_offset" in needs),
        load=load,
        stiffness_known="drum_curvature" in needs or bool(by_chance["stiffness_known"]),
    )


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
    cells: bool = False,
) -> Scenario:
    """Return a tire scenario of the kind; `needs` names effects that the plan must allow to be seen.

    `cells`: the forces will be read by load cells, whose recording has a measured load.
    """
    lay = _layout(rng, kind=kind, needs=needs, cells=cells)
    tire: tire_truth.Tire = (
        steady.draw_brush(rng)
        if kind == "python"
        else steady.draw_magic_formula(rng, pressure=lay.pressure, camber=lay.camber, symmetric=lay.turned)
    )
    seconds = float(rng.choice([14.0, 18.0, 22.0]))
    training, ahead = (
        tire_plans.single_rate(rng, seconds=seconds)
        if single_rate
        else tire_plans.plan(
            rng, reverse=lay.reverse, surfaces=lay.surfaces, seconds=seconds, turned=lay.turned,
            ripple=lay.load == "measured",
        )
    )  # fmt: skip
    runs = tire_plans.warmed(training + ahead, tire)
    outputs = (*FORCES, "FZ") if lay.load == "judged" else FORCES
    signals = tuple(
        name
        for s in SIGNALS
        if s != "P_INFL" or lay.pressure
        for name in (("FZ_CMD",) if s == "FZ" and lay.load != "measured" else (s,))
    )

    def scatter(sd: float) -> float:
        return float(np.clip(rng.normal(0, sd), -1.8 * sd, 1.8 * sd))

    rows: list[tuple[str, float, float | None]]
    if kind == "python":
        rows = [(k, v, None) for k, v in tire.c.items()]
        free = {"mu": 0.03} if lay.stiffness_known else {"mu": 0.03, "cp": 0.04, "trail": 0.05}
        rows = [(k, v, v * free[k] if k in free else None) for k, v, _ in rows]
    else:
        rows = [("LMUY", 1.0, 0.03)]
        rows += [] if lay.stiffness_known else [("LKY", 1.0, 0.04), ("LTR", 1.0, 0.05)]
    units = {"FZ0": "N", "a0": "m", "cp": "N/m^2"}
    parameters = () if kind == "columns" else tuple(
        Parameter(name=k, declared=v, unit=units.get(k, "1"), true=v + scatter(sd) if sd else v, sd=sd)
        for k, v, sd in rows
    )  # fmt: skip

    def base(p: Params, press: Array | float) -> steady.Scales:
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
        # a load that is judged stands in the recordings, and not in the files to predict
        here = (*signals, "FZ") if lay.load == "judged" and run.name.startswith("run") else signals
        wide = {s: np.interp(run.rows, t, anti_alias(t, run.fine[s], CUTOFF_Hz)) for s in here}
        return pd.DataFrame({"t": run.rows, **wide})

    def nominal(df: pd.DataFrame, run: Run, p: Params) -> dict[str, Array]:
        if kind == "python":
            out = brush_simulator.simulate(df, p)
            return {"FY": out["FY"].to_numpy(), "MZ": out["MZ"].to_numpy()}
        sign = -1.0 if run.conditions["rotation"] == "reverse" else 1.0
        slip, load = np.radians(df["SA"].to_numpy()), df["FZ" if "FZ" in df else "FZ_CMD"].to_numpy()
        press = df["P_INFL"].to_numpy() if lay.pressure else steady.NOMINAL_PRESSURE
        fy, mz = tire.forces(slip, load, base(p, press))
        found = {"FY": sign * fy, "MZ": mz}
        return found | ({"FZ": df["FZ_CMD"].to_numpy()} if lay.load == "judged" else {})

    def driven(run: Run, e: Effects) -> Run:
        """Return the run with the load that the actuator truly gave."""
        if "load_lag" not in e:
            return run
        f, tau = dict(run.fine), e["load_lag"]["time_constant"]
        f["FZ"] = tire_truth.actuator(f["t"], f["FZ_CMD"], tau, tire.nominal_load)
        return dataclasses.replace(run, fine=f)

    def truth(run: Run, p: Params, e: Effects) -> dict[str, Array]:
        there = driven(run, e)
        scales = base(p, run.fine["P_INFL"] if lay.pressure else steady.NOMINAL_PRESSURE)
        found = tire_truth.measured(there, tire, scales, e, CUTOFF_Hz)
        if lay.load == "judged":
            t, load = run.fine["t"], there.fine["FZ" if "load_lag" in e else "FZ_CMD"]
            found["FZ"] = np.interp(run.rows, t, anti_alias(t, load, CUTOFF_Hz))
        return found

    peak = dict.fromkeys(FORCES, 0.0)
    for run in runs:
        forces = tire.forces(np.radians(run.fine["SA"]), run.fine["FZ"], steady.Scales())
        for name, y in zip(FORCES, forces, strict=True):
            peak[name] = max(peak[name], float(np.abs(y).max()))
    ar: tuple[float, ...] = [(), (0.5,), (0.9,), (1.1, -0.3)][int(rng.integers(4))]
    share = float(rng.uniform(0.004, 0.012))
    noise = {
        name: Noise(sd=share * peak[name], ar=ar, outliers=0.003 if rng.random() < 0.3 else 0.0)
        for name in peak
    }
    if lay.load == "judged":
        # the tire is simulated at the measured load, whose noise must stay far below that of FY
        noise["FZ"] = Noise(sd=0.2 * noise["FY"].sd, ar=ar)
    stated = bool(rng.random() < 0.5)
    role = {"SA": "input", "FZ": "input", "FZ_CMD": "input", "V": "input"}
    channels = {"t": Channel(unit="s", role="time")}
    channels |= {s: Channel(unit=UNITS[s], role=role.get(s, "covariate")) for s in signals}
    channels |= {
        k: Channel(unit={"MZ": "N*m"}.get(k, "N"), role="output", sd=noise[k].sd if stated else None)
        for k in outputs
    }
    files: dict[str, str] = {}
    simulation: dict[str, object] = {"kind": kind}
    simulated: dict[str, str] = {}
    if kind == "machine":
        simulation |= {"machine": "m15", "tire": "tire.tir"}
        files["tire.tir"] = steady.tir_text(tire, fittyp=61 if lay.pressure else 52)  # type: ignore[arg-type]
    elif kind == "python":
        simulation |= {"path": "sim.py", "function": "simulate"}
        files["sim.py"] = Path(str(brush_simulator.__file__)).read_text(encoding="utf-8")
    else:
        simulated = {"FY": "FY_sim", "MZ": "MZ_sim"}
    table = effects(
        rng, peak_N=peak["FY"], seconds=seconds, pull="pull" in needs, commanded=lay.load != "judged"
    )
    return Scenario(
        family=f"tire-{kind}", kind=kind, title="Steering sweeps of a tire on the drum",
        simulation=simulation, files=files, parameters=parameters, channels=channels, outputs=outputs,
        runs=tuple(runs[: len(training)]), predict=tuple(runs[len(training) :]), noise=noise, inputs=inputs,
        nominal=nominal, truth=truth, effects=table, axes="machine" if kind == "machine" else "SAE",
        simulated=simulated, driven=driven if lay.load == "judged" else None,
    )  # fmt: skip
