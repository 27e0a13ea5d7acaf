"""What the commands answer with ``--json``: the declaration of each command's keys.

A command names its type where it is defined (`toolkit.cli.console.answers`), mostly that of the function
which builds the answer, so that the type checker holds it to the declaration; `docs/answers.md` is printed
from it. Every answer begins with ``"schema": 1``. Numbers are in the unit that the key ends with, in SI and
in the axes that the answer names; a number that does not exist is null.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from toolkit.declared.answers import answer_schema
from toolkit.errors import ConfigError


def declared_type(declaration: Any) -> Any:
    """Return the type that a declaration stands for, imported where it is ``module:name``."""
    if not isinstance(declaration, str):
        return declaration
    module, _, name = declaration.partition(":")
    return getattr(import_module(module), name)


def schema_text(command: str, declared: Mapping[str, Any]) -> str:
    """Return the JSON schema of a command's answer as text; ``declared`` has the declarations by command.

    Raises
    ------
    ConfigError
        ``usage``: there is no such command; those that answer are named
    """
    if command not in declared:
        raise ConfigError(
            "no such command answers in JSON", where="--answer", got=command,
            expected=" | ".join(declared), next_step="choose one of them", rule="usage",
        )  # fmt: skip
    return json.dumps(answer_schema(declared_type(declared[command])), indent=2, ensure_ascii=False)
