"""The proof of session plans: ``python -m tests.planning --hubs 200``.

Every hub is calibrated by the machine's protocol; a plan is made from that record alone, with a fifth of its
loads, and carried out on the same hub. Beside it stand the protocol itself, carried out again, and designs of
as many loads as the plan has: the three-level factorial and a space-filling one. U is the budget's at the
largest load; an interval covers if it holds one more reading of another run.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import zlib
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from tests.planning import hubs
from toolkit.calibration.registry.candidate import Candidate, calibrate
from toolkit.calibration.registry.gates import unverifiable
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.terms import term_matrix
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.planning.fixtures import loads_of_record
from toolkit.planning.knowledge import Knowledge
from toolkit.planning.session_plan import SessionPlan, plan_session
from toolkit.planning.session_search import Demand

PLANNED = "plan"
METHODS = (PLANNED, "machine's protocol", "factorial", "space filling")


def carried_out(
    hub: hubs.Hub, plan: SessionPlan, rng: np.random.Generator
) -> tuple[hubs.Readings, hubs.Readings]:
    """Return what a hub shows under a plan's loads and check loads."""
    readings = hubs.read_session(
        hub, np.array([row.loads for row in plan.rows]), np.array([row.run - 1 for row in plan.rows]),
        np.array([row.direction == "up" for row in plan.rows]), rng,
    )  # fmt: skip
    return readings, hubs.read_check(hub, np.array([row.loads for row in plan.check]), rng)


def factorial(rows: int, runs: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the 27 points of three levels, shuffled and begun anew, inside what E5 may bear."""
    levels = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij")).reshape(3, -1).T
    opposed = levels[:, 0] * levels[:, 2] < 0
    levels[opposed] *= 0.6
    order = np.concatenate([rng.permutation(len(levels)) for _ in range(rows // len(levels) + 1)])
    return levels[order[:rows]] * hubs.LARGEST


def space_filling(rows: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return points of the machine's own loads, each the farthest from those before it."""
    share = np.unique(hubs.schedule()[0] / hubs.LARGEST, axis=0)
    chosen = [int(rng.integers(len(share)))]
    while len(chosen) < min(rows, len(share)):
        distance = np.linalg.norm(share[:, None] - share[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    chosen += rng.integers(len(share), size=rows - len(chosen)).tolist()
    return share[rng.permutation(chosen)] * hubs.LARGEST


def baseline(hub: hubs.Hub, method: str, rows: int, rng: np.random.Generator) -> hubs.Readings:
    """Return a session of one of the designs beside the plan."""
    if method == "machine's protocol":
        return hubs.machine_session(hub, rng)
    loads = factorial(rows, 3, rng) if method == "factorial" else space_filling(rows, rng)
    run = np.arange(rows) * 3 // rows
    size = np.abs(loads / hubs.LARGEST).max(axis=1)
    up = np.append(True, size[1:] >= size[:-1])
    return hubs.read_session(hub, loads, run, up, rng)


def judged(hub: hubs.Hub, made: Candidate, rng: np.random.Generator) -> dict[str, Any]:
    """Return U at the largest loads, whether it holds another reading, and what no check load verifies."""
    session, record = made.fit.session, made.record
    U, errors = [], []
    for at, fit in enumerate(record.loads):
        budget = calibration_budget(record, session.table, session.check, fit.load)
        load = np.zeros((1, 3))
        load[0, at] = budget.at
        reading = hubs.read_session(hub, load, np.zeros(1, dtype=np.intp), np.ones(1, dtype=bool), rng)
        terms = term_matrix(fit.terms, dict(zip(record.indications, reading.cells.T, strict=True)))
        errors.append(float((terms @ np.array(fit.coefficients))[0] - budget.at))
        U.append(budget.U)
    return {
        "loads": session.table.rows, "runs": len(np.unique(session.table.run)), "U": U, "error": errors,
        "unverified": list(unverifiable(record, session.check)),
        "signs": [
            bool(np.all(np.sign(fit.coefficients[:3]) == np.sign(hub.loads_by_cell[at])))
            for at, fit in enumerate(record.loads)
        ],
    }  # fmt: skip


def of_hub(seed: int) -> dict[str, Any]:
    """Return what every method gives on one hub."""
    hub = hubs.draw_hub(seed)
    result: dict[str, Any] = {"seed": seed, "runs_differ": bool(hub.zero.any())}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)

        def session(name: str, readings: hubs.Readings, check: hubs.Readings) -> Candidate:
            path = hubs.write_session(folder / name, readings, check)
            return calibrate(path, Registry(folder / f"{name} records"))

        rng = np.random.default_rng([11, seed])
        first = session("first", hubs.machine_session(hub, rng), hubs.read_check(hub, hubs.CHECK, rng))
        table, check = first.fit.session.table, first.fit.session.check
        assert check is not None
        feasible = loads_of_record(first.record, [table, check])
        plan = plan_session(
            Knowledge.of(first.record, table, check), feasible, Demand(loads=table.rows // 5, simulated=2)
        )
        result["expected"] = [load.U for load in plan.outlook]
        for method in METHODS:
            rng = np.random.default_rng([12, seed, zlib.crc32(method.encode())])
            if method == PLANNED:
                readings, own_check = carried_out(hub, plan, rng)
            else:
                readings = baseline(hub, method, len(plan.rows), rng)
                own_check = hubs.read_check(hub, hubs.CHECK, rng)
            result[method] = judged(hub, session(method, readings, own_check), rng)
    return result


def interval(hits: int, trials: int) -> str:
    """Return a share in per cent with its exact (Clopper-Pearson) 95 % interval."""
    low = beta.ppf(0.025, hits, trials - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, trials - hits) if hits < trials else 1.0
    return f"{100 * hits / trials:.1f} ({100 * low:.1f} to {100 * high:.1f})"


def table_lines(results: list[dict[str, Any]]) -> Iterable[str]:
    """Yield the table of all methods as Markdown."""
    yield (
        "| design | loads | runs | U against the protocol's, median | U no larger, % "
        "| holds another reading, % | every sign verified, % |"
    )
    yield "|---|---|---|---|---|---|---|"
    for method in METHODS:
        own = [result[method] for result in results]
        protocol = [result["machine's protocol"] for result in results]
        ratio = np.array([a["U"] for a in own]) / np.array([b["U"] for b in protocol])
        errors, U = np.array([a["error"] for a in own]), np.array([a["U"] for a in own])
        count = ratio.size
        held = int(np.count_nonzero(np.abs(errors) <= U))
        verified = sum(not a["unverified"] and all(a["signs"]) for a in own)
        smaller = (
            "-" if method == "machine's protocol" else interval(int(np.count_nonzero(ratio <= 1)), count)
        )
        loads = sorted(a["loads"] for a in own)
        runs = sorted(a["runs"] for a in own)
        yield (
            f"| {method} | {loads[0]} to {loads[-1]} | {runs[0]} to {runs[-1]} | {np.median(ratio):.3f} | "
            f"{smaller} | {interval(held, count)} | {interval(verified, len(own))} |"
        )


def main() -> None:
    """Run the campaign and print its table, of all hubs and of those whose runs differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hubs", type=int, default=200)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file for every hub's results, a line of JSON each")
    options = parser.parse_args()
    results = []
    with ProcessPoolExecutor(options.processes) as pool:
        for result in pool.map(of_hub, range(options.hubs)):
            results.append(result)
            if options.out is not None:
                options.out.write_text("\n".join(json.dumps(r) for r in results) + "\n")
    apart = [result for result in results if result["runs_differ"]]
    same = [result for result in results if not result["runs_differ"]]
    for title, chosen in (("all", results), ("runs differ", apart), ("runs do not differ", same)):
        if chosen:
            print(f"\n{title}: {len(chosen)} hubs\n")  # noqa: T201
            print("\n".join(table_lines(chosen)))  # noqa: T201


if __name__ == "__main__":
    main()
