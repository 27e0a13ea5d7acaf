"""The program's commands, run in this process as the command line runs them."""

from __future__ import annotations

import contextlib
import functools
import io
import json
from typing import Any, NamedTuple

import pytest
import typer.testing
from click.testing import Result
from typer.testing import CliRunner

from toolkit.cli.main import _register, app, run

# A runner builds the whole command line for each command, 0.1 s; the program itself builds it once.
typer.testing._get_command = functools.cache(typer.testing._get_command)  # type: ignore[attr-defined]


class Said(NamedTuple):
    """Exit code of a command, and what it printed."""

    code: int
    out: str
    err: str


def said(*words: object) -> Said:
    """Run the program on words."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as ended,
    ):
        run([str(word) for word in words])
    return Said(int(ended.value.code or 0), out.getvalue(), err.getvalue())


def answer(*words: object) -> tuple[int, dict[str, Any]]:
    """Return a command's exit code and its JSON answer, of a refusal the error under ``error``."""
    code, out, _ = said(*words, "--json")
    return code, json.loads(out)


def result(*words: object) -> Result:
    """Return a command's exit code as ``return_value``, what it printed, and the error that it raised."""
    _register()
    return CliRunner().invoke(app, [str(word) for word in words], standalone_mode=False)
