"""Planned tests against the machine's protocol, on virtual tires that the planner has not seen.

    python -m tests.campaigns.planned_tests [--tires 100] [--seed 25] [--workers 1]

One plan is made for each choice of loads, by a test of the published tire. Then tires are drawn: stiffness,
friction, shape and trail of the packaged property file scaled at random, with a plysteer and a conicity of
their own. Each is tested by every design, with a record of its own session, fresh noise and fresh errors of
every instrument that the machine definition states (`tests.coverage.characteristics`). Held against the tire:
coverage of the 95 % intervals, U over that of the protocol on the same tire, and the errors themselves.
Beside the plan: the protocol, evenly spaced angles in as many rows, and every angle once.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tests.campaigns.physics_gate import EXAMPLES
from tests.coverage.characteristics import drawn_test, session_record
from tests.coverage.rows import exact_interval
from toolkit.characteristics.characterise import characterise
from toolkit.machine import Machine, load_machine
from toolkit.pipeline import TestResult
from toolkit.planning.demands import PEAK, parse_demand
from toolkit.planning.design import Design, ordered, standard, steps_of
from toolkit.planning.expectation import EarlierTest, earlier_test, pooled
from toolkit.planning.protocol_search import Question, least_plan
from toolkit.planning.tread import Tread
from toolkit.simulation.file_tire import read_file_tire
from toolkit.simulation.plan import Plan, read_plan, with_effects, with_numbers
from toolkit.simulation.steady import settled
from toolkit.simulation.truth import true_stiffness

if TYPE_CHECKING:
    from toolkit.characteristics.model import Row
    from toolkit.simulation.steady import Answer

MACHINE = load_machine("m15-virtual")
NAMES = ("conicity", "plysteer", "slope_cornering", PEAK)
LOADS = {"five loads": slice(0, 5), "three loads": slice(1, 4)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One design of the table, by what loads it serves."""

    loads: str
    asked_N: tuple[float, ...]
    name: str
    design: Design


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """One interval of one tire: ``ratio`` is U over that of the protocol on the same tire."""

    loads: str
    design: str
    name: str
    tire: int
    rows: int
    error: float
    U: float
    ratio: float


def published(seed: int) -> EarlierTest:
    """Return what the planner is given: three tests of the published tire, each with errors of its own."""
    tests = []
    for number in range(3):
        rng = np.random.default_rng([seed, 0, number])
        plan = dataclasses.replace(read_plan(EXAMPLES / "test_plan.toml"), seed=int(rng.integers(2**31)))
        record = session_record(int(rng.integers(2**31)))
        reduced = drawn_test(plan, record, MACHINE, rng)
        found = characterise(reduced, machine=MACHINE, record=record)
        result = TestResult(reduced=reduced, characteristics=found)
        tests.append(earlier_test(result, machine=MACHINE, record=record))
    return pooled(tests)


def entries(seed: int) -> tuple[Entry, ...]:
    """Return the designs that are compared."""
    earlier = published(seed)
    own = standard(MACHINE, MACHINE.rotations)
    demands = tuple(parse_demand(name) for name in NAMES)
    made: list[Entry] = []
    for text, part in LOADS.items():
        loads = earlier.loads_N[part]
        question = Question.beside(own, tires=(earlier,), demands=demands, loads_N=loads)
        found = least_plan(question, Tread.of(MACHINE, (earlier,)))
        size = len(found.design.slip_angles_rad)
        even = tuple(math.radians(a) for a in np.linspace(-10, 10, size))
        for name, design in (
            ("protocol", own),
            ("planned", found.design),
            ("evenly spaced", dataclasses.replace(found.design, slip_angles_rad=even)),
            ("every angle", dataclasses.replace(found.design, slip_angles_rad=steps_of(MACHINE))),
        ):
            made.append(Entry(loads=text, asked_N=loads, name=name, design=design))
    return tuple(made)


def tire_plan(number: int, seed: int) -> Plan:
    """Return the plan of a tire that is drawn."""
    rng = np.random.default_rng([seed, 1, number])
    plan = read_plan(EXAMPLES / "test_plan.toml")
    file = read_file_tire(EXAMPLES / "tire.tir")
    low = {"LMUY": 0.8, "LKY": 0.7, "LCY": 0.95, "LEY": 0.7, "LTR": 0.8, "LRES": 0.5}
    scales = {name: float(rng.uniform(least, 2 - least)) for name, least in low.items()}
    file = dataclasses.replace(file, tir=with_numbers(file.tir, scales))
    tire = dataclasses.replace(plan.tire, plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=0.0)
    plan = dataclasses.replace(plan, tire_file=file, tire=tire, seed=int(rng.integers(2**31)))
    effects = [f"plysteer={rng.uniform(-0.3, 0.3):.4f}deg", f"conicity={rng.uniform(-80, 80):.3f}N"]
    return with_effects(plan, effects)


def held(number: int, seed: int, listed: tuple[Entry, ...]) -> tuple[Held, ...]:
    """Return every interval of a tire, by every design."""
    plan = tire_plan(number, seed)
    record, tire = session_record(number), settled(plan, {})
    made: list[Held] = []
    widths: dict[tuple[str, str, float, bool], float] = {}
    for place, entry in enumerate(listed):
        rng = np.random.default_rng([seed, 2, number, place])
        order = entry.design.slip_angles_rad
        if entry.name != "protocol":
            order = ordered(order, seed=place)
        mine = dataclasses.replace(
            plan, slip_angles_rad=order, loads_N=entry.design.loads_N, seed=int(rng.integers(2**31))
        )
        reduced = drawn_test(mine, record, _machine(order, entry.design.loads_N), rng)
        steps = {c.FZ_common: c.step_FZ for c in reduced.used() if c.step_FZ is not None}
        rows = [row for row in characterise(reduced, machine=MACHINE, record=record).rows if row.estimate]
        for name, row in _read(rows):
            nominal = min(steps.items(), key=lambda item: abs(item[0] - row.load_N))[1]
            if row.estimate is None or not any(math.isclose(nominal, load) for load in entry.asked_N):
                continue
            U, _ = row.estimate.expanded()
            key = (entry.loads, name, round(nominal), bool(row.SA_rad and row.SA_rad > 0))
            if entry.name == "protocol":
                widths[key] = U
            error = row.estimate.value - _true(tire, name, row)
            made.append(
                Held(loads=entry.loads, design=entry.name, name=name, tire=number, rows=entry.design.rows,
                     error=error, U=U, ratio=U / widths.get(key, math.nan))
            )  # fmt: skip
    return tuple(made)


def _machine(slip_angles_rad: tuple[float, ...], loads_N: tuple[float, ...]) -> Machine:
    protocol = dataclasses.replace(MACHINE.protocol, slip_angles_rad=slip_angles_rad, loads_N=loads_N)
    return dataclasses.replace(MACHINE, protocol=protocol)


def _read(rows: list[Row]) -> Iterator[tuple[str, Row]]:
    """Yield what is held against the tire, of a direction with the drum forward; peaks by side and load."""
    peaks: dict[tuple[float, bool], Row] = {}
    for row in rows:
        if row.rotation == "reverse":
            continue
        if row.name in NAMES:
            yield row.name, row
        elif row.name == "FY" and row.SA_rad:
            key = (row.load_N, row.SA_rad > 0)
            peaks[key] = max(row, peaks.get(key, row), key=_size)
    for row in peaks.values():
        yield PEAK, row


def _size(row: Row) -> float:
    return abs(row.estimate.value) if row.estimate else 0.0


def _true(tire: Answer, name: str, row: Row) -> float:
    if name == PEAK:
        return tire(row.SA_rad or 0.0, row.load_N, "forward")[0]
    if name == "slope_cornering":
        return true_stiffness(tire, load_N=row.load_N, rotation="forward").slope_cornering
    forward, reverse = (tire(0.0, row.load_N, rotation)[0] for rotation in MACHINE.rotations)
    return (forward + reverse) / 2 if name == "conicity" else (forward - reverse) / 2


def table(every: list[Held]) -> Iterator[str]:
    """Yield the lines of the table.

    The intervals of one tire share their errors: the binomial interval counts each tire once.
    """
    yield (
        "| loads | design | rows | characteristic | intervals | cover % | 95 % of it "
        "| rms error / protocol's | median U / protocol's |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    keys = dict.fromkeys((h.loads, h.design, h.rows, h.name) for h in every)
    for loads, design, rows, name in sorted(keys, key=lambda k: (k[0], NAMES.index(k[3]), -k[2])):
        mine = [h for h in every if (h.loads, h.design, h.name) == (loads, design, name)]
        own = [h for h in every if (h.loads, h.design, h.name) == (loads, "protocol", name)]
        share = float(np.mean([abs(h.error) <= h.U for h in mine]))
        tires = len({h.tire for h in mine})
        low, high = exact_interval(round(share * tires), tires)
        rms, of_protocol = (math.sqrt(float(np.mean([h.error**2 for h in part]))) for part in (mine, own))
        yield (
            f"| {loads} | {design} | {rows} | {name} | {len(mine)} | {100 * share:.1f} | "
            f"{100 * low:.1f} to {100 * high:.1f} | {rms / of_protocol:.2f} | "
            f"{np.median([h.ratio for h in mine]):.3f} |"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.planned_tests", description=__doc__)
    parser.add_argument("--tires", type=int, default=100)
    parser.add_argument("--seed", type=int, default=25)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    listed = entries(given.seed)
    for entry in listed:
        angles = ", ".join(f"{math.degrees(a):.4g}" for a in sorted(entry.design.slip_angles_rad))
        sys.stdout.write(f"{entry.loads}, {entry.name}: {entry.design.rows} rows at {angles} deg\n")
    job = functools.partial(held, seed=given.seed, listed=listed)
    if given.workers > 1:
        with ProcessPoolExecutor(given.workers) as pool:
            every = [h for some in pool.map(job, range(given.tires), chunksize=2) for h in some]
    else:
        every = [h for number in range(given.tires) for h in job(number)]
    sys.stdout.write("\n".join(table(every)) + "\n")


if __name__ == "__main__":
    main()
