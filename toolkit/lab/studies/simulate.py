"""The virtual machine: a plan's test, session or table into a folder; a model file run on inputs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NotRequired, TypedDict

from toolkit.effects.applied import SimulatedEffect
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import finding_lines
from toolkit.listing import one_line

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.errors import ToolkitError
    from toolkit.simulation.acquisition import OwnProgram
    from toolkit.simulation.plan import Plan
    from toolkit.worker.posix import Limits


class SimulatedFiles(TypedDict):
    """What the virtual machine wrote."""

    out: Path
    simulated: Annotated[bool, "always true"]
    kind: Annotated[str, "test, session, table or model"]
    files: list[str]
    findings: list[FindingEntry]


class PlannedSimulation(SimulatedFiles):
    """What a plan was simulated with."""

    machine: str
    date: str
    seed: int
    effects: list[SimulatedEffect]


class AcquisitionProgram(TypedDict):
    """What the machine's own program computed by."""

    record: str | None
    negated: Annotated[list[str], "indications that it takes with the wrong sign"]


class CopiedTest(TypedDict):
    """Where a simulated test stands in other forms."""

    csv: NotRequired[list[str]]
    case: NotRequired[Annotated[str, "case that `diagnose` reads"]]


class SimulatedTest(PlannedSimulation, CopiedTest):
    """A simulated test."""

    record: Annotated[str, "means or continuous"]
    recordings: list[str]
    truth: Annotated[str, "file of what was simulated"]
    acquisition_program: AcquisitionProgram


class SimulatedSession(PlannedSimulation):
    """A simulated reference-load session."""

    session: str
    truth: Annotated[str, "file of what was simulated"]
    points: int
    check_points: int


class SimulatedTable(PlannedSimulation):
    """A maker's flat-surface table, simulated."""

    table: str
    axes: str


class SimulatedModel(SimulatedFiles):
    """Outputs of a diagnosis's model on inputs."""

    model_sha256: str
    case_sha256: str
    effects: Annotated[list[str], "effects in the model"]


PlanForms = SimulatedTest | SimulatedSession | SimulatedTable
SimulateForms = PlanForms | SimulatedModel


def simulate_plan(
    plan: Plan,
    out: Path,
    *,
    calibrations: Path | None = None,
    home: Path | None = None,
    csv: Path | None = None,
    case: Path | None = None,
) -> tuple[PlanForms, str, Sequence[Finding]]:
    """Write what a plan makes; return the JSON answer, the text for people and the findings on its tire.

    Parameters
    ----------
    csv : folder for the recordings as CSV; None without
    case : folder for a case that `diagnose` reads; None without

    Raises
    ------
    ToolkitError
        a folder cannot be used; a session or a table has no recordings for ``csv`` and ``case``
    """
    from toolkit.lab.home import registry_if_any

    if plan.kind != "test" and (csv is not None or case is not None):
        raise _no_runs(plan)
    payload: PlanForms
    if plan.kind == "session":
        payload, text = _session(plan, out)
    elif plan.kind == "table":
        payload, text = _table(plan, out)
    else:
        payload, text = _test(plan, out, registry_if_any(calibrations, home), csv, case)
    effects = (f"  effect       {effect.as_text()}" for effect in plan.effects)
    findings = _findings(plan)
    return payload, "\n".join([text, *effects, *finding_lines(findings)]), findings


def _findings(plan: Plan) -> Sequence[Finding]:
    return () if plan.tire_file is None else plan.tire_file.tir.findings()


def _no_runs(plan: Plan) -> ToolkitError:
    from toolkit.errors import ConfigError

    return ConfigError(
        f"a {plan.kind} has no recordings", where="--csv, --case", got=f'kind = "{plan.kind}"',
        expected='a plan with kind = "test"', next_step="leave the option out", rule="wrong-value",
    )  # fmt: skip


def _test(
    plan: Plan, out: Path, registry: Registry | None, csv: Path | None, case: Path | None
) -> tuple[SimulatedTest, str]:
    from toolkit.publication import publication
    from toolkit.simulation.case import CASE, RUNS, TIRE, check_case, run_names, write_case, write_runs
    from toolkit.simulation.program import other_programs
    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import TEST, TRUTH, check_folder, test_names, write_test

    program = _program(plan, registry)
    record = None if program is None else program.record
    programs = other_programs(plan, registry)
    for folder, names in ((csv, {*run_names(plan)}), (case, {CASE, RUNS, TIRE})):
        if folder is not None:
            _check_apart(folder, out)
            check_folder(folder, names)
    if case is not None:
        check_case(plan, record)
    test = simulate(plan, program, programs)
    check_folder(out, set(test_names(test)))
    with ExitStack() as together:
        stages = {
            folder: together.enter_context(publication(folder))
            for folder in (out, csv, case)
            if folder is not None
        }
        files = write_test(test, stages[out])
        runs = () if csv is None else write_runs(test, stages[csv])
        if case is not None:
            write_case(test, stages[case], record=record)
    copies: CopiedTest = {}
    if csv is not None:
        copies["csv"] = [str(csv / path.name) for path in runs]
    if case is not None:
        copies["case"] = str(case / CASE)
    payload: SimulatedTest = {
        **_planned(plan, out, files),
        "record": plan.record,
        "recordings": [file.name for file in test.files],
        "truth": TRUTH,
        "acquisition_program": {"record": record, "negated": [*plan.acquisition.negated]},
        **copies,
    }
    wrong = f", with {', '.join(plan.acquisition.negated)} negative" if plan.acquisition.negated else ""
    text = (
        f"{len(test.files)} recordings of the virtual machine {plan.machine.name} in {one_line(out)}"
        "  SIMULATED\n"
        f"  conditions   {TEST}\n  truth        {TRUTH}\n"
        f"  own Fy, Mz   by {record or 'the true map of the cells (no record applies)'}{wrong}"
    )
    if csv is not None:
        text += f"\n  as CSV       {csv}"
    if case is not None:
        text += f"\n  case         {case / CASE}   (toolkit diagnose {case / CASE} --out DIR)"
    return payload, text


def _check_apart(folder: Path, out: Path) -> None:
    from toolkit.errors import OutputError
    from toolkit.files import real_path

    if real_path(out) in (real_path(folder), *real_path(folder).parents):
        raise OutputError(
            "CSV files would lie among the test's recordings", where=folder, got=f"a folder in {out}",
            expected="a folder beside the one of --out",
            next_step="choose another folder; nothing was written",
        )  # fmt: skip


def _table(plan: Plan, out: Path) -> tuple[SimulatedTable, str]:
    from toolkit.simulation.steady import TABLE, write_table
    from toolkit.simulation.write import check_folder

    check_folder(out, {TABLE})
    path = write_table(plan, out)
    payload: SimulatedTable = {**_planned(plan, out, (path,)), "table": path.name, "axes": "SAE"}
    return payload, f"flat-surface table of the plan's tire in {path}, SAE axes  SIMULATED"


def _session(plan: Plan, out: Path) -> tuple[SimulatedSession, str]:
    from toolkit.simulation.session import simulate_session
    from toolkit.simulation.write import SESSION, TRUTH, write_session

    session = simulate_session(plan)
    files = write_session(session, out)
    payload: SimulatedSession = {
        **_planned(plan, out, files),
        "session": SESSION,
        "truth": TRUTH,
        "points": len(session.run),
        "check_points": len(session.check_loads),
    }
    text = (
        f"reference-load session of {plan.machine.name}: {len(session.run)} points in "
        f"{max(session.run)} runs, {len(session.check_loads)} check loads  SIMULATED\n"
        f"  next: toolkit calibrate {out / SESSION}"
    )
    return payload, text


def _planned(plan: Plan, out: Path, files: Sequence[Path]) -> PlannedSimulation:
    return {
        "out": out,
        "simulated": True,
        "kind": plan.kind,
        "machine": plan.machine.name,
        "date": plan.date,
        "seed": plan.seed,
        "effects": [effect.as_dict() for effect in plan.effects],
        "files": [path.name for path in files],
        "findings": [finding.as_dict() for finding in _findings(plan)],
    }


def _program(plan: Plan, registry: Registry | None) -> OwnProgram | None:
    from datetime import date

    from toolkit.errors import RegistryError
    from toolkit.simulation.program import program_from

    if registry is None:
        return None
    try:
        record = registry.in_force(plan.machine.name, on=date.fromisoformat(plan.date))
    except RegistryError as error:
        if error.rule == "no-record-in-force":
            return None
        raise
    return program_from(record)


def is_model_file(path: Path) -> bool:
    """Tell whether a file is the model file of a diagnosis; what is no TOML is none."""
    from toolkit.errors import ConfigError
    from toolkit.files import read_toml
    from toolkit.simulation.model_file import is_model

    try:
        return is_model(read_toml(path))
    except ConfigError:
        return False


def model_answer(
    path: Path,
    inputs: Sequence[Path],
    conditions: Sequence[str],
    out: Path,
    calibrations: Path | None,
    home: Path | None,
    *,
    budget_s: float,
    limits: Limits,
) -> tuple[SimulatedModel, str]:
    """Write the outputs of a model on inputs; return the JSON answer and the text for people.

    ``limits`` are of the worker in which the model's own code runs, ``budget_s`` its seconds.
    """
    from toolkit.diagnosis.forward import simulate_model
    from toolkit.lab.studies.diagnosis import machine_registry
    from toolkit.publication import publication
    from toolkit.simulation.model_file import read_model
    from toolkit.simulation.write import check_folder

    model = read_model(path)
    registry = machine_registry(model.kind, calibrations, home)
    outputs, findings = simulate_model(
        model, inputs, registry, conditions=_conditions(conditions), budget_s=budget_s, limits=limits
    )
    check_folder(out, {name for name, _ in outputs})
    with publication(out) as stage:
        for name, content in outputs:
            (stage / name).write_text(content, encoding="utf-8")
    payload: SimulatedModel = {
        "out": out,
        "simulated": True,
        "kind": "model",
        "model_sha256": model.sha256,
        "case_sha256": model.case_sha256,
        "effects": [effect.label for effect in model.effects],
        "files": [name for name, _ in outputs],
        "findings": [finding.as_dict() for finding in findings],
    }
    lines = [f"{model.title}: {len(outputs)} files of outputs in {one_line(out)}  SIMULATED"]
    lines += [f"  effect       {effect.label}" for effect in model.effects]
    return payload, "\n".join([*lines, *finding_lines(findings)])


def _conditions(texts: Sequence[str]) -> dict[str, str]:
    from toolkit.errors import ConfigError

    conditions = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not key.strip() or not equals or not value.strip() or key.strip() == "file":
            raise ConfigError(
                "a condition is not whole", where="--condition", got=text, expected="KEY=VALUE",
                next_step="write for example --condition rotation=reverse", rule="wrong-value",
            )  # fmt: skip
        conditions[key.strip()] = value.strip()
    return conditions
