"""Cases of a diagnosis, small ones of every kind of simulation, with no, one or two effects left out."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Files = dict[str, str]
_TWO_RUNS = "".join(f'[[recording.run]]\nfile = "r{number}.csv"\n' for number in range(2))
_PREDICT = '[[recording.predict]]\nfile = "more.csv"\n'

CARRIAGE = """def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": p["mass"] * inputs["a"] + p["c"] * inputs["v"]})
"""
CARRIAGE_CASE = """schema = 1
title = "A carriage"
[simulation]
kind = "python"
path = "sim.py"
function = "simulate"
[simulation.parameters.mass]
value = 94.0
unit = "kg"
sd = 5.0
bounds = [80.0, 110.0]
[simulation.parameters.c]
value = 210.0
unit = "N*s/m"
sd = 40.0
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
v = { unit = "m/s", role = "input" }
a = { unit = "m/s^2", role = "input" }
F = { unit = "N", role = "output" }
"""
CELL = """def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": p["gain"] * inputs["L"]})
"""
CELL_CASE = """schema = 1
title = "A load cell"
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters.gain]
value = 1.0
unit = "1"
sd = 0.001
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
L = { unit = "N", role = "input" }
T = { unit = "degC", role = "covariate" }
F = { unit = "N", role = "output", sd = 0.4 }
"""
BALL = """def rhs(t, x, u, p):
    return [x[1], -p["g"]]
def outputs(x, u, p):
    return {"h": x[0]}
def initial(p):
    return [0.0, 0.0]
"""
BALL_CASE = """schema = 1
title = "A ball"
[simulation]
kind = "ode"
path = "sim.py"
states = ["h", "v"]
force_terms = { v = "N/kg" }
[simulation.parameters.g]
value = 9.81
unit = "m/s^2"
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
h = { unit = "m", role = "output" }
"""
OSCILLATOR = """def rhs(t, x, u, p):
    return [x[1], (u["F"] - p["c"] * x[1] - p["k"] * x[0]) / 2.0]
def outputs(x, u, p):
    return {"x": x[0]}
def initial(p):
    return [0.0, 0.0]
"""
OSCILLATOR_CASE = """schema = 1
title = "An oscillator"
[simulation]
kind = "ode"
path = "sim.py"
states = ["x", "v"]
force_terms = { v = "N/kg" }
[simulation.parameters.k]
value = 50.0
unit = "N/m"
sd = 2.0
[simulation.parameters.c]
value = 1.5
unit = "N*s/m"
sd = 0.3
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
F = { unit = "N", role = "input" }
x = { unit = "m", role = "output" }
"""
TIRE_FILE = """[MDI_HEADER]
FILE_TYPE='tir'
[UNITS]
LENGTH='meter'
FORCE='newton'
ANGLE='radians'
MASS='kg'
TIME='second'
[MODEL]
FITTYP=6
[DIMENSION]
UNLOADED_RADIUS=0.3
[VERTICAL]
FNOMIN=4000
[SCALING_COEFFICIENTS]
LMUY=1
LKY=1
[LATERAL_COEFFICIENTS]
PCY1=1.3
PDY1=1.0
PDY2=-0.1
PKY1=-15
PKY2=1.8
[ALIGNING_COEFFICIENTS]
QBZ1=8
QCZ1=1.1
QDZ1=0.1
"""
TIRE = """import numpy as np
import pandas as pd
def simulate(inputs, p):
    slip, FZ = np.deg2rad(inputs["SA"]), inputs["FZ"]
    FY = -p["mu"] * FZ * (1.1 - 2e-5 * FZ) * np.sin(1.3 * np.arctan(9 * slip))
    MZ = 0.02 * FZ * np.sin(2 * np.arctan(8 * slip)) * np.exp(-20 * slip**2)
    return pd.DataFrame({"FY": FY, "MZ": MZ})
"""


def csv_text(**columns: Array) -> str:
    """Return columns as the text of a CSV file, ten significant digits."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{cell:.10g}" for cell in row) for row in rows)]) + "\n"


def _runs(make: Callable[[int], str], *, more: bool = False) -> Files:
    files = {f"r{number}.csv": make(number) for number in range(2)}
    return files | ({"more.csv": make(7)} if more else {})


def carriage(*, coulomb: float = 0.0, drag: float = 0.0, delay: float = 0.0, more: bool = False) -> Files:
    """Return a carriage on two sines: mass 95 kg, 200 N s/m, and what the simulation leaves out."""

    def run(seed: int) -> str:
        rng = np.random.default_rng(seed)
        t = np.arange(80) * 0.1
        v = 0.2 * np.sin(1.3 * t + seed) + 0.1 * np.sin(3.1 * t)
        a = 0.26 * np.cos(1.3 * t + seed) + 0.31 * np.cos(3.1 * t)
        F = 95 * a + 200 * v + coulomb * np.sign(v) + drag * v * np.abs(v)
        return csv_text(t=t, v=v, a=a, F=np.interp(t - delay, t, F) + rng.normal(0, 2.0, t.size))

    case = CARRIAGE_CASE + _TWO_RUNS + (_PREDICT if more else "")
    return {"CASE.toml": case, "sim.py": CARRIAGE, **_runs(run, more=more)}


def cell(*, quadratic: float = 0.0, drift: float = 0.0, thermal: float = 0.0) -> Files:
    """Return a load cell under a known load of steps and ramps, with a temperature beside it."""

    def run(seed: int) -> str:
        rng = np.random.default_rng(seed + 20)
        t = np.arange(90) * 2.0
        L = 1000 * np.abs(np.sin(0.021 * t + seed)) + 100 * (np.arange(90) // 15 % 3)
        T = 21 + 3 * np.sin(0.013 * t + 2 * seed)
        F = L + quadratic * L**2 / 1000 + drift * t / 60 + thermal * (T - 21)
        return csv_text(t=t, L=L, T=T, F=F + rng.normal(0, 0.4, t.size))

    return {"CASE.toml": CELL_CASE + _TWO_RUNS, "sim.py": CELL, **_runs(run)}


def ball(*, drag: float = 0.0) -> Files:
    """Return a ball that falls from rest, m v' = -g - k v |v|, in closed form."""

    def run(seed: int) -> str:
        t = np.linspace(0, 1.5, 60)
        if drag:
            w = np.sqrt(9.81 / drag)
            h = -(w**2) / 9.81 * np.log(np.cosh(9.81 * t / w))
        else:
            h = -9.81 * t**2 / 2
        return csv_text(t=t, h=h + np.random.default_rng(seed).normal(0, 0.005, 60))

    return {"CASE.toml": BALL_CASE + _TWO_RUNS, "sim.py": BALL, **_runs(run)}


def oscillator(*, cubic: float = 0.0, offset: float = 0.0) -> Files:
    """Return a driven oscillator, integrated by fixed steps of Runge and Kutta, with a cubic spring."""

    def run(seed: int) -> str:
        t = np.arange(0, 12, 0.1)
        F = 3 * np.sin(2.1 * t + seed) + 2 * np.sin(5.3 * t)

        def slope(x: Array, force: float) -> Array:
            return np.array([x[1], (force - 1.4 * x[1] - 50.5 * x[0] - cubic * x[0] ** 3) / 2.0])

        states = [np.zeros(2)]
        for now, after in itertools.pairwise(F.tolist()):
            x = states[-1]
            for part in range(10):
                force = [now + (after - now) * (part + share) / 10 for share in (0, 0.5, 1)]
                k1 = slope(x, force[0])
                k2 = slope(x + 0.005 * k1, force[1])
                k3 = slope(x + 0.005 * k2, force[1])
                x = x + 0.01 / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + 0.01 * k3, force[2]))
            states.append(x)
        x = np.array(states)[:, 0] + offset
        return csv_text(t=t, F=F, x=x + np.random.default_rng(seed).normal(0, 0.001, t.size))

    return {"CASE.toml": OSCILLATOR_CASE + _TWO_RUNS, "sim.py": OSCILLATOR, **_runs(run)}


def _sweep(seed: int, *, offset: float = 0.0, pull: float = 0.0, lag: float = 0.0) -> dict[str, Array]:
    """Return a steering test in SAE axes, of the tire in ``TIRE``, with what is left out."""
    rng = np.random.default_rng(seed)
    t = np.arange(120) * 0.1
    SA = 6 * np.sin(2 * np.pi * t / 7.5 + seed)
    FZ = np.where(t < 6, 3000.0, 5000.0) + 200 * np.sin(t)
    slip = np.deg2rad(SA - offset)
    FY = -FZ * (1.1 - 2e-5 * FZ) * np.sin(1.3 * np.arctan(9 * slip))
    MZ = 0.02 * FZ * np.sin(2 * np.arctan(8 * slip)) * np.exp(-20 * slip**2)
    FY = np.interp(t - lag, t, FY) + pull * FZ / 4000
    return {"t": t, "SA": SA, "FZ": FZ, "FY": FY + rng.normal(0, 8, 120), "MZ": MZ + rng.normal(0, 0.4, 120)}


def _tire_case(simulation: str, *, axes: str, free: str = "", channels: str = "") -> str:
    parameter = f'[simulation.parameters.{free}]\nvalue = 1.0\nunit = "1"\nsd = 0.05\n' if free else ""
    return f"""schema = 1
title = "A tire"
[simulation]
{simulation}
{parameter}[recording]
axes = "{axes}"
[recording.channels]
t = {{ unit = "s", role = "time" }}
SA = {{ unit = "deg", role = "input" }}
FZ = {{ unit = "N", role = "input" }}
FY = {{ unit = "N", role = "output" }}
MZ = {{ unit = "N*m", role = "output" }}
{channels}{_TWO_RUNS}"""


def python_tire(**effect: float) -> Files:
    """Return a steering test whose simulation is a file of Python."""
    case = _tire_case('kind = "python"\npath = "sim.py"', axes="SAE", free="mu")
    return {"CASE.toml": case, "sim.py": TIRE, **_runs(lambda seed: csv_text(**_sweep(seed, **effect)))}


def columns_tire(*, factor: float = 1.0, **effect: float) -> Files:
    """Return a steering test beside the columns that another program simulated."""
    case = _tire_case('kind = "columns"\nsimulated = { FY = "FY_sim", MZ = "MZ_sim" }', axes="SAE")

    def run(seed: int) -> str:
        measured, plain = _sweep(seed, **effect), _sweep(seed)
        rng = np.random.default_rng(seed)
        simulated = {
            "FY_sim": plain["FY"] - rng.normal(0, 8, 120),
            "MZ_sim": plain["MZ"] - rng.normal(0, 0.4, 120),
        }
        return csv_text(**(measured | {"FY": factor * measured["FY"]}), **simulated)

    return {"CASE.toml": case, **_runs(run)}


def _tir_forces(SA: Array, FZ: Array, *, factor: float = 1.0) -> tuple[Array, Array]:
    """Return FY, MZ in SAE axes of the tire file above, by the equations of MF 6 for its few numbers."""
    alpha, dfz = np.tan(np.deg2rad(-SA)), (FZ - 4000) / 4000
    D = factor * FZ * (1.0 - 0.1 * dfz)
    K = -15 * 4000 * np.sin(2 * np.arctan(FZ / (1.8 * 4000)))
    FY = -D * np.sin(1.3 * np.arctan(K / (1.3 * D) * alpha))
    trail = FZ * 0.3 / 4000 * 0.1 * np.cos(1.1 * np.arctan(8 * alpha)) * np.cos(np.deg2rad(SA))
    return FY, -trail * FY


def machine_tire(*, kind: str = "machine", offset: float = 0.0, leak: float = 0.0) -> Files:
    """Return a steering test of the machine whose tire is a property file; ``kind`` machine."""

    def run(seed: int) -> str:
        signals = _sweep(seed)
        rng = np.random.default_rng(seed + 5)
        FY, MZ = _tir_forces(signals["SA"] - offset, signals["FZ"])
        FY = FY + leak * signals["FZ"]
        return csv_text(**(signals | {"FY": FY + rng.normal(0, 8, 120), "MZ": MZ + rng.normal(0, 0.4, 120)}))

    case = _tire_case('kind = "machine"\nmachine = "m15"\ntire = "tire.tir"', axes="machine", free="LMUY")
    return {"CASE.toml": case, "tire.tir": TIRE_FILE, **_runs(run)}


def acquisition(*, negative: bool = True) -> Files:
    """Return cells and the program's own forces, printed to seven digits; by the sign of its E5 terms."""
    FY, MZ = np.array([0.99719, 0.99718, 1.0228, 0.6473]), np.array([-0.15688, 0.16197, 0.0026666, 0.68759])
    if negative:
        FY[2], MZ[2] = -FY[2], -MZ[2]

    def run(seed: int) -> str:
        rng = np.random.default_rng(seed + 3)
        FZ = np.repeat([250.0, 567.0, 833.0, 1101.0, 1372.0], 20) + rng.normal(0, 0.5, 100)
        x = np.array([[0.36, 0.22, -0.36]]) * FZ[:, None] + rng.normal(0, 4, (100, 3))
        x = np.array([[float(f"{cell:.7g}") for cell in row] for row in x.tolist()])
        y = [np.array([float(f"{cell:.7g}") for cell in (x @ c[:3] + c[3]).tolist()]) for c in (FY, MZ)]
        return csv_text(FZ=FZ, D51=x[:, 0], D52=x[:, 1], E5=x[:, 2], FY=y[0], MZ=y[1])

    cells = "".join(f'{name} = {{ unit = "lbf", role = "input" }}\n' for name in ("D51", "D52", "E5"))
    case = f"""schema = 1
title = "The acquisition program"
[simulation]
kind = "machine"
machine = "m15"
calibration = "m15-r2"
[recording]
axes = "machine"
[recording.channels]
FZ = {{ unit = "lbf", role = "covariate" }}
{cells}FY = {{ unit = "lbf", role = "output" }}
MZ = {{ unit = "lbf*ft", role = "output" }}
{_TWO_RUNS}"""
    return {"CASE.toml": case, **_runs(run)}


CASES: dict[str, Callable[[], Files]] = {
    "python-nothing": carriage,
    "python-friction": lambda: carriage(coulomb=20.0, more=True),
    "python-friction-and-delay": lambda: carriage(coulomb=20.0, delay=0.15),
    "cell-nonlinear": lambda: cell(quadratic=8.0),
    "cell-drift-and-thermal": lambda: cell(drift=8.0, thermal=6.0),
    "ode-nothing": ball,
    "ode-drag": lambda: ball(drag=0.2),
    "ode-cubic": lambda: oscillator(cubic=900.0),
    "tire-nothing": python_tire,
    "tire-offset": lambda: python_tire(offset=0.3),
    "columns-unit": lambda: columns_tire(factor=1.3558),
    "columns-pull-and-delay": lambda: columns_tire(pull=120.0, lag=0.2),
    "machine-nothing": machine_tire,
    "machine-offset": lambda: machine_tire(offset=0.3),
    "machine-leak": lambda: machine_tire(leak=0.02),
    "acquisition-sign": acquisition,
    "acquisition-nothing": lambda: acquisition(negative=False),
}
"""Files of each case by its name."""
QUICK = ("python-nothing", "cell-nonlinear")
