"""A diagnosis case made of a virtual test: CASE.toml, its runs as CSV, the tire; no word of any effect.

The case's simulation is the plan without its effects: of kind ``machine`` where the plan's tire is a file,
else of kind ``columns`` with what the plan's tire does at the measured slip angles and loads.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.effects.signals import Drive, drive
from toolkit.errors import ConfigError
from toolkit.inputs import TIRE_FILE, read_input
from toolkit.publication import publication
from toolkit.simulation.cells import CELLS
from toolkit.simulation.file_tire import FileTire
from toolkit.simulation.plan import Plan
from toolkit.simulation.plan_file import COLUMNS, CaseParameter
from toolkit.simulation.run import VirtualFile, VirtualTest
from toolkit.simulation.steady import steady_of
from toolkit.simulation.write import shown, unit_of
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_write import file_text
from toolkit.units import from_si

CASE, TIRE, RUNS = "CASE.toml", "tire.tir", "runs"
_TARE = "tare.csv"
_TARE_BEFORE_S = 60.0  # how long before the first run the tare ended


def write_runs(test: VirtualTest, folder: Path) -> tuple[Path, ...]:
    """Write every recording as plain CSV, all columns, names in the header; return the files."""
    names = (
        "t",
        "SA",
        "FZ",
        *CELLS,
        "FY",
        "MZ",
        *(column for column in COLUMNS if column not in ("SA", "FZ")),
    )
    with publication(folder) as stage:
        for name, file in zip(run_names(test.plan), test.files, strict=True):
            _csv(stage / name, _columns(file, names, []))
    return tuple(folder / name for name in run_names(test.plan))


def write_case(test: VirtualTest, folder: Path, *, record: str | None = None) -> tuple[Path, ...]:
    """Write a case of a test into a folder; return the files, CASE.toml first.

    Parameters
    ----------
    record : registry id of the calibration, needed where the case's outputs are cells

    Raises
    ------
    ConfigError
        no case can be made of the plan: see `check_case`
    """
    plan = test.plan
    kind = check_case(plan, record)
    inputs = _inputs(test)
    cells = plan.case.outputs == "cells"
    outputs = list(CELLS) if cells else ["FY", "MZ"]
    names = ("t", *inputs, *_judged(plan), *outputs)
    simulated = [] if kind == "machine" else ["FY", "MZ"]
    written = [CASE, *(f"{RUNS}/{name}" for name in run_names(plan))]
    with publication(folder) as stage:
        (stage / RUNS).mkdir()
        for name, file in zip(run_names(plan), test.files, strict=True):
            nominal = _nominal(test, file) if simulated else []
            _csv(stage / RUNS / name, _columns(file, names, nominal))
        if cells:
            _csv(stage / RUNS / _TARE, _tare(test, names))
            written.append(f"{RUNS}/{_TARE}")
        if plan.tire_file is not None:
            # As the plan has it: of a model file the coefficients that were refitted.
            (stage / TIRE).write_bytes(_tire_text(plan.tire_file))
            written.append(TIRE)
        text = case_toml(test, kind=kind, record=record, inputs=inputs, outputs=outputs)
        (stage / CASE).write_text(text, encoding="utf-8")
    return tuple(folder / name for name in written)


def case_toml(
    test: VirtualTest, *, kind: str, record: str | None, inputs: Sequence[str], outputs: Sequence[str]
) -> str:
    """Return the text of CASE.toml."""
    plan = test.plan
    lines = [
        "# simulated: made by the virtual machine of the toolkit, no real tire was tested",
        "schema = 1",
        f"title = {_text(plan.title)}",
        "",
        "[simulation]",
        f"kind = {_text(kind)}",
    ]
    if kind == "machine":
        lines += [f"machine = {_text(plan.machine.name)}", f"tire = {_text(TIRE)}"]
        if plan.case.outputs == "cells":
            lines.append(f"calibration = {_text(str(record))}")
    else:
        lines.append('simulated = { FY = "FY_sim", MZ = "MZ_sim" }')
    for parameter in plan.case.parameters:
        lines += ["", f"[simulation.parameters.{parameter.name}]", *_parameter(parameter)]
    lines += [
        "",
        "[recording]",
        'time = "t"',
        'axes = "machine"',
        "simulated = true",
        "",
        "[recording.channels]",
    ]
    lines.append('t = { unit = "s", role = "time" }')
    lines += [f'{name} = {{ unit = {_text(unit_of(name))}, role = "{_role(name)}" }}' for name in inputs]
    judged = [*_judged(plan), *outputs]
    lines += [f'{name} = {{ unit = {_text(unit_of(name))}, role = "output" }}' for name in judged]
    turned = any(file.run.mounting == "turned" for file in test.files)
    if plan.case.outputs == "cells":
        lines += ["", "[[recording.run]]", f"file = {_text(f'{RUNS}/{_TARE}')}", 'phase = "tare"']
    for name, file in zip(run_names(plan), test.files, strict=True):
        lines += ["", "[[recording.run]]", f"file = {_text(f'{RUNS}/{name}')}"]
        for key, value in file.run.conditions.items():
            if key != "mounting" or turned:
                lines.append(f"{_text(key) if not key.isidentifier() else key} = {_text(value)}")
    return "\n".join(lines) + "\n"


def check_case(plan: Plan, record: str | None) -> str:
    """Return the kind of the case that can be made of a plan: ``machine`` or ``columns``.

    Raises
    ------
    ConfigError
        none can
    """
    kind = "columns" if plan.tire_file is None else "machine"
    wrong: tuple[str, str] | None = None
    if kind == "columns" and (plan.case.outputs == "cells" or plan.case.load != "measured"):
        wrong = "a tire that is no file", '[tire] file = "tire.tir" in the plan'
    elif plan.case.outputs == "cells" and record is None:
        wrong = "no calibration of the virtual machine", "--calibrations DIR with a record in force"
    elif kind == "columns" and plan.case.parameters:
        wrong = "parameters of a tire that is no file", '[tire] file = "tire.tir" in the plan'
    if wrong is not None:
        raise ConfigError(
            "no case can be made from this plan", where="[case]", got=wrong[0], expected=wrong[1],
            next_step="change the plan's [case] or [tire]; nothing was written", rule="wrong-value",
        )  # fmt: skip
    return kind


def _tire_text(file: FileTire) -> bytes:
    unchanged = read_tir(file.path).coefficients() == file.tir.coefficients()
    return read_input(file.path, TIRE_FILE) if unchanged else file_text(file.tir).encode()


def _inputs(test: VirtualTest) -> list[str]:
    """Return the driving columns: slip angle and load, and those that the plan names or that vary."""
    load = test.plan.case.load
    columns = test.plan.case.columns
    if columns is None:
        columns = tuple(
            name
            for name in COLUMNS
            if not name.endswith("_CMD")
            and len({float(v) for file in test.files for v in shown(file.signals, name)[[0, -1]]}) > 1
        )
    columns_in_order = dict.fromkeys(("SA", "FZ" if load == "measured" else "FZ_CMD", *columns))
    return [name for name in columns_in_order if name != "FZ" or load == "measured"]


def _judged(plan: Plan) -> list[str]:
    return ["FZ"] if plan.case.load == "judged" else []


def _role(name: str) -> str:
    return "input" if name in ("SA", "FZ", "V", "SA_CMD", "FZ_CMD") else "covariate"


def _parameter(parameter: CaseParameter) -> list[str]:
    lines = [f"value = {parameter.value!r}", f"unit = {_text(parameter.unit)}"]
    if parameter.sd is not None:
        lines.append(f"sd = {parameter.sd!r}")
    if parameter.bounds is not None:
        lines.append(f"bounds = [{parameter.bounds[0]!r}, {parameter.bounds[1]!r}]")
    return lines


def _columns(
    file: VirtualFile, names: Sequence[str], nominal: list[tuple[str, Array]]
) -> list[tuple[str, Array]]:
    return [*((name, shown(file.signals, name)) for name in names), *nominal]


def _nominal(test: VirtualTest, file: VirtualFile) -> list[tuple[str, Array]]:
    plan, signals = test.plan, file.signals
    facing = -1.0 if file.run.mounting == "turned" else 1.0
    pressure = plan.pressure_Pa if file.run.pressure_Pa is None else file.run.pressure_Pa
    steady = steady_of(plan, rotation=file.rotation, facing=facing, pressure_Pa=pressure)
    start: Drive = drive(signals["t"], signals["SA"], signals["FZ"], V=signals["V"])
    responses = steady(start.SA, start)
    return [
        ("FY_sim", np.round(responses.FY, 5) + 0.0),
        ("MZ_sim", np.round(responses.MZ, 6) + 0.0),
    ]


def _tare(test: VirtualTest, names: Sequence[str]) -> list[tuple[str, Array]]:
    rows = len(test.tare_rows[CELLS[0]])
    first = {name: values[:1] for name, values in test.files[0].signals.items()}
    columns: list[tuple[str, Array]] = []
    for name in names:
        if name == "t":
            times = -_TARE_BEFORE_S + test.tare_dt * np.arange(rows)
            columns.append((name, np.round(times, 6)))
        elif name in CELLS:
            columns.append((name, np.round(from_si(test.tare_rows[name], unit_of(name)), 8) + 0.0))
        elif name in ("SA", "FZ", "SA_CMD", "FZ_CMD"):
            columns.append((name, np.zeros(rows)))
        else:
            columns.append((name, np.full(rows, shown(first, name)[0])))
    return columns


def run_names(plan: Plan) -> tuple[str, ...]:
    """Return the names of the runs' CSV files, in their order."""
    count = len(plan.recordings)
    width = max(2, len(str(count)))
    return tuple(f"run{number:0{width}d}.csv" for number in range(1, count + 1))


def _csv(path: Path, columns: list[tuple[str, Any]]) -> None:
    # repr of a rounded double is the shortest text that reads back as the same number.
    rows = zip(*(values.tolist() for _, values in columns), strict=True)
    lines = [",".join(name for name, _ in columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
