"""`toolkit plan test` and `plan next`: which runs to make next, and how few of them are enough."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import INTO_FOLDER, CalibrationId, Draft, Output, RegistryOptions, WorkerOptions
from toolkit.cli.plan import SheetTemplate, answered, app


@app.command("test")
@answers("toolkit.lab.plans.protocol_plan:PlanTestAnswer")
def protocol(
    like: Annotated[
        list[Path] | None,
        "Earlier test of such a tire, or a tire file (.tir, model.toml); repeatable: the plan serves each "
        "of them. Default: passenger tires, by the published one on the virtual machine.",
        Mark(metavar="TEST|TIRE"),
    ] = None,
    spread: Annotated[
        list[str] | None,
        "How far tires of the class may be from it, as factors: stiffness=0.7..1.3, friction=0.9..1.1; the "
        "plan serves all of them. Default: as tested; of passenger tires, stiffness=0.41..1.11.",
        Mark(metavar="NAME=LOW..HIGH"),
    ] = None,
    u: Annotated[
        list[str] | None,
        "Largest expanded uncertainty: 'conicity=2 N', 'slope_cornering=2 %', 'FY@8deg=40 N', 'peak=1 %'; a "
        "name alone: that of the machine's protocol. Repeatable; default: slope_cornering, conicity, "
        "plysteer and peak as by the protocol.",
        Mark(metavar="NAME=U"),
    ] = None,
    load: Annotated[
        list[str] | None, "At which load, '833 lbf'; repeatable; default: all.", Mark(metavar="LOAD")
    ] = None,
    minutes: Annotated[float, "Time on the machine at most."] = math.inf,
    between_files: Annotated[
        float | None, "From one recording to the next; default 30.", Mark(metavar="SECONDS", min=0.0)
    ] = None,
    sliding: Annotated[
        float, "Energy that may slide away: wear of the tread.", Mark(metavar="KJ")
    ] = math.inf,
    rise: Annotated[
        float,
        "Largest temperature rise of the tread above the room; pauses keep it below.",
        Mark(metavar="K"),
    ] = math.inf,
    out: Annotated[
        Path | None, "Folder for protocol.toml and the plan.toml of `toolkit simulate`.", INTO_FOLDER
    ] = None,
    template: SheetTemplate = None,
    calibration: CalibrationId = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Plan the shortest test that reaches stated uncertainties.

    Slip angles, loads and directions, by the budget that `toolkit process` prints. A demand that no
    test meets ends with 2 and the nearest plan that is feasible.

    Example: toolkit plan test --like tests/2019-06-04 --u "conicity=2 N" --load "833 lbf" --out plan
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.protocol_plan import ProtocolOrder, plan_test

    order = ProtocolOrder(
        like=tuple(like or ()), spread=tuple(spread or ()), demands=tuple(u or ()), loads=tuple(load or ()),
        minutes=minutes,
        between_files_s=between_files, sliding_kJ=sliding, rise_K=rise,
        basis=place.basis(calibration=calibration, draft=draft),
    )  # fmt: skip
    opened = document_template(template, out)
    with output.progress("planning") as step:
        planned, text = plan_test(order, out, template=opened, tell=step)
    return answered(planned, text, output)


@app.command("next")
@answers("toolkit.lab.plans.next_run:PlanNextAnswer")
def following(
    source: Annotated[
        Path, "Folder of toolkit diagnose --out, or its diagnosis.json.", ARGUMENT, Mark(metavar="ANSWER")
    ],
    case: Annotated[Path | None, "The case; default: the one that the answer's model names."] = None,
    limit: Annotated[
        list[str] | None,
        "What an input may reach, in its unit; repeatable; default: what was recorded.",
        Mark(metavar="NAME=LOW..HIGH"),
    ] = None,
    rate: Annotated[
        list[str] | None,
        "How fast an input may change, in its unit a second; repeatable; default: four times as recorded.",
        Mark(metavar="NAME=MOST"),
    ] = None,
    budget: Annotated[float, "Seconds of the search.", Mark(min=1.0)] = 45.0,
    out: Annotated[
        Path | None, "Folder for the inputs, what each member predicts, and the steps.", INTO_FOLDER
    ] = None,
    template: SheetTemplate = None,
    *,
    worker: WorkerOptions,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Propose the run that tells the members of a diagnosis' class apart.

    Each member is fitted to the recordings in the others' place. Runs are those that were made, with inputs
    faster or slower, larger or smaller, one alone, on new courses within the limits, and conditions changed:
    the one is proposed in which the members' predictions are furthest apart beyond noise and what is open of
    their parameters.

    Example: toolkit plan next answer --out next
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.next_run import plan_next

    opened = document_template(template, out)
    with output.progress("planning") as step:
        planned, text = plan_next(
            source, out, case=case, limits=tuple(limit or ()), rates=tuple(rate or ()),
            budget_s=budget, calibrations=place.calibrations, home=place.home, worker=worker.limits(),
            template=opened, tell=step,
        )  # fmt: skip
    return answered(planned, text, output)
