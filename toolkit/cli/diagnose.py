"""`toolkit diagnose CASE.toml`: simulation against recording, and what physics was left out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, finding_lines, table
from toolkit.cli.home import calibrations_folder

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.report.word.package import Template

NAME = "diagnose"


def command(
    case: Annotated[Path, typer.Argument(metavar="CASE.toml", help="Simulation and recordings.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for diagnosis.json, the page and predictions.")],
    budget: Annotated[
        float, typer.Option("--budget", min=1.0, help="Seconds after which a partial answer is given.")
    ] = 600.0,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", help="Model file (model.toml of an earlier answer) in place of the case's simulation."
        ),
    ] = None,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Also diagnosis.docx and its verified diagnosis.pdf.")
    ] = False,
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template of --pdf; default: report_templates/diagnosis.docx."),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            "--by", help="Who releases the opinion on the cause (ISO/IEC 17025, 7.8.7); else a draft."
        ),
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Diagnose why a simulation and a recording differ.

    It tells where they differ, which physics was left out, and how much better the fit is with it.

    The answer is one of: named, equivalent (a class of effects that this recording cannot tell apart),
    unknown (structure that no known effect explains), nothing, untestable. It ends with 0 for nothing and
    1 for the rest.

    What is named goes into model.toml beside the answer: the simulation with these effects in it, which
    toolkit simulate and toolkit diagnose (--model, or [simulation] model = "model.toml") read.

    Example: toolkit diagnose case.toml --out answer
    """
    _one_thread()
    import json as json_module

    from toolkit.cli.delivery import draft_keys
    from toolkit.diagnosis.answer.case_findings import calibration_use
    from toolkit.diagnosis.answer.model_text import MODEL, model_text
    from toolkit.diagnosis.answer.serial import as_json
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose
    from toolkit.files import write_atomic
    from toolkit.report.diagnosis.page import page

    started = time.perf_counter()
    read = read_case(case, model=model)
    _writable(out)
    opened = _template(template, home) if pdf or template else None
    _apart(model or read.model, out / MODEL)
    registry = registry_of(calibrations, home) if read.simulation.kind == "machine" else None
    tell = _teller(show=not quiet and not json)
    result = diagnose(read, registry, budget_s=budget, tell=tell)
    tell("")
    made = result.diagnosis
    augmented = None if result.search is None else model_text(read, result.search, made, out)
    use = calibration_use(read, registry)
    payload = (
        as_json(made) | draft_keys(*([use] if use else [])) | {"model": None if augmented is None else MODEL}
    )
    drawn = page(result, use)
    payload["timing"] = {"seconds": time.perf_counter() - started}
    text = json_module.dumps({"schema": 1, **payload}, ensure_ascii=False, indent=2, allow_nan=False) + "\n"
    for name, content in result.predictions:
        write_atomic(out / "predictions" / name, content)
    _write_model(out / MODEL, augmented)
    write_atomic(out / "diagnosis.html", drawn)
    write_atomic(out / "diagnosis.json", text)
    said = _text(made, out)
    warned = False
    if opened is not None:
        from toolkit.cli.diagnose_document import write_document

        document = write_document(read, result, opened, out, augmented=augmented, use=use, by=by)
        payload["document"] = document
        warned = bool(document["warnings"])
        said += f"\n{document['pdf']}\n{document['docx']}\n{document['pages']} pages, verified"
        said += "".join(f"\n  warning {one}" for one in document["warnings"])
    answer({**payload, "out": str(out)}, said, as_json=json, quiet=quiet)
    return 0 if made.verdict == "nothing" and not warned else 1


def _template(template: Path | None, home: Path | None) -> Template:
    """Return the template of the document, judged before anything is searched."""
    from toolkit.cli.delivery import home_template
    from toolkit.report.word.package import read_template

    return read_template(template or home_template("diagnosis.docx", home))


def _apart(model: Path | None, target: Path) -> None:
    """Refuse to write the new model over the one that the simulation was taken from."""
    from toolkit.errors import OutputError

    if model is not None and model.resolve() == target.resolve():
        raise OutputError(
            "the answer's model would replace the one that it starts from", where=target,
            got=f"--model {model}", expected="another folder",
            next_step="choose another folder with --out", rule="not-writable",
        )  # fmt: skip


def _write_model(path: Path, text: str | None) -> None:
    """Write the model file; one of an earlier answer does not stay beside an answer that names nothing."""
    from toolkit.files import read_toml, write_atomic
    from toolkit.simulation.model_file import is_model

    if text is not None:
        write_atomic(path, text)
    elif path.is_file() and is_model(read_toml(path)):
        path.unlink()


def _one_thread() -> None:
    """Keep linear algebra on one thread: its matrices are small, and threads only wait for each other."""
    import os

    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _writable(out: Path) -> None:
    """Refuse a folder that cannot be written before the search, not after it."""
    import os

    from toolkit.errors import OutputError

    folder = out.absolute()
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(
            "the answer's folder cannot be written",
            where=out,
            got="a file" if folder.is_file() else f"no write permission in {folder}",
            expected="a folder, or a place where one can be made",
            next_step="choose another folder with --out",
            rule="not-writable",
        )


def registry_of(calibrations: Path | None, home: Path | None) -> Path | None:
    """Return the registry's folder, None where there is no home and none was asked for."""
    from toolkit.errors import ToolkitError

    try:
        return calibrations_folder(calibrations, home)
    except ToolkitError:
        if calibrations is not None or home is not None:
            raise
        return None


def _teller(*, show: bool) -> Any:
    import sys

    started = time.monotonic()

    def tell(what: str) -> None:
        if show and sys.stderr.isatty():
            text = f"{time.monotonic() - started:5.0f} s  {what}" if what else ""
            sys.stderr.write(f"\r\x1b[K{text[:110]}")
            sys.stderr.flush()

    return tell


def _text(made: Diagnosis, out: Path) -> str:
    from toolkit.diagnosis.answer.answer import cut_short
    from toolkit.report.diagnosis.numbers import chance

    cut = made.verdict == "unknown" and cut_short(made.skipped)
    lines = [f"{made.title}: {_CUT if cut else _VERDICTS[made.verdict]}"]
    for one in made.effects:
        channel = f" on {one.channel}" if one.channel else ""
        lines += ["", f"{one.name}{channel} ({one.stage}): {one.statement}", f"  {one.equation}"]
        for each in one.parameters:
            if isinstance(each.value, str):
                lines.append(f"  {each.name} = {each.value}")
                continue
            reach = "" if each.ci95 is None else f"  [{each.ci95[0]:.4g}, {each.ci95[1]:.4g}] 95 %"
            lines.append(f"  {each.name} = {each.value:.4g} {each.unit}{reach}")
        runs = next((each.runs for each in one.parameters if each.runs is not None), None)
        if runs is not None:
            lines.append(f"  in {', '.join(runs)} alone")
        if one.equivalent_to:
            lines.append(f"  this recording cannot tell it from: {', '.join(one.equivalent_to)}")
        lines.append(
            f"  held-out log score +{one.held_out_log_score_gain:.1f}, {chance(one.p_value)} in the search"
        )
    for channel, names in made.depends_on:
        lines.append(f"{channel}: structure that no named effect explains, over {' and '.join(names)}")
    for place in made.mismatch:
        for at in place.where[:1]:
            much = "over all of" if at.whole else "mostly where"
            lines.append(
                f"{place.channel}: mismatch {much} {at.variable}{',' if at.whole else ' is'} "
                f"{at.ends('{:.4g}'.format)} {at.unit}".rstrip()
            )
    rows = [
        [
            o.channel,
            o.unit,
            *(f"{v:.4g}" for v in (o.nominal_rmse, o.refitted_rmse, o.augmented_rmse, o.noise_floor)),
        ]
        for o in made.held_out
    ]
    if rows:
        lines += ["", f"error on held-out rows (by {made.held_out_by}):"]
        lines.append(
            table(["output", "unit", "nominal", "refitted", "augmented", "noise"], rows, align="<<>>>>")
        )
    moved = [one for one in made.nominal_parameters if one.prior_sd]
    if moved:
        cells = [
            [o.name, o.unit, f"{o.before:.5g}", f"{o.after:.5g}", f"{o.shift_in_sd or 0:+.1f}"] for o in moved
        ]
        lines += ["", table(["parameter", "unit", "before", "after", "shift/sd"], cells, align="<<>>>")]
    lines += ["", *made.next_measurements] if made.next_measurements else []
    if not made.complete:
        lines += ["", f"incomplete: the budget was spent before {made.skipped[0]}; a larger --budget goes on"]
    if made.findings:
        lines += ["", "findings (toolkit explain RULE tells more):", *finding_lines(made.findings)]
    return "\n".join([*lines, "", f"written to {out}"])


_CUT = "something is missing; the budget was spent before every known effect was tried"
_VERDICTS = {
    "named": "the missing physics has a name",
    "equivalent": "a class of effects explains it, which this recording cannot tell apart",
    "unknown": "something is missing that no known effect explains",
    "nothing": "nothing is missing that this recording could show",
    "untestable": "this recording cannot tell",
}
