"""What `explain` tells in plain words: rules of findings, effects of a diagnosis, characteristics."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

from toolkit.declared.answers import merged

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic
    from toolkit.effects.effect import Effect, EffectParameter


class RuleEntry(TypedDict):
    """A rule of findings and errors."""

    rule: str
    means: str
    refuses: NotRequired[Annotated[str, "when, as an error, it refuses the approval of a calibration record"]]
    do: str


class ParameterFacts(TypedDict):
    """A parameter of an effect."""

    name: str
    unit: str
    means: str
    typical: Annotated[list[float], "usual least and largest value"]
    relative: Annotated[bool, "whether these are shares of the channel's spread"]


class EffectFacts(TypedDict):
    """An effect that a diagnosis names."""

    effect: str
    means: str
    stage: str
    equation: str
    signature: Annotated[str, "what it does to a recording"]
    separates: Annotated[str, "what tells it from others"]
    needs: str
    source: str
    parameters: list[ParameterFacts]


class CharacteristicFacts(TypedDict):
    """A characteristic of a test."""

    name: str
    title: str
    symbol: str
    unit: str
    means: str
    formula: str
    term: Annotated[str, "of the standard"]
    source: str
    uncertainty: Annotated[str, "sources of its uncertainty"]


class ExplainedCharacteristic(TypedDict):
    """A characteristic of a test, beside the effect of its name where there is one."""

    characteristic: CharacteristicFacts


class Explanations(TypedDict):
    """All rules, effects and characteristics."""

    rules: list[RuleEntry]
    effects: list[EffectFacts]
    characteristics: list[CharacteristicFacts]


EffectAndCharacteristic = merged(ExplainedCharacteristic, EffectFacts, name="EffectAndCharacteristic")


AnswerSchema = TypedDict(
    "AnswerSchema",
    {
        "$schema": str,
        "type": NotRequired[str],
        "description": NotRequired[str],
        "properties": NotRequired[Mapping[str, Any]],
        "required": NotRequired[list[str]],
        "additionalProperties": NotRequired[bool],
        "anyOf": NotRequired[
            Annotated[list[Mapping[str, Any]], "of a command with answers of several forms"]
        ],
        "$defs": Mapping[str, Any],
    },
)
AnswerSchema.__doc__ = "The JSON schema of a command's answer, for --answer."


ExplainForms = (
    Explanations | RuleEntry | EffectFacts | ExplainedCharacteristic | EffectAndCharacteristic | AnswerSchema
)
"""Of no name, of a rule, of what is an effect, a characteristic or both; of --answer."""


RULES_FILE = Path(__file__).with_name("rules.toml")


def rules_catalogue() -> dict[str, dict[str, str]]:
    """Return every rule with what it means and what to do, in alphabetical order."""
    rules: dict[str, dict[str, str]] = tomllib.loads(RULES_FILE.read_text(encoding="utf-8"))
    return dict(sorted(rules.items()))


def explained(name: str | None) -> tuple[dict[str, Any], str]:
    """Return a rule, an effect or a characteristic as JSON values and as text; of no name, all of them.

    Raises
    ------
    ConfigError
        ``unknown-rule``: none has this name; the nearest are named
    """
    import difflib

    from toolkit.characteristics.catalogue import characteristics
    from toolkit.effects.catalogue import effects
    from toolkit.errors import ConfigError
    from toolkit.spelling import LIKE

    rules, effects_by_name = rules_catalogue(), effects()
    declared = {characteristic.name: characteristic for characteristic in characteristics()}
    if name is None:
        lines = [f"{rule:<24}{entry['means']}" for rule, entry in rules.items()]
        lines += ["", "effects that a diagnosis names:", ""]
        lines += [f"{key:<24}{effect.statement}" for key, effect in sorted(effects_by_name.items())]
        lines += ["", "characteristics of a test:", ""]
        lines += [f"{key:<24}{characteristic.definition}" for key, characteristic in declared.items()]
        answer = {
            "rules": [{"rule": rule, **entry} for rule, entry in rules.items()],
            "effects": [effect_keys(effect) for _, effect in sorted(effects_by_name.items())],
            "characteristics": [
                {"name": key, **characteristic.facts()} for key, characteristic in declared.items()
            ],
        }
        return answer, "\n".join(lines)
    # Conicity and plysteer are effects of a simulated tire and characteristics of a test: both are told.
    if name in effects_by_name or name in declared:
        keys = effect_keys(effects_by_name[name]) if name in effects_by_name else {}
        texts = [effect_text(effects_by_name[name])] if name in effects_by_name else []
        if name in declared:
            keys |= {"characteristic": {"name": name, **declared[name].facts()}}
            texts.append(_characteristic_text(declared[name]))
        return keys, "\n\n".join(texts)
    if name not in rules:
        near = difflib.get_close_matches(name, [*rules, *effects_by_name, *declared], n=3, cutoff=LIKE)
        raise ConfigError(
            f"unknown rule {name!r}",
            got=name,
            expected=", ".join(near)
            if near
            else "a rule id as findings print it, or the name of an effect or a characteristic",
            next_step="'toolkit explain' lists them all",
            rule="unknown-rule",
        )
    entry = rules[name]
    return {"rule": name, **entry}, _rule_text(name, entry)


def _rule_text(name: str, entry: Mapping[str, str]) -> str:
    lines = [name, f"  means: {entry['means']}"]
    if "refuses" in entry:
        lines.append(f"  refuses an approval: {entry['refuses']}")
    return "\n".join([*lines, f"  do:    {entry['do']}"])


def _characteristic_text(characteristic: Characteristic) -> str:
    facts = (f"  {name + ':':<13}{text}" for name, text in characteristic.facts().items())
    return "\n".join([f"{characteristic.name}, a characteristic of a test", *facts])


def effect_text(effect: Effect) -> str:
    """Return an effect for people: its facts, then its parameters."""
    lines = [effect.name, *(f"  {name + ':':<11}{text}" for name, text in _facts(effect).items() if text)]
    if effect.parameters:
        lines += ["  parameters:", *(f"    {_parameter(parameter)}" for parameter in effect.parameters)]
    return "\n".join(lines)


def effect_keys(effect: Effect) -> dict[str, Any]:
    """Return an effect under the keys of the answer."""
    return {
        "effect": effect.name,
        **_facts(effect),
        "parameters": [
            {"name": parameter.name, "unit": parameter.unit, "means": parameter.text,
             "typical": list(parameter.typical), "relative": parameter.relative}
            for parameter in effect.parameters
        ],
    }  # fmt: skip


def _facts(effect: Effect) -> dict[str, str]:
    return {
        "means": effect.statement,
        "stage": effect.stage.replace("_", " "),
        "equation": effect.equation,
        "signature": effect.signature,
        "separates": effect.separates,
        "needs": " or ".join(effect.any_of),
        "source": effect.reference,
    }


def _parameter(parameter: EffectParameter) -> str:
    low, high = parameter.typical
    spread = " of the channel's spread" if parameter.relative else ""
    unit = re.sub(r"\{(\w+)\}", r"unit of \1", parameter.unit).replace("unit of from", "unit of the source")
    return f"{parameter.name} [{unit}]: {parameter.text}; usually {low:g} to {high:g}{spread}"
