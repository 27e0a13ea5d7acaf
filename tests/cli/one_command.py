"""A single command, run as the command line runs it, its errors raised to the test."""

from __future__ import annotations

import functools
from collections.abc import Callable

import typer

from tests.commands import CliRunner
from toolkit.errors import ToolkitError


def run(command: Callable[..., int], *words: object) -> tuple[int, str]:
    """Return a command's exit code and what it printed."""
    result = CliRunner().invoke(_of_its_own(command), [str(word) for word in words], standalone_mode=False)
    if isinstance(result.exception, ToolkitError):
        raise result.exception
    assert result.exception is None, result.exception
    return result.return_value, result.stdout


@functools.cache
def _of_its_own(command: Callable[..., int]) -> typer.Typer:
    app = typer.Typer()
    app.command()(command)
    return app
