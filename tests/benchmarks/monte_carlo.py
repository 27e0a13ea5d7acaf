"""A million Monte Carlo trials of one calibration; the peers work on the same budget.

Ours refits the calibration in every trial (X^+ e, with U' e drawn in place of the rows' errors e), then adds
the budget's other components and takes the coverage interval. metrolopy has no refit: it draws each component
of the finished budget once a trial, vectorised. GTC has no Monte Carlo: it combines the same components to
first order, once, where ours starts from the data.
"""

from __future__ import annotations

import math
from pathlib import Path

from tests.benchmarks.timing import pairs, row
from toolkit.lab.home import packaged_home

TRIALS = 1_000_000


def run(_folder: Path, count: int) -> list[dict[str, object]]:
    """Time the trials of the packaged record's FY at full scale, and both peers, imports excluded."""
    import GTC
    import metrolopy

    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.stored import stored_check, stored_loads
    from toolkit.calibration.uncertainty.budget import calibration_budget
    from toolkit.calibration.uncertainty.monte_carlo import monte_carlo

    registry = Registry(packaged_home() / "calibrations")
    record = registry.load("m15-virtual-r1")
    loads, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    if loads is None:
        raise RuntimeError("the packaged record has no data")
    budget = calibration_budget(record, loads, check, "FY")
    parts = [part for part in budget.components if part.u > 0]

    def ours() -> object:
        return monte_carlo(record, loads, budget, trials=TRIALS)

    def first_order() -> object:
        return calibration_budget(record, loads, check, "FY")

    def draws() -> object:
        total = metrolopy.gummy(budget.at)
        for part in parts:
            total = total + metrolopy.gummy(
                0, u=part.u, dof=part.dof if math.isfinite(part.dof) else float("inf")
            )
        total.sim(TRIALS)
        return total.usim

    def combines() -> object:
        total = GTC.constant(budget.at)
        for part in parts:
            total = total + GTC.ureal(0, part.u, min(part.dof, 1e6))
        return total.u, total.df

    times = pairs(ours, draws, max(count // 2, 2))
    once = pairs(first_order, combines, count)
    rows = f"{loads.rows} rows refitted a trial"
    return [
        row(f"1e6 trials of a calibration, {rows}", times[0], "metrolopy draws the parts", times[1], "-"),
        row("budget from the data, first order", once[0], "GTC combines the parts", once[1], "-"),
    ]
