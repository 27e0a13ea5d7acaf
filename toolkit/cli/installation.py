"""`toolkit init, migrate, doctor, docs, qualify, explain`: the home, the computer, the manual, the digits."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, TypedDict

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import INTO_FILE, INTO_FOLDER, Output


class InitAnswer(TypedDict):
    """A laboratory's home."""

    home: Path
    written: Annotated[list[str], "what was not there before"]


class DocsAnswer(TypedDict):
    """Where the documentation is."""

    page: Annotated[Path, "its first page"]
    opened: Annotated[bool, "in a browser"]


@answers(InitAnswer)
def init(
    folder: Annotated[Path, "The home to make.", ARGUMENT, INTO_FOLDER, Mark(metavar="DIR")],
    *,
    output: Output,
) -> int:
    """Make a laboratory's home folder.

    An empty calibrations/ and the default report_templates/. What is there already is left as it is.

    Example: toolkit init lab
    """
    from toolkit.files import real_path
    from toolkit.lab.home import TEMPLATES, make_home

    written = make_home(folder)
    text = (
        f"home: {folder}\n"
        f"  calibrations/       fill it with: toolkit calibrate SESSION.toml --home {folder}\n"
        f"  report_templates/   {', '.join(p.name for p in sorted((folder / TEMPLATES).glob('*.docx')))}"
    )
    output.answer({"home": real_path(folder), "written": list(written)}, text)
    return 0


@answers("toolkit.lab.upkeep.migrate:MigrateAnswer")
def migrate(
    home: Annotated[Path, "The home, as an older version left it.", ARGUMENT, Mark(metavar="HOME")],
    dry_run: Annotated[bool, "Check and tell; write nothing."] = False,
    undo: Annotated[bool, "Put back what the last migration replaced."] = False,
    *,
    output: Output,
) -> int:
    """Check a home of an older version whole, and bring its files to this one.

    Every record is refitted and held against its ledger, every other file read whole. Templates that a
    version shipped and nobody changed become today's; what they were is kept in migrations/. Records and
    ledgers are never written to. Done twice, it finds nothing to do.

    Example: toolkit migrate lab --dry-run
    """
    from toolkit.lab.upkeep import migrate as migration

    payload, text = migration.undo(home) if undo else migration.migrate(home, dry_run=dry_run)
    output.answer(payload, text)
    return int(any(file.state == "refused" for file in payload["files"]))


@answers("toolkit.lab.upkeep.installation:DoctorAnswer")
def doctor(*, output: Output) -> int:
    """Report what this computer lacks, and how to install it.

    Example: toolkit doctor
    """
    from toolkit.lab.upkeep.installation import doctor_answer

    payload, text = doctor_answer()
    output.answer(payload, text)
    return 1 if payload["mend"] else 0


@answers(DocsAnswer)
def docs(
    no_browser: Annotated[bool, "Print the place of its first page and open nothing."] = False,
    *,
    output: Output,
) -> int:
    """Open the documentation, which needs no network: tutorials, how-tos, reference, explanations.

    Example: toolkit docs --no-browser
    """
    import webbrowser

    from toolkit.lab.home import documentation

    page = documentation()
    opened = not no_browser and webbrowser.open(page.as_uri())
    output.answer({"page": page, "opened": opened}, str(page))
    return 0


@answers("toolkit.qualification.model:QualificationRecord")
def qualify(
    out: Annotated[Path | None, "Write the record here: .json, else as text.", INTO_FILE] = None,
    *,
    output: Output,
) -> int:
    """Qualify this installation: certified sets, published examples, golden vectors, and every refusal once.

    Example: toolkit qualify --out qualification.json
    """
    from toolkit.declared import answer
    from toolkit.lab.home import packaged_home
    from toolkit.lab.upkeep.installation import qualification_text
    from toolkit.publication import write_result
    from toolkit.qualification.run import qualify as run

    record = run(calibrations=packaged_home() / "calibrations", on=datetime.now(tz=UTC).date())
    payload, text = answer(record), qualification_text(record)
    if out is not None:
        document = json.dumps(payload, ensure_ascii=False, indent=2, allow_nan=False)
        write_result(out, (document if out.suffix.lower() == ".json" else text) + "\n")
        text += f"\nwritten: {out}"
    output.answer(payload, text)
    return 0 if record.passed else 1


@answers("toolkit.lab.rules:ExplainForms")
def explain(
    context: typer.Context,
    rule: Annotated[
        str | None,
        "Rule id, or the name of an effect or of a characteristic; without it, all of them.",
        ARGUMENT,
        Mark(metavar="RULE"),
    ] = None,
    answer_of: Annotated[
        str | None,
        "Print the JSON schema of a command's answer.",
        Mark(names=("--answer",), metavar="COMMAND"),
    ] = None,
    *,
    output: Output,
) -> int:
    """Explain a finding's rule and what to do, an effect that a diagnosis names, or a characteristic.

    Examples: toolkit explain no-tare, toolkit explain relaxation, toolkit explain --answer process
    """
    if answer_of is not None:
        from toolkit.cli.groups import declared_answers, schema_text

        text = schema_text(answer_of, declared_answers(context.find_root().command))
        output.answer(json.loads(text), text)
        return 0
    from toolkit.lab.rules import explained

    payload, text = explained(rule)
    output.answer(payload, text)
    return 0
