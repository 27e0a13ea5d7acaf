"""A model file: a simulation with what a diagnosis found in it, as TOML for `simulate` and `diagnose`.

It names the simulation of a case, its refitted parameters, the effects that were found with their fitted
parameters, units and standard errors, and what it rests on: the hashes of the case and its recordings and of
every file that the simulation needs, and the version of the program. It is written by `toolkit diagnose`;
a file that it names and that has changed since is refused, because the fit is not of that file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from toolkit.channels import AXES, Axes
from toolkit.effects.applied import AppliedEffect, Condition
from toolkit.effects.catalogue import effect as find_effect
from toolkit.effects.effect import Effect
from toolkit.errors import ConfigError
from toolkit.files import check_keys, is_number, number_expected, parse_toml, sha256_bytes
from toolkit.inputs import NAMED_FILE, SETTINGS_FILE, read_input
from toolkit.publication import settle
from toolkit.units import unit

CONTENT = "augmented simulation"
FILES = ("tire", "path", "calibration", "machine")
_TOP = "schema content title code_version axes time nominal_load_N answer simulation channels effect".split()
_ANSWER = ("verdict", "remaining", "complete", "case", "case_sha256", "recordings")
_SIMULATION = (
    "kind machine calibration tire path function states force_terms simulated inputs outputs step_s "
    "parameters sha256"
).split()
_EFFECT = (
    "name stage statement equation channel source runs condition nuisance equivalent_to parameters numerics"
).split()


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelParameter:
    """A fitted number of the simulation; without ``standard_error`` it was not fitted but known."""

    name: str
    value: float
    unit: str
    standard_error: float | None = None
    bounds: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedEffect:
    """An applied effect in the simulation, and what an answer knows of it.

    ``standard_errors`` are those of its fitted parameters, in their units. ``axes`` are those in which its
    values are stated, ``origin`` the file that they come from and its hash; ``of_machine`` says that it is a
    correction of the machine's definition.
    """

    applied: AppliedEffect
    standard_errors: Mapping[str, float] = field(default_factory=dict)
    equivalent_to: tuple[str, ...] = ()
    nuisance: bool = False
    axes: Axes | None = None
    origin: str = ""
    of_machine: bool = False

    @property
    def label(self) -> str:
        """Name and place, as people read it."""
        return self.applied.key.label


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFile:
    """A model file, read whole and checked; paths are absolute or relative to the working folder.

    ``case`` is where the case lay when it was diagnosed, None where the answer does not say;
    ``files`` are the files of the simulation by key (``tire``, ``path``, ``calibration``, ``machine``);
    ``simulation`` the rest of that table as TOML values; ``channels`` name, unit, role and noise of each.
    """

    path: Path
    sha256: str
    title: str
    code_version: str
    verdict: str
    complete: bool
    case: Path | None
    case_sha256: str
    recordings: tuple[tuple[str, str], ...]
    axes: Axes
    time: str | None
    nominal_load_N: float | None
    kind: str
    simulation: Mapping[str, Any]
    files: tuple[tuple[str, Path], ...]
    parameters: tuple[ModelParameter, ...]
    channels: Mapping[str, Any]
    effects: tuple[FittedEffect, ...]

    def file(self, key: str) -> Path | None:
        """Return a file of the simulation, None where it has none of that kind."""
        return dict(self.files).get(key)


def is_model(table: Mapping[str, Any]) -> bool:
    """Tell whether the table of a TOML file is that of a model file."""
    return table.get("content") == CONTENT


def read_model(path: Path) -> ModelFile:
    """Read a model file and check that every file of its simulation is the one that was fitted.

    Raises
    ------
    ConfigError
        ``no-file``, ``not-toml``; ``model-file``: it is none, or an entry is missing or of the wrong kind;
        ``model-changed``: a file of the simulation is not the one that the model was fitted with
    """
    settle(path.parent)
    data = read_input(path, SETTINGS_FILE)
    table = parse_toml(data, where=path)
    if not is_model(table):
        raise _wrong("the file is no model file", path, table.get("content"), f'content = "{CONTENT}"')
    check_keys(table, _TOP, where=path)
    if table.get("schema") != 1:
        raise _wrong("the model file has another schema", f"{path}: schema", table.get("schema"), "1")
    answer, simulation = (_table(table.get(key), f"{path}: {key}") for key in ("answer", "simulation"))
    check_keys(answer, _ANSWER, where=f"{path}: answer")
    check_keys(simulation, _SIMULATION, where=f"{path}: simulation")
    axes = _text(table.get("axes"), f"{path}: axes")
    if axes not in AXES:
        raise _wrong("unknown axis system", f"{path}: axes", axes, ", ".join(AXES))
    load = table.get("nominal_load_N")
    settings = {
        key: entry for key, entry in simulation.items() if key not in (*FILES, "parameters", "sha256")
    }
    files = {key: simulation[key] for key in FILES if key in simulation}
    hashes = _table(simulation.get("sha256", {}), f"{path}: simulation.sha256")
    check_keys(hashes, FILES, where=f"{path}: simulation.sha256")
    return ModelFile(
        path=path,
        sha256=sha256_bytes(data),
        title=_text(table.get("title"), f"{path}: title"),
        code_version=_text(table.get("code_version"), f"{path}: code_version"),
        verdict=_text(answer.get("verdict"), f"{path}: answer.verdict"),
        complete=answer.get("complete") is True,
        case=path.parent / name if (name := _maybe(answer.get("case"), f"{path}: answer.case")) else None,
        case_sha256=_text(answer.get("case_sha256"), f"{path}: answer.case_sha256"),
        recordings=tuple(
            (name, _text(digest, f"{path}: answer.recordings"))
            for name, digest in _table(answer.get("recordings"), f"{path}: answer.recordings").items()
        ),
        axes=axes,
        time=None if table.get("time") is None else _text(table["time"], f"{path}: time"),
        nominal_load_N=None if load is None else _number(load, f"{path}: nominal_load_N"),
        kind=_text(simulation.get("kind"), f"{path}: simulation.kind"),
        simulation=settings | {key: file for key, file in files.items() if key not in hashes},
        files=tuple((key, _same(path, key, files.get(key), digest)) for key, digest in hashes.items()),
        parameters=_parameters(simulation.get("parameters", {}), f"{path}: simulation.parameters"),
        channels=_table(table.get("channels", {}), f"{path}: channels"),
        effects=_effects(
            table.get("effect", []),
            path,
            axes,
            f"{path.name}, SHA-256 {sha256_bytes(data)[:16]}",
        ),
    )


def _same(path: Path, key: str, name: object, digest: object) -> Path:
    """Return a file of the simulation, or refuse one that has changed."""
    where = f"{path}: simulation.{key}"
    file = path.parent / _text(name, where)
    actual = sha256_bytes(read_input(file, NAMED_FILE))
    if actual != digest:
        raise ConfigError(
            "a file of the model is not the one that was fitted", where=where,
            got=f"{file.name} with SHA-256 {actual[:16]}...", expected=f"{str(digest)[:16]}...",
            next_step="restore the file, or diagnose the case again", rule="model-changed",
        )  # fmt: skip
    return file


def _effects(entry: object, path: Path, axes: Axes, origin: str) -> tuple[FittedEffect, ...]:
    if not isinstance(entry, list):
        raise _wrong("effects are no list of tables", f"{path}: effect", entry, "[[effect]]")
    effects = []
    for i, one in enumerate(entry, start=1):
        where = f"{path}: effect[{i}]"
        table = _table(one, where)
        check_keys(table, _EFFECT, where=where)
        effect = find_effect(_text(table.get("name"), f"{where}.name"), where=where)
        parameters = _parameters(table.get("parameters", {}), f"{where}.parameters")
        check_keys({parameter.name: 0 for parameter in parameters}, effect.names, where=f"{where}.parameters")
        names = {parameter.name for parameter in parameters}
        parameters += tuple(
            ModelParameter(name=parameter.name, value=parameter.absent, unit=parameter.unit)
            for parameter in effect.parameters
            if parameter.name not in names and parameter.absent is not None
        )
        missing = [name for name in effect.names if name not in {parameter.name for parameter in parameters}]
        if missing:
            raise _wrong(
                "a parameter of the effect is missing", f"{where}.parameters", "nothing", ", ".join(missing)
            )
        for parameter, declared in zip(_in_order(parameters, effect), effect.parameters, strict=True):
            # One bound may be the other's mirror: axes turn the sense of an angle.
            limit = max(abs(declared.bounds[0]), abs(declared.bounds[1]))
            if abs(parameter.value) > limit * (1 + 1e-9):
                raise _wrong(
                    "a parameter lies outside what the effect can have",
                    f"{where}.parameters.{parameter.name}", parameter.value, f"at most {limit:g}",
                )  # fmt: skip
        condition = table.get("condition")
        parameters = _in_order(parameters, effect)
        numerics = {
            name: _number(value, f"{where}.numerics.{name}")
            for name, value in _table(table.get("numerics", {}), f"{where}.numerics").items()
        }
        effects.append(
            FittedEffect(
                applied=AppliedEffect(
                    effect=effect,
                    channel=_maybe(table.get("channel"), f"{where}.channel"),
                    source=_maybe(table.get("source"), f"{where}.source"),
                    values={parameter.name: parameter.value for parameter in parameters} | numerics,
                    units={parameter.name: parameter.unit for parameter in parameters},
                    runs=None if "runs" not in table else frozenset(_texts(table["runs"], f"{where}.runs")),
                    condition=None if condition is None else _condition(condition, f"{where}.condition"),
                ),
                standard_errors={
                    parameter.name: parameter.standard_error
                    for parameter in parameters
                    if parameter.standard_error is not None
                },
                equivalent_to=_texts(table.get("equivalent_to", []), f"{where}.equivalent_to"),
                nuisance=table.get("nuisance") is True,
                axes=axes,
                origin=origin,
            )
        )
    return tuple(effects)


def effect_lines(fitted: FittedEffect) -> list[str]:
    """Return an effect as the lines of a model file that `read_model` takes."""
    applied = fitted.applied
    effect = applied.effect
    entries: dict[str, Any] = {
        "name": effect.name, "stage": effect.stage, "statement": effect.statement,
        "equation": effect.equation,
    }  # fmt: skip
    entries |= {key: text for key, text in (("channel", applied.channel), ("source", applied.source)) if text}
    if applied.runs is not None:
        entries["runs"] = sorted(applied.runs)
    if applied.condition is not None:
        entries["condition"] = {applied.condition[0]: list(applied.condition[1])}
    if fitted.equivalent_to:
        entries["equivalent_to"] = list(fitted.equivalent_to)
    if fitted.nuisance:
        entries["nuisance"] = True
    lines = ["", "[[effect]]", *toml_lines(entries)]
    for name in effect.names:
        lines += ["", f"[effect.parameters.{toml_key(name)}]"]
        lines += toml_lines({"value": applied.values.get(name, 0.0), "unit": applied.units[name]})
        if name in fitted.standard_errors:
            lines += toml_lines({"standard_error": fitted.standard_errors[name]})
    numerics = applied.numerics
    return [*lines, "", "[effect.numerics]", *toml_lines(numerics)] if numerics else lines


def toml_lines(table: Mapping[str, Any]) -> list[str]:
    """Return the lines of a TOML table with plain values."""
    return [f"{toml_key(name)} = {_toml(value)}" for name, value in table.items()]


def toml_key(name: str) -> str:
    """Return a key of a TOML table, in quotes where it needs them."""
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else _toml(name)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{toml_key(name)} = {_toml(entry)}" for name, entry in value.items()) + " }"
    # JSON's escapes are TOML's, the one of DEL excepted.
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007F")


def _in_order(parameters: tuple[ModelParameter, ...], effect: Effect) -> tuple[ModelParameter, ...]:
    return tuple(sorted(parameters, key=lambda parameter: effect.names.index(parameter.name)))


def _condition(entry: object, where: str) -> Condition:
    table = _table(entry, where)
    if len(table) != 1:
        raise _wrong("a condition is one key with its values", where, entry, '{ order = ["1", "2"] }')
    ((key, values),) = table.items()
    return key, _texts(values, where)


def _parameters(entry: object, where: str) -> tuple[ModelParameter, ...]:
    parameters = []
    for name, value in _table(entry, where).items():
        place = f"{where}.{name}"
        table = _table(value, place)
        check_keys(table, ("value", "unit", "standard_error", "bounds"), where=place)
        text = _text(table.get("unit"), f"{place}.unit")
        unit(text, where=f"{place}.unit")
        error = table.get("standard_error")
        if error is not None and not _number(error, f"{place}.standard_error") > 0:
            raise _wrong("a standard error is not positive", f"{place}.standard_error", error, "above zero")
        bounds = table.get("bounds")
        if bounds is not None and (not isinstance(bounds, list) or len(bounds) != 2):
            raise _wrong("bounds are two numbers", f"{place}.bounds", bounds, "[low, high]")
        parameters.append(
            ModelParameter(
                name=name,
                value=_number(table.get("value"), f"{place}.value"),
                unit=text,
                standard_error=None if error is None else float(error),
                bounds=None
                if bounds is None
                else (_number(bounds[0], f"{place}.bounds"), _number(bounds[1], f"{place}.bounds")),
            )
        )
    return tuple(parameters)


def _table(entry: object, where: str) -> dict[str, Any]:
    if not isinstance(entry, dict):
        raise _wrong("a table is missing", where, entry, "a TOML table")
    return entry


def _maybe(entry: object, where: str) -> str | None:
    return None if entry is None else _text(entry, where)


def _text(entry: object, where: str) -> str:
    if not isinstance(entry, str) or not entry:
        raise _wrong("an entry is no text", where, entry, "text in quotes")
    return entry


def _texts(entry: object, where: str) -> tuple[str, ...]:
    if not isinstance(entry, list) or not all(isinstance(text, str) for text in entry):
        raise _wrong("an entry is no list of texts", where, entry, '["run01.csv"]')
    return tuple(cast("Iterable[str]", entry))


def _number(entry: object, where: str) -> float:
    if not is_number(entry):
        raise _wrong("an entry is no number", where, entry, number_expected(entry, "a finite number"))
    return float(entry)


def _wrong(problem: str, where: object, actual: object, expected: str) -> ConfigError:
    return ConfigError(
        problem, where=where, got="nothing" if actual is None else actual, expected=expected,
        next_step="name a file that toolkit diagnose has written; it is not edited by hand",
        rule="model-file",
    )  # fmt: skip
