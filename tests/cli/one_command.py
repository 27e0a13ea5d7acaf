"""A single command, run as the command line runs it, its errors raised to the test."""

from __future__ import annotations

from collections.abc import Callable

import typer
from typer.testing import CliRunner

from toolkit.errors import ToolkitError


def run(command: Callable[..., int], *words: object) -> tuple[int, str]:
    """Return a command's exit code and what it printed."""
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, [str(word) for word in words], standalone_mode=False)
    if isinstance(result.exception, ToolkitError):
        raise result.exception
    assert result.exception is None, result.exception
    return result.return_value, result.stdout
