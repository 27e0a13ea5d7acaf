"""The structure of the house: no import cycles, small files, one public face."""

from __future__ import annotations

import ast
import graphlib
import statistics
from pathlib import Path

import grimp
from jinja2 import Environment, nodes
from jinja2.runtime import LoopContext

import toolkit
from tests.house.source import read_package
from tests.house.structure import NO_COMMAND_ASKED

ROOT = Path(toolkit.__file__).parent
TESTS = Path(__file__).parent
APART = {
    "golden",
    "benchmarks",
    "crash",
    "campaigns",
    "coverage",
    "fuzz",
    "house",
    "proof",
    "public_sets",
    "released",
}
"""Folders that test more than the package, or measure it."""
OF_THE_CHECKOUT = {
    "test_containerfile",
    "test_docs",
    "test_front_door",
    "test_house",
    "test_readme",
    "test_recipes",
    "test_tutorials",
}
OF_THE_CHECKOUT |= {"test_wheel"}
"""Tests of the checkout's pages and of the package as a whole; no others stand beside the mirror."""


def test_no_import_cycles() -> None:
    graph = grimp.build_graph("toolkit")
    arrows = {
        module: {other for other in graph.find_modules_directly_imported_by(module) if other != module}
        for module in graph.modules
    }
    # CycleError names the modules of the circle.
    graphlib.TopologicalSorter(arrows).prepare()


def test_files_are_small() -> None:
    lines = {path: len(path.read_text().splitlines()) for path in ROOT.rglob("*.py")}
    assert max(lines.values()) <= 500, max(lines, key=lines.get)  # type: ignore[arg-type]
    # Fewer, fuller files: a module of a few lines that one other alone uses is a part of that one.
    assert statistics.median(n for n in lines.values() if n > 10) <= 200


def test_the_public_api_is_small_and_there() -> None:
    names = [name for name in dir(toolkit) if not name.startswith("_")]
    assert len(names) <= 20
    for name in names:
        assert getattr(toolkit, name) is not None


def test_importing_the_package_imports_nothing_heavy() -> None:
    import subprocess
    import sys

    code = "import sys, toolkit, toolkit.cli.main as m; m._register(); print(*sorted(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    heavy = {"numpy", "scipy", "pandas", "matplotlib", "statsmodels", "pint", "openpyxl", "docx", "lxml"}
    assert heavy.isdisjoint(loaded)


def test_every_module_of_the_command_line_holds_a_command() -> None:
    from toolkit.cli.main import _register, app

    _register()
    groups = [app, *(group.typer_instance for group in app.registered_groups)]
    commands = [command.callback for group in groups for command in group.registered_commands]
    homes = {callback.__module__ for callback in commands if callback is not None}
    modules = {f"toolkit.cli.{path.stem}".removesuffix(".__init__") for path in (ROOT / "cli").glob("*.py")}
    assert modules - homes == NO_COMMAND_ASKED


def mirrored(test: Path) -> bool:
    """Return whether a test's folder is a package and its name begins with a module of it or with its own."""
    package = ROOT / test.parent.relative_to(TESTS)
    modules = {path.stem for path in package.glob("*.py")} - {"__init__"}
    packages = {path.parent.name for path in package.glob("*/__init__.py")} | {package.name}
    name = test.stem.removeprefix("test_")
    return (package / "__init__.py").is_file() and any(
        name == tested or name.startswith(f"{tested}_") for tested in modules | packages
    )


def test_tests_lie_where_the_package_has_what_they_test() -> None:
    tests = [path for path in TESTS.rglob("test_*.py") if path.relative_to(TESTS).parts[0] not in APART]
    astray = {path for path in tests if not mirrored(path)}
    assert {path.relative_to(TESTS).as_posix() for path in astray} == {
        f"{name}.py" for name in OF_THE_CHECKOUT
    }


def test_every_folder_of_tests_is_a_package() -> None:
    folders = {path.parent for path in TESTS.rglob("*.py")}
    assert {path for path in folders if not (path / "__init__.py").is_file()} == set()


def _written(tree: ast.AST) -> set[str]:
    """Return every name, field, keyword and text that a module writes down."""
    names: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.keyword(arg=str(name)):
                names.add(name)
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                names.add(name)
            case ast.Constant(value=str(name)):
                names.add(name)
    return names


def test_what_a_page_reads_is_written_somewhere() -> None:
    """A template asks for its values by name at run time: what only pages ask for looks dead in the code."""
    written = {name for module in read_package() for name in _written(module.tree)}
    written |= {name for builtin in (str, dict, list, LoopContext) for name in dir(builtin)}
    pages = sorted(ROOT.rglob("*.j2"))
    parse = Environment(autoescape=True, extensions=["jinja2.ext.do", "jinja2.ext.i18n"]).parse
    unknown = {
        f"{page.name}:{read.lineno}: {read.attr}"
        for page in pages
        for read in parse(page.read_text("utf-8")).find_all(nodes.Getattr)
        if read.attr not in written
    }
    assert len(pages) > 50
    assert not unknown


def test_every_campaign_says_why_it_stands_apart() -> None:
    """A test leaves the ordinary run for a reason that its marker states in a sentence's length."""
    texts = {path: path.read_text("utf-8") for path in TESTS.rglob("*.py")}
    nodes_of = {
        path: [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute | ast.Call)]
        for path, text in texts.items()
        if "mark.campaign" in text
    }
    marks = {
        (path.name, node.lineno): node
        for path, found in nodes_of.items()
        for node in found
        if isinstance(node, ast.Attribute) and ast.unparse(node).endswith("mark.campaign")
    }
    reasons = {
        (path.name, node.lineno)
        for path, found in nodes_of.items()
        for node in found
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("mark.campaign")
        for reason in node.args
        if isinstance(reason, ast.Constant) and len(str(reason.value).split()) >= 4
    }
    assert marks
    assert marks.keys() - reasons == set()
