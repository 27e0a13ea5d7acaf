"""`toolkit simulate`: the virtual machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, exit_code, finding_lines

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.errors import ToolkitError
    from toolkit.simulation.acquisition import OwnProgram
    from toolkit.simulation.plan import Plan

NAME = "simulate"


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN.toml", help="What the machine does, and what it is.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for the files; new or empty.")],
    seed: Annotated[int | None, typer.Option("--seed", help="Replaces the plan's seed.")] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME[.CHANNEL][@KEY:VALUE][=VALUE]",
            help="Switch an effect of the catalogue on, beside the plan's own; repeatable.",
        ),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", help="Folder for the recordings as CSV, every column.")
    ] = None,
    case: Annotated[
        Path | None,
        typer.Option("--case", help="Folder for a case that `toolkit diagnose` reads; it names no effect."),
    ] = None,
    inputs: Annotated[
        list[Path] | None,
        typer.Option("--inputs", metavar="FILE.csv", help="Inputs of a model file; repeatable."),
    ] = None,
    condition: Annotated[
        list[str] | None,
        typer.Option("--condition", metavar="KEY=VALUE", help="Condition of all inputs; repeatable."),
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Run a test or a session on the virtual machine, or print a maker's flat-surface table.

    The files are in the machine's own format, everything is marked simulated, and the truth is stored
    beside it. Where the registry has a record of the virtual machine, its acquisition program computes
    Fy and Mz by the record's issued coefficients. [acquisition] record = "continuous" in the plan keeps
    every row, moves too, with time, commands, angles, temperatures and pressure.

    Effects are those of the catalogue that `toolkit diagnose` looks for. A number without a unit is in the
    parameter's own; an effect on cells without a cell's name is on every cell:

    \b
      --effect relaxation=0.5m
      --effect creep.D51=fraction:0.01,time_constant:20s
      --effect zero_offset.D51=0.002mV/V
      --effect crosstalk.FZ.FY=0.01            (from FZ to FY)
      --effect channel_sign.E5
      --effect channel_swap.D51.D52
      --effect wrong_calibration=m15-virtual-r1
      --effect load_lag@order:1+2=1.5s         (in runs with that condition)

    In place of a plan it takes the model.toml of a diagnosis, of any kind of simulation, and runs it on
    inputs: DIR gets the outputs of each file as CSV. The model of a tire may also be the tire of a plan,
    [tire] file = "model.toml": its effects are then switched on.

    Example: toolkit simulate toolkit/examples/virtual/test_plan.toml --out virtual-test
    """
    from toolkit.cli.simulate_model import is_model_file, model_answer
    from toolkit.simulation.plan import read_plan, with_effects

    if inputs or condition or is_model_file(plan):
        _refuse_options({"--effect": effect, "--seed": seed, "--csv": csv, "--case": case})
        payload, text = model_answer(plan, inputs or [], condition or [], out, calibrations, home)
        answer(payload, text, as_json=json, quiet=quiet)
        return 0
    told = with_effects(read_plan(plan, seed=seed), effect or [])
    if told.kind != "test" and (csv is not None or case is not None):
        raise _no_runs(told)
    if told.kind == "session":
        payload, text = _session(told, out)
    elif told.kind == "table":
        payload, text = _table(told, out)
    else:
        payload, text = _test(told, out, _registry(calibrations, home), csv, case)
    findings = () if told.tire_file is None else told.tire_file.tir.findings()
    payload["findings"] = [one.as_dict() for one in findings]
    answer(payload, "\n".join([text, *finding_lines(findings)]), as_json=json, quiet=quiet)
    return exit_code(findings)


def _refuse_options(given: dict[str, object]) -> None:
    """Refuse options of a plan beside a model file."""
    from toolkit.errors import ConfigError

    for name, value in given.items():
        if value is not None and value != []:
            raise ConfigError(
                "a model file is run on inputs alone", where=name, got=name,
                expected="--inputs, --condition, --out", rule="model-file",
                next_step="leave the option out; a plan with [tire] file = the model knows it",
            )  # fmt: skip


def _no_runs(plan: Plan) -> ToolkitError:
    from toolkit.errors import ConfigError

    return ConfigError(
        f"a {plan.kind} has no recordings", where="--csv, --case", got=f'kind = "{plan.kind}"',
        expected='a plan with kind = "test"', next_step="leave the option out", rule="wrong-value",
    )  # fmt: skip


def _test(
    plan: Plan, out: Path, registry: Registry | None, csv: Path | None, case: Path | None
) -> tuple[dict[str, Any], str]:
    from toolkit.simulation.case import CASE, RUNS, TIRE, check_case, run_names, write_case, write_runs
    from toolkit.simulation.program import other_programs
    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import TEST, TRUTH, check_folder, write_test

    program = _program(plan, registry)
    record = None if program is None else program.record
    others = other_programs(plan, registry)
    for folder, names in ((csv, {*run_names(plan)}), (case, {CASE, RUNS, TIRE})):
        if folder is not None:
            _check_apart(folder, out)
            check_folder(folder, names)
    if case is not None:
        check_case(plan, record)
    test = simulate(plan, program, others)
    files = write_test(test, out)
    payload = _common(plan, out, files) | {
        "kind": "test",
        "record": plan.record,
        "recordings": [file.name for file in test.files],
        "truth": TRUTH,
        "acquisition_program": {"record": record, "negated": plan.acquisition.negated},
    }
    wrong = f", with {', '.join(plan.acquisition.negated)} negative" if plan.acquisition.negated else ""
    text = (
        f"{len(test.files)} recordings of the virtual machine {plan.machine.name} in {out}  SIMULATED\n"
        f"  conditions   {TEST}\n  truth        {TRUTH}\n"
        f"  own Fy, Mz   by {record or 'the true map of the cells (no record applies)'}{wrong}"
    )
    if csv is not None:
        payload["csv"] = [str(path) for path in write_runs(test, csv)]
        text += f"\n  as CSV       {csv}"
    if case is not None:
        payload["case"] = str(write_case(test, case, record=record)[0])
        text += f"\n  case         {case / CASE}   (toolkit diagnose {case / CASE} --out DIR)"
    return payload, text + _effects(plan)


def _check_apart(folder: Path, out: Path) -> None:
    from toolkit.errors import OutputError

    if out.resolve() in (folder.resolve(), *folder.resolve().parents):
        raise OutputError(
            "CSV files would lie among the test's recordings", where=folder, got=f"a folder in {out}",
            expected="a folder beside the one of --out",
            next_step="choose another folder; nothing was written",
        )  # fmt: skip


def _table(plan: Plan, out: Path) -> tuple[dict[str, Any], str]:
    from toolkit.simulation.maker import TABLE, write_table
    from toolkit.simulation.write import check_folder

    check_folder(out, {TABLE})
    path = write_table(plan, out)
    payload = _common(plan, out, (path,)) | {"kind": "table", "table": path.name, "axes": "SAE"}
    text = f"flat-surface table of the plan's tire in {path}, SAE axes  SIMULATED"
    return payload, text + _effects(plan)


def _session(plan: Plan, out: Path) -> tuple[dict[str, Any], str]:
    from toolkit.simulation.session import simulate_session
    from toolkit.simulation.write import SESSION, TRUTH, write_session

    session = simulate_session(plan)
    files = write_session(session, out)
    payload = _common(plan, out, files) | {
        "kind": "session",
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
    return payload, text + _effects(plan)


def _common(plan: Plan, out: Path, files: tuple[Path, ...]) -> dict[str, Any]:
    return {
        "out": out,
        "simulated": True,
        "machine": plan.machine.name,
        "date": plan.date,
        "seed": plan.seed,
        "effects": [one.as_dict() for one in plan.effects],
        "files": [path.name for path in files],
    }


def _effects(plan: Plan) -> str:
    return "".join(f"\n  effect       {applied.as_text()}" for applied in plan.effects)


def _registry(calibrations: Path | None, home: Path | None) -> Registry | None:
    # A virtual machine needs no registry; but one that is named, or is damaged, is never passed over.
    from toolkit.calibration.registry.registry import Registry
    from toolkit.cli.home import calibrations_folder
    from toolkit.errors import ConfigError

    try:
        return Registry(calibrations_folder(calibrations, home))
    except ConfigError:
        if calibrations is not None or home is not None:
            raise
        return None


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
