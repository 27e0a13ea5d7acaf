"""The equations of one tire, recorded: what goes in and comes out by name, unit and start; ISO-W, SI."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.channels import signs
from toolkit.errors import ConfigError
from toolkit.tires.global_data import Measured
from toolkit.tires.global_model import GlobalModel, ModelFit, Rows
from toolkit.tires.mf import MF52, MF61
from toolkit.tires.recorded import NotRecordedError, Program, record
from toolkit.tires.tir import TirFile, si_number
from toolkit.tires.tir_checks import demanded, nominal_pressure
from toolkit.tires.tir_evaluate import forces_of

_TEXTS = {
    "SA": ("rad", "slip angle"),
    "FZ": ("N", "load, not negative"),
    "IA": ("rad", "inclination angle"),
    "KAPPA": ("1", "longitudinal slip"),
    "P": ("Pa", "inflation pressure"),
    "V": ("m/s", "speed; below zero the tire rolls backward"),
    "FX": ("N", "longitudinal force"),
    "FY": ("N", "lateral force"),
    "MZ": ("N*m", "aligning moment"),
}
_NOMINAL = {
    "FNOMIN": ("N", "nominal load"),
    "NOMPRES": ("Pa", "nominal pressure"),
    "LONGVL": ("m/s", "speed of the test"),
    "UNLOADED_RADIUS": ("m", "free radius"),
}
Evaluation = Callable[[Mapping[str, Any]], Mapping[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A quantity of the tire: name, unit, what it is; ``start`` None for an output."""

    name: str
    unit: str
    text: str
    start: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TireEquations:
    """A tire in ISO-W axes and SI: its ``program`` gives ``outputs`` of ``inputs`` and ``parameters``."""

    title: str
    reference: str
    inputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    program: Program

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Inputs, parameters, outputs."""
        return (*self.inputs, *self.parameters, *self.outputs)


def equations_of_file(tir: TirFile) -> TireEquations:
    """Return the equations of a tire file, as `evaluate_tir` has them with angles ``star``.

    Its coefficients are parameters, except one that says which equations hold (LMUV).

    Raises
    ------
    ConfigError
        FITTYP is not known, FNOMIN, UNLOADED_RADIUS are missing or not positive, or NOMPRES is negative
    """
    version, p = tir.version, tir.coefficients()
    speed, nominal = si_number(tir, "LONGVL", 0.0) or None, nominal_pressure(tir) or 0.0
    pressed = version == "6.x" and nominal > 0
    inflation = si_number(tir, "INFLPRES", nominal)
    starts = {"SA": 0.0, "FZ": demanded(tir, "FNOMIN"), "IA": 0.0, "KAPPA": 0.0, "V": speed or 1.0}
    if pressed:
        starts["P"] = inflation if inflation > 0 else nominal
    parameters = {"FNOMIN": starts["FZ"], "UNLOADED_RADIUS": demanded(tir, "UNLOADED_RADIUS"), **p}
    if pressed:
        parameters["NOMPRES"] = nominal

    def evaluation(q: Mapping[str, Any]) -> Mapping[str, Any]:
        forces = forces_of(
            version, {name: q[name] for name in p}, SA=q["SA"], FZ=q["FZ"], IA=q["IA"], KAPPA=q["KAPPA"],
            pressure_change=q["P"] / q["NOMPRES"] - 1 if pressed else 0.0, V=q["V"], LONGVL=speed,
            FNOMIN=q["FNOMIN"], UNLOADED_RADIUS=q["UNLOADED_RADIUS"],
        )  # fmt: skip
        return {"FX": forces.FX, "FY": forces.FY, "MZ": forces.MZ}

    table = {entry.name: ("1", entry.text) for entry in (MF52 if version == "5.2" else MF61)}
    return _recorded(
        evaluation, starts, parameters, table, title=f"Magic Formula {version}",
        reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 4.E1 to 4.E78", where=tir.where,
    )  # fmt: skip


def equations_of_fit(model: GlobalModel, fit: ModelFit, data: Measured) -> TireEquations:
    """Return the equations of a fitted model over all loads, turned from its own axes to ISO-W.

    Raises
    ------
    ConfigError
        ``fmu-equations``: the model has no list of steps, such as one that balances its bristles
    """
    rows, turn = data.rows, signs(model.axes, "ISO-W")
    nominal = {
        "FNOMIN": rows.FNOMIN, "NOMPRES": rows.NOMPRES, "LONGVL": rows.LONGVL,
        "UNLOADED_RADIUS": rows.UNLOADED_RADIUS,
    }  # fmt: skip
    fitted = dict(zip(model.names, fit.values.tolist(), strict=True))
    starts = {
        "SA": 0.0, "FZ": rows.FNOMIN, "IA": 0.0, "KAPPA": 0.0, "P": rows.NOMPRES, "V": rows.LONGVL
    }  # fmt: skip
    channels = [entry.channel for entry in fit.fits]

    def evaluation(q: Mapping[str, Any]) -> Mapping[str, Any]:
        asked = Rows(
            SA=turn["SA"] * q["SA"], FZ=q["FZ"], IA=q["IA"], P=q["P"], V=q["V"], KAPPA=q["KAPPA"],
            **{name: q[name] for name in nominal},
        )  # fmt: skip
        responses = model.forces([q[name] for name in model.names], asked)
        return {name: turn.get(name, 1) * responses[name] for name in ("FX", "FY", "MZ") if name in channels}

    table = {entry.name: (entry.unit, entry.text) for entry in model.parameters}
    return _recorded(
        evaluation, starts, nominal | fitted, table, title=model.title, reference=model.reference,
        where=model.name,
    )  # fmt: skip


def _recorded(
    evaluation: Evaluation,
    starts: Mapping[str, float],
    parameters: Mapping[str, float],
    table: Mapping[str, tuple[str, str]],
    *,
    title: str,
    reference: str,
    where: str,
) -> TireEquations:
    constants: dict[str, float] = {}
    while True:
        names = [name for name in (*starts, *parameters) if name not in constants]
        try:
            program = record(lambda q: evaluation({**q, **constants}), names)  # noqa: B023  called at once
        except NotRecordedError as error:
            # A coefficient that says which equations hold is a number of this tire, once for all.
            deciding = error.quantities - constants.keys()
            if not deciding or not deciding <= parameters.keys():
                raise _not_recorded(title, where, error) from error
            constants |= {name: parameters[name] for name in deciding}
            continue
        break
    _check(program, evaluation, starts, parameters, where)
    used = program.quantities
    texts = {**table, **_NOMINAL}
    return TireEquations(
        title=title,
        reference=reference,
        inputs=tuple(_variable(name, _TEXTS[name], starts[name]) for name in starts if name in used),
        parameters=tuple(
            _variable(name, texts.get(name, _scale(name)), parameters[name])
            for name in parameters
            if name in used
        ),
        outputs=tuple(_variable(name, _TEXTS[name], None) for name, _ in program.results),
        program=program,
    )


def _variable(name: str, unit_text: tuple[str, str], start: float | None) -> Variable:
    return Variable(name=name, unit=unit_text[0], text=unit_text[1], start=start)


def _scale(name: str) -> tuple[str, str]:
    return "1", "scale factor" if name.startswith("L") else "coefficient"


def _check(
    program: Program,
    evaluation: Evaluation,
    starts: Mapping[str, float],
    parameters: Mapping[str, float],
    where: str,
) -> None:
    """Refuse a recording that does not give what the equations give on rows of all signs."""
    quantities = _rows(starts)
    everything: dict[str, Any] = {**parameters, **quantities}
    with np.errstate(all="ignore"):
        expected, replayed = evaluation(everything), program.replay(everything)
    for name, values in expected.items():
        if not np.allclose(replayed[name], values, rtol=1e-12, atol=1e-9, equal_nan=True):
            raise _not_recorded(name, where, f"the recorded {name} is not the one that is evaluated")


def _rows(starts: Mapping[str, float]) -> dict[str, np.ndarray]:
    count = 64
    spread = {"SA": 0.35, "IA": 0.12, "KAPPA": 0.3}
    turns = {name: (np.arange(count) * step) % 1.0 for name, step in zip(starts, _STEPS, strict=False)}
    return {
        name: spread[name] * (2 * turns[name] - 1) if name in spread else start * (0.3 + 1.4 * turns[name])
        for name, start in starts.items()
    }


_STEPS: Sequence[float] = (0.6180, 0.4142, 0.7321, 0.2361, 0.3166, 0.6458)  # incommensurate: all signs meet


def _not_recorded(title: str, where: str, problem: object) -> ConfigError:
    return ConfigError(
        f"{title} cannot be written as C", where=where, got=str(problem),
        expected="a model whose forces are one chain of equations: mf52, mf61, mf62, brush, tmeasy, lugre, "
        "pacejka94",
        next_step="choose one of those with --model", rule="fmu-equations",
    )  # fmt: skip
