"""What `toolkit plan test` promises, against what the planned test then reaches, on drawn tires.

    python -m tests.campaigns.promised_tests [--first 0] [--plans 24] [--times 8] [--seed 2500]

Each plan is asked for as a person asks, of a tire file, demands and loads that are drawn. Nothing of the
planner is used but its answer. The plan is then carried out several times on the same tire, with a
record of a session of its own and every error that the machine definition states. Held against the tire:
U reached over U promised, errors within the U that the test states, and within the U that was promised.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.campaigns.physics_gate import EXAMPLES
from tests.coverage.characteristics import drawn_test, session_record
from tests.coverage.rows import exact_interval
from toolkit.characteristics.characterise import characterise
from toolkit.declared import answer as declared_answer
from toolkit.lab.plans.protocol_plan import ProtocolOrder, plan_test
from toolkit.machine import load_machine
from toolkit.simulation.plan import Plan, read_plan
from toolkit.simulation.steady import settled
from toolkit.simulation.truth import true_stiffness

if TYPE_CHECKING:
    from toolkit.channels import Rotation
    from toolkit.characteristics.model import Row
    from toolkit.simulation.steady import Answer

MACHINE = load_machine("m15-virtual")
NAMES = ("slope_cornering", "conicity", "plysteer", "peak")
SCALES = {"LMUY": 0.25, "LKY": 0.4, "LCY": 0.05, "LEY": 0.3, "LTR": 0.2, "LRES": 0.5}
"""Scale factors of the packaged tire file are drawn within this part of 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One characteristic of one test: error, U that the test states, U that was promised,
    and the U that was said to be kept in nine of ten."""

    plan: int
    time: int
    name: str
    error: float
    U: float
    promised: float
    kept: float


def drawn_tire(folder: Path, rng: np.random.Generator) -> Path:
    """Write the packaged tire with its scale factors drawn; return the file."""
    text = (EXAMPLES / "tire.tir").read_text(encoding="utf-8")
    for name, part in SCALES.items():
        text = text.replace(f"{name} = 1\n", f"{name} = {1 + rng.uniform(-part, part):.5f}\n")
    path = folder / "drawn.tir"
    path.write_text(text, encoding="utf-8")
    return path


def tested_plan(folder: Path, tire: Path, asked: dict[str, Any], seed: int) -> Plan:
    """Return the planned test of a tire as a plan of the virtual machine."""
    path = folder / "plan.toml"
    path.write_text(
        "schema = 1\ndate = 2026-03-17\n"
        f'[tire]\nfile = "{tire.name}"\n', encoding="utf-8",
    )  # fmt: skip
    return dataclasses.replace(
        read_plan(path), seed=seed,
        slip_angles_rad=tuple(math.radians(angle) for angle in asked["slip_angles_deg"]),
        loads_N=tuple(asked["loads_N"]), rotations=tuple(asked["rotations"]),
    )  # fmt: skip


def outcomes(number: int, times: int, seed: int) -> Iterator[Outcome]:
    """Yield what a plan promised, and what each test of it reached."""
    rng = np.random.default_rng([seed, number])
    loads = MACHINE.protocol.loads_N
    names = sorted(rng.choice(NAMES, size=int(rng.integers(1, 4)), replace=False).tolist())
    chosen = sorted(rng.choice(len(loads), size=int(rng.integers(1, 4)), replace=False).tolist())
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        tire = drawn_tire(folder, rng)
        order = ProtocolOrder(
            like=(tire,), demands=tuple(names), loads=tuple(f"{loads[i]:.1f} N" for i in chosen)
        )
        answer = declared_answer(plan_test(order)[0])
        sys.stderr.write(f"{number}: {names} at {len(chosen)} loads: {answer['plan']['rows']} rows\n")
        for time in range(times):
            draws = np.random.default_rng([seed, number, time])
            plan = tested_plan(folder, tire, answer["plan"], int(draws.integers(2**31)))
            record = session_record(int(draws.integers(2**31)))
            own = dataclasses.replace(
                MACHINE.protocol, slip_angles_rad=plan.slip_angles_rad, loads_N=plan.loads_N
            )
            reduced = drawn_test(plan, record, dataclasses.replace(MACHINE, protocol=own), draws)
            steps = {c.FZ_common: c.step_FZ for c in reduced.used() if c.step_FZ is not None}
            rows = [r for r in characterise(reduced, machine=MACHINE, record=record).rows if r.estimate]
            truth = settled(plan, {})
            for value in answer["values"]:
                row = _row_of(value, rows, steps)
                if row is None or row.estimate is None:
                    raise ValueError(f"the test lacks {value['name']} at {value['load_N']:g} N")
                yield Outcome(
                    plan=number, time=time, name=value["name"], U=row.estimate.expanded()[0],
                    error=row.estimate.value - _true(truth, value["name"], row), promised=value["planned_U"],
                    kept=value["planned_U_in_nine_of_ten"],
                )  # fmt: skip


def _row_of(value: dict[str, Any], rows: list[Row], steps: dict[float, float]) -> Row | None:
    """Return the row of the promised value's load, direction and slip angle."""
    name = "FY" if value["name"] == "peak" else value["name"]
    for row in rows:
        step = min(steps.items(), key=lambda item: abs(item[0] - row.load_N))[1]
        here = row.name == name and row.rotation == value["rotation"] and math.isclose(step, value["load_N"])
        at = None if row.SA_rad is None else math.degrees(row.SA_rad)
        if here and (value["SA_deg"] is None or (at is not None and abs(at - value["SA_deg"]) < 1e-3)):
            return row
    return None


def _true(tire: Answer, name: str, row: Row) -> float:
    rotation: Rotation = "reverse" if row.rotation == "reverse" else "forward"
    if name == "peak":
        # Rows are in SAE axes, the tire in the machine's: with the drum reversed FY has the other sign.
        force = tire(row.SA_rad or 0.0, row.load_N, rotation)[0]
        return force if rotation == "forward" else -force
    if name == "slope_cornering":
        return true_stiffness(tire, load_N=row.load_N, rotation=rotation).slope_cornering
    forward, reverse = (tire(0.0, row.load_N, rotation)[0] for rotation in MACHINE.rotations)
    return (forward + reverse) / 2 if name == "conicity" else (forward - reverse) / 2


def table(every: list[Outcome]) -> Iterator[str]:
    """Yield the lines of the table; intervals of one test share their errors and count once."""
    yield (
        "| characteristic | intervals | U reached / promised, mean (5 to 95 %) | within its own U, % "
        "| 95 % of it | within the promised U, % | U no more than in nine of ten, % |"
    )
    yield "|---|---|---|---|---|---|---|"
    for name in NAMES:
        mine = [one for one in every if one.name == name]
        if not mine:
            continue
        ratios = np.array([one.U / one.promised for one in mine])
        low, high = np.quantile(ratios, [0.05, 0.95])
        own = float(np.mean([abs(one.error) <= one.U for one in mine]))
        promised = float(np.mean([abs(one.error) <= one.promised for one in mine]))
        tests = len({(one.plan, one.time) for one in mine})
        least, most = exact_interval(round(own * tests), tests)
        yield (
            f"| {name} | {len(mine)} | {ratios.mean():.3f} ({low:.2f} to {high:.2f}) | {100 * own:.1f} | "
            f"{100 * least:.1f} to {100 * most:.1f} | {100 * promised:.1f} | "
            f"{100 * np.mean([one.U <= one.kept for one in mine]):.0f} |"
        )


def by_plan(every: list[Outcome]) -> Iterator[str]:
    """Yield a line for each plan and characteristic: U reached over promised, test by test."""
    for plan, name in dict.fromkeys((one.plan, one.name) for one in every):
        mine = [one for one in every if (one.plan, one.name) == (plan, name)]
        held = sum(abs(one.error) <= one.U for one in mine)
        ratios = ", ".join(f"{one.U / one.promised:.2f}" for one in mine)
        yield f"plan {plan}, {name}: {held} of {len(mine)} within U; {ratios}"


def main() -> None:
    """Print the table, and what it was made of."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.promised_tests", description=__doc__)
    parser.add_argument("--plans", type=int, default=24)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--times", type=int, default=8)
    parser.add_argument("--seed", type=int, default=2500)
    given = parser.parse_args()
    numbers = range(given.first, given.plans)
    every = [one for number in numbers for one in outcomes(number, given.times, given.seed)]
    sys.stdout.write("\n".join((*table(every), "", *by_plan(every))) + "\n")


if __name__ == "__main__":
    main()
