"""What a case says of its simulation, by kind: files and parameters, or a model file of an earlier answer.

A model file is an earlier answer, taken up as it was left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from toolkit.declared import Above, Distinct, Entry, Format, Keyed, Size, Text, Unit, UnitName
from toolkit.diagnosis.case.case import KINDS, Kind, Simulation
from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.simulation.model_file import FittedEffect, ModelFile, read_model
from toolkit.simulation.plan_file import CaseParameter

FORMAT = Format(
    title="case", schema=1, schema_required=True, wrong="case", missing="case", unit="case",
    next_step="correct the case file; `toolkit explain case` shows a whole one",
)  # fmt: skip
_Simulator = Annotated[Path, Entry("of the simulator", example="sim.py", expected='path = "FILE"')]
_Parameters = Annotated[tuple[CaseParameter, ...], Keyed(by="name"), Entry("with their priors")]
# Simulation, free parameters, and the model file that they were taken from, None without one.
Resolved = tuple[Simulation, tuple[CaseParameter, ...], ModelFile | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineSimulation:
    """The chain of the machine: tire, road, carriage, load cells, acquisition."""

    kind: Literal["machine"]
    machine: Annotated[str, Entry("name of the machine, or its definition's path")] = DEFAULT_MACHINE
    calibration: Annotated[
        str, Text(empty=True), Entry("id or file of a record; with cells", example="rig-r3")
    ] = ""
    tire: Annotated[Path | None, Entry("MF 5.2 or 6.x, or a model file", example="tire.tir")] = None
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:
        """Return the machine, its tire, and where that is a model file its parameters too."""
        folder, tire, parameters, model = path.parent, None, self.parameters, None
        if self.tire is not None:
            tire = folder / self.tire
            if tire.suffix.lower() == ".toml":
                model = tire_model(tire, f"{path}: simulation.tire")
                tire, parameters = model.file("tire"), parameters_of(model, parameters)
        simulation = Simulation(
            kind=self.kind,
            # A definition by path is meant relative to the case, as every path in it.
            machine=str(folder / self.machine) if self.machine.endswith(".toml") else self.machine,
            calibration=self.calibration,
            tire=tire,
        )
        return simulation, parameters, model


@dataclass(frozen=True, slots=True, kw_only=True)
class PythonSimulation:
    """Any simulator: a file with ``simulate(inputs, p)``."""

    kind: Literal["python"]
    path: _Simulator
    function: Annotated[str, Entry("of the file")] = "simulate"
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:
        """Return the simulator with its path from here."""
        simulation = Simulation(kind=self.kind, path=path.parent / self.path, function=self.function)
        return simulation, self.parameters, None


@dataclass(frozen=True, slots=True, kw_only=True)
class OdeSimulation:
    """An equation of motion: a file with ``rhs``, ``outputs`` and ``initial``."""

    kind: Literal["ode"]
    path: _Simulator
    states: Annotated[
        tuple[str, ...], Distinct(), Entry("names, in the order of initial", example=["x", "v"])
    ] = ()
    force_terms: Annotated[
        tuple[tuple[str, str], ...], Keyed(), UnitName(as_written=True),
        Entry("states whose equation a missing term may enter, and its unit", example={"v": "N/kg"}),
    ] = ()  # fmt: skip
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:
        """Return the equation with its path from here."""
        simulation = Simulation(
            kind=self.kind, path=path.parent / self.path, states=self.states, force_terms=self.force_terms
        )
        return simulation, self.parameters, None


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuSimulation:
    """A co-simulation unit of FMI 2 or 3; parameters are its own by name."""

    kind: Literal["fmu"]
    path: Annotated[Path, Entry("of the unit", example="plant.fmu", expected='path = "FILE.fmu"')]
    inputs: Annotated[
        tuple[tuple[str, str], ...], Keyed(),
        Entry("column of each variable; those of one name need none", example={"alpha": "SA"}),
    ] = ()  # fmt: skip
    outputs: Annotated[
        tuple[tuple[str, str], ...], Keyed(),
        Entry("variable of each output; those of one name need none", example={"FY": "tire.Fy"}),
    ] = ()  # fmt: skip
    step_s: Annotated[
        float | None, Unit("s"), Above(0),
        Entry("longest communication step; without it row to row", key="step"),
    ] = None  # fmt: skip
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:
        """Return the unit with its path from here."""
        simulation = Simulation(
            kind=self.kind,
            path=path.parent / self.path,
            fmu_inputs=self.inputs,
            fmu_outputs=self.outputs,
            step_s=self.step_s,
        )
        return simulation, self.parameters, None


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnsSimulation:
    """Another program's output, already beside the recording."""

    kind: Literal["columns"]
    simulated: Annotated[
        tuple[tuple[str, str], ...], Keyed(), Size(1),
        Entry("column of each output", example={"FY": "FY_sim"}, expected='simulated = { FY = "FY_sim" }'),
    ]  # fmt: skip
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:  # noqa: ARG002
        """Return the columns."""
        return Simulation(kind=self.kind, simulated=self.simulated), self.parameters, None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSimulation:
    """A model file of an earlier answer; parameters that stand here go before its own."""

    model: Annotated[Path, Entry("of toolkit diagnose", example="model.toml")]
    kind: Annotated[Kind | None, Entry("of the model")] = None
    parameters: _Parameters = ()

    def resolve(self, path: Path) -> Resolved:
        """Return the simulation of the model file."""
        model = read_model(path.parent / self.model)
        return simulation_of(model), parameters_of(model, self.parameters), model


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
        if parameter.name not in {parameter_before.name for parameter_before in first}
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
