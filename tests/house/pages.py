"""The pages of ``docs/`` that are printed from the code: ``python -m tests.house.pages`` writes them.

A page is prose, written by hand, above a line that says so, and below it what the declarations say: one page
for each file format, one each for the effects, the characteristics, the rules, the commands, the library, the
tags of templates and licences. A page that does not exist yet is begun with its title; its prose is then to
be written.
"""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

from tests.house import manual
from tests.house.source import ROOT, modules_of
from toolkit.characteristics.catalogue import characteristics
from toolkit.cli.groups import declared_answers, declared_type
from toolkit.cli.main import command_tree
from toolkit.declared import Format, reference, starter, table_of
from toolkit.declared.answers import answer_reference
from toolkit.declared.declaration import form_of
from toolkit.declared.describe import _sections
from toolkit.effects.catalogue import effects
from toolkit.effects.effect import Effect, Stage
from toolkit.lab.rules import effect_keys, rules_catalogue
from toolkit.report.kinds import VOCABULARIES

GENERATED = "<!-- Written by `make pages` from here on: change the declarations, not this text. -->"


@functools.cache
def formats(root: Path = ROOT) -> Sequence[type]:
    """Return the classes that declare a file, by title, found in the syntax trees of the package.

    A class with ``FORMAT`` declares one, unless it has no schema and is a table of another class with it.
    """
    classes = [
        getattr(import_module(module.name), node.name)
        for module in modules_of(root)
        if "FORMAT: ClassVar" in module.text
        for node in module.tree.body
        if isinstance(node, ast.ClassDef) and any(_is_format(statement) for statement in node.body)
    ]
    inner = {table for cls in classes for table in _tables_below(cls)}
    files = (cls for cls in classes if cls not in inner or _form(cls).schema is not None)
    return tuple(sorted(files, key=_title))


def _is_format(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.AnnAssign)
        and isinstance(statement.target, ast.Name)
        and statement.target.id == "FORMAT"
    )


def _tables_below(cls: type) -> Iterator[type]:
    return (kind.cls for _, kind in _sections(table_of(cls), "", set()) if kind.cls is not cls)


def _form(cls: type) -> Format:
    form = form_of(cls)
    assert form is not None, f"{cls.__name__} declares no format"
    return form


def _title(cls: type) -> str:
    return _form(cls).title


def generated(root: Path = ROOT) -> dict[str, tuple[str, str]]:
    """Return title and printed part of every page, by its path below ``docs/``."""
    pages = {
        "effects.md": ("Effects that a simulation may leave out", _effects_text()),
        "characteristics.md": ("Characteristics of a test", _characteristics_text()),
        "rules.md": ("Rules of findings and errors", _rules_text()),
        "answers.md": ("Answers of the commands", _answers_text()),
        "commands.md": ("The commands", manual.commands_text()),
        "api.md": ("Public names of the library", manual.library_text()),
        "templates.md": ("Templates", manual.tags_text(VOCABULARIES.values())),
        "licences.md": ("Licences of what others wrote", manual.licences_text()),
    }
    for cls in formats(root):
        title = _title(cls)
        pages[f"formats/{title.replace(' ', '_')}.md"] = (
            f"{title[0].upper()}{title[1:]}: the file", _format_text(cls),
        )  # fmt: skip
    return pages


def page_text(present: str, title: str, printed: str) -> str:
    """Return a page: the prose of the present one, or a title alone, above what is printed."""
    prose = present.partition(GENERATED)[0] or f"# {title}\n\n"
    return f"{prose}{GENERATED}\n\n{printed}"


def _format_text(cls: type) -> str:
    table = reference(cls).partition("\n")[2].lstrip("\n")
    return (
        f"Declared by `{cls.__module__}.{cls.__name__}`. {table}\n## A file to begin with\n\n"
        f"Entries that may be left out stand behind a `#`.\n\n```toml\n{starter(cls)}```\n"
    )


def _effects_text() -> str:
    lines: list[str] = []
    for stage in get_args(Stage):
        members = [effect for effect in effects().values() if effect.stage == stage]
        lines += [f"## {stage.replace('_', ' ').capitalize()}", ""]
        for effect in members:
            lines += _effect_lines(effect)
    return "\n".join(lines).rstrip() + "\n"


def _effect_lines(effect: Effect) -> Iterator[str]:
    keys = effect_keys(effect)
    yield from (f"### `{effect.name}`", "", keys["means"], "")
    facts = ("equation", "signature", "separates", "needs", "source")
    yield from (f"- **{fact}**: {keys[fact]}" for fact in facts if keys[fact])
    for parameter in keys["parameters"]:
        low, high = parameter["typical"]
        spread = " of the channel's spread" if parameter["relative"] else ""
        yield (
            f"- `{parameter['name']}` [{parameter['unit']}]: {parameter['means']}; "
            f"usually {low:g} to {high:g}{spread}"
        )
    yield ""


def _characteristics_text() -> str:
    lines: list[str] = []
    for declared in characteristics():
        lines += [f"## `{declared.name}`", ""]
        lines += [f"- **{fact}**: {text}" for fact, text in declared.facts().items() if text]
        lines += [""]
    return "\n".join(lines).rstrip() + "\n"


def _answers_text() -> str:
    described: dict[Any, None] = {}
    parts = [
        f"## toolkit {command} --json\n\n{answer_reference(declared_type(declared), described=described)}"
        for command, declared in declared_answers(command_tree()).items()
    ]
    return "\n".join(parts).rstrip() + "\n"


def _meaning(entry: Mapping[str, str]) -> str:
    refuses = entry.get("refuses")
    return f"{entry['means']} Refuses an approval: {refuses}" if refuses else entry["means"]


def _rules_text() -> str:
    def row(*cells: str) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"

    lines = [row("rule", "what it means", "what to do"), "|---|---|---|"]
    lines += [row(f"`{rule}`", _meaning(entry), entry["do"]) for rule, entry in rules_catalogue().items()]
    return "\n".join(lines) + "\n"


def written(root: Path = ROOT) -> Iterator[tuple[Path, str, str]]:
    """Yield each page's path, its text as it stands (empty where there is none) and as it should be."""
    for name, (title, printed) in generated(root).items():
        path = root / "docs" / name
        present = path.read_text(encoding="utf-8") if path.is_file() else ""
        yield path, present, page_text(present, title, printed)


def main() -> int:
    """Write the pages that are not up to date."""
    for path, present, text in written():
        if text != present:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            print(path.relative_to(ROOT))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
