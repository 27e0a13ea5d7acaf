"""`toolkit diagnose CASE.toml`: simulation against recording, and what physics was left out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import INTO_FOLDER, Output, RegistryOptions, WorkerOptions

NAME = "diagnose"


@answers("toolkit.lab.studies.diagnosis:DiagnoseAnswer")
def command(
    case: Annotated[Path, "Simulation and recordings.", ARGUMENT, Mark(metavar="CASE.toml")],
    out: Annotated[Path, "Folder for diagnosis.json, the page and predictions.", INTO_FOLDER],
    budget: Annotated[float, "Seconds after which a partial answer is given.", Mark(min=1.0)] = 600.0,
    model: Annotated[
        Path | None, "Model file (model.toml of an earlier answer) in place of the case's simulation."
    ] = None,
    pdf: Annotated[bool, "Also diagnosis.docx and its verified diagnosis.pdf."] = False,
    template: Annotated[
        Path | None, "Word template of --pdf; default: report_templates/diagnosis.docx."
    ] = None,
    by: Annotated[
        str | None, "Who releases the opinion on the cause (ISO/IEC 17025, 7.8.7); else a draft."
    ] = None,
    *,
    worker: WorkerOptions,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Diagnose why a simulation and a recording differ.

    It tells where they differ, which physics was left out, and how much better the fit is with it.

    The answer is one of: named, equivalent (a class of effects that this recording cannot tell apart),
    unknown (structure that no known effect explains), nothing, untestable. It ends with 0 for nothing and
    1 for the rest.

    What is named goes into model.toml beside the answer: the simulation with these effects in it, which
    toolkit simulate and toolkit diagnose (--model, or [simulation] model = "model.toml") read.

    A case executes its code: simulators of kind python and ode are programs. They run in a process of their
    own, which cannot end or garble this one, but may read and write what you may; run those of others
    --isolated.

    Example: toolkit diagnose case.toml --out answer
    """
    from toolkit.declared import answer
    from toolkit.lab.answers import document_text
    from toolkit.lab.home import home_template
    from toolkit.lab.studies.diagnosis import diagnose_case, diagnosis_text, write_diagnosis
    from toolkit.report.word.office import find_soffice
    from toolkit.report.word.package import read_template

    # What the document needs is judged before anything is searched: it comes with the answer or not at all.
    chosen = template or (home_template("diagnosis.docx", place.home) if pdf else None)
    opened = None if chosen is None else read_template(chosen)
    if opened is not None:
        find_soffice()
    diagnosed = diagnose_case(
        case, out=out, model=model, calibrations=place.calibrations, home=place.home, budget_s=budget,
        limits=worker.limits(),
        tell=_teller(show=not output.silent),
    )  # fmt: skip
    payload = write_diagnosis(diagnosed, out, timing=lambda: output.timing, opened=opened, by=by)
    text = diagnosis_text(diagnosed.result.diagnosis, out)
    warned = payload.document is not None and bool(payload.document["warnings"])
    output.answer(answer(payload), text + document_text(payload.document))
    return 0 if diagnosed.result.diagnosis.verdict == "nothing" and not warned else 1


def _teller(*, show: bool) -> Any:
    import sys

    from toolkit.lab.progress_note import note_of
    from toolkit.printable import escaped

    if (note := note_of("diagnosis", None)) is not None:
        return note.step
    started = time.monotonic()

    def tell(step: str) -> None:
        if show and sys.stderr.isatty():
            text = escaped(f"{time.monotonic() - started:5.0f} s  {step}", lines=False) if step else ""
            sys.stderr.write(f"\r\x1b[K{text[:110]}")
            sys.stderr.flush()

    return tell
