"""The modules of the package, read and parsed once."""

from __future__ import annotations

import ast
import functools
import gc
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "toolkit"


def walk(tree: ast.AST) -> list[ast.AST]:
    """Return every node of a tree in the order of `ast.walk`, in half its time."""
    nodes = [tree]
    for node in nodes:
        for field in node._fields:
            below = getattr(node, field, None)
            if isinstance(below, ast.AST):
                nodes.append(below)
            elif isinstance(below, list):
                nodes += [inner for inner in below if isinstance(inner, ast.AST)]
    return nodes


@dataclass(frozen=True, eq=False)
class Module:
    """A file of Python: ``path`` relative to the checkout, ``name`` as it is imported."""

    path: Path
    name: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """The syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """Every node of the tree in the order of `ast.walk`: many tests go through all modules."""
        return tuple(walk(self.tree))

    @cached_property
    def lines(self) -> list[str]:
        """The lines of the text."""
        return self.text.splitlines()

    @property
    def layer(self) -> str:
        """The package or module directly below the root that it belongs to; the root itself is "toolkit"."""
        return self.name.split(".")[1] if "." in self.name else self.name

    @property
    def is_sliver(self) -> bool:
        """Whether it is a package's face of a few lines, no module of its own."""
        return self.path.name == "__init__.py" and len(self.lines) <= 10


def read_module(path: Path, root: Path = ROOT) -> Module:
    """Return a module of a checkout."""
    place = path.relative_to(root)
    parts = list(place.with_suffix("").parts)
    if parts[-1] == "__init__":
        parts.pop()
    return Module(place, ".".join(parts), path.read_text(encoding="utf-8"))


def read_package(root: Path = ROOT) -> Sequence[Module]:
    """Return every module of the package in a checkout, by name; this one is read and parsed once."""
    return _checkout() if root == ROOT else _read(root)


@functools.cache
def _checkout() -> Sequence[Module]:
    # A million nodes that stay: the collector would look at them again and again, which takes longer than
    # to parse them.
    collecting = gc.isenabled()
    gc.disable()
    modules = _texts()
    for module in modules:
        _ = module.nodes
    gc.freeze()
    if collecting:
        gc.enable()
    return modules


def modules_of(root: Path = ROOT) -> Sequence[Module]:
    """Return every module of the package in a checkout, read alone: a tree is parsed where one asks."""
    return _texts() if root == ROOT else _read(root)


@functools.cache
def _texts() -> Sequence[Module]:
    return _read(ROOT)


def _read(root: Path) -> Sequence[Module]:
    return tuple(read_module(path, root) for path in sorted((root / PACKAGE).rglob("*.py")))


def layers(root: Path = ROOT) -> list[str]:
    """Return the layers from the lowest to the highest, as the import contract states them."""
    (stack,) = [contract["layers"] for contract in contracts(root) if contract["containers"] == [PACKAGE]]
    return [name.strip() for line in reversed(stack) for name in line.split("|")]


def contracts(root: Path = ROOT) -> list[dict[str, list[str]]]:
    """Return the layered import contracts of pyproject.toml."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    stated = project["tool"]["importlinter"]["contracts"]
    return [contract for contract in stated if contract["type"] == "layers"]
