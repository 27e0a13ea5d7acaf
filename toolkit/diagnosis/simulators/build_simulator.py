"""From a case to the simulation of its kind: one file of this folder for each kind, under its name."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, cast

from toolkit.diagnosis.case.case import Kind
from toolkit.diagnosis.simulators.built_in import WithEffects
from toolkit.diagnosis.simulators.simulator import Model

if TYPE_CHECKING:
    from collections.abc import Callable

    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.simulators.case_code import CaseCode

    # (case, folder of the registry, worker of its code): None for what is not there
    Builder = Callable[[Case, Path | None, CaseCode | None], Model]


def builder(kind: Kind) -> Builder:
    """Return what builds a simulation of a kind: ``build`` of the file of that name."""
    module = importlib.import_module(f"toolkit.diagnosis.simulators.{kind}")
    return cast("Builder", module.build)


def model_of(case: Case, calibrations: Path | None, code: CaseCode | None = None) -> Model:
    """Return the simulation of a case, ready to run.

    Parameters
    ----------
    calibrations : folder of the registry, None without one
    code : worker of the case's own code; None runs that in this process

    Raises
    ------
    ConfigError
        the simulator, tire file or calibration cannot be used
    """
    plain = builder(case.simulation.kind)(case, calibrations, code)
    return WithEffects(case, plain) if case.effects else plain
