"""Processor seconds of cases of kind ``ode``: an oscillator with a cubic spring, a pendulum with friction.

Each is written as a user would: the oscillator's right-hand side with numpy, the pendulum's with `math`. Of
both the text-book equation is diagnosed on recordings of a machine that has more in it. Before the rows of a
simulation were solved at once, the smaller oscillator's refit and hold-out alone took 36 s (now 7 s).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import row

_OSCILLATOR = """import numpy as np

def initial(p, run):
    return [run["y"], 0.0]

def rhs(t, x, u, p):
    return np.array([x[1], (u["u"] - p["d"] * x[1] - p["k"] * x[0]) / p["m"]])

def outputs(x, u, p):
    return {"y": x[0]}
"""
_PENDULUM = """import math

def initial(p, run):
    return [run["y"], 0.0]

def rhs(t, x, u, p):
    return [x[1], -p["g"] / p["L"] * math.sin(x[0])]

def outputs(x, u, p):
    return {"y": x[0]}
"""
_CASE = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["y", "rate"]
[simulation.parameters]
PARAMETERS
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
CHANNELS
"""


def run(folder: Path, pairs: int) -> list[dict[str, object]]:
    """Return processor seconds of an oscillator of four runs, of two lengths, and of a pendulum."""
    lengths = (250, 2000) if pairs > 1 else (250,)
    return [
        *(_one(folder / f"{rows}", f"oscillator 4 x {rows} rows", _oscillator, rows, 4) for rows in lengths),
        _one(folder / "pendulum", "pendulum 3 x 800 rows", _pendulum, 800, 3),
    ]


def _one(
    folder: Path, name: str, draw: Callable[[Path, int, int], None], rows: int, count: int
) -> dict[str, object]:
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose

    folder.mkdir(parents=True)
    draw(folder, rows, count)
    case = read_case(folder / "case.toml")
    began = time.process_time()
    # In this process: the seconds of a worker are not ours to count.
    answer = diagnose(case, None, budget_s=3600.0, limits=None).diagnosis
    names = ", ".join(effect.key.label for effect in answer.effects) or answer.verdict
    what = f"diagnose an equation, {name}: {names}"
    return row(what, [time.process_time() - began], "none: processor time", None, "60 s")


def _oscillator(folder: Path, rows: int, count: int) -> None:
    rng, step, lead = np.random.default_rng(1), 1 / 610.35, 200
    for i in range(count):
        t = np.arange(rows + lead) * step
        u = np.convolve(rng.normal(size=len(t)), np.ones(4) / 4, "same") * 0.08

        def rate(s: float, x: np.ndarray, t: np.ndarray = t, u: np.ndarray = u) -> list[float]:
            return [x[1], (np.interp(s, t, u) - 2e-4 * x[1] - 0.97 * x[0] - 3.0 * x[0] ** 3) / 5e-6]

        y = _solved(rate, t, [0.0, 0.0])[lead:] + 2e-4 * rng.normal(size=rows)
        table = np.stack([t[:rows], u[lead:], y], axis=1)
        np.savetxt(folder / f"run{i}.csv", table, delimiter=",", header="t,u,y", comments="", fmt="%.7g")
    channels = 'u = { unit = "V", role = "input" }\ny = { unit = "V", role = "output" }'
    _write(folder, count, _OSCILLATOR, channels, (
        "m = { value = 5e-6, unit = '1', sd = 5e-7 }", "d = { value = 2e-4, unit = '1', sd = 5e-5 }",
        "k = { value = 1.0, unit = '1', sd = 0.1 }",
    ))  # fmt: skip


def _pendulum(folder: Path, rows: int, count: int) -> None:
    rng, t = np.random.default_rng(2), np.arange(rows) * 0.02
    for i in range(count):

        def rate(_: float, x: np.ndarray) -> list[float]:
            friction = 0.05 * np.tanh(x[1] / 1e-3) + 0.03 * x[1] * abs(x[1])
            return [x[1], -9.81 / 0.5 * np.sin(x[0]) - friction]

        y = _solved(rate, t, [1.2 - 0.2 * i, 0.0]) + 1e-3 * rng.normal(size=rows)
        table = np.stack([t, y], axis=1)
        np.savetxt(folder / f"run{i}.csv", table, delimiter=",", header="t,y", comments="", fmt="%.7g")
    _write(folder, count, _PENDULUM, 'y = { unit = "rad", role = "output" }', (
        "g = { value = 9.81, unit = 'm/s^2' }", "L = { value = 0.5, unit = 'm', sd = 0.01 }",
    ))  # fmt: skip


def _solved(rate: Callable[..., list[float]], t: np.ndarray, start: list[float]) -> np.ndarray:
    from scipy.integrate import solve_ivp

    way = solve_ivp(
        rate, (0, t[-1]), start, t_eval=t, rtol=1e-7, atol=1e-9, max_step=t[1] - t[0], method="LSODA"
    )
    return np.asarray(way.y[0])


def _write(folder: Path, count: int, simulator: str, channels: str, parameters: tuple[str, ...]) -> None:
    (folder / "sim.py").write_text(simulator)
    text = _CASE.replace("PARAMETERS", "\n".join(parameters)).replace("CHANNELS", channels)
    text += "".join(f'[[recording.run]]\nfile = "run{i}.csv"\n' for i in range(count))
    (folder / "case.toml").write_text(text)
