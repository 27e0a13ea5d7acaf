"""No code names a machine: what only one machine is stands in its definition, its name in one module."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import toolkit
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE, SIMULATED_MACHINE

PACKAGE = Path(toolkit.__file__).parent
# The definitions, the packaged recordings and plans of the default machine, and a published table of it.
OWN = ("machine/default.py", "machine/*.toml", "examples/**/*", "examples/*.py", "qualification/data/*")
TEXTS = {".py", ".toml", ".po", ".j2", ".html", ".css", ".js", ".json", ".md", ".txt", ".xml", ".svg"}
NAME = re.compile(r"m[-\s]?15|michelin", re.IGNORECASE)
# The line after >>> with what follows it: its own further lines and what it prints.
EXAMPLE = re.compile(r"^ *>>> .*\n(?:(?! *>>> | *\"\"\"| *$).*\n)*", re.MULTILINE)


def searched() -> list[Path]:
    own = {path for pattern in OWN for path in PACKAGE.glob(pattern)}
    return sorted(path for path in PACKAGE.rglob("*") if path.suffix in TEXTS and path not in own)


def without_doctests(text: str) -> str:
    """Return a module's text without its executed examples: those run on the packaged machines."""
    return EXAMPLE.sub("", text)


def names(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    return NAME.findall(without_doctests(text) if path.suffix == ".py" else text)


def test_no_code_names_a_machine() -> None:
    files = searched()
    assert len(files) > 300
    assert {path.relative_to(PACKAGE).as_posix(): found for path in files if (found := names(path))} == {}


@pytest.mark.parametrize("text", ["the M-15's drum", 'machine = "m15"', "the M 15", "a Michelin tire"])
def test_a_name_is_seen(tmp_path: Path, text: str) -> None:
    (tmp_path / "rig.py").write_text(f'"""{text}.\n\n    >>> 1\n    1\n"""\n')
    assert names(tmp_path / "rig.py")


def test_the_default_machines_are_packaged() -> None:
    assert not load_machine(DEFAULT_MACHINE).simulated
    assert load_machine(SIMULATED_MACHINE).simulated
