"""Where lines could be saved: what nobody calls, what is written twice, what one command alone needs."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.house.source import PACKAGE, ROOT, Module, walk
from tests.house.structure import NO_COMMAND_ASKED

_WORD = re.compile(r"[A-Za-z_]\w*")
_CALLERS = ("*.py", "*.j2", "*.toml")
_SHORTEST, _LEAST = 4, 30  # lines, and nodes of its body: smaller functions are alike by chance


@dataclass(frozen=True, slots=True)
class Weight:
    """What a command alone leads to: modules that no other command does, and their lines."""

    command: str
    lines: int
    modules: int


def uncalled(modules: Sequence[Module], root: Path = ROOT) -> list[str]:
    """Return the functions whose name stands nowhere in the package but where they are defined.

    What is decorated may be registered by that; a method of a class with a base, or of a name such as
    ``__call__``, is called by others.
    """
    texts = [path.read_text(encoding="utf-8") for end in _CALLERS for path in (root / PACKAGE).rglob(end)]
    named = Counter(word for text in texts for word in _WORD.findall(text))
    return [
        f"{module.name}.{function.name}"
        for module in modules
        for function in _free(module.tree)
        if named[function.name] == 1 and not re.fullmatch(r"_\w+_", function.name)
    ]


def _free(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef) and not node.bases]
    for node in (*tree.body, *(inner for owner in classes for inner in owner.body)):
        if isinstance(node, ast.FunctionDef) and not node.decorator_list:
            yield node


def written_twice(modules: Sequence[Module]) -> list[list[str]]:
    """Return groups of functions that differ in names and constants alone, each as ``module.name:lines``."""
    alike: dict[tuple[tuple[str, str], ...], list[str]] = defaultdict(list)
    for module in modules:
        for node in module.nodes:
            if isinstance(node, ast.FunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                if lines >= _SHORTEST and len(shape := _shape(node)) >= _LEAST:
                    alike[shape].append(f"{module.name}.{node.name}:{lines}")
    return [places for places in alike.values() if len(places) > 1]


def repeated_lines(groups: Sequence[Sequence[str]]) -> int:
    """Return how many lines the groups of `written_twice` have beyond the first function of each."""
    return sum(int(place.rpartition(":")[2]) for places in groups for place in places[1:])


def _shape(function: ast.FunctionDef) -> tuple[tuple[str, str], ...]:
    """Return what a function does without its names, constants, annotations and documentation."""
    body = (statement for statement in function.body if not _is_text(statement))
    return tuple(
        (type(node).__name__, getattr(node, "attr", "")) for statement in body for node in walk(statement)
    )


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def needed_by_one(modules: Sequence[Module]) -> list[Weight]:
    """Return what each module of commands alone leads to, the heaviest first.

    Options that commands share lead to nothing here: they know the whole house.
    """
    leads = _leads(modules)
    lines = {module.name: len(module.lines) for module in modules}
    commands = [m.name for m in modules if m.layer == "cli" and m.name not in NO_COMMAND_ASKED]
    reached = {command: _reached(command, leads, {*commands, *NO_COMMAND_ASKED}) for command in commands}
    count = Counter(name for names in reached.values() for name in names)
    alone = {command: [name for name in names if count[name] == 1] for command, names in reached.items()}
    weights = [Weight(command, sum(map(lines.__getitem__, own)), len(own)) for command, own in alone.items()]
    return sorted(weights, key=lambda weight: (-weight.lines, weight.command))


def _reached(command: str, leads: dict[str, set[str]], barred: set[str]) -> set[str]:
    reached, ahead = {command}, [command]
    while ahead:
        further = leads[ahead.pop()] - reached - barred
        reached |= further
        ahead += further
    return reached


def _leads(modules: Sequence[Module]) -> dict[str, set[str]]:
    """Return what each module imports when it runs; by ``import_module(f"toolkit.room.{name}")`` too."""
    names = {module.name for module in modules}
    leads: dict[str, set[str]] = {}
    for module in modules:
        typed = {
            id(inner)
            for node in module.tree.body
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
            for inner in ast.walk(node)
        }
        found: set[str] = set()
        for node in module.nodes:
            if isinstance(node, ast.ImportFrom) and node.module and id(node) not in typed:
                inside = {f"{node.module}.{alias.name}" for alias in node.names} & names
                found |= inside or {node.module}
            elif isinstance(node, ast.Call) and _called(node) == "import_module":
                begin = _begin(node.args[0], module.name)
                found |= {name for name in names if begin and name.startswith(begin)}
        leads[module.name] = (found & names) - {module.name, PACKAGE}
    return leads


def _called(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def _begin(argument: ast.expr, name: str) -> str:
    """Return how the names begin that an f-string of a module's name makes; empty of any other argument."""
    if not isinstance(argument, ast.JoinedStr) or not argument.values:
        return ""
    first = argument.values[0]
    if isinstance(first, ast.Constant):
        return str(first.value)
    return f"{name}." if ast.unparse(first) == "f'{__name__}'" else ""
