"""`toolkit explain`: a finding's rule in plain words."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.console import Json, Quiet, answer

NAME = "explain"

RULES_FILE = Path(__file__).with_name("rules.toml")


def command(
    rule: Annotated[str | None, typer.Argument(metavar="RULE", help="Rule id; without it, all.")] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Explain a finding's rule and what to do.

    Example: toolkit explain no-tare
    """
    import difflib

    from toolkit.errors import ConfigError

    rules = rules_catalogue()
    if rule is None:
        text = "\n".join(f"{name:<24}{entry['means']}" for name, entry in rules.items())
        answer({"rules": [{"rule": name, **entry} for name, entry in rules.items()]}, text, as_json=json,
               quiet=quiet)  # fmt: skip
        return 0
    if rule not in rules:
        near = difflib.get_close_matches(rule, rules, n=3, cutoff=0.4)
        raise ConfigError(
            f"unknown rule {rule!r}",
            got=rule,
            expected=", ".join(near) if near else "a rule id as findings print it",
            next_step="'toolkit explain' lists them all",
            rule="unknown-rule",
        )
    entry = rules[rule]
    answer(
        {"rule": rule, **entry},
        f"{rule}\n  means: {entry['means']}\n  do:    {entry['do']}",
        as_json=json,
        quiet=quiet,
    )
    return 0


def rules_catalogue() -> dict[str, dict[str, str]]:
    """Return every rule with what it means and what to do, in alphabetical order."""
    rules: dict[str, dict[str, str]] = tomllib.loads(RULES_FILE.read_text(encoding="utf-8"))
    return dict(sorted(rules.items()))
