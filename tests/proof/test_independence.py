"""The generator shares nothing with the code that it tests."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import proof

HERE = Path(proof.__file__).parent
ALLOWED = {"numpy", "scipy", "pandas", "openpyxl", "proof"}
PAGE = HERE / "page.py"
"""It reads what was scored, and takes the page kit from the toolkit."""
MODULES = sorted(path for path in HERE.rglob("*.py") if path != PAGE)


def imports(path: Path) -> set[str]:
    """Return every module that a file imports, wherever the import stands."""
    out = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            out |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative import"
            out.add(str(node.module))
    return out


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.stem)
def test_a_module_imports_only_the_standard_library_and_the_four_packages(path: Path) -> None:
    for name in imports(path):
        top = name.split(".")[0]
        assert top in ALLOWED or top in sys.stdlib_module_names, f"{path.name} imports {name}"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.stem)
def test_no_module_reaches_the_toolkit_by_another_way(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert "importlib" not in text
    assert "__import__" not in text


def test_the_page_takes_nothing_but_the_page_kit_and_nothing_takes_the_page_to_draw_or_judge() -> None:
    assert {name for name in imports(PAGE) if name.startswith("toolkit")} == {
        "toolkit.report.pages",
        "toolkit.report.audit.svg",
    }
    callers = [path.stem for path in MODULES if "import page" in path.read_text(encoding="utf-8")]
    assert callers == ["__main__"]
    code = "import sys, proof.__main__; print(*sorted({n.split('.')[0] for n in sys.modules}))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=HERE.parent
    ).stdout.split()
    assert {"toolkit", "jinja2"}.isdisjoint(loaded)
    assert "numpy" in loaded


def test_a_case_simulator_stands_alone() -> None:
    for path in (HERE / "simulators").glob("[a-z]*.py"):
        assert {name.split(".")[0] for name in imports(path)} <= {"math", "numpy", "pandas"}


def test_every_module_fits_the_house() -> None:
    assert all(len(p.read_text(encoding="utf-8").splitlines()) <= 400 for p in HERE.rglob("*.py"))
