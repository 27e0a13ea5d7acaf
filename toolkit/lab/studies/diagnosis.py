"""A diagnosis: its answer, page, predictions and model file in one folder, and its Word document."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from toolkit.declared import Entry, answer
from toolkit.declared.answers import extended
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.lab.answers import DeliveredDocument, Timing, delivered_keys, draft_keys, finding_lines
from toolkit.listing import or_dash, table
from toolkit.units import with_unit

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.diagnose import Result
    from toolkit.report.word.package import Template
    from toolkit.worker.posix import Limits


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisFile(Diagnosis):
    """What ``diagnosis.json`` holds beside its schema."""

    draft: Annotated[bool, Entry("whether a record is used that is not approved and in force")]
    draft_reasons: Annotated[tuple[str, ...], Entry("why")]
    model: Annotated[str | None, Entry("file of the simulation with these effects in it")]
    timing: Timing


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnoseAnswer(DiagnosisFile):
    """Why a simulation and a recording differ."""

    out: str
    document: Annotated[DeliveredDocument | None, Entry(sparse=True)] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosed:
    """A case with its result, and how the calibration that it names stands."""

    case: Case
    result: Result
    use: CalibrationUse | None

    def model(self, folder: Path) -> str | None:
        """Return the model file for a folder; None where nothing is named that could go back into use."""
        from toolkit.diagnosis.answer.model_text import model_text

        result = self.result
        if result.search is None:
            return None
        return model_text(self.case, result.search, result.diagnosis, folder, result.laws)


def diagnose_case(
    file: Path,
    *,
    out: Path | None = None,
    model: Path | None = None,
    calibrations: Path | None = None,
    home: Path | None = None,
    budget_s: float = 600.0,
    limits: Limits | None = None,
    tell: Callable[[str], None] = lambda _text: None,
) -> Diagnosed:
    """Return the diagnosis of a case.

    Parameters
    ----------
    out : where `write_diagnosis` will put it: judged before the search, not after it
    model : model file in place of the case's simulation
    limits : of the worker in which the case's own code runs (`worker_limits`); None runs it in this process
    tell : told what is searched

    Raises
    ------
    ToolkitError
        the case cannot be read or used, or the folder not written
    """
    from toolkit.diagnosis.answer.case_findings import calibration_use
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose

    case = read_case(file, model=model)
    if out is not None:
        check_folder(out, model or case.model)
    registry = machine_registry(case.simulation.kind, calibrations, home)
    result = diagnose(case, registry, budget_s=budget_s, limits=limits, tell=tell)
    tell("")
    return Diagnosed(case=case, result=result, use=calibration_use(case, registry))


def worker_limits(
    *, isolated: bool = False, memory_GB: float | None = None, processes: int | None = None
) -> Limits:
    """Return the limits of the process in which a case's own code runs; None for those of the policy."""
    from toolkit.diagnosis.policy import WORKER
    from toolkit.diagnosis.simulators.case_code import limits_of

    return limits_of(
        memory_GB=WORKER.memory_GB if memory_GB is None else memory_GB,
        processes=WORKER.processes if processes is None else processes,
        isolated=isolated,
    )


def check_folder(out: Path, model: Path | None) -> None:
    """Refuse a folder that cannot be written, or whose model file is the one that was started from."""
    from toolkit.diagnosis.answer.model_text import MODEL
    from toolkit.publication import check_place

    check_place(out)
    _apart(model, out / MODEL)


def machine_registry(kind: str, calibrations: Path | None, home: Path | None) -> Path | None:
    """Return the registry's folder for a simulation of the machine; None for others, and without a home."""
    from toolkit.lab.home import registry_if_any

    registry = registry_if_any(calibrations, home) if kind == "machine" else None
    return None if registry is None else registry.folder


def write_diagnosis(
    diagnosed: Diagnosed,
    out: Path,
    *,
    timing: Callable[[], Timing],
    opened: Template | None = None,
    by: str | None = None,
) -> DiagnoseAnswer:
    """Write predictions, model file, page, answer and, by a template, the document; return the answer.

    ``timing`` is asked at its end; ``by`` releases the document's opinion on the cause.

    Raises
    ------
    OutputError, TemplateError, RenderError
        the folder cannot be written to, or the document not be made: then nothing of it was changed
    """
    from toolkit.diagnosis.answer.model_text import MODEL
    from toolkit.publication import publication
    from toolkit.report.diagnosis.page import page

    model = diagnosed.model(out)
    drawn = page(diagnosed.result, diagnosed.use)
    content = extended(
        DiagnosisFile, diagnosed.result.diagnosis, **draft_keys(*([diagnosed.use] if diagnosed.use else [])),
        model=None if model is None else MODEL, timing=timing(),
    )  # fmt: skip
    written = json.dumps(answer(content), ensure_ascii=False, indent=2, allow_nan=False) + "\n"
    files = {f"predictions/{name}": rows for name, rows in diagnosed.result.predictions}
    files |= {"diagnosis.html": drawn, "diagnosis.json": written}
    with publication(out) as stage:
        for name, text in files.items():
            (stage / name).parent.mkdir(exist_ok=True)
            (stage / name).write_text(text, encoding="utf-8")
        _write_model(out / MODEL, model, stage)
        document = None if opened is None else _write_document(diagnosed, opened, out, stage, by=by)
    return extended(DiagnoseAnswer, content, out=str(out), document=document)


def _write_document(
    diagnosed: Diagnosed, opened: Template, out: Path, stage: Path, *, by: str | None
) -> DeliveredDocument:
    """Deliver ``diagnosis.docx`` and ``diagnosis.pdf``; return what the JSON answer says of them."""
    from datetime import date

    from toolkit.files import sha256_bytes
    from toolkit.report.deliver import deliver
    from toolkit.report.diagnosis.content import build_diagnosis_content
    from toolkit.report.style import read_style, style_file

    model = diagnosed.model(out)
    content = build_diagnosis_content(
        diagnosed.case,
        diagnosed.result,
        read_style(style_file(opened.path)),
        issued=date.today(),  # noqa: DTZ011
        use=diagnosed.use,
        model_sha256=None if model is None else sha256_bytes(model.encode()),
        by=by,
    )
    return delivered_keys(deliver(opened, content, out, name="diagnosis", stage=stage))


def _apart(model: Path | None, target: Path) -> None:
    """Refuse to write the new model over the one that the simulation was taken from."""
    from toolkit.errors import OutputError
    from toolkit.files import same_file

    if model is not None and same_file(model, target):
        raise OutputError(
            "the answer's model would replace the one that it starts from", where=target,
            got=f"--model {model}", expected="another folder",
            next_step="choose another folder with --out", rule="not-writable",
        )  # fmt: skip


def _write_model(path: Path, text: str | None, stage: Path) -> None:
    """Write the model file; one of an earlier answer does not stay beside an answer that names nothing."""
    from toolkit.files import read_toml
    from toolkit.simulation.model_file import is_model
    from toolkit.staging import supersede

    if text is not None:
        (stage / path.name).write_text(text, encoding="utf-8")
    elif path.is_file() and is_model(read_toml(path)):
        supersede(stage, path.name)


def diagnosis_text(diagnosis: Diagnosis, out: Path) -> str:
    """Return a diagnosis for people."""
    from toolkit.report.diagnosis.numbers import UNRESOLVED, chance, over, rounded
    from toolkit.report.diagnosis.page import headline, simulated

    mark = simulated(diagnosis)
    lines = [mark] if mark else []
    lines.append(f"{diagnosis.title}: {headline(diagnosis, with_cause=True)}")
    for effect in diagnosis.effects:
        channel = f" on {effect.channel}" if effect.channel else ""
        lines += ["", f"{effect.name}{channel} ({effect.stage}): {effect.statement}", f"  {effect.equation}"]
        for parameter in effect.parameters:
            if isinstance(parameter.value, str):
                lines.append(f"  {parameter.name} = {parameter.value}")
                continue
            value, interval = rounded(parameter.value, parameter.ci95)
            reach = f"  (95 %: {interval})" if interval else ""
            if value == UNRESOLVED:
                lines.append(with_unit(f"  {parameter.name}: {value}, {interval}", parameter.unit))
                continue
            lines.append(f"  {parameter.name} = {with_unit(value, parameter.unit)}{reach}")
        if effect.equivalent_to:
            lines.append(f"  this recording cannot tell it from: {', '.join(effect.equivalent_to)}")
        lines.append(
            f"  held-out log score +{effect.evidence.held_out_log_score_gain:.1f}, "
            f"{chance(effect.evidence.p_value)} in the search"
        )
    for law in diagnosis.laws:
        lines += ["", f"law without a name: {law.sentence}"]
        for parameter in law.parameters if law.formula is not None else ():
            if isinstance(parameter.value, str) or not math.isfinite(parameter.value):
                continue
            value, interval = rounded(parameter.value, parameter.ci95)
            lines.append(
                f"  {parameter.name} = {with_unit(value, parameter.unit)}"
                + (f"  (95 %: {interval})" if interval else "")
            )
        lines += [f"  {law.likeness}"] if law.resembles else []
        lines.append(f"  takes {100 * law.evidence.share_of_gap:.0f} % of the mean square that was left")
    structures = list(
        dict.fromkeys((by.channel, tuple(by.variables), by.reason) for by in diagnosis.depends_on)
    )  # the largest first
    for channel, names, reason in structures[:_STRUCTURES]:
        lines.append(f"structure that no named effect explains: {over(channel, names, reason)}")
    if len(structures) > _STRUCTURES:
        lines.append(
            f"and {len(structures) - _STRUCTURES} smaller ones over other variables: see diagnosis.json"
        )
    for place in diagnosis.mismatch:
        for at in place.where[:1]:
            extent = "over all of" if at.whole else "mostly where"
            lines.append(
                f"{place.channel}: mismatch {extent} {at.over(place.channel)}{',' if at.whole else ' is'} "
                + with_unit(at.ends("{:.4g}".format), at.unit)
            )
    rows = [
        [
            o.channel,
            o.unit,
            *(f"{v:.4g}" for v in (o.nominal_rmse, o.refitted_rmse, o.augmented_rmse)),
            *([] if o.with_laws_rmse is None else [f"{o.with_laws_rmse:.4g}"]),
            f"{o.noise_floor:.4g}",
            or_dash(o.sensor_sd, ".4g"),
        ]
        for o in diagnosis.fit.held_out
    ]
    lawful = ["with laws"] if any(o.with_laws_rmse is not None for o in diagnosis.fit.held_out) else []
    if rows:
        lines += ["", f"error on held-out rows (by {diagnosis.fit.held_out_by}):"]
        lines.append(
            table(
                ["output", "unit", "nominal", "refitted", "augmented", *lawful, "noise", "sensor"],
                rows,
                align="<<>>>>>" + ">" * len(lawful),
            )
        )
    moved = [parameter for parameter in diagnosis.nominal_parameters if parameter.prior_sd]
    if moved:
        beside = ["with laws"] if any(o.with_laws is not None for o in moved) else []
        cells = [
            [
                o.name, o.unit, f"{o.before:.5g}", f"{o.after:.5g}",
                *("" if o.with_laws is None else f"{o.with_laws:.5g}" for _ in beside),
                f"{o.shift_in_sd or 0:+.1f}",
            ]
            for o in moved
        ]  # fmt: skip
        titles = ["parameter", "unit", "before", "after", *beside, "shift/sd"]
        lines += ["", table(titles, cells, align="<<>>>" + ">" * len(beside))]
    lines += ["", *diagnosis.next_measurements] if diagnosis.next_measurements else []
    if not diagnosis.complete:
        lines += [
            "",
            f"incomplete: the budget was spent before {diagnosis.skipped[0]}; a larger --budget goes on",
        ]
    if diagnosis.findings:
        lines += ["", "findings (toolkit explain RULE tells more):", *finding_lines(diagnosis.findings)]
    return "\n".join([*lines, "", f"written to {out}"])


_STRUCTURES = 3  # told on a screen, of dozens that overlap
