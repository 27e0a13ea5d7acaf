"""`toolkit template`: the template contract: check a template, list the tags, make a new one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NotRequired, TypedDict

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import INTO_FILE, Draft, Output, RegistryOptions


class LintEntry(TypedDict):
    """What is wrong with a template at one place."""

    rule: str
    level: Annotated[str, "error, warning or note"]
    part: Annotated[str, "part of the Word file"]
    place: str
    message: str


class ListedTag(TypedDict):
    """A tag that a template may use."""

    tag: str
    kind: Annotated[str, "text, number, date, figure, table or if"]
    unit: str | None
    required: bool
    columns: Annotated[list[str], "of a table"]
    available: Annotated[bool | None, "whether the test has it; null without a test"]
    value: Annotated[str | bool | None, "as it would be printed"]
    description: str


class TemplateCheckAnswer(TypedDict):
    """What is wrong with a template."""

    template_sha256: str
    tag_count: Annotated[int, "different tags"]
    findings: list[LintEntry]


class TagsAnswer(TypedDict):
    """Every tag that a template may use."""

    tags: list[ListedTag]
    written: NotRequired[Annotated[list[str], "files"]]


class MissingTranslation(TypedDict):
    """A phrase that a language lacks."""

    language: str
    phrase: str


class WordsAnswer(TypedDict):
    """The phrases that documents print."""

    languages: list[str]
    phrases: Annotated[list[Mapping[str, str]], "phrase, and its translation under each language that has it"]
    missing: list[MissingTranslation]


class NewTemplateAnswer(TypedDict):
    """A template and its style file, copied."""

    template: Path
    style: Path


app = typer.Typer(help="The contract of report templates.", no_args_is_help=True, rich_markup_mode=None)


@app.command("check")
@answers(TemplateCheckAnswer)
def check(
    file: Annotated[Path, "Word template, .docx or .dotx.", ARGUMENT, Mark(metavar="FILE")],
    *,
    output: Output,
) -> int:
    """Tell what is wrong with a template: 0 clean or mere advice, 1 findings, 2 not a safe Word file.

    Example: toolkit template check report_templates/org.docx
    """
    from toolkit.listing import one_line
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
        "findings": findings,
    }
    # Their number tells a template that another program has robbed of its controls.
    output.answer(payload, text or f"{one_line(file)}: no findings; {tags} different tags")
    return 1 if any(finding.level != "note" for finding in findings) else 0


@app.command("tags")
@answers(TagsAnswer)
def tags(
    test: Annotated[Path | None, "Show which tags this test has, and their values."] = None,
    template: Annotated[Path | None, "Take units and required tags from its style file."] = None,
    calibration: Annotated[str | None, "Record id."] = None,
    draft: Draft = False,
    kind: Annotated[
        str, "report, certificate, comparison, diagnosis or audit: tags of that document."
    ] = "report",
    for_print: Annotated[
        Path | None, "Also a Word file of them, to copy from.", Mark(metavar="FILE.docx")
    ] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """List every tag that a template may use.

    Example: toolkit template tags --test tests/2019-06-04 --for-print tags.docx
    """
    from datetime import UTC, datetime

    from toolkit.listing import table
    from toolkit.publication import write_result
    from toolkit.report.kinds import TITLES, VOCABULARIES, list_tags
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content
    from toolkit.report.word.package import read_template
    from toolkit.report.word.tag_sheet import tag_sheet

    if kind not in VOCABULARIES or (kind != "report" and test is not None):
        raise typer.BadParameter(f"{', '.join(VOCABULARIES)}; only report with --test", param_hint="--kind")
    style = read_style(None if template is None else style_file(read_template(template).path))
    content = None
    if test is not None:
        from toolkit.lab.tire_tests.resolve import resolve_test

        resolved = resolve_test(test, place.basis(calibration=calibration, draft=draft))
        content = build_content(resolved.result, resolved.record, findings=resolved.findings, style=style)
    listed = list_tags(content, style, VOCABULARIES[kind])
    if for_print is not None:
        examples = {tag["tag"]: tag["value"] for tag in listed if tag["value"] is not None}
        today = datetime.now(tz=UTC).date()
        sheet = tag_sheet(VOCABULARIES[kind], style, title=TITLES[kind], values=examples, day=today)
        write_result(_word_file(for_print), sheet)
    rows = [
        [tag["tag"], tag["kind"], tag["unit"] or "", str(tag["value"] or "")[:40], tag["description"]]
        for tag in listed
    ]
    text = table(["tag", "kind", "unit", "value", "description"], rows, align="<<<<<")
    written = {} if for_print is None else {"written": [str(for_print)]}
    text = text if for_print is None else str(for_print)
    output.answer({"tags": listed, **written}, text)
    return 0


@app.command("words")
@answers(WordsAnswer)
def words(
    language: Annotated[str | None, "This language alone; default: all but English."] = None,
    template: Annotated[Path | None, "Only the texts that stand in this template."] = None,
    *,
    output: Output,
) -> int:
    """List the phrases that documents print, with their translations: 0 whole, 1 where one is missing.

    Example: toolkit template words --language fr
    """
    from toolkit.report.word.package import open_package, read_template
    from toolkit.report.word.scan import fixed_texts, phrase_of
    from toolkit.report.word.xml import stories
    from toolkit.words.phrasebook import SOURCE, languages, phrasebook, phrases

    translated = [name for name in languages() if name != SOURCE]
    if language is not None and language not in translated:
        raise typer.BadParameter(", ".join(translated), param_hint="--language")
    listed_languages = translated if language is None else [language]
    listed: list[str] = list(phrases(SOURCE))
    if template is not None:
        texts = fixed_texts(stories(open_package(read_template(template))))
        listed = list(dict.fromkeys(phrase_of(text.text or "") for text in texts))
    books = {name: phrasebook(name) for name in listed_languages}
    rows = [
        {"phrase": phrase} | {name: book.say(phrase) for name, book in books.items() if book.knows(phrase)}
        for phrase in listed
    ]
    missing = [
        {"language": name, "phrase": row["phrase"]}
        for row in rows
        for name in listed_languages
        if name not in row
    ]
    lines = [
        f"{'' if name == 'phrase' else f'  {name}  '}{row.get(name, 'MISSING')}"
        for row in rows
        for name in ("phrase", *listed_languages)
    ]
    lines.append(f"{len(rows)} phrases, {len(missing)} translations missing")
    output.answer({"languages": listed_languages, "phrases": rows, "missing": missing}, "\n".join(lines))
    return 1 if missing else 0


@app.command("new")
@answers(NewTemplateAnswer)
def new(
    file: Annotated[Path, "Where to write it: NAME.docx.", ARGUMENT, INTO_FILE, Mark(metavar="FILE")],
    like: Annotated[
        str,
        "Which to copy: org, summary, pruefbericht, certificate, comparison, laboratories, diagnosis, "
        "audit, plan.",
    ] = "org",
    language: Annotated[str, "Its texts in this language: en, de or fr."] = "en",
    force: Annotated[bool, "Overwrite an existing file."] = False,
    *,
    output: Output,
) -> int:
    """Write a fresh copy of one of the toolkit's templates and its style file, to be changed in Word.

    Example: toolkit template new report_templates/ours.docx --like summary --language fr
    """
    from toolkit.errors import OutputError
    from toolkit.lab.home import packaged_home
    from toolkit.listing import one_line
    from toolkit.publication import publication
    from toolkit.report.style import style_file, style_in_language
    from toolkit.report.word.package import read_template
    from toolkit.report.word.scan import in_language
    from toolkit.words.phrasebook import SOURCE, languages

    sources = {path.stem: path for path in sorted((packaged_home() / "report_templates").glob("*.docx"))}
    if like not in sources:
        raise typer.BadParameter(", ".join(sources), param_hint="--like")
    if language not in languages():
        raise typer.BadParameter(", ".join(languages()), param_hint="--language")

    style = _word_file(file).with_suffix(".toml")
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
        words = source.read_bytes() if language == SOURCE else in_language(read_template(source), language)
        toml = (style_file(source) or source.with_name("org.toml")).read_text(encoding="utf-8")
        toml = toml if language == SOURCE else style_in_language(toml, language)
        (stage / file.name).write_bytes(words)
        (stage / style.name).write_text(toml, encoding="utf-8")
    output.answer({"template": file, "style": style}, f"{one_line(file)}\n{one_line(style)}")
    return 0


def _word_file(file: Path) -> Path:
    from toolkit.errors import OutputError

    if file.suffix.lower() != ".docx":
        raise OutputError(
            "what is to be opened in Word needs its suffix",
            where=file,
            got=file.suffix or "no suffix",
            expected=".docx",
            next_step="name it NAME.docx",
            rule="not-word",
        )
    return file
