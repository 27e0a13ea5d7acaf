"""Planned tests of three kinds of tires, blind: passenger, truck, racing slick, each on a machine of its
loads.

    python -m tests.campaigns.planned_kinds [--tires 40] [--seed 25]

A plan is made once a kind, from three tests of one tire of that kind; the tires that it is held against are
drawn and never seen by it. Tires, hub and noise are those of `tests.coverage.foreign_tests`, which know
nothing of the toolkit's virtual machine. Beside the plan stand the machine's protocol, every angle at every
load, and in as many rows as the plan evenly spaced angles and a low-discrepancy sequence. The demands are the
protocol's own uncertainties of conicity, plysteer, cornering stiffness and peak, at all five loads. Counted
are the intervals at the middle load, one a tire: what one test says at several loads shares its errors.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tests.campaigns.planned_tests import NAMES
from tests.coverage.foreign_tests import DESIGNS, LBF, Tire, made, own_record
from tests.coverage.rows import exact_interval
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.model import Row
from toolkit.machine import Machine, load_machine
from toolkit.pipeline import TestResult
from toolkit.planning.demands import PEAK, parse_demand
from toolkit.planning.design import Design, ordered, standard, steps_of
from toolkit.planning.expectation import earlier_test, pooled
from toolkit.planning.protocol_search import Question, least_plan
from toolkit.planning.tread import Tread


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of tires: the one that the planner is shown, and its machine's loads in units of the M-15's."""

    name: str
    tire: Tire
    scale: float


KINDS = (
    Kind(name="passenger", tire=Tire(), scale=1.0),
    Kind(
        name="truck", scale=6.0,
        tire=Tire(FN=25_000.0, c1=215_000.0, c2=38_000.0, mu=0.78, fade=0.14, C=1.25, E=-0.2, trail=0.062,
                  blunt=7.0, conicity=210.0, conicity_moment=9.0, plysteer=0.0016, residual=35.0),
    ),
    Kind(
        name="racing slick", scale=0.25,
        tire=Tire(FN=1000.0, c1=27_000.0, c2=1900.0, mu=1.9, fade=0.12, C=1.5, E=-1.0, trail=0.022,
                  blunt=11.0, conicity=12.0, conicity_moment=0.15, plysteer=0.0009, residual=0.4),
    ),
)  # fmt: skip


def machine_of(kind: Kind) -> Machine:
    """Return the machine of a kind: the virtual one with its protocol's loads scaled."""
    machine = load_machine("m15-virtual")
    loads = tuple(load * kind.scale for load in machine.protocol.loads_N)
    return dataclasses.replace(machine, protocol=dataclasses.replace(machine.protocol, loads_N=loads))


def result_of(
    kind: Kind, tire: Tire, machine: Machine, design: Design, seed: tuple[int, ...], *, mixed: bool
) -> TestResult:
    """Return a test of a tire by a design, its angles in a mixed order, with every stated error drawn."""
    rng = np.random.default_rng(seed)
    order = ordered(design.slip_angles_rad, seed=seed[-1]) if mixed else design.slip_angles_rad
    degrees = tuple(math.degrees(angle) for angle in order)
    loads = tuple(load / LBF for load in sorted(design.loads_N))
    how = dataclasses.replace(DESIGNS[0], tire=tire, angles=(degrees, degrees), loads=(loads, loads))
    protocol = dataclasses.replace(machine.protocol, slip_angles_rad=order, loads_N=design.loads_N)
    record = own_record(seed[-1] // 10, kind.scale)
    reduced = made(how, dataclasses.replace(machine, protocol=protocol), record, rng, kind.scale)
    return TestResult(reduced=reduced, characteristics=characterise(reduced, machine=machine, record=record))


def designs_of(kind: Kind, machine: Machine, seed: int) -> dict[str, Design]:
    """Return the designs of a kind, by name."""
    own = standard(machine, machine.rotations)
    shown = [result_of(kind, kind.tire, machine, own, (seed, 0, number), mixed=False) for number in range(3)]
    earlier = pooled([earlier_test(one, machine=machine, record=own_record(0, kind.scale)) for one in shown])
    question = Question.beside(
        own, tires=(earlier,), demands=tuple(parse_demand(name) for name in NAMES), loads_N=earlier.loads_N
    )
    plan = least_plan(question, Tread.of(machine, (earlier,))).design
    count = len(plan.slip_angles_rad)
    even = tuple(math.radians(angle) for angle in np.linspace(-10, 10, count))
    sequence = tuple(math.radians(20 * halton(place) - 10) for place in range(1, count + 1))
    return {
        "protocol": own,
        "planned": plan,
        "evenly spaced": dataclasses.replace(plan, slip_angles_rad=even),
        "low discrepancy": dataclasses.replace(plan, slip_angles_rad=sequence),
        "every angle, every load": dataclasses.replace(own, slip_angles_rad=steps_of(machine)),
    }


def halton(place: int) -> float:
    """Return a member of van der Corput's sequence to base two, from 1.

    >>> [halton(place) for place in (1, 2, 3, 4)]
    [0.5, 0.25, 0.75, 0.125]
    """
    value, part = 0.0, 0.5
    while place:
        value += part * (place % 2)
        place, part = place // 2, part / 2
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """One interval of one tire: ``ratio`` is U over that of the protocol on the same tire."""

    kind: str
    design: str
    rows: int
    name: str
    error: float
    U: float
    ratio: float


def held(kind: Kind, machine: Machine, designs: dict[str, Design], number: int, seed: int) -> Iterator[Held]:
    """Yield the intervals of a tire that is drawn, by every design, at the middle load."""
    mine = KINDS.index(kind)
    tire = kind.tire.drawn(np.random.default_rng([seed, 1, mine, number]))
    widths: dict[str, float] = {}
    for place, (name, design) in enumerate(designs.items()):
        result = result_of(
            kind, tire, machine, design, (seed, 2, mine, place, number), mixed=name != "protocol"
        )
        loads = result.characteristics.loads_N
        for asked, row in middle(result.characteristics.rows, loads[len(loads) // 2]):
            true = tire.true(row)
            if row.estimate is None or true is None:
                continue
            U, _ = row.estimate.expanded()
            widths.setdefault(asked, U)
            yield Held(
                kind=kind.name, design=name, rows=design.rows, name=asked, error=row.estimate.value - true,
                U=U, ratio=U / widths[asked],
            )  # fmt: skip


def middle(rows: tuple[Row, ...], load_N: float) -> Iterator[tuple[str, Row]]:
    """Yield what is asked at a load, drum forward; the peak is FY where it is largest at positive slip."""
    mine = [row for row in rows if row.load_N == load_N and row.rotation != "reverse" and row.estimate]
    yield from ((row.name, row) for row in mine if row.name in NAMES)
    beyond = [row for row in mine if row.name == "FY" and row.SA_rad and row.SA_rad > 0]
    if beyond:
        yield PEAK, max(beyond, key=lambda row: abs(row.estimate.value) if row.estimate else 0.0)


def table(every: list[Held]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield (
        "| kind | design | rows | what | tires | covers % | 95 % of it | rms error / protocol's "
        "| median U / protocol's |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for kind, design, rows, name in dict.fromkeys((h.kind, h.design, h.rows, h.name) for h in every):
        mine = [h for h in every if (h.kind, h.design, h.name) == (kind, design, name)]
        own = [h for h in every if (h.kind, h.design, h.name) == (kind, "protocol", name)]
        covered = sum(abs(h.error) <= h.U for h in mine)
        low, high = exact_interval(covered, len(mine))
        rms, of_protocol = (math.sqrt(float(np.mean([h.error**2 for h in part]))) for part in (mine, own))
        yield (
            f"| {kind} | {design} | {rows} | {name} | {len(mine)} | {100 * covered / len(mine):.1f} | "
            f"{100 * low:.1f} to {100 * high:.1f} | {rms / of_protocol:.2f} | "
            f"{np.median([h.ratio for h in mine]):.3f} |"
        )


def main() -> None:
    """Print the designs and the table, kind after kind."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.planned_kinds", description=__doc__)
    parser.add_argument("--tires", type=int, default=40, help="of each kind")
    parser.add_argument("--seed", type=int, default=25)
    given = parser.parse_args()
    every: list[Held] = []
    for kind in KINDS:
        machine = machine_of(kind)
        designs = designs_of(kind, machine, given.seed)
        for name, design in designs.items():
            angles = ", ".join(f"{math.degrees(a):.4g}" for a in sorted(design.slip_angles_rad))
            sys.stdout.write(f"{kind.name}, {name}: {design.rows} rows at {angles} deg\n")
        sys.stdout.flush()
        for number in range(given.tires):
            every += held(kind, machine, designs, number, given.seed)
        sys.stdout.write("\n".join(table([h for h in every if h.kind == kind.name])) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
