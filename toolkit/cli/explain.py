"""`toolkit explain`: a finding's rule, an effect of a diagnosis, or a characteristic, in plain words."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli.console import Json, Quiet, answer

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic
    from toolkit.effects.effect import Effect, EffectParameter

NAME = "explain"

RULES_FILE = Path(__file__).with_name("rules.toml")


def command(
    rule: Annotated[
        str | None,
        typer.Argument(
            metavar="RULE",
            help="Rule id, or the name of an effect or of a characteristic; without it, all of them.",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Explain a finding's rule and what to do, an effect that a diagnosis names, or a characteristic.

    Examples: toolkit explain no-tare, toolkit explain relaxation, toolkit explain PRAT
    """
    import difflib

    from toolkit.characteristics.catalogue import characteristics
    from toolkit.effects.catalogue import effects
    from toolkit.errors import ConfigError

    rules, known = rules_catalogue(), effects()
    declared = {one.name: one for one in characteristics()}
    if rule is None:
        lines = [f"{name:<24}{entry['means']}" for name, entry in rules.items()]
        lines += ["", "effects that a diagnosis names:", ""]
        lines += [f"{name:<24}{one.statement}" for name, one in sorted(known.items())]
        lines += ["", "characteristics of a test:", ""]
        lines += [f"{name:<24}{one.definition}" for name, one in declared.items()]
        told = {
            "rules": [{"rule": name, **entry} for name, entry in rules.items()],
            "effects": [_as_json(one) for _, one in sorted(known.items())],
            "characteristics": [{"name": name, **one.facts()} for name, one in declared.items()],
        }
        answer(told, "\n".join(lines), as_json=json, quiet=quiet)
        return 0
    # Conicity and plysteer are effects of a simulated tire and characteristics of a test: both are told.
    if rule in known or rule in declared:
        keys = _as_json(known[rule]) if rule in known else {}
        texts = [_as_text(known[rule])] if rule in known else []
        if rule in declared:
            keys |= _characteristic(declared[rule])
            texts.append(_characteristic_text(declared[rule]))
        answer(keys, "\n\n".join(texts), as_json=json, quiet=quiet)
        return 0
    if rule not in rules:
        near = difflib.get_close_matches(rule, [*rules, *known, *declared], n=3, cutoff=0.4)
        raise ConfigError(
            f"unknown rule {rule!r}",
            got=rule,
            expected=", ".join(near)
            if near
            else "a rule id as findings print it, or the name of an effect or a characteristic",
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


def _characteristic_text(one: Characteristic) -> str:
    facts = (f"  {name + ':':<13}{text}" for name, text in one.facts().items())
    return "\n".join([f"{one.name}, a characteristic of a test", *facts])


def _characteristic(one: Characteristic) -> dict[str, object]:
    return {"characteristic": {"name": one.name, **one.facts()}}


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
        "needs": ", ".join([*one.needs, *([" or ".join(one.any_of)] if one.any_of else [])]),
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
