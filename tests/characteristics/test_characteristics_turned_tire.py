"""A tire is reversed in two ways: the drum runs backwards, or the tire is turned round on the hub."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.estimate import Estimate
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.simulation.plan import Plan
from toolkit.simulation.run import simulate
from toolkit.simulation.steps import RunSteps
from toolkit.simulation.write import write_test

ANGLES = (0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8)
NAMES = ("conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero")


def pull_of(plan: Plan, record: CalibrationRecord, folder: Path, *, turned: bool) -> dict[str, Estimate]:
    """A whole virtual test at the nominal load, whose second half is reversed in one of the two ways."""
    load = plan.tire.nominal_load_N
    made = {
        one: RunSteps(
            rotation="reverse" if back and not turned else "forward",
            mounting="turned" if back and turned else "normal",
            slip_angles_rad=(math.radians(angle),),
            loads_N=(load,),
        )
        for one, (back, angle) in enumerate((b, a) for b in (False, True) for a in ANGLES)
    }
    carriage = dataclasses.replace(plan.carriage, load_spread=0.0)
    road = dataclasses.replace(plan.road, runout_1_N=0.0, runout_2_N=0.0)  # else a few newtons of each mean
    test = simulate(dataclasses.replace(plan, runs=tuple(made.values()), carriage=carriage, road=road))
    write_test(test, folder)
    found = read_test_folder(folder)
    assert found.info.reversal == ("tire" if turned else "drum")
    rows = process(found, read_test(found), record).characteristics.rows
    return {row.name: row.estimate for row in rows if row.rotation == "both" and row.estimate is not None}


def test_both_ways_of_reversal_give_one_pull(
    tmp_path: Path, virtual_plan: Plan, virtual_record: CalibrationRecord
) -> None:
    """Conicity is what the plan gives the tire; the rest is the same tire's, whichever was turned.

    Conicity turns with the tire and plysteer does not: (F-R)/2 and (F+R)/2 of what the cells felt, where a
    reversed drum gives (F+R)/2 and (F-R)/2 (table of the pull characteristics by symmetry).
    """
    drum, tire = (
        pull_of(virtual_plan, virtual_record, tmp_path / str(turned), turned=turned)
        for turned in (False, True)
    )
    for name in NAMES:
        one, other = drum[name], tire[name]
        assert abs(one.value - other.value) < 0.01 * abs(one.value), name
    truth = virtual_plan.tire.conicity_N
    assert tire["conicity"].value == pytest.approx(truth, rel=0.02)
