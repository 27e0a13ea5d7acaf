"""What the code names: effects outside their own file, and pages that have to exist."""

from __future__ import annotations

import ast
import io
import posixpath
import re
import tokenize
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.house.source import PACKAGE, Module

EFFECT_LAYERS = ("effects", "simulation", "diagnosis")
"""Layers in which a word equal to an effect's name is that effect.

Elsewhere the words of the field mean what they mean (a cell's creep in a calibration, the characteristic
conicity), unless the module imports the effects or the diagnosis.
"""


@dataclass(frozen=True, slots=True)
class Mention:
    """A word at a line of a module or page."""

    place: str
    line: int
    word: str


def effect_names(modules: Sequence[Module]) -> frozenset[str]:
    """Return the names of the effects: the files of the layer ``effects`` that define ``EFFECT``."""
    return frozenset(
        module.path.stem
        for module in modules
        if module.layer == "effects" and any(_binds(node, "EFFECT") for node in module.tree.body)
    )


def _binds(node: ast.stmt, name: str) -> bool:
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return any(isinstance(target, ast.Name) and target.id == name for target in targets)


PLAN_KEYS = ("toolkit.simulation.plan_file",)
"""Modules in which such words are keys of a plan's sections: the truth of the virtual machine, a format."""


def effects_named(modules: Sequence[Module]) -> list[Mention]:
    """Return where an effect is named outside its own file, each name once a line.

    A name is a string equal to it, alone or before ``.``, ``=`` or ``:``, or a word of a string that is a
    list of such names; and an import of the effect's module. Other identifiers are free: the virtual tire
    has a conicity, and a parameter of a tire file may be a pressure change. So are docstrings and comments,
    and the keys of a plan.
    """
    names = effect_names(modules)
    mentions: list[Mention] = []
    for module in modules:
        if module.layer not in EFFECT_LAYERS and not _imports_effects(module):
            continue
        if module.name in PLAN_KEYS:
            continue
        at = {pair for pair in _words(module.nodes, names) if pair[1] != module.path.stem}
        mentions += [Mention(module.name, line, word) for line, word in sorted(at)]
    return mentions


def _imports_effects(module: Module) -> bool:
    if "effects" not in module.text and "diagnosis" not in module.text:
        return False
    for node in module.nodes:
        if isinstance(node, ast.ImportFrom) and node.module:
            if node.module.startswith((f"{PACKAGE}.effects", f"{PACKAGE}.diagnosis")):
                return True
            if node.module == PACKAGE and any(alias.name in ("effects", "diagnosis") for alias in node.names):
                return True
    return False


def _words(nodes: Sequence[ast.AST], names: frozenset[str]) -> Iterator[tuple[int, str]]:
    # Strings that stand as statements: docstrings, and remarks below attributes.
    free = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    # Keys of a declared entry are words of that file.
    free |= {
        id(word.value)
        for node in nodes
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Entry"
        for word in node.keywords
        if word.arg == "key"
    }
    for node in nodes:
        match node:
            case ast.Constant(value=str(text)) if id(node) not in free:
                words = [re.split(r"[.=:@]", word)[0] for word in text.split()]
                named = [word for word in words if word in names]
                if 2 * len(named) >= len(words):  # a name or a list of names, no sentence
                    yield from ((node.lineno, word) for word in named)
            case ast.ImportFrom(module=str(module), names=aliases) if module.startswith(f"{PACKAGE}.effects"):
                for word in (*(alias.name for alias in aliases), module.split(".")[-1]):
                    if word in names:
                        yield node.lineno, word


_PAGE = re.compile(r"(?<![\w./*-])((?:[\w.-]+/)*[\w-]+\.md)\b(?:#([\w-]+))?")
_FOLDER = re.compile(r"(?<![\w./-])(docs/[\w./-]*\w)")
_SECTION = re.compile(r"\.md[`'\"]?,\s+(?:section\s+)?[\"“']([^\"”']+)[\"”']")


def pages_missing(root: Path) -> list[Mention]:
    """Return citations of pages, or of their sections, that the checkout does not hold.

    Read are docstrings, comments and messages of the package and its tests, and the pages themselves: every
    ``page.md``, ``docs/...``, ``page.md#section`` and ``page.md, "Section"``. A page may be cited by its path
    from the checkout, by that from the citing page, or by its name alone. The CHANGELOG tells of pages that
    were, these tests of pages that never are, and what a console prints in an example cites nothing.
    """
    pages = {path.relative_to(root).as_posix(): path for path in _pages(root)}
    return [
        Mention(place, line, cited)
        for place, line, text in _prose(root, pages.values())
        for cited in _missing(text, pages, root, place)
    ]


def _missing(text: str, pages: dict[str, Path], root: Path, place: str) -> Iterator[str]:
    for match in _PAGE.finditer(text):
        page = _page(match[1], pages, root, place)
        title = _SECTION.match(text, match.end(1) - 3)
        section = match[2] or (title and title[1])
        if page is None or (section and not _has_section(page, section)):
            yield match[0] + (f", {title[1]}" if title else "")
    for match in _FOLDER.finditer(text):
        if not match[1].endswith(".md") and not (root / match[1]).exists():
            yield match[1]


def _pages(root: Path) -> Iterator[Path]:
    yield from root.glob("*.md")
    yield from (root / "docs").rglob("*.md")
    yield from (root / PACKAGE).rglob("*.md")


def _page(cited: str, pages: dict[str, Path], root: Path, place: str) -> Path | None:
    beside = posixpath.normpath(posixpath.join(posixpath.dirname(place), cited))
    for path in (cited, beside):
        if path in pages:
            return pages[path]
    if "/" in cited:
        return root / cited if (root / cited).is_file() else None
    return next((path for name, path in pages.items() if name.rsplit("/", 1)[-1] == cited), None)


def _has_section(page: Path, section: str) -> bool:
    titles = re.findall(r"(?m)^#+\s+(.*?)\s*#*$", page.read_text(encoding="utf-8"))
    return section.lower() in [title.lower() for title in titles] or section.lower() in map(_anchor, titles)


def _anchor(title: str) -> str:
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def _prose(root: Path, pages: Iterable[Path]) -> Iterator[tuple[str, int, str]]:
    """Yield place, line and text of every comment, string and page; strings of many lines line by line."""
    for page in pages:
        if page.name != "CHANGELOG.md":
            console = False
            for number, text in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
                if text.startswith("```"):
                    console = text == "```console"
                if console:
                    continue
                yield page.relative_to(root).as_posix(), number, text
    for folder in (PACKAGE, "tests", "proof", "benchmarks"):
        for path in sorted((root / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if path.is_relative_to(root / "tests" / "house") or not (".md" in text or "docs/" in text):
                continue
            for token in tokenize.generate_tokens(io.StringIO(text).readline):
                if token.type in (tokenize.COMMENT, tokenize.STRING):
                    for number, line in enumerate(token.string.splitlines(), start=token.start[0]):
                        yield path.relative_to(root).as_posix(), number, line
