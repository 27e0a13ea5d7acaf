"""The packaged virtual hub, as a plan begins with it."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_check, stored_loads
from toolkit.planning.fixtures import FeasibleLoads, loads_of_record
from toolkit.planning.knowledge import Knowledge

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"


@pytest.fixture(scope="package")
def knowledge() -> Knowledge:
    registry = Registry(CALIBRATIONS)
    record = registry.in_force("m15-virtual", on=dt.date(2026, 11, 1))
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    return Knowledge.of(record, loads, stored_check(registry.folder, record))


@pytest.fixture(scope="package")
def feasible(knowledge: Knowledge) -> FeasibleLoads:
    assert knowledge.check is not None
    return loads_of_record(knowledge.record, [knowledge.loads, knowledge.check])
