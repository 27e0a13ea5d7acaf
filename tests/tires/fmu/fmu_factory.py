"""FMUs as an importer runs them: without interpolation, one row after the other."""

from __future__ import annotations

import shutil
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


def outputs_of(path: Path, rows: dict[str, np.ndarray], parameters: dict[str, float] | None = None):
    """Return the outputs by name at every row of inputs."""
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    names = [variable.name for variable in description.modelVariables if variable.causality == "output"]
    two = description.fmiVersion == "2.0"
    unit = (FMU2Slave if two else FMU3Slave)(
        guid=description.guid, unzipDirectory=folder, instanceName="tire",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )  # fmt: skip
    try:
        unit.instantiate()
        read, write = (unit.getReal, unit.setReal) if two else (unit.getFloat64, unit.setFloat64)
        if parameters:
            write([references[name] for name in parameters], list(parameters.values()))
        if two:
            unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        read_rows = []
        for row in zip(*(np.asarray(column).tolist() for column in rows.values()), strict=True):
            write([references[name] for name in rows], list(row))
            read_rows.append(read([references[name] for name in names]))
        unit.terminate()
        unit.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return {name: np.array(column) for name, column in zip(names, zip(*read_rows, strict=True), strict=True)}


def grid() -> dict[str, np.ndarray]:
    """Return 600 rows of all signs, and the edges: no slip, no camber, no load, backwards, locked."""
    rng = np.random.default_rng(24)
    n = 600
    rows = {
        "SA": rng.uniform(-0.5, 0.5, n),
        "FZ": rng.uniform(0.0, 9000.0, n),
        "IA": rng.uniform(-0.2, 0.2, n),
        "KAPPA": rng.uniform(-0.9, 0.9, n),
        "P": rng.uniform(1.2e5, 3.5e5, n),
        "V": rng.choice([-20.0, 0.0, 10.0, 40.0], n),
    }
    rows["SA"][:60] = 0.0
    rows["KAPPA"][30:160] = 0.0
    rows["IA"][100:260] = 0.0
    rows["FZ"][250:260] = 0.0
    rows["KAPPA"][0], rows["SA"][1], rows["SA"][2] = -1.0, 1.4, -1.4
    return rows
