"""Kind ``fmu``: a co-simulation unit of FMI 2 or 3, run from row to row of a recording.

The inputs of a row are set, the unit takes the way from the row before, and its outputs are read: inputs are
held over a step at the value of its end. Where a unit has states, ``step`` cuts the way into shorter ones,
along which inputs are linear.
"""

from __future__ import annotations

import io
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.python import LARGEST, PythonModel, apart
from toolkit.errors import ConfigError, FitError, UnitError
from toolkit.inputs import FMU_FILE, read_regular
from toolkit.spelling import nearest
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.case_code import CaseCode
    from toolkit.worker.serve import Handlers


_UNPACKED = 2**30  # bytes: what the temporary folder of an isolated worker holds
_EVEN = 1e-6  # of a step, by which rows of one distance may differ


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variable:
    """A real variable of the unit: ``factor`` brings the case's number to the unit's own."""

    name: str
    reference: int
    factor: float


class FmuFunction:
    """A unit that is unpacked and loaded: its outputs of a run, checked where it runs.

    Raises
    ------
    ConfigError
        ``fmu``: it is none, is for another system, or has no such variable; ``fmu-missing``: fmpy is missing
    """

    def __init__(self, case: Case) -> None:
        fmpy = _fmpy()
        self.case, self._path = case, case.file()
        self._folder = Path(tempfile.mkdtemp(prefix="toolkit-fmu-"))
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        _unpack(self._path, self._folder)
        try:
            self._description = fmpy.read_model_description(str(self._folder), validate=False)
        except Exception as error:
            raise self._unusable(f"modelDescription.xml: {error}", "an FMU of FMI 2 or 3") from error
        self._two = self._description.fmiVersion.startswith("2")
        if not self._two and not self._description.fmiVersion.startswith("3"):
            raise self._unusable(f"FMI {self._description.fmiVersion}", "FMI 2 or 3")
        if self._description.coSimulation is None:
            raise self._unusable("a unit of model exchange alone", "co-simulation, which has its own solver")
        self._inputs = [
            (channel, self._variable(name, case.unit(channel), ("input",)))
            for name, channel in self._pairs(case.simulation.fmu_inputs, ("input",))
        ]
        self._outputs = [
            (channel, self._variable(name, case.unit(channel), ("output", "local")))
            for channel, name in (
                (output.name, dict(case.simulation.fmu_outputs).get(output.name, output.name))
                for output in case.outputs
            )
        ]
        self._parameters = {
            parameter.name: self._variable(parameter.name, parameter.unit, ("parameter", "input"))
            for parameter in case.parameters
        }
        self._unit = self._loaded()

    def call(self, run: Run, p: Mapping[str, float], changed: Mapping[str, Array]) -> dict[str, Array]:
        """Return the outputs of a run with some of its inputs changed; FitError where they are none."""
        columns = [
            np.asarray(changed.get(channel, run.columns[channel]), dtype=np.float64) * variable.factor
            for channel, variable in self._inputs
        ]
        inputs = np.stack(columns, axis=1) if columns else np.zeros((run.rows, 0))
        steps = self._steps(run)
        rows: list[list[float]] = []
        time = float(run.t[0])
        try:
            self._begin(p, inputs[0], time)
            try:
                rows.append(self._read())
                for row in range(1, run.rows):
                    way = float(run.t[row]) - float(run.t[row - 1])
                    for part in range(1, steps[row - 1] + 1):
                        share = part / steps[row - 1]
                        self._write(self._inputs, inputs[row - 1] + share * (inputs[row] - inputs[row - 1]))
                        time = float(run.t[row - 1]) + (part - 1) * way / steps[row - 1]
                        self._unit.doStep(time, way / steps[row - 1])
                    rows.append(self._read())
            finally:
                self._end()
        except Exception as error:
            raise self._failed(run, f"{error} at t = {time:.6g} s, row {len(rows) + 1}") from error
        result = {}
        for (name, variable), values in zip(self._outputs, np.array(rows).T, strict=True):
            column = values / variable.factor
            if not (np.abs(column) <= LARGEST).all():
                bad = int(np.flatnonzero(~(np.abs(column) <= LARGEST))[0]) + 1
                raise self._failed(run, f"no number in {variable.name!r}, row {bad}")
            result[name] = column
        return result

    def _begin(self, p: Mapping[str, float], first: Array, time: float) -> None:
        self._unit.instantiate()
        listed = [(name, self._parameters[name]) for name in p if name in self._parameters]
        self._write(listed, np.array([p[name] * variable.factor for name, variable in listed]))
        if self._two:
            self._unit.setupExperiment(startTime=time)
            self._unit.enterInitializationMode()
        else:
            self._unit.enterInitializationMode(startTime=time)
        self._write(self._inputs, first)
        self._unit.exitInitializationMode()

    def _end(self) -> None:
        # `freeInstance` of fmpy unloads the library as well, and it is wanted for the next run.
        free = self._unit.fmi2FreeInstance if self._two else self._unit.fmi3FreeInstance
        free(self._unit.component)

    def _write(self, named: list[tuple[str, _Variable]], values: Array) -> None:
        if named:
            write = self._unit.setReal if self._two else self._unit.setFloat64
            write([variable.reference for _, variable in named], values.tolist())

    def _read(self) -> list[float]:
        read = self._unit.getReal if self._two else self._unit.getFloat64
        return list(read([variable.reference for _, variable in self._outputs]))

    def _steps(self, run: Run) -> list[int]:
        """Return into how many steps each way between rows is cut."""
        ways = np.diff(run.t)
        longest = self.case.simulation.step_s
        steps = (
            np.ones(len(ways), dtype=int) if longest is None else np.ceil(ways / longest - _EVEN).astype(int)
        )
        steps = np.maximum(steps, 1)
        sizes = ways / steps
        variable = self._description.coSimulation.canHandleVariableCommunicationStepSize
        if not variable and len(ways) and np.ptp(sizes) > _EVEN * sizes.mean():
            raise self._failed(
                run, f"steps from {sizes.min():.6g} to {sizes.max():.6g} s, and the unit takes one size alone"
            )
        return list(map(int, steps))

    def _pairs(
        self, stated: tuple[tuple[str, str], ...], causality: tuple[str, ...]
    ) -> list[tuple[str, str]]:
        """Return variables with their channels: as the case says, else those of one name."""
        channels = [channel.name for channel in self.case.drivers]
        pairs = dict(stated)
        for name, channel in pairs.items():
            if channel not in channels:
                near = nearest(channel, channels)
                raise self._unusable(
                    f"{name} = {channel!r}, no input or covariate of the case" + _meant(near),
                    ", ".join(channels),
                )
        for variable in self._description.modelVariables:
            if variable.causality in causality and variable.name in channels:
                pairs.setdefault(variable.name, variable.name)
        return list(pairs.items())

    def _variable(self, name: str, case_unit: str, causality: tuple[str, ...]) -> _Variable:
        variables = {variable.name: variable for variable in self._description.modelVariables}
        chosen = [each.name for each in variables.values() if each.causality in causality]
        variable = variables.get(name)
        if variable is None or variable.causality not in causality:
            got = f"no {causality[0]} {name!r}" + _meant(nearest(name, chosen))
            raise self._unusable(got, ", ".join(chosen[:20]) or f"an {causality[0]}")
        if variable.type not in ("Real", "Float64"):
            raise self._unusable(f"{name} is of type {variable.type}", "Real (FMI 2) or Float64 (FMI 3)")
        own = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
        return _Variable(
            name=name, reference=variable.valueReference, factor=self._factor(name, case_unit, own)
        )

    def _factor(self, name: str, case_unit: str, own: str | None) -> float:
        """Return what brings the case's number to the unit's; 1 where the FMU states no unit."""
        if own is None:
            return 1.0
        stated = unit(case_unit)
        try:
            known = unit(own.replace(".", "*") if own[:1].isalpha() else own)
        except UnitError as error:
            if own == case_unit:
                return 1.0
            raise self._unusable(f"{name} in {own!r}, a unit that is not known", case_unit) from error
        if known.dimension != stated.dimension:
            raise self._unusable(f"{name} in {own}", f"a unit of {stated.dimension}, as {case_unit}")
        return stated.factor / known.factor

    def _loaded(self) -> Any:
        from fmpy import platform, platform_tuple
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        folder = self._folder
        here = platform if self._two else platform_tuple
        if not (folder / "binaries" / here).is_dir():
            binaries = folder / "binaries"
            others = sorted(path.name for path in binaries.iterdir()) if binaries.is_dir() else []
            raise self._unusable(", ".join(others) or "sources alone, no binary", f"a binary for {here}")
        try:
            return (FMU2Slave if self._two else FMU3Slave)(
                guid=self._description.guid,
                unzipDirectory=str(folder),
                modelIdentifier=self._description.coSimulation.modelIdentifier,
                instanceName="toolkit",
            )
        except Exception as error:
            raise self._unusable(str(error), f"a binary that loads on {here}") from error

    def _unusable(self, got: str, expected: str) -> ConfigError:
        return ConfigError(
            "the FMU cannot be used", where=self._path, got=got, expected=expected,
            next_step="correct simulation.inputs, simulation.outputs or a parameter's name, or export the "
            "FMU again as co-simulation for this system",
            rule="fmu",
        )  # fmt: skip

    def _failed(self, run: Run, got: str) -> FitError:
        return FitError(
            "the FMU gives no usable output", where=f"{self._path}, {run.name}", got=got,
            expected="a finite number of every output at every row",
            next_step="run the FMU on that file by itself; bounds keep parameters where it can answer",
            rule="simulator",
        )  # fmt: skip


def build(case: Case, _: Path | None, code: CaseCode | None) -> PythonModel:
    """Return the simulation of a case of this kind; ConfigError where its unit cannot be used."""
    if code is None:
        return PythonModel(case, FmuFunction(case).call)
    code.begin(handlers)

    def failed(run: Run, name: str) -> FitError:
        return FitError(
            "the FMU gives no usable output", where=f"{case.file()}, {run.name}",
            got=f"no number in {name!r}", expected="a finite number at every row",
            next_step="run the FMU on that file by itself", rule="simulator",
        )  # fmt: skip

    return PythonModel(case, apart(case, code, failed))


def handlers(case: Case) -> Handlers:
    """Return what a worker answers of a unit."""
    from toolkit.worker.serve import Numbers

    function, runs = FmuFunction(case), (*case.runs, *case.predict)
    return {"call": lambda run, p, changed: Numbers(function.call(runs[run], p, changed))}


def _fmpy() -> Any:
    try:
        import fmpy
    except ModuleNotFoundError as error:
        raise ConfigError(
            "FMUs need fmpy", where='simulation.kind = "fmu"', got="fmpy is not installed",
            expected="the package fmpy", next_step="pip install 'tire-lab-toolkit[fmi]'", rule="fmu-missing",
        ) from error  # fmt: skip
    return fmpy


def _unpack(path: Path, folder: Path) -> None:
    """Unpack an archive whose members stay in the folder and within its size."""
    content = read_regular(path, FMU_FILE)
    problem = None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = archive.infolist()
            names = [entry.filename for entry in entries]
            leaving = [
                name for name in names if name.startswith("/") or ".." in name.split("/") or "\\" in name
            ]
            if leaving:
                problem = f"a member that leaves its folder, {leaving[0]!r}"
            elif sum(entry.file_size for entry in entries) > _UNPACKED:
                problem = f"more than {_UNPACKED >> 20} MiB when it is unpacked"
            elif "modelDescription.xml" not in names:
                problem = "no modelDescription.xml"
            else:
                archive.extractall(folder)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        problem = f"no archive: {error}"
    if problem is not None:
        raise ConfigError(
            "the file is no FMU", where=path, got=problem, expected="an FMU (.fmu) of FMI 2 or 3",
            next_step="check simulation.path", rule="fmu",
        )  # fmt: skip


def _meant(near: str | None) -> str:
    return "" if near is None else f", did you mean {near!r}?"
