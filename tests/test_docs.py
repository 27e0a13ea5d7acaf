"""The pages say what is there: printed parts are up to date, and every name in them exists."""

from __future__ import annotations

import functools
import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.diagnosis.cases import HEAD, SIMULATOR, TWO, carriage, write_case
from tests.house.pages import GENERATED, written
from tests.house.source import ROOT, contracts, layers
from tests.recipes import new_files
from toolkit.cli import main
from toolkit.declared import Source, build, json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.case.simulation import (
    ColumnsSimulation,
    FmuSimulation,
    MachineSimulation,
    OdeSimulation,
    PythonSimulation,
)
from toolkit.diagnosis.diagnose import diagnose

DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
EACH = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
PLACES = (*layers(), "toolkit", "tests", "docs", "calibrations", "report_templates")
FENCES = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"[\w.*-]+/[\w./*-]*")


def spans(page: Path) -> list[str]:
    """Return what stands in backticks outside fenced blocks, and above what is printed from the code."""
    text = page.read_text(encoding="utf-8").partition(GENERATED)[0]
    return re.findall(r"`([^`\n]+)`", FENCES.sub("", text))


def names(page: Path) -> list[str]:
    """Return the dotted names of modules, classes and functions of the package."""
    dotted = re.compile(rf"(?:toolkit\.)?(?:{'|'.join(layers())})(?:\.[A-Za-z_]\w*)+(?:\(\))?")
    files = tuple(".py .md .toml .docx .pdf .html .jsonl".split())
    return [span for span in spans(page) if dotted.fullmatch(span) and not span.endswith(files)]


def exists(name: str) -> bool:
    """Tell whether a dotted name of the package is a module, or something in one."""
    parts = name.removesuffix("()").removeprefix("toolkit.").split(".")
    for end in range(len(parts), 0, -1):
        try:
            member: Any = import_module(".".join(("toolkit", *parts[:end])))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            member = getattr(member, part, None)
        return member is not None
    return False


PRINTED = tuple(written())


@pytest.mark.parametrize(("path", "present", "text"), [
    pytest.param(*page, id=page[0].relative_to(DOCS).as_posix()) for page in PRINTED
])  # fmt: skip
def test_what_is_printed_from_the_code_is_up_to_date(path: Path, present: str, text: str) -> None:
    assert present == text, f"run make pages: {path.name} is not what the declarations say"


@pytest.mark.parametrize("path", [page[0] for page in PRINTED], ids=lambda path: path.stem)
def test_a_printed_page_begins_with_prose(path: Path) -> None:
    title, _, prose = path.read_text(encoding="utf-8").partition(GENERATED)[0].partition("\n")
    assert title.startswith("# ")
    assert len(prose.split()) > 25, f"write what {path.name} is for, above the line {GENERATED}"


@EACH
def test_every_module_and_function_that_is_named_exists(page: Path) -> None:
    missing = [name for name in names(page) if not exists(name)]
    assert not missing


def test_the_architecture_names_many() -> None:
    assert len(names(DOCS / "architecture.md")) > 50


@EACH
def test_every_file_that_is_named_exists(page: Path) -> None:
    recipes = {path for paths in new_files().values() for path in paths}
    paths = {span for span in spans(page) if FILE.fullmatch(span) and span.split("/")[0] in PLACES} - recipes
    roots = (ROOT, ROOT / "toolkit", page.parent)
    assert not [path for path in paths if not any(any(root.glob(path)) for root in roots)]


@functools.cache
def _commands() -> Any:
    """Return the tree of commands, built for all pages."""
    main._register()
    return typer.main.get_command(main.app)


@EACH
def test_every_command_that_is_named_exists(page: Path) -> None:
    root = _commands()
    for span in spans(page):
        words = re.fullmatch(r"toolkit ([a-z]+)(?: ([a-z]+)\b(?![.=/]))?.*", span)
        if words is None:
            continue
        command = root.commands.get(words[1])
        assert command is not None, span
        if hasattr(command, "commands") and words[2]:
            assert words[2] in command.commands, span


def test_every_page_stands_in_the_index() -> None:
    listed = set(re.findall(r"\]\(([^)#\s]+)", (DOCS / "README.md").read_text(encoding="utf-8")))
    decisions = set(
        re.findall(r"\]\(([^)#\s]+)", (DOCS / "decisions" / "README.md").read_text(encoding="utf-8"))
    )
    for page in DOCS.rglob("*.md"):
        name = page.relative_to(DOCS).as_posix()
        assert name == "README.md" or name in listed or name.removeprefix("decisions/") in decisions, name


def test_the_architecture_lists_the_layers_from_the_top() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    house = text.partition("## The house")[2].partition("\n## ")[0]
    listed = [name for row in re.findall(r"(?m)^\| (`.*?) \|", house) for name in re.findall(r"`(\w+)`", row)]
    assert set(listed) == set(layers())
    (stack,) = [contract["layers"] for contract in contracts() if contract["containers"] == ["toolkit"]]
    rank = {name.strip(): height for height, line in enumerate(stack) for name in line.split("|")}
    assert [rank[name] for name in listed] == sorted(rank[name] for name in listed)


def toml_blocks(page: str) -> list[str]:
    return re.findall(r"^```toml\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.M | re.S)


def test_the_case_of_the_page_is_read(tmp_path: Path) -> None:
    case_file, *simulations = toml_blocks("case.md")
    runs = {"run01__csv": carriage(seed=1), "run02__csv": carriage(seed=2)}
    more = carriage(seed=3).drop(columns="F")
    case = read_case(write_case(tmp_path, case_file, simulator=SIMULATOR, **runs, more__csv=more))
    assert [run.conditions.get("surface") for run in case.runs] == [None, "wet"]
    forms = {
        "python": PythonSimulation,
        "ode": OdeSimulation,
        "machine": MachineSimulation,
        "fmu": FmuSimulation,
        "columns": ColumnsSimulation,
    }
    tables = [tomllib.loads(block)["simulation"] for block in simulations]
    kinds = {build(forms[table["kind"]], table, Source(where="case.md")).kind for table in tables}
    assert kinds | {case.simulation.kind} == {"python", "ode", "machine", "fmu", "columns"}


def _paths(value: object, path: str = "") -> Iterator[str]:
    if isinstance(value, dict) and value:
        for key, entry in value.items():
            yield from _paths(entry, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from (name for entry in value for name in _paths(entry, f"{path}[]"))
    else:
        yield path


def test_the_page_has_the_keys_of_an_answer(tmp_path: Path) -> None:
    recordings = {f"r{seed}__csv": carriage(seed=seed, coulomb=0.0, drag=800.0) for seed in range(2)}
    answer = json_value(
        diagnose(read_case(write_case(tmp_path, HEAD + TWO, **recordings)), None, limits=None).diagnosis
    )
    text = (DOCS / "case.md").read_text(encoding="utf-8").partition("| key |")[2]
    listed = set(re.findall(r"(?m)^\| `([^`]+)` \|", text))
    shown = {path for path in _paths(answer) if not path.startswith(("findings", "depends_on"))}
    # Lists that are empty in this answer stand for their entries.
    empty = {path for path in shown if any(key.startswith(f"{path}[]") for key in listed)}
    assert shown - listed - empty == set()
    assert {key.partition("[]")[0] for key in listed - shown} <= {
        "schema", "timing", "findings", "depends_on", *(path.partition("[]")[0] for path in empty)
    }  # fmt: skip
