"""Coverage of characteristics on tests that another made: own tires, own hub, own noise.

Nothing of the toolkit's virtual machine is used. A tire is a Magic Formula with coefficients of its own or a
brush with parabolic pressure (Pacejka, Tire and Vehicle Dynamics, 3.2); the hub is a matrix with crosstalk
that is calibrated by a session of its own; rows follow an autoregression, the wheel comes to rest beside its
step, bushings leave a hysteresis between angles that are reached from below and from above, and an operator
re-zeroes the cells between files. What is read off the reduced test is held against the equations.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.signal import lfilter

from tests.coverage.rows import CoverageRow, row_of
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.channels import Rotation
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.model import Row
from toolkit.machine import Machine, load_machine
from toolkit.recording.model import Recording, Series, TestInfo
from toolkit.reduction.model import ReducedTest, Tare
from toolkit.reduction.reduce import reduce_test

Array = NDArray[np.float64]
LBF, LBF_FT = 4.4482216152605, 1.3558179483314004
CELLS = ("D51", "D52", "E5")
# [FY lbf, MZ lbf ft, MX lbf ft] a mV/V of each cell: a hub of nobody, its channels cross.
HUB = np.array([[1430.0, 1510.0, 1490.0], [-241.0, 236.0, 9.0], [251.0, 239.0, -470.0]])
CELL_NOISE = 8e-5  # mV/V, of one reading of the session
PRESSURE = 230e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Tire:
    """FY and MZ in SAE axes with the drum forward; ``brush`` in place of the Magic Formula.

    Stiffness ``c1 sin(2 atan(FZ/c2))`` [N/rad], friction ``mu (1 - fade (FZ/FN - 1))``, ``C`` and ``E`` of
    the force; trail ``trail FZ/FN`` [m] at zero slip, falling by ``blunt`` [1/rad]. Pull: conicity [N] and
    its moment [N m] at FN, plysteer [rad], residual moment [N m] at FN.
    """

    FN: float = 4000.0
    c1: float = 62_000.0
    c2: float = 5200.0
    mu: float = 1.02
    fade: float = 0.09
    C: float = 1.38
    E: float = -0.7
    trail: float = 0.034
    blunt: float = 9.0
    conicity: float = 52.0
    conicity_moment: float = 0.9
    plysteer: float = 0.0021
    residual: float = 2.4
    brush: bool = False

    def drawn(self, rng: np.random.Generator) -> Tire:
        """Return a tire beside this one: what a form misses and how it pulls is another in each."""
        factors = {
            name: float(getattr(self, name) * rng.uniform(0.8, 1.2))
            for name in ("c1", "c2", "mu", "fade", "trail", "blunt")
        }
        pull = {
            name: float(getattr(self, name) * rng.uniform(-1.5, 1.5))
            for name in ("conicity", "conicity_moment", "plysteer", "residual")
        }
        shape = {"C": float(rng.uniform(1.2, 1.6)), "E": float(rng.uniform(-1.6, 0.3))}
        return dataclasses.replace(self, **factors, **pull, **shape)

    def side(self, SA: Array | float, FZ: Array | float) -> tuple[Array, Array]:
        """Return FY and MZ without pull."""
        t = np.tan(np.asarray(SA, dtype=float) + self.plysteer)
        load = np.asarray(FZ, dtype=float)
        stiffness = self.c1 * np.sin(2 * np.arctan(load / self.c2))
        most = self.mu * (1 - self.fade * (load / self.FN - 1)) * load
        trail = self.trail * load / self.FN
        if self.brush:
            x = np.minimum(stiffness * np.abs(t) / (3 * most), 1.0)
            force = most * (3 * x - 3 * x**2 + x**3)
            return -np.sign(t) * force, np.sign(t) * trail * 3 * most * x * (1 - x) ** 3
        x = stiffness * t / (self.C * most)
        FY = -most * np.sin(self.C * np.arctan(x - self.E * (x - np.arctan(x))))
        return FY, -FY * trail * np.cos(1.1 * np.arctan(6.5 * t)) / (1 + (self.blunt * t) ** 2)

    def machine(self, SA: Array | float, FZ: Array | float, rotation: Rotation) -> tuple[Array, Array]:
        """Return FY and MZ as the carriage feels them: of a turned drum FY without conicity changes sign."""
        FY, MZ = self.side(SA, FZ)
        part = np.asarray(FZ) / self.FN
        sign = -1.0 if rotation == "reverse" else 1.0
        return sign * FY + self.conicity * part, MZ + part * (self.residual + sign * self.conicity_moment)

    def true(self, row: Row) -> float | None:
        """Return what a row of characteristics states; None for what is not asked."""
        FZ = row.load_N
        FY0, MZ0 = (float(v) for v in self.side(0.0, FZ))
        part = FZ / self.FN
        pull = {
            "conicity": self.conicity * part, "plysteer": FY0, "CRAT": self.conicity_moment * part,
            "PRAT": MZ0 + self.residual * part,
        }  # fmt: skip
        if row.name in pull:
            return pull[row.name]
        rotation: Rotation = "reverse" if row.rotation == "reverse" else "forward"
        if row.name == "PRAT_at_FY_zero":
            return sum(self.residual_moment(FZ, way) for way in ("forward", "reverse")) / 2
        channel = 0 if row.name in ("FY", "slope_cornering", "secant_cornering") else 1
        # SAE: FY of the turned drum has the other sign.
        sign = -1.0 if channel == 0 and rotation == "reverse" else 1.0

        def at(SA: float) -> float:
            return sign * float(self.machine(SA, FZ, rotation)[channel])

        if row.name.startswith("slope") or row.name.startswith("secant"):
            step = 1e-5 if row.name.startswith("slope") else math.radians(1.0)
            return (at(step) - at(-step)) / (2 * step) * (-1.0 if channel == 0 else 1.0)
        return at(row.SA_rad or 0.0) if row.name in ("FY", "MZ") else None

    def residual_moment(self, FZ: float, rotation: Rotation) -> float:
        """Return MZ where FY of a direction is zero."""
        zero = brentq(lambda SA: float(self.machine(SA, FZ, rotation)[0]), -0.06, 0.06, xtol=1e-12)
        return float(self.machine(zero, FZ, rotation)[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """How a test is made; angles [deg] and loads [lbf] in their order of each direction.

    ``rows`` of a block with noise ``sd`` [lbf] (of MZ a tenth in lbf ft), an autoregression of ``rho``;
    ``rest`` [deg] by which the wheel stops beside its step, ``loads_sd`` of a load about its step,
    ``hysteresis`` [N] between angles reached from below and above, ``rezero`` [mV/V] by which the cells' zero
    moves from file to file. ``reverse_noise`` is the noise of the second direction in units of the first's.
    """

    name: str
    tire: Tire = Tire()
    angles: tuple[tuple[float, ...], tuple[float, ...]] = (
        (0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10),
    ) * 2
    loads: tuple[tuple[float, ...], tuple[float, ...]] = ((250, 567, 833, 1101, 1372),) * 2
    rows: int = 40
    sd: float = 0.5
    rho: float = 0.0
    rest: float = 0.0
    loads_sd: float = 0.01
    hysteresis: float = 0.0
    rezero: float = 0.0
    reverse_noise: float = 1.0
    stated: bool = True


_STEPS = (0.0, 1.0, -1.0, -2.0, 2.0, 4.0, -4.0, -6.0, 6.0, 8.0, -8.0, -10.0, 10.0)
_NINE = (-9.0, -5.0, -2.0, -1.0, 0.0, 1.0, 2.0, 5.0, 9.0)
_FIVE, _THREE = (250.0, 567.0, 833.0, 1101.0, 1372.0), (250.0, 833.0, 1372.0)
DESIGNS = (
    Design(name="protocol, white"),
    Design(
        name="nine angles, three loads, 8 rows", angles=(_NINE, _NINE), loads=(_THREE, _THREE), rows=8,
        stated=False,
    ),
    Design(
        name="uneven: 13 x 5 and 9 x 3, noise 1 and 4", angles=(_STEPS, _NINE), loads=(_FIVE, _THREE),
        reverse_noise=4.0, stated=False,
    ),
    Design(
        name="coloured 0.95, rests, loads 3 %, hysteresis", rho=0.95, sd=2.0, rest=0.03, loads_sd=0.03,
        hysteresis=6.0, stated=False,
    ),
    Design(name="re-zeroed between files", rezero=2e-4, stated=False),
    Design(name="brush, every stated error", tire=Tire(brush=True)),
)  # fmt: skip
ASKED = (
    "conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero", "secant_cornering", "secant_aligning",
    "slope_cornering", "slope_aligning",
)  # fmt: skip


@functools.lru_cache(maxsize=4)
def own_record(seed: int, scale: float = 1.0) -> CalibrationRecord:
    """Return the record of a session on the hub: three runs of single and combined loads, noise of the cells.

    A hub for ``scale`` times the loads is as many times less sensitive.
    """
    rng = np.random.default_rng([51, seed])
    most = np.array([1600.0, 200.0, 1500.0]) * scale
    parts = [
        one * step
        for one in np.eye(3)
        for step in (0.25, 0.5, 0.75, 1.0, 0.5, -0.25, -0.5, -0.75, -1.0, -0.5)
    ]
    parts += [np.array(v) for v in ((0.6, 0.7, 0.5), (-0.6, 0.7, -0.5), (0.4, -0.7, -0.3), (-0.5, -0.4, 0.6))]
    parts += [np.zeros(3)]
    lines = [",".join(f"{cell} [mV/V]" for cell in CELLS) + ",FY [lbf],MZ [lbf*ft],MX [lbf*ft],run,direction"]
    for run in (1, 2, 3):
        for part in parts:
            load = part * most
            cells = np.linalg.solve(HUB * scale, load) + rng.normal(0.0, CELL_NOISE, 3)
            lines.append(",".join(f"{v:.6f}" for v in (*cells, *load)) + f",{run},up")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        (home / "loads.csv").write_text("\n".join(lines) + "\n")
        (home / "SESSION.toml").write_text(
            'schema = 1\ninstrument = "m15-virtual"\ndate = 2026-03-02\noperator = "first person"\n'
            'indications = ["D51", "D52", "E5"]\nloads = ["FY", "MZ", "MX"]\ndata = "loads.csv"\n'
            'zero = "tared"\n'
        )
        return calibrate(home / "SESSION.toml", Registry(home / "calibrations")).record


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """What the instruments of one test show: true (1 + scale) + zero, and forces times 1 + ``force``."""

    SA_zero: float = 0.0
    SA_scale: float = 0.0
    FZ_scale: float = 0.0
    force: float = 0.0

    @classmethod
    def drawn(cls, machine: Machine, rng: np.random.Generator) -> Errors:
        """Return errors of the sizes that the machine definition states."""
        SA, scale, FZ, P = (machine.stated_uncertainty(name) for name in ("SA", "SA_scale", "FZ", "P"))
        z = rng.standard_normal(4)
        return cls(
            SA_zero=z[0] * SA.u, SA_scale=z[1] * scale.relative, FZ_scale=z[2] * FZ.relative,
            force=z[3] * P.u / PRESSURE * P.effect,
        )  # fmt: skip


def made(
    design: Design, machine: Machine, record: CalibrationRecord, rng: np.random.Generator, scale: float = 1.0
) -> ReducedTest:
    """Return a reduced test of a design on a hub for ``scale`` times the loads."""
    shown = Errors.drawn(machine, rng) if design.stated else Errors()
    zeros = rng.normal(0.0, 0.01, 3)
    tare = zeros + rng.normal(0.0, CELL_NOISE / 10, 3)
    rotations: tuple[tuple[Rotation, int], ...] = (("forward", 0), ("reverse", 1))
    recordings = [
        _file(design, machine, rotation, place, number, shown, zeros, rng, scale)
        for rotation, place in rotations
        for number in range(len(design.angles[place]))
    ]
    return reduce_test(
        info=TestInfo(name="foreign", machine=machine.name, pressure_Pa=PRESSURE, simulated=True),
        machine=machine,
        record=record,
        recordings=recordings,
        tare=Tare(
            source="test.toml", values=tuple(zip(CELLS, tare.tolist(), strict=True)), unit="mV/V",
            u=tuple((cell, CELL_NOISE / 10) for cell in CELLS),
        ),
    )  # fmt: skip


def _file(
    design: Design,
    machine: Machine,
    rotation: Rotation,
    place: int,
    number: int,
    shown: Errors,
    zeros: Array,
    rng: np.random.Generator,
    scale: float,
) -> tuple[str, Recording, Rotation]:
    angles = design.angles[place]
    angle = angles[number]
    rising = angle >= (angles[number - 1] if number else 0.0)
    true_SA = math.radians(angle + rng.normal(0.0, design.rest))
    noise = design.sd * (design.reverse_noise if rotation == "reverse" else 1.0)
    moved = zeros + rng.normal(0.0, design.rezero, 3) if design.rezero else zeros
    columns: dict[str, list[Array]] = {name: [] for name in ("FZ", *CELLS, "SA")}
    for load in design.loads[place]:
        n = design.rows
        FZ = load * LBF * (1 + rng.normal(0.0, design.loads_sd)) * np.ones(n)
        SA = true_SA + math.radians(0.002) * rng.standard_normal(n)
        FY, MZ = design.tire.machine(SA, FZ, rotation)
        FY = (FY + (0.5 if rising else -0.5) * design.hysteresis) * (1 + shown.force)
        MZ = MZ * (1 + shown.force)
        at_hub = np.vstack([FY / LBF, MZ / LBF_FT, -0.3 * FY / LBF])
        at_hub += scale * noise * np.array([[1.0], [0.1], [0.5]]) * coloured(rng, (3, n), design.rho)
        cells = np.linalg.solve(HUB * scale, at_hub) + moved[:, None]
        columns["FZ"].append(FZ * (1 + shown.FZ_scale) / LBF + 0.2 * scale * rng.standard_normal(n))
        columns["SA"].append(np.degrees(SA * (1 + shown.SA_scale) + shown.SA_zero))
        for name, values in zip(CELLS, cells, strict=True):
            columns[name].append(values)
    series = tuple(
        Series(
            symbol=column.symbol, header=column.header, unit=column.unit, role=column.role,
            values=np.concatenate(columns[column.symbol]),
        )
        for column in machine.columns
        if column.symbol in columns
    )  # fmt: skip
    name = f"{rotation}_{number}.xlsx"
    return (
        name,
        Recording(
            path=Path(name), sha256=f"{rng.integers(2**62)}", machine=machine, series=series, simulated=True,
            format="labview",
        ),
        rotation,
    )  # fmt: skip


def coloured(rng: np.random.Generator, shape: tuple[int, int], rho: float) -> Array:
    """Return a settled autoregression of unit variance along the rows (channels, rows)."""
    white = rng.standard_normal(shape)
    white[:, 1:] *= math.sqrt(1 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], white))


def readings(design: Design, seed: int) -> list[tuple[str, int, float, float, float]]:
    """Return name, place of the load, error, u and U of every characteristic asked, drum forward."""
    rng = np.random.default_rng([1954, seed])
    machine = load_machine("m15-virtual")
    if not design.stated:
        machine = dataclasses.replace(machine, type_b=())
    record = own_record(seed // 25)
    design = dataclasses.replace(design, tire=design.tire.drawn(rng))
    found = characterise(made(design, machine, record, rng), machine=machine, record=record)
    read: list[tuple[str, int, float, float, float]] = []
    largest: dict[tuple[str, float], float] = {}
    for row in found.rows:
        if row.estimate is None or row.rotation == "reverse":
            continue
        name = row.name if row.name in ASKED else _extreme(row, found.rows, largest)
        true = design.tire.true(row)
        if name is not None and true is not None:
            U, _ = row.estimate.expanded()
            place = found.loads_N.index(row.load_N)
            read.append((name, place, row.estimate.value - true, row.estimate.u, U))
    return read


def _extreme(row: Row, rows: Sequence[Row], largest: dict[tuple[str, float], float]) -> str | None:
    """Return the name of the step at which FY or MZ is largest at positive slip, of others None."""
    if row.name not in ("FY", "MZ") or not row.SA_rad or row.SA_rad < 0:
        return None
    key = (row.name, row.load_N)
    if key not in largest:
        largest[key] = max(
            abs(other.estimate.value)
            for other in rows
            if other.name == row.name and other.load_N == row.load_N and other.rotation == row.rotation
            and other.SA_rad and other.SA_rad > 0 and other.estimate is not None
        )  # fmt: skip
    return f"peak {row.name}" if row.estimate and abs(row.estimate.value) == largest[key] else None


def _one(job: tuple[Design, int]) -> list[tuple[str, int, float, float, float]]:
    return readings(*job)


def run(designs: Sequence[Design], repetitions: int, seed: int, *, workers: int = 1) -> list[CoverageRow]:
    """Return one row a design and characteristic, at the middle one of its loads."""
    rows: list[CoverageRow] = []
    for design in designs:
        jobs = [(design, 100_000 * seed + i) for i in range(repetitions)]
        every = [one for some in _mapped(_one, jobs, workers) for one in some]
        middle = (1 + max((place for _, place, *_ in every), default=0)) // 2
        for name in (*ASKED, "peak FY", "peak MZ"):
            part = [one for one in every if one[:2] == (name, middle)]
            rows.append(
                row_of(
                    name,
                    design.name,
                    errors=[p[2] for p in part],
                    u=[p[3] for p in part],
                    U=[p[4] for p in part],
                )
            )
    return rows


def _mapped(
    work: Callable[[tuple[Design, int]], list[tuple[str, int, float, float, float]]],
    jobs: Sequence[tuple[Design, int]],
    workers: int,
) -> Iterator[list[tuple[str, int, float, float, float]]]:
    if workers == 1:
        yield from map(work, jobs)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(work, jobs, chunksize=4)


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage."""
    return run(DESIGNS, repetitions, seed, workers=workers)
