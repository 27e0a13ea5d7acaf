"""What a case says of its simulation: kind, files, parameters, or a model file of an earlier answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.diagnosis.case.case import KINDS, CaseParameter, Simulation
from toolkit.diagnosis.case.entries import known_unit, none_of, number_of, table_of, text_of, wrong
from toolkit.diagnosis.case.model_file import parameters_of, simulation_of, tire_model
from toolkit.files import check_keys
from toolkit.simulation.model_file import ModelFile, read_model

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

_KEYS = {
    "machine": ("kind", "machine", "calibration", "tire", "parameters"),
    "python": ("kind", "path", "function", "parameters"),
    "ode": ("kind", "path", "states", "force_terms", "parameters"),
    "columns": ("kind", "simulated", "parameters"),
}
_PARAMETER = ("value", "unit", "sd", "bounds")


def read_simulation(
    entry: object, path: Path
) -> tuple[Simulation, tuple[CaseParameter, ...], ModelFile | None]:
    """Return simulation, free parameters, and the model file that they were taken from, None without one.

    Raises
    ------
    ConfigError
        an unknown key or kind, a parameter without unit, a model file that cannot be used
    """
    where = f"{path}: simulation"
    table = table_of(entry, where)
    if "model" in table:
        check_keys(table, ("kind", "model", "parameters"), where=where)
        model = read_model(_file(table, "model", path, where))
        if table.get("kind", model.kind) != model.kind:
            raise wrong("the model is of another kind", f"{where}.kind", table["kind"], model.kind)
        return simulation_of(model), parameters_of(model, _parameters(table, where)), model
    kind = table.get("kind")
    if kind not in KINDS:
        raise none_of("unknown kind of simulation", f"{where}.kind", kind, KINDS)
    check_keys(table, _KEYS[kind], where=where)
    parameters = _parameters(table, where)
    tire = _file(table, "tire", path, where) if kind == "machine" and "tire" in table else None
    taken = None
    if tire is not None and tire.suffix.lower() == ".toml":
        taken = tire_model(tire, f"{where}.tire")
        tire, parameters = taken.file("tire"), parameters_of(taken, parameters)
    machine = text_of(table.get("machine", "m15"), f"{where}.machine")
    return (
        Simulation(
            kind=kind,
            # A definition by path is meant relative to the case, as every path in it.
            machine=str(path.parent / machine) if machine.endswith(".toml") else machine,
            calibration=text_of(table.get("calibration", ""), f"{where}.calibration"),
            tire=tire,
            path=_file(table, "path", path, where) if kind in ("python", "ode") else None,
            function=text_of(table.get("function", "simulate"), f"{where}.function"),
            states=_names(table.get("states", []), f"{where}.states"),
            force_terms=_units(table.get("force_terms", {}), f"{where}.force_terms"),
            simulated=_pairs(table, where) if kind == "columns" else (),
        ),
        parameters,
        taken,
    )


def _parameters(table: Mapping[str, Any], where: str) -> tuple[CaseParameter, ...]:
    given = table_of(table.get("parameters", {}), f"{where}.parameters")
    return tuple(_parameter(name, one, f"{where}.parameters.{name}") for name, one in given.items())


def _parameter(name: str, entry: object, where: str) -> CaseParameter:
    table = table_of(entry, where)
    check_keys(table, _PARAMETER, where=where)
    text = table.get("unit")
    if not isinstance(text, str):
        raise wrong("a parameter has no unit", f"{where}.unit", text, 'unit = "kg" (or "1" for a number)')
    known_unit(text, f"{where}.unit")
    value = number_of(table.get("value"), f"{where}.value")
    sd = None if "sd" not in table else number_of(table["sd"], f"{where}.sd")
    if sd is not None and sd <= 0:
        raise wrong(
            "a prior has no width", f"{where}.sd", sd, "a number above zero, or no sd where known exactly"
        )
    bounds = None
    if "bounds" in table:
        given = table["bounds"]
        if not isinstance(given, list) or len(given) != 2:
            raise wrong("bounds are two numbers", f"{where}.bounds", given, "bounds = [low, high]")
        bounds = (number_of(given[0], f"{where}.bounds"), number_of(given[1], f"{where}.bounds"))
        if not bounds[0] <= value <= bounds[1] or bounds[0] >= bounds[1]:
            raise wrong(
                "the value lies outside its bounds", f"{where}.bounds", given, f"bounds around {value:g}"
            )
    return CaseParameter(name=name, value=value, unit=text, sd=sd, bounds=bounds)


def _pairs(table: Mapping[str, Any], where: str) -> tuple[tuple[str, str], ...]:
    made = table_of(table.get("simulated"), f"{where}.simulated")
    if not made:
        raise wrong("no simulated columns", f"{where}.simulated", made, 'simulated = { FY = "FY_sim" }')
    return tuple((name, text_of(column, f"{where}.simulated.{name}")) for name, column in made.items())


def _units(entry: object, where: str) -> tuple[tuple[str, str], ...]:
    made = tuple((name, text_of(one, f"{where}.{name}")) for name, one in table_of(entry, where).items())
    for name, text in made:
        known_unit(text, f"{where}.{name}")
    return made


def _names(entry: object, where: str) -> tuple[str, ...]:
    if not isinstance(entry, list) or not all(isinstance(one, str) and one for one in entry):
        raise wrong("names are a list of texts", where, entry, '["x", "v"]')
    if len(set(entry)) != len(entry):
        raise wrong("a name stands twice", where, entry, "different names")
    return tuple(entry)


def _file(table: Mapping[str, Any], key: str, path: Path, where: str) -> Path:
    name = table.get(key)
    if not isinstance(name, str) or not name:
        raise wrong(f"the simulation has no {key}", f"{where}.{key}", name, f'{key} = "FILE"')
    return path.parent / name
