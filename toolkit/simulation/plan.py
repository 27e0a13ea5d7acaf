"""Plan: what the virtual machine is told to do, and what it really is.

A plan is a TOML file with ``kind = "test"``, ``"session"`` or ``"table"`` (a maker's flat-surface table).
Every number that is not given has its default; the packaged plans in ``toolkit/examples/virtual`` show them.
A number is written with its unit, ``plysteer = { value = 0.12, unit = "deg" }``.

The tire of a plan may be a model file: refitted coefficients, and the effects that a diagnosis named.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

from toolkit.channels import Rotation
from toolkit.declared import Fault, Source, read_text, refuse
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import ConfigError
from toolkit.inputs import SETTINGS_FILE, read_input
from toolkit.machine.default import SIMULATED_MACHINE
from toolkit.machine.definition import Machine, load_machine
from toolkit.simulation.acquisition import AcquisitionTruth
from toolkit.simulation.carriage import CarriageTruth, RoadTruth
from toolkit.simulation.cells import CellsTruth
from toolkit.simulation.effect_text import parse_effect
from toolkit.simulation.file_tire import FileTire, read_file_tire
from toolkit.simulation.model_file import FittedEffect, ModelFile, read_model
from toolkit.simulation.plan_file import CasePlan, Kind, PlanFile, Record, SessionTruth, TireEntries, filled
from toolkit.simulation.steps import Motion, RunSteps, protocol_runs, stated_runs
from toolkit.simulation.tire import TireTruth
from toolkit.tires.tir import TirFile, TirLine, si_number
from toolkit.units import to_si

_NEW = "SCALING_COEFFICIENTS"  # where a coefficient goes that the file leaves to its default


def model_tire(path: Path, *, where: str) -> tuple[FileTire, tuple[str, ...]]:
    """Return the tire of a model file with its refitted coefficients, and its effects as a plan writes them.

    Raises
    ------
    ConfigError
        as `read_model`; the model is of another kind than ``machine``, frees a number of the machine, or has
        an effect that is tied to single recordings
    """
    model = read_model(path)
    tire = model.file("tire")
    if model.kind != "machine" or tire is None:
        raise _wrong("the model has no tire", where, f"a model of kind {model.kind}", "one of kind machine")
    numbers = {fitted.name: fitted.value for fitted in model.parameters}
    ours = [name for name in numbers if "." in name]
    if ours:
        raise _wrong(
            "the model holds a refitted number of the machine", where, ", ".join(ours),
            "coefficients and scale factors of the tire alone",
        )  # fmt: skip
    file = read_file_tire(tire)
    changed = dataclasses.replace(file, tir=with_numbers(file.tir, numbers))
    return changed, tuple(effect_text(fitted, model, where=where) for fitted in model.effects)


def with_numbers(tir: TirFile, numbers: dict[str, float]) -> TirFile:
    """Return a tire file with other values of coefficients; one that it leaves out is added.

    >>> from toolkit.tires.tir import parse_tir
    >>> tir = parse_tir("[MODEL]\\nFITTYP = 61\\n[LATERAL_COEFFICIENTS]\\nPCY1 = 1.3\\n")
    >>> with_numbers(tir, {"PCY1": 1.4, "LKY": 0.9}).coefficients()
    {'PCY1': 1.4, 'LKY': 0.9}
    """
    keys = {line.key for line in tir.lines if line.section.endswith("COEFFICIENTS")}
    lines = [
        dataclasses.replace(line, value=numbers[line.key])
        if line.key in numbers and line.section.endswith("COEFFICIENTS")
        else line
        for line in tir.lines
    ]
    missing = [name for name in numbers if name not in keys]
    if missing:
        lines += [TirLine(section=_NEW, text=f"[{_NEW}]")]
        lines += [TirLine(section=_NEW, key=name, value=numbers[name]) for name in missing]
    return dataclasses.replace(tir, lines=tuple(lines))


def effect_text(one: FittedEffect, model: ModelFile, *, where: str) -> str:
    """Return an effect of a model as a plan writes it: ``steer_offset=offset:0.3deg``, machine axes.

    Raises
    ------
    ConfigError
        ``model-file``: the effect is in some runs only, by their names
    """
    applied, effect = one.applied, one.applied.effect
    if effect.replaces_record:
        return f"{effect.name}={applied.source}"
    head = applied.key.dotted
    if applied.condition is not None:
        key, values = applied.condition
        head += f"@{key}:{'+'.join(values)}"
    elif applied.runs is not None:
        raise _wrong(
            "an effect of the model is tied to single recordings", where,
            f"{one.label} in {', '.join(sorted(applied.runs))}",
            "an effect in all runs, or by a condition of runs",
        )  # fmt: skip
    written = [
        f"{parameter.name}:"
        f"{applied.values[parameter.name] * parameter.sign_between(model.axes, 'machine')!r}"
        f"{applied.units[parameter.name]}"
        for parameter in effect.parameters
    ]
    return head + (f"={','.join(written)}" if written else "")


def _wrong(problem: str, where: str, actual: str, expected: str) -> ConfigError:
    return ConfigError(
        problem, where=where, got=actual, expected=expected,
        next_step="run the model on inputs instead: toolkit simulate MODEL.toml --inputs FILE.csv",
        rule="model-file",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A test, session or table of the virtual machine: the steps, and the truth of every stage, in SI.

    ``record`` says whether a file holds settled blocks alone or every row; ``tire_file`` replaces the
    published tire; ``runs`` replaces the protocol's order.
    """

    kind: Kind
    title: str
    date: str
    machine: Machine
    seed: int
    label: tuple[tuple[str, str], ...] = ()
    rotations: tuple[Rotation, ...] = ("forward", "reverse")
    slip_angles_rad: tuple[float, ...] = ()
    loads_N: tuple[float, ...] = ()
    pressure_Pa: float = 0.0
    file_name: str = "FM_run_{number}.xlsx"
    tire: TireTruth = field(default_factory=TireTruth)
    road: RoadTruth = field(default_factory=RoadTruth)
    carriage: CarriageTruth = field(default_factory=CarriageTruth)
    cells: CellsTruth = field(default_factory=CellsTruth)
    acquisition: AcquisitionTruth = field(default_factory=AcquisitionTruth)
    session: SessionTruth = field(default_factory=SessionTruth)
    effects: tuple[AppliedEffect, ...] = ()
    record: Record = "dwell"
    motion: Motion = field(default_factory=Motion)
    runs: tuple[RunSteps, ...] = ()
    tire_file: FileTire | None = None
    case: CasePlan = field(default_factory=CasePlan)

    @property
    def recordings(self) -> tuple[RunSteps, ...]:
        """The runs, one recording each: as given, else one for each direction and slip angle."""
        return self.runs or protocol_runs(self.rotations, self.slip_angles_rad, self.loads_N)


def read_plan(path: Path, *, seed: int | None = None) -> Plan:
    """Read a plan; ``seed`` replaces the plan's own.

    Raises
    ------
    ConfigError
        no TOML; every entry that is unknown, missing or cannot be used; an unknown machine or effect, a tire
        file that cannot be used
    """
    data = read_input(path, SETTINGS_FILE)
    stated = read_text(PlanFile, data, where=path)
    machine = load_machine(stated.machine)
    if not machine.simulated:
        expected = f'a machine definition with kind = "simulated", such as {SIMULATED_MACHINE}'
        problem = "a real machine cannot be simulated under its own name"
        fault = Fault(
            key=("machine",), got=machine.name, expected=expected, what=problem, form=PlanFile.FORMAT
        )
        refuse([fault], Source(where=path, text=data.decode("utf-8-sig")))
    angles = stated.slip_angles_rad or machine.protocol.slip_angles_rad
    loads = stated.loads_N or machine.protocol.loads_N
    tire, file, model_effects = _tire(stated.tire, path)
    plan = Plan(
        kind=stated.kind,
        title=path.stem if stated.title is None else stated.title,
        date=stated.date,
        machine=machine,
        seed=stated.seed if seed is None else seed,
        label=stated.label,
        rotations=stated.rotations or machine.rotations,
        slip_angles_rad=angles,
        loads_N=loads,
        pressure_Pa=_stated_pressure(file) if stated.pressure_Pa is None else stated.pressure_Pa,
        file_name=stated.file_name,
        tire=tire,
        road=stated.road,
        carriage=stated.carriage,
        cells=stated.cells.truth(),
        acquisition=filled(AcquisitionTruth(), stated.acquisition),
        session=stated.session,
        record=stated.acquisition.record,
        motion=stated.motion,
        runs=stated_runs(stated.run or (), slip_angles_rad=angles, loads_N=loads),
        tire_file=file,
        case=stated.case,
    )
    return with_effects(plan, [*model_effects, *stated.effects])


def with_effects(plan: Plan, given: list[str]) -> Plan:
    """Return a plan with further effects switched on, each as `effect_text` has it.

    Raises
    ------
    ConfigError
        an effect that cannot be read, that the plan's tire does not know, or that acts in none of its runs
    """
    added: list[AppliedEffect] = []
    for text in given:
        for applied in parse_effect(text, plan.machine):
            _check_tire(plan, applied, text)
            _check_runs(plan, applied, text)
            added.append(applied)
    return dataclasses.replace(plan, effects=(*plan.effects, *added))


def _check_tire(plan: Plan, applied: AppliedEffect, text: str) -> None:
    file, need = plan.tire_file, applied.effect.needs_tire
    has = {
        "pressure": file is not None and file.has_pressure,
        "camber": file is None or file.has_camber,
    }
    if need is not None and not has[need]:
        raise ConfigError(
            f"the plan's tire does not depend on its {need}", where=f"--effect {text}",
            got=applied.effect.name,
            expected=f"a tire file with {need} coefficients",
            next_step=f"give the plan a .tir of MF 6.x with {need} terms, or leave the effect out",
            rule="effect-value",
        )  # fmt: skip


def _check_runs(plan: Plan, applied: AppliedEffect, text: str) -> None:
    if applied.condition is None or any(applied.acts_under(run.conditions) for run in plan.recordings):
        return
    conditions = sorted({f"{k}:{v}" for run in plan.recordings for k, v in run.conditions.items()})
    raise ConfigError(
        "no run has the condition of an effect", where=f"--effect {text}",
        got=f"{applied.condition[0]}:{'+'.join(applied.condition[1])}", expected=", ".join(conditions),
        next_step="name a condition of the plan's runs", rule="effect-value",
    )  # fmt: skip


def _tire(entries: TireEntries, path: Path) -> tuple[TireTruth, FileTire | None, tuple[str, ...]]:
    """Return the published tire, or a file's; of a model file its effects too."""
    if entries.file is None:
        return filled(TireTruth(), entries), None, ()
    effects: tuple[str, ...] = ()
    if entries.file.name.endswith(".toml"):
        file, effects = model_tire(path.parent / entries.file, where=f"{path}: tire.file")
    else:
        file = read_file_tire(path.parent / entries.file)
    default = TireTruth(
        plysteer_rad=0.0,
        aligning_shift_rad=0.0,
        conicity_N=0.0,
        nominal_load_N=file.FNOMIN,
        free_radius_m=file.UNLOADED_RADIUS,
        vertical_stiffness_N_m=si_number(file.tir, "VERTICAL_STIFFNESS", TireTruth().vertical_stiffness_N_m),
    )
    return filled(default, entries), file, effects


def _stated_pressure(file: FileTire | None) -> float:
    if file is not None and file.INFLPRES > 0:
        return file.INFLPRES
    return float(to_si(34, "psi"))
