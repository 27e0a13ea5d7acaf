"""Sizes, imports and the public face: what stands where, and what leans on what."""

from __future__ import annotations

import ast
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.house.source import PACKAGE, Module, contracts, layers

NO_COMMAND_ASKED = frozenset(
    f"toolkit.cli{name}" for name in ("", ".main", ".groups", ".command", ".console", ".options")
)
"""The package itself, its entry, and what all commands share: how they are built, options, printing."""
ROOMS = ("report", "diagnosis")
"""Packages whose inside has an order of its own."""


@dataclass(frozen=True, slots=True)
class Layer:
    """Lines and modules of one layer."""

    name: str
    lines: int
    modules: int


@dataclass(frozen=True, slots=True)
class Arrow:
    """An import against the layers of its package."""

    importer: str
    imported: str


def sizes(modules: Sequence[Module], root: Path) -> list[Layer]:
    """Return the size of each layer, the highest first; what no contract names stands at the end."""
    order = layers(root)[::-1]
    present = {module.layer for module in modules}
    names = [name for name in order if name in present] + sorted(present - set(order))
    parts = {name: [module for module in modules if module.layer == name] for name in names}
    return [Layer(name, sum(len(m.lines) for m in part), len(part)) for name, part in parts.items()]


def median_lines(modules: Sequence[Module]) -> float:
    """Return the median length of the modules; the faces of packages, ten lines at most, do not count."""
    return statistics.median(len(module.lines) for module in modules if not module.is_sliver)


def largest(modules: Sequence[Module]) -> Module:
    """Return the longest module."""
    return max(modules, key=lambda module: len(module.lines))


def public_names(root: Path) -> list[str]:
    """Return the names that ``import toolkit`` offers, as its face declares them.

    ``__all__`` where it stands, else what is bound without an underscore.
    """
    tree = ast.parse((root / PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    names: list[str] = []
    for statement in tree.body:
        match statement:
            case (
                ast.Assign(targets=[ast.Name(id="__all__")], value=value)
                | ast.AnnAssign(target=ast.Name(id="__all__"), value=ast.expr() as value)
            ):
                return sorted(
                    node.value for node in ast.walk(value)
                    if isinstance(node, ast.Constant) and isinstance(node.value, str)
                )  # fmt: skip
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases) if not _is_future(statement):
                names += [alias.asname or alias.name.split(".")[0] for alias in aliases]
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.append(name)
            case ast.Assign(targets=targets):
                names += [target.id for target in targets if isinstance(target, ast.Name)]
    return sorted({name for name in names if not name.startswith("_")})


def _is_future(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.ImportFrom) and statement.module == "__future__"


def without_command(modules: Sequence[Module]) -> list[str]:
    """Return the modules of ``cli`` that hold no command: nothing is registered, declares its answer, or is
    called ``command``."""
    return [
        module.name
        for module in modules
        if module.layer == "cli" and module.name not in NO_COMMAND_ASKED and not _has_command(module.tree)
    ]


def _has_command(tree: ast.Module) -> bool:
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    calls = [mark.func for node in functions for mark in node.decorator_list if isinstance(mark, ast.Call)]
    marks = {call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in calls}
    return bool(marks & {"answers", "command"}) or any(node.name == "command" for node in functions)


def import_graph() -> Any:
    """Return the graph of the package's imports, those inside functions and of types alone among them."""
    import grimp

    return grimp.build_graph(PACKAGE, cache_dir=None)


def imported_once(graph: Any) -> list[tuple[str, str]]:
    """Return modules that one other module alone imports, with that module; faces of packages left out."""
    found = []
    for name in sorted(graph.modules):
        importers = graph.find_modules_that_directly_import(name)
        if len(importers) == 1 and not graph.find_children(name):
            found.append((name, next(iter(importers))))
    return found


def arrows_up(graph: Any, package: str, root: Path) -> list[Arrow]:
    """Return the imports inside a package that run up its layers.

    The layers are those of its contract in pyproject.toml; where it has none, the fewest imports that would
    have to go for its parts to have any order.
    """
    name = f"{PACKAGE}.{package}"
    stated = [contract["layers"] for contract in contracts(root) if name in contract["containers"]]
    if not stated:
        return sorted((Arrow(*pair) for pair in graph.nominate_cycle_breakers(name)), key=_names)
    height = {
        f"{name}.{part.strip(' ()')}": -level
        for level, line in enumerate(stated[0])
        for part in line.split("|")
    }
    arrows = []
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            low, high = _part(importer, name), _part(imported, name)
            if low in height and high in height and height[low] < height[high]:
                arrows.append(Arrow(importer, imported))
    return sorted(arrows, key=_names)


def _part(module: str, package: str) -> str:
    return ".".join(module.split(".")[: package.count(".") + 2])


def _names(arrow: Arrow) -> tuple[str, str]:
    return arrow.importer, arrow.imported
