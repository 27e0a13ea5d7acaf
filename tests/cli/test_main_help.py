"""The help of every command shows an example, and the command line understands it."""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
import typer

from toolkit.cli.main import _register, app


def commands() -> dict[str, Any]:
    """Return every command by the words that call it."""
    _register()
    found: dict[str, Any] = {}

    def walk(group: Any, words: tuple[str, ...]) -> None:
        for name, one in group.commands.items():
            if hasattr(one, "commands"):
                walk(one, (*words, name))
            else:
                found[" ".join((*words, name))] = one

    walk(typer.main.get_command(app), ())
    return found


COMMANDS = commands()


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_an_example_that_it_understands(name: str) -> None:
    told = re.search(r"Examples?:\s*(toolkit .*?)(?:\n\s*\n|\Z)", COMMANDS[name].help, re.DOTALL)
    assert told, "the help ends with an example"
    for line in re.split(r"\s+(?=toolkit )", " ".join(told[1].split())):
        words = shlex.split(line)
        head = ["toolkit", *name.split()]
        assert words[: len(head)] == head
        # An option that does not exist, or one that is missing, is a usage error.
        COMMANDS[name].make_context(name, words[len(head) :])
