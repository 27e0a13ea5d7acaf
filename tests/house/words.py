"""Names that say nothing of what they stand for, wherever a name is bound.

A binding is an assignment, an argument, a variable of a loop or a comprehension, a name after ``as``, a
function, a class, an attribute of a class, a capture of a pattern. Each occurrence counts. ``self``, ``cls``,
``_`` and names with two underscores at both ends are nobody's choice and are left out.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from tests.house.source import Module

VAGUE: dict[str, str] = {
    "a pronoun: it stands for a noun that the reader has to find": """
        one ones it this that these those them which what some any another other others each every all both
        same such own more most much rest whole thing things something stuff""",
    "a participle without its noun: which thing was made, found or told stays open": """
        made found told given known kept done got tried named held seen said shown used wanted asked meant
        taken gone left chosen""",
    "a place or a manner: where or how, not what": "here there way ways",
}
"""Vague words by the reason why they are no names. ``left`` as a side is ``left_side`` or ``lower``."""
WORDS = frozenset(word for words in VAGUE.values() for word in words.split())
_NOBODYS_CHOICE = frozenset(("self", "cls"))


@dataclass(frozen=True, slots=True)
class Binding:
    """A name bound in a scope: a function or class by its qualified name, "" for the module."""

    name: str
    scope: str
    line: int


def is_vague(name: str) -> bool:
    """Tell whether all of a name's words are vague.

    >>> is_vague("_told"), is_vague("each_one"), is_vague("found_record")
    (True, True, False)
    """
    parts = [part for part in name.lower().split("_") if part]
    return bool(parts) and all(part in WORDS for part in parts)


def counts(name: str) -> bool:
    """Tell whether somebody chose a name.

    >>> [name for name in ("self", "_", "__all__", "_told", "load") if counts(name)]
    ['_told', 'load']
    """
    if name in _NOBODYS_CHOICE or not name.strip("_"):
        return False
    return not (name.startswith("__") and name.endswith("__"))


def bindings(tree: ast.AST) -> Iterator[Binding]:
    """Yield every binding of a module that somebody chose, in no order."""
    waiting: list[tuple[ast.AST, str]] = [(tree, "")]
    while waiting:
        node, scope = waiting.pop()
        name = _bound(node)
        if name is not None and counts(name):
            yield Binding(name, scope, node.lineno)  # type: ignore[attr-defined]
        if isinstance(node, _SCOPES):
            scope = f"{scope}.{node.name}".lstrip(".")
        for field in node._fields:
            inner = getattr(node, field)
            if isinstance(inner, list):
                waiting += [(item, scope) for item in inner if isinstance(item, ast.AST)]
            elif field not in _NO_NAMES and isinstance(inner, ast.AST):
                waiting.append((inner, scope))


_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
_NO_NAMES = frozenset(("ctx", "op", "annotation", "returns"))
_NAMED_BY: dict[type[ast.AST], str] = {
    ast.FunctionDef: "name", ast.AsyncFunctionDef: "name", ast.ClassDef: "name", ast.arg: "arg",
    ast.ExceptHandler: "name", ast.MatchAs: "name", ast.MatchStar: "name", ast.MatchMapping: "rest",
    ast.alias: "asname",
}  # fmt: skip


def _bound(node: ast.AST) -> str | None:
    """Return the name that a node binds; None where it binds none."""
    if type(node) is ast.Name:
        return node.id if type(node.ctx) is ast.Store else None
    field = _NAMED_BY.get(type(node))
    return getattr(node, field) if field else None


@dataclass(frozen=True, slots=True)
class Share:
    """How many names are bound, and how many of them are vague."""

    bound: int
    vague: int

    @property
    def percent(self) -> float:
        """The share of vague names in percent."""
        return 100 * self.vague / self.bound if self.bound else 0.0


def share_of(modules: Sequence[Module]) -> Share:
    """Return the share of vague names over modules."""
    counted = [_counted(module) for module in modules]
    return Share(sum(bound for bound, _ in counted), sum(len(vague) for _, vague in counted))


@cache
def _counted(module: Module) -> tuple[int, tuple[Binding, ...]]:
    """Return how many names a module binds, and the vague ones by line."""
    bound = list(bindings(module.tree))
    vague = [binding for binding in bound if is_vague(binding.name)]
    return len(bound), tuple(sorted(vague, key=lambda binding: (binding.line, binding.name)))


def vague_bindings(module: Module) -> tuple[Binding, ...]:
    """Return the vague names of a module by line."""
    return _counted(module)[1]


def commonest(modules: Sequence[Module], count: int) -> list[tuple[str, int]]:
    """Return the vague names bound most often."""
    total = Counter(binding.name for module in modules for binding in vague_bindings(module))
    return total.most_common(count)
