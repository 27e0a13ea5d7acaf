"""`toolkit simulate`: the virtual machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer

if TYPE_CHECKING:
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
            "--effect", metavar="NAME=VALUE", help="Set an effect, e.g. drum_runout=40; repeatable."
        ),
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Run a test or a session on the virtual machine.

    The files are in the machine's own format, everything is marked simulated, and the truth is stored
    beside it. Where the registry has a record of the virtual machine, its acquisition program computes
    Fy and Mz by the record's issued coefficients.

    Example: toolkit simulate toolkit/examples/virtual/test_plan.toml --out virtual-test
    """
    from toolkit.simulation.effects import with_effects
    from toolkit.simulation.plan import read_plan

    told = with_effects(read_plan(plan, seed=seed), effect or [])
    if told.kind == "session":
        payload, text = _session(told, out)
    else:
        payload, text = _test(told, out, _program(told, calibrations, home))
    answer(payload, text, as_json=json, quiet=quiet)
    return 0


def _test(plan: Plan, out: Path, program: OwnProgram | None) -> tuple[dict[str, Any], str]:
    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import TEST, TRUTH, write_test

    test = simulate(plan, program)
    files = write_test(test, out)
    record = test.program.record
    payload = _common(plan, out, files) | {
        "kind": "test",
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
        "effects": [{"name": name, "value": value} for name, value in plan.effects],
        "files": [path.name for path in files],
        "findings": [],
    }


def _effects(plan: Plan) -> str:
    return "".join(f"\n  effect       {name} = {value:g}" for name, value in plan.effects)


def _program(plan: Plan, calibrations: Path | None, home: Path | None) -> OwnProgram | None:
    # A virtual machine needs no registry; but a registry that is named, or is damaged, is never passed over.
    from datetime import date

    from toolkit.calibration.registry.registry import Registry
    from toolkit.cli.home import calibrations_folder
    from toolkit.errors import ConfigError, RegistryError
    from toolkit.simulation.program import program_from

    try:
        registry = Registry(calibrations_folder(calibrations, home))
    except ConfigError:
        if calibrations is not None or home is not None:
            raise
        return None
    try:
        record = registry.in_force(plan.machine.name, on=date.fromisoformat(plan.date))
    except RegistryError as error:
        if error.rule == "no-record-in-force":
            return None
        raise
    return program_from(record)
