"""`toolkit template`: the template contract: check a template, list the tags, make a new one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.console import Calibrations, Draft, Home, Json, Quiet, answer

app = typer.Typer(help="The contract of report templates.", no_args_is_help=True, rich_markup_mode=None)


@app.command("check")
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Word template, .docx or .dotx.")],
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell what is wrong with a template: 0 clean, 1 findings, 2 not a Word file or not safe to open.

    Example: toolkit template check report_templates/org.docx
    """
    from toolkit.report.kinds import check as check_template
    from toolkit.report.style import read_style, style_file
    from toolkit.report.word.package import open_package, read_template
    from toolkit.report.word.scan import scan
    from toolkit.report.word.xml import stories

    template = read_template(file)
    findings = check_template(template, read_style(style_file(file)))
    tags = len({str(site.tag) for site in scan(stories(open_package(template)))})
    text = "\n".join(
        f"{finding.level:<8}{finding.rule:<18}{finding.part}, {finding.place}: {finding.message}"
        for finding in findings
    )
    payload = {
        "template_sha256": template.sha256,
        "tag_count": tags,
        "findings": [finding.as_dict() for finding in findings],
    }
    # Their number tells a template that another program has robbed of its controls.
    answer(payload, text or f"{file}: no findings; {tags} different tags", as_json=json, quiet=quiet)
    return 1 if findings else 0


@app.command("tags")
def tags(
    test: Annotated[
        Path | None, typer.Option("--test", help="Show which tags this test has, and their values.")
    ] = None,
    template: Annotated[
        Path | None, typer.Option("--template", help="Take units and required tags from its style file.")
    ] = None,
    calibration: Annotated[str | None, typer.Option("--calibration", help="Record id.")] = None,
    draft: Draft = False,
    kind: Annotated[
        str,
        typer.Option(
            "--kind", help="report, certificate, comparison, diagnosis or audit: tags of that document."
        ),
    ] = "report",
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """List every tag that a template may use.

    Example: toolkit template tags --test tests/2019-06-04
    """
    from toolkit.lab.answers import table
    from toolkit.report.kinds import VOCABULARIES, list_tags
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content

    if kind not in VOCABULARIES or (kind != "report" and test is not None):
        raise typer.BadParameter(f"{', '.join(VOCABULARIES)}; only report with --test", param_hint="--kind")
    style = read_style(style_file(template)) if template else read_style(None)
    content = None
    if test is not None:
        from toolkit.lab.resolve import resolve_test

        resolved = resolve_test(
            test, calibration=calibration, calibrations=calibrations, home=home, draft=draft
        )
        content = build_content(resolved.result, resolved.record, findings=resolved.findings, style=style)
    listed = list_tags(content, style, VOCABULARIES[kind])
    rows = [
        [tag["tag"], tag["kind"], tag["unit"] or "", str(tag["value"] or "")[:40], tag["description"]]
        for tag in listed
    ]
    text = table(["tag", "kind", "unit", "value", "description"], rows, align="<<<<<")
    answer({"tags": listed}, text, as_json=json, quiet=quiet)
    return 0


@app.command("new")
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Where to write it: NAME.docx.")],
    like: Annotated[
        str,
        typer.Option(
            "--like",
            help="Which to copy: org, summary, pruefbericht, certificate, comparison, diagnosis, audit.",
        ),
    ] = "org",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Write a fresh copy of one of the toolkit's templates and its style file, to be changed in Word.

    Example: toolkit template new report_templates/ours.docx --like summary
    """
    from toolkit.errors import OutputError
    from toolkit.lab.home import packaged_home
    from toolkit.publication import publication
    from toolkit.report.style import style_file

    sources = {path.stem: path for path in sorted((packaged_home() / "report_templates").glob("*.docx"))}
    if like not in sources:
        raise typer.BadParameter(", ".join(sources), param_hint="--like")

    if file.suffix.lower() != ".docx":
        raise OutputError(
            "a template is a Word file",
            where=file,
            got=file.suffix or "no suffix",
            expected=".docx",
            next_step="name it NAME.docx",
            rule="not-word",
        )
    style = file.with_suffix(".toml")
    for target in (file, style):
        if target.exists() and not force:
            raise OutputError(
                "the file exists",
                where=target,
                got="a file of that name",
                expected="a new name",
                next_step="choose another name, or overwrite with --force",
                rule="not-empty",
            )
    source = sources[like]
    with publication(file.parent) as stage:
        (stage / file.name).write_bytes(source.read_bytes())
        (stage / style.name).write_bytes((style_file(source) or source.with_name("org.toml")).read_bytes())
    answer({"template": file, "style": style}, f"{file}\n{style}", as_json=json, quiet=quiet)
    return 0
