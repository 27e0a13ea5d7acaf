"""Seconds of a 13 x 5 test of kind ``machine`` with every effect of the catalogue, and how they grow.

The virtual machine writes the test and its case: the protocol's slip angles and loads in both directions, a
Magic Formula file with two free factors. Growth is that with the rows of a revolution and with the number of
effects that were left out. Processor time of one process, linear algebra on one thread.

A tare of so few rows is itself off by a good part of a row's noise, the same in every row: a `zero_offset`
that is named where nothing was left out is that error, and no false alarm.

The power's promise is timed beside it and told in the line's text: a reduction by the drum of twice the size
that a clean test promises to show is looked for, once.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from tests.benchmarks.timing import row

TIRE = Path(__file__).resolve().parents[1] / "simulation" / "riddles" / "tire.tir"
_PLAN = """kind = "test"
title = "13 x 5"
date = 2026-04-01
seed = SEED
effects = [EFFECTS]
[tire]
file = "TIRE"
[road]
drum_runout_1 = { value = 0, unit = "N" }
drum_runout_2 = { value = 0, unit = "N" }
[acquisition]
rows_per_revolution = ROWS
filter_time_constant = { value = 0, unit = "s" }
SA_noise = { value = 0, unit = "deg" }
FZ_noise = { value = 0, unit = "N" }
negated = []
[case]
columns = []
[case.parameters]
LMUY = { value = 1.0, unit = "1", sd = 0.02 }
LKY = { value = 1.0, unit = "1", sd = 0.02 }
"""
_LEFT_OUT: tuple[tuple[int, tuple[str, ...]], ...] = (
    (4, ()),
    (4, ("drum_curvature=0.1",)),
    (4, ("drum_curvature=0.1", "crosstalk.FZ.FY=0.01")),
    (16, ("drum_curvature=0.1",)),
)


def run(folder: Path, pairs: int) -> list[dict[str, object]]:
    """Return processor seconds of four tests, and whether a size twice the detectable one is named."""
    made, promised = [], None
    for rows, effects in _LEFT_OUT:
        seconds = []
        for seed in range(1 if pairs < 3 else 3):
            spent, count, answer = _one(folder / f"{rows}-{len(effects)}-{seed}", rows, effects, seed=seed)
            seconds.append(spent)
            if not effects and seed == 0:
                promised = next(one for one in answer.not_found if one.name == "drum_curvature")
        left_out = f"{len(effects)} effects left out"
        what = f"diagnose 13 x 5, {count} rows, {left_out}: {answer.verdict}"
        made.append(row(what, seconds, "none: processor time", None, "60 s" if rows == 4 else ""))
    if promised is not None and promised.minimum_detectable:
        size = 2 * promised.minimum_detectable
        spent, _, answer = _one(folder / "power", 4, (f"drum_curvature={size:.6g}",), seed=9)
        names = {name for one in answer.effects for name in (one.name, *one.equivalent_to)}
        what = f"diagnose: twice the detectable size ({size:.2g}) is {'' if names else 'not '}named"
        made.append(row(what, [spent], "none: processor time", None, ""))
    return made


def _one(folder: Path, rows: int, effects: tuple[str, ...], *, seed: int) -> tuple[float, int, Any]:
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose
    from toolkit.simulation.case import write_case
    from toolkit.simulation.plan import read_plan
    from toolkit.simulation.run import simulate

    folder.mkdir(parents=True)
    listed = ", ".join(f'"{one}"' for one in effects)
    text = _PLAN.replace("SEED", str(seed)).replace("EFFECTS", listed).replace("ROWS", str(rows))
    (folder / "plan.toml").write_text(text.replace("TIRE", TIRE.as_posix()))
    case = read_case(write_case(simulate(read_plan(folder / "plan.toml")), folder / "case")[0])
    began = time.process_time()
    answer = diagnose(case, None, budget_s=3600.0).diagnosis
    return time.process_time() - began, sum(one.rows for one in case.runs), answer
