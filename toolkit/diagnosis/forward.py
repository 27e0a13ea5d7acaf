"""A model file run forward on inputs: what the augmented simulation says, without any recording."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from toolkit.declared import Entry, Format, Keyed, build
from toolkit.diagnosis.case.case import Case, CaseChannel
from toolkit.diagnosis.case.recordings import read_run
from toolkit.diagnosis.case.simulation import corrections_of, parameters_of, simulation_of
from toolkit.diagnosis.fit.predict import csv_of, prediction_names
from toolkit.diagnosis.policy import WORKER
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.built_in import built_in_findings
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, CaseCode, running
from toolkit.errors import ConfigError, FitError
from toolkit.inputs import TABLE_FILE, read_input
from toolkit.worker.posix import Limits
from toolkit.worker.worker import LateError

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Run
    from toolkit.findings import Finding
    from toolkit.simulation.model_file import ModelFile


@dataclass(frozen=True, slots=True, kw_only=True)
class _Channels:
    """The channels of a model file, which are those of its case."""

    FORMAT: ClassVar[Format] = Format(
        title="channels of a model file", wrong="case", missing="case", unit="case"
    )

    channels: Annotated[tuple[CaseChannel, ...], Keyed(by="name"), Entry("inputs and outputs by name")]


def simulate_model(
    model: ModelFile,
    inputs: Sequence[Path],
    calibrations: Path | None,
    *,
    conditions: Mapping[str, str] | None = None,
    budget_s: float = WORKER.simulate_s,
    limits: Limits | None = WORKER_LIMITS,
) -> tuple[tuple[tuple[str, str], ...], tuple[Finding, ...]]:
    """Return name and content of a CSV file for each file of inputs, and notes on the model's effects.

    The columns are time and every output that the model simulates, in the channels' units.

    Parameters
    ----------
    inputs : CSV files with the model's time, inputs and covariates; further columns are not read
    conditions : of all these runs, such as ``{"rotation": "reverse"}``
    budget_s : seconds that the model's own code may take
    limits : of the worker in which that code runs; None runs it in this process

    Raises
    ------
    ConfigError
        a file or a column is missing; ``model-place``: an effect has no channel to act on; FitError: the
        simulation gives no usable output
    """
    case = case_of(model, inputs, conditions or {})
    with running(case, limits) as code:
        if code is not None:
            code.until = time.monotonic() + budget_s
        try:
            return _outputs(case, calibrations, code), built_in_findings(case)
        except LateError:
            raise FitError(
                "the simulation gives no usable output", where=case.file(), rule="simulator",
                got=f"no answer within {budget_s:g} s", expected="outputs of every file of inputs",
                next_step="give a larger --budget, or fewer inputs at once",
            ) from None  # fmt: skip


def _outputs(case: Case, calibrations: Path | None, code: CaseCode | None) -> tuple[tuple[str, str], ...]:
    simulator = model_of(case, calibrations, code)
    p = {parameter.name: parameter.value for parameter in simulator.parameters}
    files = []
    for name, run in zip(prediction_names(case.runs), case.runs, strict=True):
        outputs = simulator.simulate(run, p, ())
        _refuse_nothing(outputs, run)
        columns = {
            channel.name: run.columns[channel.name] for channel in case.channels if channel.role == "time"
        }
        columns |= {output.name: outputs[output.name] for output in simulator.outputs}
        files.append((name, csv_of(columns)))
    return tuple(files)


def case_of(model: ModelFile, inputs: Sequence[Path], conditions: Mapping[str, str]) -> Case:
    """Return a model and inputs as a case without recorded outputs."""
    simulation = simulation_of(model)
    channels = build(_Channels, {"channels": model.channels}, model.path).channels
    time = next((channel for channel in channels if channel.name == model.time), None)
    if not inputs:
        raise ConfigError(
            "a model file is run on inputs", where=model.path, got="no --inputs",
            expected="CSV files with "
            + ", ".join(channel.name for channel in channels if channel.role != "output"),
            next_step="give --inputs FILE.csv, or name the model as [tire] file of a plan", rule="model-file",
        )  # fmt: skip
    runs = tuple(
        read_run(
            path,
            read_input(path, TABLE_FILE),
            name=path.name,
            channels=channels,
            time=time,
            declared={"file": path.name, **conditions},
            simulated=dict(simulation.simulated),
            machine=simulation.machine if simulation.kind == "machine" else "",
            predict=True,
        )
        for path in inputs
    )
    return Case(
        path=model.path,
        title=model.title,
        simulation=simulation,
        parameters=parameters_of(model),
        axes=model.axes,
        has_time=time is not None,
        channels=channels,
        runs=runs,
        predict=(),
        sha256=model.sha256,
        effects=(*model.effects, *corrections_of(simulation)),
        nominal_load_N=model.nominal_load_N,
        model=model.path,
    )


def _refuse_nothing(outputs: Mapping[str, np.ndarray], run: Run) -> None:
    for name, values in outputs.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise ConfigError(
                "the model gives no number", where=f"{run.name}, row {bad[0] + 1}, {name}", got=math.nan,
                expected="inputs in every row, inside what the simulation can do",
                next_step="look at the inputs of that row", rule="simulator",
            )  # fmt: skip
