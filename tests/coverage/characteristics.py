"""Coverage of characteristics: whole virtual tests with every error that the machine definition states.

Each repetition is a reference-load session that becomes a record, and a test of the virtual machine forward
and reversed. Drawn anew: the session's reference loads and readings, the noise of every row, the loads at
which the test stands, and of the machine's stated errors the zero and the scale of the slip angle, the scale
of the load, and the pressure. What is read off the test is held against the tire that it was made from, at
the load at which it is stated.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

import toolkit
from tests.coverage.rows import CoverageRow, row_of
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.channels import Rotation
from toolkit.characteristics.characterise import characterise
from toolkit.estimate import Estimate
from toolkit.machine import Machine, load_machine
from toolkit.recording.model import Recording, Series, TestInfo
from toolkit.reduction.model import ReducedTest, Tare
from toolkit.reduction.reduce import reduce_test
from toolkit.simulation.plan import Plan, read_plan, with_effects
from toolkit.simulation.run import VirtualTest, simulate
from toolkit.simulation.session import simulate_session
from toolkit.simulation.steady import settled
from toolkit.simulation.truth import true_pull, true_stiffness
from toolkit.simulation.write import write_session
from toolkit.units import si_scale

_EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
MACHINE = load_machine("m15-virtual")
PULL = ("conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero")
STIFFNESS = ("secant_cornering", "secant_aligning", "slope_cornering", "slope_aligning")
# Of the protocol's five, by their places.
LOADS = {0: "250 lbf", 2: "833 lbf", 4: "1372 lbf"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """What is drawn beside record and noise: ``stated`` the machine's type B terms.

    ``effects`` are switched on as in ``toolkit simulate --effect``; they move no mean of a whole turn.
    """

    name: str
    stated: bool = True
    effects: tuple[str, ...] = ()


CELLS = (
    Cell(name="every stated error, the record, noise"),
    Cell(name="the record and noise", stated=False),
    Cell(name="the record, noise, an uneven tire", stated=False, effects=("nonuniformity.FY=40N",)),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One characteristic of one repetition: its error against the truth, u and 95 % half width."""

    name: str
    load: int
    rotation: str
    error: float
    u: float
    U: float


def readings(cell: Cell, seed: int) -> tuple[Reading, ...]:
    """Return every characteristic of one repetition."""
    rng = np.random.default_rng([1987, seed])
    bare = dataclasses.replace(_plan(), seed=int(rng.integers(2**31)))
    plan = with_effects(bare, list(cell.effects))
    machine = MACHINE if cell.stated else dataclasses.replace(MACHINE, type_b=())
    record = session_record(int(rng.integers(2**31)))
    reduced = drawn_test(plan, record, machine, rng)
    found = characterise(reduced, machine=machine, record=record)
    tire = settled(bare, {})
    # Several characteristics are read off at each load: the tire is asked once.
    pull = functools.cache(lambda load_N: true_pull(tire, load_N=load_N))
    stiffness = functools.cache(
        lambda load_N, rotation: true_stiffness(tire, load_N=load_N, rotation=rotation)
    )
    made: list[Reading] = []

    def hold(name: str, load: int, rotation: str, estimate: Estimate | None, true: float) -> None:
        if estimate is not None:
            U, _ = estimate.expanded()
            error = estimate.value - true
            made.append(Reading(name=name, load=load, rotation=rotation, error=error, u=estimate.u, U=U))

    for row in found.rows:
        load = found.loads_N.index(row.load_N)
        if row.name in PULL:
            hold(row.name, load, "both", row.estimate, getattr(pull(row.load_N), row.name))
        elif row.name in STIFFNESS:
            rotation = cast("Rotation", row.rotation)
            true = getattr(stiffness(row.load_N, rotation), row.name)
            hold(row.name, load, rotation, row.estimate, true)
    return tuple(made)


def _plan() -> Plan:
    return read_plan(_EXAMPLES / "test_plan.toml")


@functools.lru_cache(maxsize=2)
def session_record(seed: int) -> CalibrationRecord:
    """Return the record of a reference-load session that is drawn."""
    plan = dataclasses.replace(read_plan(_EXAMPLES / "session_plan.toml"), seed=seed)
    with tempfile.TemporaryDirectory() as folder:
        session = write_session(simulate_session(plan), Path(folder) / "session")
        (Path(folder) / "calibrations").mkdir()
        return calibrate(session[0], Registry(Path(folder) / "calibrations")).record


def drawn_test(
    plan: Plan, record: CalibrationRecord, machine: Machine, rng: np.random.Generator
) -> ReducedTest:
    """Return a test of a plan with every error drawn that the machine's instruments are stated to have."""
    test = simulate(plan)
    drawn = _Drawn.of(machine, plan.pressure_Pa, rng)
    tare = Tare(source="test.toml", values=test.tare, unit=test.tare_unit, u=test.tare_u)
    return reduce_test(
        info=TestInfo(name="coverage", machine=MACHINE.name, pressure_Pa=plan.pressure_Pa, simulated=True),
        machine=machine,
        record=record,
        recordings=list(_recordings(test, drawn)),
        tare=tare,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    """What the machine's instruments show wrongly in one test: shown = true (1 + scale) + zero."""

    SA_zero: float
    SA_scale: float
    FZ_scale: float
    force: float

    @classmethod
    def of(cls, machine: Machine, pressure_Pa: float, rng: np.random.Generator) -> _Drawn:
        SA, scale, FZ, P = (machine.stated_uncertainty(name) for name in ("SA", "SA_scale", "FZ", "P"))
        z = rng.standard_normal(4)
        return cls(
            SA_zero=z[0] * SA.u,
            SA_scale=z[1] * scale.relative,
            FZ_scale=z[2] * FZ.relative,
            force=z[3] * P.u / pressure_Pa * P.effect,
        )


def _recordings(test: VirtualTest, drawn: _Drawn) -> Iterator[tuple[str, Recording, Rotation]]:
    """Return the recordings as they would be read, with what the instruments show wrongly."""
    tare = dict(test.tare)
    for file in test.files:
        columns = dict(file.columns)
        unit = {one.symbol: one.unit for one in test.plan.machine.columns}
        columns["SA"] = columns["SA"] * (1 + drawn.SA_scale) + drawn.SA_zero / si_scale(unit["SA"])
        columns["FZ"] = columns["FZ"] * (1 + drawn.FZ_scale)
        for name, zero in tare.items():
            columns[name] = zero + (columns[name] - zero) * (1 + drawn.force)
        series = tuple(
            Series(
                symbol=one.symbol,
                header=one.header,
                unit=one.unit,
                role=one.role,
                values=np.asarray(columns[one.symbol], dtype=np.float64),
            )
            for one in test.plan.machine.columns
            if one.symbol in columns and one.role != "acquired"
        )
        yield (
            file.name,
            Recording(
                path=Path(file.name),
                sha256=f"{test.plan.seed}/{file.name}",
                machine=MACHINE,
                series=series,
                simulated=True,
                format="labview",
            ),
            file.rotation,
        )


def _one(cell_and_seed: tuple[Cell, int]) -> tuple[Reading, ...]:
    return readings(*cell_and_seed)


def run(cells: Sequence[Cell], repetitions: int, seed: int, *, workers: int = 1) -> list[CoverageRow]:
    """Return one row a cell, characteristic and load of `LOADS`, drum forward where a direction is asked.

    What one repetition gives at several loads and in both directions shares its errors: counted together it
    would make the binomial interval too narrow.
    """
    rows: list[CoverageRow] = []
    for cell in cells:
        jobs = [(cell, 100_000 * seed + i) for i in range(repetitions)]
        if workers > 1:
            with ProcessPoolExecutor(workers) as pool:
                found = list(pool.map(_one, jobs, chunksize=4))
        else:
            found = [_one(job) for job in jobs]
        every = [one for some in found for one in some if one.rotation != "reverse"]
        for name, (load, text) in itertools.product((*PULL, *STIFFNESS), LOADS.items()):
            part = [one for one in every if one.name == name and one.load == load]
            rows.append(
                row_of(
                    name,
                    f"{cell.name}; {text}",
                    errors=[one.error for one in part],
                    u=[one.u for one in part],
                    U=[one.U for one in part],
                )
            )
    return rows


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage."""
    return run(CELLS, repetitions, seed, workers=workers)
