"""The simulation of a case that is a model file: an earlier answer, taken up as it was left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from toolkit.diagnosis.case.case import KINDS, Simulation
from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.simulation.model_file import FittedEffect, ModelFile, read_model
from toolkit.simulation.plan_file import CaseParameter


def simulation_of(model: ModelFile) -> Simulation:
    """Return the simulation that a model file declares; its files by path."""
    if model.kind not in KINDS:
        raise ConfigError(
            "a model file of an unknown kind of simulation", where=f"{model.path}: simulation.kind",
            got=model.kind, expected=", ".join(KINDS),
            next_step="name a file that toolkit diagnose has written", rule="model-file",
        )  # fmt: skip
    entries: Mapping[str, Any] = model.simulation
    # A file by path is a path, whatever folder the case lies in.
    machine, calibration = (
        str(file.absolute()) if (file := model.file(key)) is not None else str(entries.get(key, ""))
        for key in ("machine", "calibration")
    )
    return Simulation(
        kind=model.kind,
        machine=machine or DEFAULT_MACHINE,
        calibration=calibration,
        tire=model.file("tire"),
        path=model.file("path"),
        function=str(entries.get("function", "simulate")),
        states=tuple(entries.get("states", ())),
        force_terms=tuple(dict(entries.get("force_terms", {})).items()),
        simulated=tuple(dict(entries.get("simulated", {})).items()),
        fmu_inputs=tuple(dict(entries.get("inputs", {})).items()),
        fmu_outputs=tuple(dict(entries.get("outputs", {})).items()),
        step_s=float(entries["step_s"]) if "step_s" in entries else None,
    )


def parameters_of(model: ModelFile, first: tuple[CaseParameter, ...] = ()) -> tuple[CaseParameter, ...]:
    """Return the model's parameters, free within their standard errors; those ``given`` go before them."""
    further = tuple(
        CaseParameter(
            name=parameter.name,
            value=parameter.value,
            unit=parameter.unit,
            sd=parameter.standard_error,
            bounds=parameter.bounds,
        )
        for parameter in model.parameters
        if parameter.name not in {each.name for each in first}
    )
    return (*first, *further)


def tire_model(path: Path, where: str) -> ModelFile:
    """Return the model file that stands in the place of a tire file: one of kind ``machine``.

    Raises
    ------
    ConfigError
        ``model-file``: it has no tire
    """
    model = read_model(path)
    if model.kind != "machine" or model.file("tire") is None:
        raise ConfigError(
            "the model has no tire", where=where, got=f"a model of kind {model.kind}",
            expected="a tire file (.tir), or a model file of kind machine",
            next_step="name the model as [simulation] model", rule="model-file",
        )  # fmt: skip
    return model


def corrections_of(simulation: Simulation) -> tuple[FittedEffect, ...]:
    """Return the corrections of a case's machine as effects: the recordings still have them.

    None where no tire is simulated: an acquisition program's arithmetic is not the machine's.
    """
    if simulation.kind != "machine" or simulation.tire is None:
        return ()
    machine = load_machine(simulation.machine)
    return tuple(
        FittedEffect(
            applied=correction.applied,
            standard_errors={correction.parameter: correction.u} if correction.u else {},
            axes="machine",
            of_machine=True,
            origin=f"{machine.name}, version {machine.version}: answer {correction.answer_sha256[:16]}",
        )
        for correction in machine.corrections
    )
