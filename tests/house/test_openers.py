"""Inputs are opened by `toolkit.inputs` alone: no pipe, device or file without end reaches another call."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.house.source import Module, read_package

_READ = {"read_text", "read_bytes"}
_BY_PATH = {
    "ZipFile", "loadmat", "loadtxt", "genfromtxt", "fromfile", "memmap", "load_workbook", "read_excel",
    "read_parquet", "from_path", "MDF", "TdmsFile", "iterparse", "copyfile", "copy2", "copytree",
}  # fmt: skip
"""Functions of libraries that would open a path themselves."""

ALLOWED = {
    ("toolkit.inputs", "os.open"): "the opener",
    ("toolkit.inputs", "os.fdopen"): "the opener",
    ("toolkit.files", "os.open"): "a file that is made, an output",
    ("toolkit.system", "os.open"): "a folder to lock, and what was just written, to be synced",
    ("toolkit.calibration.registry.lock", "os.open"): "the lock file that is made",
    ("toolkit.calibration.registry.lock", "os.fdopen"): "the lock file that is made, an output",
    ("toolkit.calibration.registry.lock", "read_text"): "the system's figures of its processes and its boot",
    ("toolkit.trust.keys", "os.open"): "a key that is made",
    ("toolkit.trust.keys", "os.fdopen"): "a key that is made, an output",
    ("toolkit.worker.posix", "os.open"): "the null device",
    ("toolkit.worker.posix", "open"): "the system's figures of its processes",
    ("toolkit.worker.walls", "os.open"): "a folder, as the walls are told it",
    ("toolkit.audit.resume", "os.open"): "one read of what the inventory found regular, without blocking",
    ("toolkit.report.drawer", "os.fdopen"): "a pipe of its own",
    ("toolkit.report.word.office", "read_text"): "the system's figures of its own processes",
    ("toolkit.report.word.office", "ZipFile"): "a document that was just written",
    ("toolkit.report.word.filled", "iterparse"): "a part of an archive in memory",
    ("toolkit.report.pages.kit", "read_text"): "data of the package",
    ("toolkit.lab.rules", "read_text"): "data of the package",
    ("toolkit.lab.home", "copyfile"): "data of the package",
    ("toolkit.lab.upkeep.kept_files", "read_bytes"): "data of the package",
    ("toolkit.cli.demo", "copytree"): "data of the package",
    ("toolkit.cli.template", "read_bytes"): "data of the package",
    ("toolkit.cli.template", "read_text"): "data of the package",
    ("toolkit.workbench.app", "read_bytes"): "data of the package",
    ("toolkit.tires.fmu.archive", "read_text"): "data of the package",
    ("toolkit.tires.fmu.archive", "read_bytes"): "what the compiler just wrote",
    ("toolkit.words.phrasebook", "read_bytes"): "data of the package",
    ("toolkit.diagnosis.simulators.user_code", "open"): "the null device, an output",
    ("toolkit.qualification.gates.bench", "copytree"): "a registry of the qualification's own",
    ("toolkit.qualification.gates.records", "read_bytes"): "a registry of the qualification's own",
}
"""Who opens what in another way, and why that is no input."""


def openings(module: Module) -> list[tuple[str, str, int]]:
    """Return the calls of a module that open a file for reading: module, call, line."""
    calls = [node for node in module.nodes if isinstance(node, ast.Call)]
    return [(module.name, name, call.lineno) for call in calls if (name := _opening(call)) is not None]


def _opening(call: ast.Call) -> str | None:
    match call.func:
        case ast.Name(id="open"):
            return _by_mode(call, call.args[1:])
        case ast.Attribute(value=ast.Name(id="os"), attr="open" | "fdopen" as name):
            return f"os.{name}"
        case ast.Attribute(attr="open"):
            # The first word of Path.open is its mode; archives and libraries take a member or a stream there.
            return _by_mode(call, call.args) if not call.args or _text(call.args[0]) else None
        case ast.Attribute(attr=name) if name in _READ and not call.args:
            return name
        case ast.Attribute(attr=name) | ast.Name(id=name) if name in _BY_PATH and call.args:
            return None if _in_memory(call) else name
    return None


def _by_mode(call: ast.Call, words: list[ast.expr]) -> str | None:
    stated = [*words[:1], *(word.value for word in call.keywords if word.arg == "mode")]
    mode = _text(stated[0]) if stated else ""
    return None if set(mode) & set("wax+") else f"open {mode}".strip()


def _text(node: ast.expr) -> str:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def _in_memory(call: ast.Call) -> bool:
    if "w" in [_text(argument) for argument in call.args[1:2]]:
        return True
    source = ast.unparse(call.args[0])
    return "BytesIO(" in source or "StringIO(" in source or source == "stream"


def test_inputs_are_opened_by_the_opener_alone() -> None:
    others = [
        f"{name}:{line} {call}"
        for module in read_package()
        for name, call, line in openings(module)
        if (name, call) not in ALLOWED
    ]
    assert others == []


def test_what_is_allowed_is_there() -> None:
    calls = {(name, call) for module in read_package() for name, call, _ in openings(module)}
    assert ALLOWED.keys() <= calls


def test_links_are_followed_by_one_function() -> None:
    # Path.resolve fails on a loop of links by an error that is no OSError.
    others = [
        f"{module.name}:{node.lineno}"
        for module in read_package()
        for node in module.nodes
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        and (node.func.attr == "realpath" or (node.func.attr == "resolve" and not node.args))
        and module.name != "toolkit.files"
    ]  # fmt: skip
    assert others == []


@pytest.mark.parametrize(
    ("line", "call"),
    [
        ("open(path)", "open"),
        ("open(path, 'rb')", "open rb"),
        ("open(path, 'w')", None),
        ("path.open()", "open"),
        ("path.open('rb')", "open rb"),
        ("path.open(mode='rb')", "open rb"),
        ("path.open('w')", None),
        ("path.read_text(encoding='utf-8')", "read_text"),
        ("(folder / name).read_bytes()", "read_bytes"),
        ("os.open(path, os.O_RDONLY)", "os.open"),
        ("zipfile.ZipFile(path)", "ZipFile"),
        ("zipfile.ZipFile(io.BytesIO(data))", None),
        ("zipfile.ZipFile(stream, 'w')", None),
        ("archive.open(member)", None),
        ("np.loadtxt(path)", "loadtxt"),
        ("read_text(Plan, data, where=path)", None),
    ],
)
def test_each_way_to_open_is_seen(line: str, call: str | None) -> None:
    seen = openings(Module(Path("toolkit/a.py"), "toolkit.a", line))
    assert [name for _, name, _ in seen] == ([] if call is None else [call])
