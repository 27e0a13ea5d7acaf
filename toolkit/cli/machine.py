"""`toolkit machine`: definitions of machines, and their corrections by what a diagnosis has found."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import DAY, INTO_FILE, Output
from toolkit.findings import FindingEntry

if TYPE_CHECKING:
    from toolkit.machine import Machine


class CorrectionEntry(TypedDict):
    """A correction of a machine, and the diagnosis that it comes from."""

    effect: str
    channel: str | None
    source: str | None
    parameter: str
    value: Annotated[float, "machine axes"]
    unit: str
    u: Annotated[float, "standard uncertainty"]
    reason: str
    by: Annotated[str, "who decided it"]
    date: str
    answer_sha256: str
    case_sha256: str
    code_version: str
    equivalent_to: Annotated[list[str], "effects that the diagnosis could not tell it from"]


class MachineAnswer(TypedDict):
    """A machine's definition and its corrections."""

    path: Path
    sha256: NotRequired[Annotated[str, "of the file; not of a new one"]]
    name: str
    title: str
    version: int
    supersedes: Annotated[str | None, "definition that it replaces"]
    corrections: list[CorrectionEntry]
    findings: list[FindingEntry]


app = typer.Typer(help="Machine definitions: show one, correct one by an answer.", no_args_is_help=True)


@app.command("show")
@answers(MachineAnswer)
def show(
    machine: Annotated[str, "Name of a packaged machine, or the path of a definition.", ARGUMENT],
    *,
    output: Output,
) -> int:
    """Show a machine: version, file hash, and every correction with the answer that it comes from.

    Example: toolkit machine show belt.toml
    """
    from toolkit.files import sha256_file
    from toolkit.machine import load_machine
    from toolkit.machine.definition import machine_file

    definition = load_machine(machine)
    path = machine_file(machine)
    payload = {"path": path, "sha256": sha256_file(path)} | _payload(definition)
    output.answer(payload, _text(definition))
    return 0


@app.command("correct")
@answers(MachineAnswer)
def correct(
    source: Annotated[
        Path, "Folder of toolkit diagnose --out, or its model.toml.", ARGUMENT, Mark(metavar="ANSWER")
    ],
    effect: Annotated[str, "What is corrected: an effect that the answer names."],
    reason: Annotated[str, "Why it is taken for the machine's own."],
    by: Annotated[str, "Who decides it."],
    out: Annotated[Path, "The new definition (.toml); it must not exist yet.", INTO_FILE],
    machine: Annotated[str | None, "Machine that is corrected: a packaged name, or a definition."] = None,
    on: Annotated[datetime | None, "Day of the decision; default today.", DAY] = None,
    *,
    output: Output,
) -> int:
    """Make the next version of a machine definition, with one effect of an answer as a correction.

    The older definition stays as it is. A test on the new one says so, machine = "NEW.toml" in its test.toml
    or in a case; its reduction applies the correction, its budget holds the uncertainty, its findings and its
    report name both. Where the answer could not tell the effect from others, the decision is yours: give the
    reason, such as a zero that was measured with the wheel at rest.

    Example: toolkit machine correct answer --effect steer_offset --by "second person" --reason "zero
    measured at rest, 2026-03-02" --machine belt.toml --out belt-2.toml
    """
    from datetime import date

    from toolkit.diagnosis.answer.correction import correction_of, machine_of
    from toolkit.lab.starters import refuse_existing
    from toolkit.listing import one_line
    from toolkit.machine import load_machine
    from toolkit.machine.default import DEFAULT_MACHINE
    from toolkit.machine.definition import next_version
    from toolkit.publication import write_result
    from toolkit.simulation.model_file import read_model

    refuse_existing(out)
    machine = machine or DEFAULT_MACHINE
    corrected = load_machine(machine)
    model = read_model(source / "model.toml" if source.is_dir() else source)
    day = on.date() if on else date.today()  # noqa: DTZ011
    correction = correction_of(model, effect, reason=reason, by=by, date=day.isoformat())
    fitted = machine_of(model, corrected.name)
    text, definition = next_version(machine, correction, out=out, diagnosed_with=fitted)
    write_result(out, text)
    payload = {"path": out} | _payload(definition)
    output.answer(payload, f"{_text(definition)}\nwritten to {one_line(out)}")
    return 0


def _payload(definition: Machine) -> dict[str, Any]:
    import dataclasses

    return {
        "name": definition.name,
        "title": definition.title,
        "version": definition.version,
        "supersedes": definition.supersedes,
        "corrections": [dataclasses.asdict(correction) for correction in definition.corrections],
        "findings": [],
    }


def _text(definition: Machine) -> str:
    lines = [f"{definition.title} ({definition.name}), version {definition.version}"]
    lines += [f"  correction   {correction.as_text()}" for correction in definition.corrections]
    return "\n".join(lines if definition.corrections else [*lines, "  no corrections"])
