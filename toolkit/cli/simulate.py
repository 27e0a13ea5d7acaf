"""`toolkit simulate`: the virtual machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import INTO_FOLDER, Output, RegistryOptions, WorkerOptions

NAME = "simulate"


@answers("toolkit.lab.studies.simulate:SimulateForms")
def command(
    plan: Annotated[Path, "What the machine does, and what it is.", ARGUMENT, Mark(metavar="PLAN.toml")],
    out: Annotated[Path, "Folder for the files; new or empty.", INTO_FOLDER],
    seed: Annotated[int | None, "Replaces the plan's seed."] = None,
    effect: Annotated[
        list[str] | None,
        "Switch an effect of the catalogue on, beside the plan's own; repeatable.",
        Mark(metavar="NAME[.CHANNEL][@KEY:VALUE][=VALUE]"),
    ] = None,
    csv: Annotated[Path | None, "Folder for the recordings as CSV, every column.", INTO_FOLDER] = None,
    case: Annotated[
        Path | None, "Folder for a case that `toolkit diagnose` reads; it names no effect.", INTO_FOLDER
    ] = None,
    inputs: Annotated[
        list[Path] | None, "Inputs of a model file; repeatable.", Mark(metavar="FILE.csv")
    ] = None,
    condition: Annotated[
        list[str] | None, "Condition of all inputs; repeatable.", Mark(metavar="KEY=VALUE")
    ] = None,
    budget: Annotated[float, "Seconds that a model's own code may take.", Mark(min=1.0)] = 600.0,
    *,
    worker: WorkerOptions,
    place: RegistryOptions,
    output: Output,
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
      --effect wrong_calibration=rig-r1
      --effect load_lag@order:1+2=1.5s         (in runs with that condition)

    In place of a plan it takes the model.toml of a diagnosis, of any kind of simulation, and runs it on
    inputs: DIR gets the outputs of each file as CSV. The model of a tire may also be the tire of a plan,
    [tire] file = "model.toml": its effects are then switched on. A model of kind python or ode executes its
    code, in a process of its own; run that of others --isolated.

    Example: toolkit simulate toolkit/examples/virtual/test_plan.toml --out virtual-test
    """
    from toolkit.lab.studies.simulate import is_model_file, model_answer, simulate_plan
    from toolkit.simulation.plan import read_plan, with_effects

    if inputs or condition or is_model_file(plan):
        _refuse_options({"--effect": effect, "--seed": seed, "--csv": csv, "--case": case})
        outputs, text = model_answer(
            plan, inputs or [], condition or [], out, place.calibrations, place.home, budget_s=budget,
            limits=worker.limits(),
        )  # fmt: skip
        output.answer(outputs, text)
        return 0
    planned = with_effects(read_plan(plan, seed=seed), effect or [])
    payload, text, findings = simulate_plan(
        planned, out, calibrations=place.calibrations, home=place.home, csv=csv, case=case
    )
    output.answer(payload, text)
    return exit_code(findings)


def _refuse_options(options: dict[str, object]) -> None:
    """Refuse options of a plan beside a model file."""
    from toolkit.errors import ConfigError

    for name, value in options.items():
        if value is not None and value != []:
            raise ConfigError(
                "a model file is run on inputs alone", where=name, got=name,
                expected="--inputs, --condition, --out", rule="model-file",
                next_step="leave the option out; a plan with [tire] file = the model knows it",
            )  # fmt: skip
