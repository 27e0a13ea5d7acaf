"""Calibration and standards toolkit for a tire force-and-moment laboratory.

What a notebook needs is here; every name is loaded when it is first used, so that ``import toolkit`` costs
nothing. Forces are in N, moments in N·m, angles in rad, in SAE J670 axes, unless a header says otherwise.

>>> import toolkit
>>> laboratory = toolkit.open_laboratory(toolkit.example("home"))
>>> laboratory.records
<Records m15-r1 withdrawn | m15-r2 approved | m15-virtual-r1 approved>
>>> record = laboratory.in_force("m15-virtual")
>>> record
<Record m15-virtual-r1 | approved, in force from 2026-03-03 | verified | FY, MZ, MX from ...>

A record turns indications into loads, each with its expanded uncertainty; units stand in the headers. What
the cells showed without a load is their tare:

>>> loads = record.apply(
...     {"D51 [mV/V]": [0.1, 0.2], "D52 [mV/V]": [0.1, 0.2], "E5 [mV/V]": [0.1, 0.1]},
...     tare={"D51": 0.01, "D52": 0.0, "E5": 0.0},
... )
>>> loads
<Loads 2 rows | FY [N], MZ [N*m], MX [N*m] | m15-virtual-r1>
>>> list(loads.to_dataframe().columns)
['FY [N]', 'U(FY) [N]', 'MZ [N*m]', 'U(MZ) [N*m]', 'MX [N*m]', 'U(MX) [N*m]']

`read_test` and `process` take a test from its recordings to its characteristics, `fit_tire` to tire models.
The laboratory's `write_report` fills its Word template, and its `audit_archive` tells which calibration
computed old files; `diagnose` and `simulate` are the use cases of the same names. docs/library.md walks
through all of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from toolkit.version import __version__ as __version__

if TYPE_CHECKING:
    from toolkit.errors import ToolkitError
    from toolkit.estimate import Estimate
    from toolkit.lab.laboratory import Laboratory, example, open_laboratory
    from toolkit.lab.records.record import Record
    from toolkit.lab.studies.cases import Diagnosis, Simulation, diagnose, simulate
    from toolkit.lab.tire_tests.test import (
        ProcessedTest,
        Recording,
        Test,
        read_recording,
        read_test,
    )
    from toolkit.lab.tire_tests.tires import Tire, TireFit, fit_tire, read_tire

__all__ = [
    "Diagnosis",
    "Estimate",
    "Laboratory",
    "ProcessedTest",
    "Record",
    "Recording",
    "Simulation",
    "Test",
    "Tire",
    "TireFit",
    "ToolkitError",
    "diagnose",
    "example",
    "fit_tire",
    "open_laboratory",
    "read_recording",
    "read_test",
    "read_tire",
    "simulate",
]

_PUBLIC = {
    "errors": "ToolkitError",
    "estimate": "Estimate",
    "lab.studies.cases": "Diagnosis Simulation diagnose simulate",
    "lab.laboratory": "Laboratory example open_laboratory",
    "lab.records.record": "Record",
    "lab.tire_tests.test": "ProcessedTest Recording Test read_recording read_test",
    "lab.tire_tests.tires": "Tire TireFit fit_tire read_tire",
}
_MODULES = {name: module for module, names in _PUBLIC.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'toolkit' has no attribute {name!r}")
    return getattr(import_module(f"toolkit.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(["__version__", *__all__])
