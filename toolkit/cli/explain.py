"""`toolkit explain`: a finding's rule, or an effect of a diagnosis, in plain words."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli.console import Json, Quiet, answer

if TYPE_CHECKING:
    from toolkit.effects.effect import Effect, EffectParameter

NAME = "explain"

RULES_FILE = Path(__file__).with_name("rules.toml")


def command(
    rule: Annotated[
        str | None,
        typer.Argument(
            metavar="RULE", help="Rule id, or the name of an effect; without it, all rules and effects."
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Explain a finding's rule and what to do, or an effect that a diagnosis names.

    Examples: toolkit explain no-tare, toolkit explain relaxation
    """
    import difflib

    from toolkit.effects.catalogue import effects
    from toolkit.errors import ConfigError

    rules, known = rules_catalogue(), effects()
    if rule is None:
        lines = [f"{name:<24}{entry['means']}" for name, entry in rules.items()]
        lines += ["", "effects that a diagnosis names:", ""]
        lines += [f"{name:<24}{one.statement}" for name, one in sorted(known.items())]
        told = {
            "rules": [{"rule": name, **entry} for name, entry in rules.items()],
            "effects": [_as_json(one) for _, one in sorted(known.items())],
        }
        answer(told, "\n".join(lines), as_json=json, quiet=quiet)
        return 0
    if rule in known:
        answer(_as_json(known[rule]), _as_text(known[rule]), as_json=json, quiet=quiet)
        return 0
    if rule not in rules:
        near = difflib.get_close_matches(rule, [*rules, *known], n=3, cutoff=0.4)
        raise ConfigError(
            f"unknown rule {rule!r}",
            got=rule,
            expected=", ".join(near) if near else "a rule id as findings print it, or an effect's name",
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


def _as_text(one: Effect) -> str:
    lines = [one.name, *(f"  {name + ':':<11}{text}" for name, text in _told(one).items() if text)]
    lines += (
        ["  parameters:", *(f"    {_parameter(each)}" for each in one.parameters)] if one.parameters else []
    )
    return "\n".join(lines)


def _told(one: Effect) -> dict[str, str]:
    return {
        "means": one.statement,
        "stage": one.stage.replace("_", " "),
        "equation": one.equation,
        "signature": one.signature,
        "separates": one.separates,
        "needs": " or ".join(one.any_of),
        "source": one.reference,
    }


def _parameter(one: EffectParameter) -> str:
    low, high = one.typical
    spread = " of the channel's spread" if one.relative else ""
    unit = re.sub(r"\{(\w+)\}", r"unit of \1", one.unit).replace("unit of from", "unit of the source")
    return f"{one.name} [{unit}]: {one.text}; usually {low:g} to {high:g}{spread}"


def _as_json(one: Effect) -> dict[str, object]:
    return {
        "effect": one.name,
        **_told(one),
        "parameters": [
            {"name": each.name, "unit": each.unit, "means": each.text, "typical": list(each.typical),
             "relative": each.relative}
            for each in one.parameters
        ],
    }  # fmt: skip
