"""What the pages of commands, library, templates and licences print: commands, docstrings, tags, hashes."""

from __future__ import annotations

import inspect
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from typing import Any

import toolkit
from tests.house.source import ROOT
from toolkit.report.kinds import TITLES
from toolkit.report.vocabulary import TableEntry, Vocabulary

WIDTH = 100
"""Columns of a printed help."""
_SECTION = re.compile(r"(?m)^(\w[\w ]*)\n-{3,}\n")
_DUMP = re.compile(r"\A\w+\(.*\)\Z", re.DOTALL)


def commands_text() -> str:
    """Return the help of every command of the tree, as a terminal prints it."""
    from toolkit.cli.main import command_tree

    return "\n".join(_help(command_tree(), "toolkit")).rstrip() + "\n"


def _help(command: Any, name: str) -> Iterator[str]:
    if hasattr(command, "commands"):
        for word, below in command.commands.items():
            yield from _help(below, f"{name} {word}")
        return
    context = command.context_class(command, info_name=name, terminal_width=WIDTH, max_content_width=WIDTH)
    text = "\n".join(line.rstrip() for line in command.get_help(context).splitlines())
    yield f"## {name}\n\n```text\n{text}\n```\n"


def library_text() -> str:
    """Return signature and docstring of every public name, then the results that methods alone return."""
    entries = [(f"toolkit.{name}", getattr(toolkit, name)) for name in toolkit.__all__]
    entries += [(face.__name__, face) for face in _faces_of_methods()]
    return "\n".join(line for title, entry in entries for line in _entry(title, entry)).rstrip() + "\n"


def _faces_of_methods() -> list[type]:
    import toolkit.lab.archives.audit
    from toolkit.lab.faces import Face

    public = {getattr(toolkit, name) for name in toolkit.__all__}
    # By their names: a class with slots stands a second time, as it was before it had them.
    faces = {getattr(sys.modules[face.__module__], face.__name__) for face in Face.__subclasses__()}
    return sorted(faces - public, key=lambda face: str(face.__name__))


def _entry(title: str, thing: Any) -> Iterator[str]:
    yield f"## {title}\n"
    if not inspect.isclass(thing):
        yield f"```python\n{thing.__name__}{_signature(thing)}\n```\n"
    text = inspect.getdoc(thing) or ""
    yield docstring(text if not _DUMP.match(text) else "")
    if inspect.isclass(thing):
        members = ((key, member) for key, member in vars(thing).items() if not key.startswith("_"))
        lines = [
            _member(key, member) for key, member in members if inspect.getdoc(member) and _callable(member)
        ]
        if lines:
            yield "\n".join(lines) + "\n"
        for key, member in vars(thing).items():
            if inspect.isfunction(member) and "Parameters\n---" in (inspect.getdoc(member) or ""):
                yield f"### {thing.__name__}.{key}\n"
                yield f"```python\n{key}{_signature(member)}\n```\n"
                yield docstring(inspect.getdoc(member) or "")


def _signature(function: Any) -> str:
    """Return parameters, a line each; a default that is a function is said to be one."""
    signature = inspect.signature(function)
    parameters = [each for each in signature.parameters.values() if each.name != "self"]
    parts = [
        re.sub(r"<function .*", "a function", re.sub(r"'([^']*)'", r"\1", str(parameter)))
        for parameter in parameters
    ]
    kinds = [parameter.kind for parameter in parameters]
    if inspect.Parameter.KEYWORD_ONLY in kinds:
        parts.insert(kinds.index(inspect.Parameter.KEYWORD_ONLY), "*")
    returned = str(signature.return_annotation).strip("'")
    lines = ",\n    ".join(parts)
    return f"(\n    {lines},\n) -> {returned}"


def _callable(member: object) -> bool:
    return isinstance(member, property | classmethod | staticmethod) or inspect.isfunction(member)


def _member(name: str, member: Any) -> str:
    call = "" if isinstance(member, property) else "()"
    sentence = (inspect.getdoc(member) or "").partition("\n\n")[0].replace("\n", " ")
    return f"- `{name}{call}`: {_markdown(sentence)}"


def docstring(text: str) -> str:
    """Return a numpydoc docstring as Markdown: sections bold, their entries as items, examples fenced."""
    title_and_body = _SECTION.split(text)
    parts = [_prose(title_and_body[0])]
    for title, body in zip(title_and_body[1::2], title_and_body[2::2], strict=True):
        parts += [f"**{title}**", _items(body)]
    return "\n\n".join(part.strip("\n") for part in parts if part.strip()) + "\n"


def _prose(text: str) -> str:
    paragraphs = text.strip().split("\n\n")
    return "\n\n".join(
        f"```pycon\n{each}\n```"
        if each.lstrip().startswith(">>>") or each.startswith("    ")
        else _markdown(each)
        for each in paragraphs
    )


def _items(text: str) -> str:
    if text.lstrip().startswith(">>>"):
        return _prose(text)
    items: list[str] = []
    for line in text.splitlines():
        if line.startswith(" ") and items:
            items[-1] += f"{' ' if ': ' in items[-1] else ': '}{_markdown(line.strip())}"
        elif line:
            name, colon, rest = line.partition(" : ")
            items.append(f"- `{name}`{': ' if colon else ''}{_markdown(rest)}")
    return "\n".join(items)


def _markdown(text: str) -> str:
    return text.replace("``", "`").replace("<", "&lt;").replace("*", "\\*")


def tags_text(vocabularies: Iterable[Vocabulary]) -> str:
    """Return every value, figure, table and condition that templates of each kind can ask for."""
    return "\n".join(line for vocabulary in vocabularies for line in _chapter(vocabulary))


def _chapter(vocabulary: Vocabulary) -> Iterator[str]:
    yield from (f"## {TITLES[vocabulary.name]}", "")
    yield from ("A template must hold " + ", ".join(f"`{tag}`" for tag in vocabulary.required) + ".", "")
    yield from ("### Values", "", "| tag | kind | unit | value |", "|---|---|---|---|")
    for entry in vocabulary.values:
        yield _row(f"`tk:{entry.path}`", entry.kind, entry.unit or "", entry.description)
    yield from ("", "### Figures", "", "Each has its caption as `tk:caption.<name>`.", "")
    yield from ("| tag | as a chart of Word's own | figure |", "|---|---|---|")
    for name, description in vocabulary.figures.items():
        chart = f"`tk:chart.{name}`" if name in vocabulary.charts else ""
        yield _row(f"`tk:figure.{name}`", chart, description)
    yield from ("", "### Tables", "")
    for name, table in vocabulary.tables.items():
        yield from _table(name, table)
    yield from ("### Conditions", "")
    yield from ("Beside these, `tk:if.<name>` takes the name of any value, figure or table.", "")
    yield from ("| tag | kept when |", "|---|---|")
    for name, description in vocabulary.conditions.items():
        yield _row(f"`tk:if.{name}`", description)
    yield ""


def _table(name: str, table: TableEntry) -> Iterator[str]:
    yield from (f"`tk:table.{name}`: {table.description}.", "", "| tag | unit | column |", "|---|---|---|")
    for column in table.columns:
        yield _row(f"`tk:row.{column.name}`", column.unit or "", column.description)
    yield ""


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def licences_text() -> str:
    """Return what others wrote and the package ships: origin, licence, hash; then the licences' texts."""
    static = ROOT / "toolkit" / "workbench" / "static"
    entries = tomllib.loads((static / "vendored.toml").read_text(encoding="utf-8"))["file"]
    lines = ["| file | from | licence | SHA-256 |", "|---|---|---|---|"]
    for entry in entries:
        place = f"toolkit/workbench/static/{entry['name']}"
        lines.append(f"| `{place}` | {entry['package']} | {entry['licence']} | `{entry['sha256']}` |")
    for name in dict.fromkeys(entry["licence_file"] for entry in entries):
        text = (static / name).read_text(encoding="utf-8").strip()
        lines += ["", f"## {name.partition('.')[2]}", "", "```text", text, "```"]
    return "\n".join(lines) + "\n"
