"""Public recordings as cases: facts read from their folder when it is there, the known effect left out.

Sources: NIST StRD (Pontius), NIST Dataplot (DZIUBA1, ZARR13), the thesis's Figure 4.4, the positioning system
of Janot, Gautier and Brunot (EMPS, 2019), the balls of de Silva, Higdon, Brunton Kutz (Front. AI 3, 2020).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import io, signal

from proof.files import toml_value, write_csv
from proof.plans import source
from proof.simulators import constant, drive_force, drive_loop, fall, line


@dataclass(frozen=True, slots=True, kw_only=True)
class RealCase:
    """A public recording as a case."""

    name: str
    title: str
    folder: str
    """Under the data's folder: what must be there."""
    wanted: tuple[tuple[str, ...], ...]
    """Sets of names of which one must be reported whole, each within a name or a class; empty: nothing."""
    optional: tuple[str, ...] = ()
    """Names that may stand beside them."""
    make: Callable[[Path, Path], None]
    published: str = ""
    sizes: tuple[tuple[str, float, float], ...] = ()
    """Effects whose first parameter is published: a name, its magnitude, and the share it may be off."""
    score_on: str | None = None
    """A file to predict whose outputs are known; its relative error is printed."""
    truth: Callable[[Path], dict[str, np.ndarray]] | None = None


def _toml(
    folder: Path,
    *,
    title: str,
    simulation: dict[str, Any],
    parameters: dict[str, dict[str, Any]],
    channels: dict[str, dict[str, Any]],
    runs: list[dict[str, Any]],
    predict: list[str] | None = None,
    time: str | None = "t",
    axes: str | None = None,
) -> None:
    lines = ["schema = 1", f"title = {toml_value(title)}", "", "[simulation]"]
    lines += [f"{k} = {toml_value(v)}" for k, v in simulation.items()]
    for name, p in parameters.items():
        lines += ["", f"[simulation.parameters.{name}]", *(f"{k} = {toml_value(v)}" for k, v in p.items())]
    lines += ["", "[recording]"]
    lines += [f"time = {toml_value(time)}"] if time else []
    lines += [f"axes = {toml_value(axes)}"] if axes else []
    lines += ["", "[recording.channels]", *(f"{k} = {toml_value(v)}" for k, v in channels.items())]
    for run in runs:
        lines += ["", "[[recording.run]]", *(f"{k} = {toml_value(v)}" for k, v in run.items())]
    for name in predict or []:
        lines += ["", "[[recording.predict]]", f"file = {toml_value(name)}"]
    (folder / "CASE.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _numbers(path: Path, *, after: int, columns: int) -> np.ndarray:
    text = path.read_text(encoding="ascii", errors="replace")
    rows = [row.split() for row in text.splitlines()[after:]]
    return np.array([[float(x) for x in row[:columns]] for row in rows if len(row) >= columns])


def pontius(data: Path, out: Path) -> None:
    """Write the load cell: two runs of twenty loads, a straight line as its simulation."""
    rows = _numbers(data / "nist_strd_linear" / "Pontius.dat", after=60, columns=2)
    slope = float(np.polyfit(rows[:, 1], rows[:, 0], 1)[0]) * 1e6
    for i in range(2):
        part = rows[20 * i : 20 * i + 20]
        df = pd.DataFrame({"t": np.arange(20.0) + 100 * i, "L": part[:, 1], "D": part[:, 0]})
        write_csv(df, out / f"run{i + 1:02d}.csv")
    (out / "sim.py").write_text(source(line), encoding="utf-8")
    _toml(
        out, title="A load cell under deadweights",
        simulation={"kind": "python", "path": "sim.py", "function": "simulate"},
        parameters={
            "sensitivity": {"value": slope, "unit": "1/lbf", "sd": 0.01 * slope},
            "zero": {"value": 0.0, "unit": "1", "sd": 0.005},
        },
        channels={
            "t": {"unit": "min", "role": "time"}, "L": {"unit": "lbf", "role": "input"},
            "D": {"unit": "1", "role": "output"},
        },
        runs=[{"file": "run01.csv"}, {"file": "run02.csv"}],
    )  # fmt: skip


def figure_4_4(data: Path, out: Path) -> None:
    """Write ten rows of the machine: the published calibration, the file's own FY and MZ as outputs."""
    df = pd.read_csv(data / "m15_fig4_4" / "fig4_4.csv")
    table = df[["FZ_load", "D51", "D52", "E5", "SA", "Fy", "Mz"]]
    table.columns = pd.Index(["FZ", "D51", "D52", "E5", "SA", "FY", "MZ"])
    write_csv(table, out / "run01.csv")
    cells = {k: {"unit": "lbf", "role": "input"} for k in ("FZ", "D51", "D52", "E5")}
    _toml(
        out, title="Ten rows of a recording of the machine",
        simulation={"kind": "machine", "machine": "m15", "calibration": "m15-r2"}, parameters={}, time=None,
        axes="machine",
        channels={
            **cells, "SA": {"unit": "deg", "role": "input"}, "FY": {"unit": "lbf", "role": "output"},
            "MZ": {"unit": "lbf*ft", "role": "output"},
        },
        runs=[{"file": "run01.csv"}],
    )  # fmt: skip


def _emps(path: Path, step: int) -> dict[str, np.ndarray]:
    """Return time, position, velocity, acceleration and motor force: zero-phase filter of 20 Hz, thinned."""
    m = io.loadmat(path)
    t, q = m["t"].ravel(), m["qm"].ravel()
    sos = signal.butter(4, 20.0, fs=1000.0, output="sos")
    x = signal.sosfiltfilt(sos, q)
    v = np.gradient(x, t)
    a = np.gradient(v, t)
    force = signal.sosfiltfilt(sos, float(m["gtau"][0, 0]) * m["vir"].ravel())
    keep = slice(500, t.size - 500, step)
    return {
        "t": t[keep], "v": v[keep], "a": a[keep], "F": force[keep], "R": m["qg"].ravel()[keep], "X": q[keep],
        "U": m["vir"].ravel()[keep],
    }  # fmt: skip


def emps_force(data: Path, out: Path) -> None:
    """Write the positioning system by its motor force; the recording with pulses is to be predicted."""
    train = pd.DataFrame(_emps(data / "emps" / "DATA_EMPS.mat", 20))[["t", "v", "a", "F"]]
    for i, part in enumerate(np.array_split(np.arange(len(train)), 4)):
        write_csv(train.iloc[part], out / f"run{i + 1:02d}.csv")
    ahead = pd.DataFrame(_emps(data / "emps" / "DATA_EMPS_PULSES.mat", 20))[["t", "v", "a"]]
    write_csv(ahead, out / "pulses.csv")
    (out / "sim.py").write_text(source(drive_force), encoding="utf-8")
    _toml(
        out, title="The motor force of a positioning system",
        simulation={"kind": "python", "path": "sim.py", "function": "simulate"},
        parameters={
            "mass": {"value": 95.0, "unit": "kg", "sd": 5.0},
            "viscous": {"value": 220.0, "unit": "N*s/m", "sd": 60.0},
        },
        channels={
            "t": {"unit": "s", "role": "time"}, "v": {"unit": "m/s", "role": "input"},
            "a": {"unit": "m/s^2", "role": "input"}, "F": {"unit": "N", "role": "output"},
        },
        runs=[{"file": f"run{i + 1:02d}.csv"} for i in range(4)], predict=["pulses.csv"],
    )  # fmt: skip


def emps_truth(data: Path) -> dict[str, np.ndarray]:
    """Return the motor force of the recording with pulses."""
    return {"F": _emps(data / "emps" / "DATA_EMPS_PULSES.mat", 20)["F"]}


def emps_loop(data: Path, out: Path) -> None:
    """Write the positioning system in its loop, kind `ode`: reference in, position and voltage out.

    Eight seconds of it, every fourth row. The controller answers within 6 ms: between rows 10 ms apart a
    straight reference would miss 6 % of the voltage.
    """
    m = io.loadmat(data / "emps" / "DATA_EMPS.mat")
    table = pd.DataFrame({k: m[n].ravel() for k, n in (("t", "t"), ("R", "qg"), ("X", "qm"), ("U", "vir"))})
    table = table.iloc[600:8600:4]  # from where the first speed is reached
    first = table.iloc[:12]
    write_csv(table, out / "run01.csv")
    (out / "sim.py").write_text(source(drive_loop), encoding="utf-8")
    number = lambda name: float(m[name][0, 0])  # noqa: E731
    speed, place = np.polyfit(first["t"] - first["t"].iloc[0], first["X"], 1)
    _toml(
        out, title="A positioning system under its controller",
        simulation={
            "kind": "ode", "path": "sim.py", "states": ["x", "v", "w"],
            "force_terms": {"v": "N/kg"},
        },
        parameters={
            "mass": {"value": 95.0, "unit": "kg", "sd": 5.0},
            "viscous": {"value": 220.0, "unit": "N*s/m", "sd": 60.0},
            "gain": {"value": number("gtau"), "unit": "N/V"}, "kp": {"value": number("kp"), "unit": "1/s"},
            "kv": {"value": number("kv"), "unit": "V*s/m"},
            "x0": {"value": round(float(place), 6), "unit": "m", "sd": 1e-5},
            "v0": {"value": round(float(speed), 5), "unit": "m/s", "sd": 2e-3},
        },
        channels={
            "t": {"unit": "s", "role": "time"}, "R": {"unit": "m", "role": "input"},
            "X": {"unit": "m", "role": "output"}, "U": {"unit": "V", "role": "output"},
        },
        runs=[{"file": "run01.csv"}],
    )  # fmt: skip


def ball(sheet: str, *, free_gravity: bool) -> Callable[[Path, Path], None]:
    """Return the writer of a ball's two drops under gravity alone."""

    def make(data: Path, out: Path) -> None:
        book = pd.read_excel(data / "ball_drops" / "Ball_drops_data.xls", sheet_name=sheet, engine="calamine")
        book.columns = pd.Index(["drop", "t", "H", "V"])
        parameters: dict[str, dict[str, Any]] = {"g": {"value": 9.81, "unit": "m/s^2"}}
        if free_gravity:
            parameters["g"]["sd"] = 0.4
        for k in (1, 2):
            part = book[book["drop"] == k]
            write_csv(part[["t", "H"]], out / f"drop{k}.csv")
            # height and velocity at the start, from a parabola through the first two thirds of a second
            first = part[part["t"] < 0.7]
            _, v, h = np.polyfit(first["t"], first["H"], 2)
            parameters[f"h{k}"] = {"value": round(float(h), 3), "unit": "m", "sd": 0.1}
            parameters[f"v{k}"] = {"value": round(float(v), 3), "unit": "m/s", "sd": 0.3}
        (out / "sim.py").write_text(source(fall), encoding="utf-8")
        _toml(
            out, title="A ball dropped from a bridge",
            simulation={"kind": "ode", "path": "sim.py", "states": ["h", "v"], "force_terms": {"v": "m/s^2"}},
            parameters=parameters,
            channels={"t": {"unit": "s", "role": "time"}, "H": {"unit": "m", "role": "output"}},
            runs=[{"file": "drop1.csv"}, {"file": "drop2.csv"}],
        )  # fmt: skip

    return make


def _constant(out: Path, table: pd.DataFrame, *, title: str, unit: str, level: float, sd: float) -> None:
    write_csv(table, out / "run01.csv")
    (out / "sim.py").write_text(source(constant), encoding="utf-8")
    _toml(
        out, title=title, simulation={"kind": "python", "path": "sim.py", "function": "simulate"},
        parameters={"level": {"value": level, "unit": "1", "sd": sd}},
        channels={"t": {"unit": unit, "role": "time"}, "y": {"unit": "1", "role": "output"}},
        runs=[{"file": "run01.csv"}],
    )  # fmt: skip


def dziuba(data: Path, out: Path) -> None:
    """Write five years of a standard resistor; readings of one day stand a minute apart."""
    rows = _numbers(data / "nist_dataplot" / "DZIUBA1.DAT", after=25, columns=4)
    when = pd.to_datetime({"year": 1900 + rows[:, 2], "month": rows[:, 0], "day": rows[:, 1]})
    day = (when - when.min()).dt.total_seconds().to_numpy() / 86400
    order = np.argsort(day, kind="stable")
    t = day[order] + pd.Series(day[order]).groupby(day[order]).cumcount().to_numpy() / 1440
    _constant(
        out,
        pd.DataFrame({"t": t, "y": rows[order, 3]}),
        title="A standard resistor",
        unit="day",
        level=27.9,
        sd=0.3,
    )


def zarr(data: Path, out: Path) -> None:
    """Write 195 calibration factors of a heat-flow meter."""
    rows = _numbers(data / "nist_dataplot" / "ZARR13.DAT", after=25, columns=1)
    table = pd.DataFrame({"t": np.arange(float(len(rows))), "y": rows[:, 0]})
    _constant(out, table, title="A heat-flow meter", unit="s", level=9.26, sd=0.1)


_DRAG = (("viscous_damping",), ("quadratic_drag",))
CASES: tuple[RealCase, ...] = (
    RealCase(
        name="pontius", title="Pontius: a load cell as a straight line", folder="nist_strd_linear",
        wanted=(("nonlinearity",),), make=pontius,
        published="certified quadratic, residual sd 0.000205 (NIST StRD)",
    ),
    RealCase(
        name="figure-4-4", title="Figure 4.4: the machine's own FY and MZ", folder="m15_fig4_4",
        wanted=(("channel_sign",), ("wrong_calibration",)), make=figure_4_4,
        published="E5 taken with the wrong sign (the thesis, section 4.1)",
    ),
    RealCase(
        name="emps-force", title="EMPS: force of inertia and viscous friction", folder="emps",
        wanted=(("coulomb_friction", "constant_force"), ("coulomb_friction", "zero_offset")),
        make=emps_force, score_on="pulses.csv", truth=emps_truth,
        sizes=(("coulomb_friction", 20.4, 0.1), ("constant_force", 3.2, 0.2)),
        published="M 95.1 kg, Fv 203.5 N s/m, Fc 20.4 N, offset -3.2 N (Janot et al.)",
    ),
    RealCase(
        name="emps-loop", title="EMPS in its loop: no Coulomb friction", folder="emps",
        # A ripple of 2.503 mm is there too: 1.0 N of it in the motor force, here and in that with pulses.
        wanted=(("coulomb_friction",),), optional=("constant_force", "zero_offset", "periodic_ripple"),
        make=emps_loop, published="as above",
    ),
    *(
        RealCase(
            name=f"whiffle-{i}", title=f"{sheet}: gravity alone", folder="ball_drops", wanted=_DRAG,
            make=ball(sheet, free_gravity=False), published="drag left out (de Silva et al. 2020)",
        )
        for i, sheet in enumerate(("Whiffle Ball 1", "Whiffle Ball 2", "Yellow Whiffle Ball"), start=1)
    ),
    RealCase(
        name="golf", title="Golf Ball: gravity alone", folder="ball_drops", wanted=((), *_DRAG),
        make=ball("Golf Ball", free_gravity=False), published="nothing or drag: both are reported",
    ),
    RealCase(
        name="bowling", title="Bowling Ball: g free within 0.4 m/s^2", folder="ball_drops", wanted=((),),
        make=ball("Bowling Ball", free_gravity=True), published="a null: the camera's scale is free",
    ),
    RealCase(
        name="dziuba1", title="DZIUBA1: a resistor as a constant", folder="nist_dataplot",
        wanted=(("zero_drift",),), make=dziuba, published="a drift (NIST handbook)",
    ),
    RealCase(
        name="zarr13", title="ZARR13: a heat-flow meter as a constant", folder="nist_dataplot", wanted=((),),
        make=zarr, published="the constant is acceptable (NIST handbook)",
    ),
)  # fmt: skip
