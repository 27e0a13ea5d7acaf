"""Plan: what the virtual machine is told to do, and what it really is.

A plan is a TOML file with ``kind = "test"``, ``"session"`` or ``"table"`` (a maker's flat-surface table).
Every number that is not given has its default; the packaged plans in ``toolkit/examples/virtual`` show them.
A number is written with its unit, ``plysteer = { value = 0.12, unit = "deg" }``.
"""

from __future__ import annotations

import dataclasses
import datetime as dt
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

from toolkit.channels import ROTATIONS, Rotation
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import ConfigError
from toolkit.files import check_keys, read_toml
from toolkit.machine.definition import Machine, load_machine
from toolkit.machine.quantity import quantity
from toolkit.simulation.acquisition import AcquisitionTruth
from toolkit.simulation.carriage import CarriageTruth
from toolkit.simulation.case_plan import CasePlan, read_case_plan
from toolkit.simulation.cells import CellsTruth
from toolkit.simulation.effect_text import parse_effect
from toolkit.simulation.file_tire import FileTire, read_file_tire
from toolkit.simulation.plan_model import model_tire
from toolkit.simulation.plan_sections import (
    CARRIAGE,
    ROAD,
    TIRE,
    SessionTruth,
    acquisition_of,
    cells_of,
    choice,
    section_of,
    session_of,
    whole,
)
from toolkit.simulation.road import RoadTruth
from toolkit.simulation.steps import Motion, RunSteps, protocol_runs, read_motion, read_runs
from toolkit.simulation.tire import TireTruth
from toolkit.tires.tir_units import si_number

Kind = Literal["test", "session", "table"]
Record = Literal["dwell", "continuous"]


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


_TOP = (
    "schema kind title date machine seed rotations slip_angles loads pressure file_name label "
    "tire road carriage cells acquisition session motion run effects case"
).split()
_LABEL = ("size", "company", "DOT", "series", "construction", "rim")


def read_plan(path: Path, *, seed: int | None = None) -> Plan:
    """Read a plan; ``seed`` replaces the plan's own.

    Raises
    ------
    ConfigError
        no TOML, an unknown key, a number without a unit, a unit of another dimension, an unknown machine or
        effect, a tire file that cannot be used
    """
    table = read_toml(path)
    check_keys(table, _TOP, where=path)
    kind = choice(table.get("kind", "test"), ("test", "session", "table"), f"{path}: kind")
    machine = load_machine(str(table.get("machine", "m15-virtual")))
    if not machine.simulated:
        raise ConfigError(
            "a real machine cannot be simulated under its own name",
            where=f"{path}: machine",
            got=machine.name,
            expected='a machine definition with kind = "simulated", such as m15-virtual',
            next_step="change the plan's machine",
        )
    protocol = machine.protocol
    rotations = table.get("rotations", list(machine.rotations))
    if not isinstance(rotations, list) or not rotations:
        raise ConfigError(
            "a test needs a direction of rotation", where=f"{path}: rotations", got=rotations,
            expected=", ".join(ROTATIONS), next_step="name one or both in a list", rule="wrong-value",
        )  # fmt: skip
    for one in rotations:
        choice(one, ROTATIONS, f"{path}: rotations")
    label = table.get("label", {})
    check_keys(label, _LABEL, where=f"{path}: label")
    angles = _list(table, "slip_angles", "angle", protocol.slip_angles_rad, path)
    loads = _list(table, "loads", "force", protocol.loads_N, path)
    recording = dict(table.get("acquisition", {}))
    record = choice(recording.pop("record", "dwell"), ("dwell", "continuous"), f"{path}: acquisition.record")
    tire, file, taken = _tire(table.get("tire", {}), path)
    plan = Plan(
        kind=cast("Kind", kind),
        title=str(table.get("title", path.stem)),
        date=_date(table.get("date"), path),
        machine=machine,
        seed=whole(table.get("seed", 0) if seed is None else seed, f"{path}: seed", least=0),
        label=tuple((key, str(value)) for key, value in label.items()),
        rotations=tuple(cast("Rotation", one) for one in rotations),
        slip_angles_rad=angles,
        loads_N=loads,
        pressure_Pa=quantity(table["pressure"], "pressure", path)
        if "pressure" in table
        else _stated_pressure(file),
        file_name=_file_name(table.get("file_name", "FM_run_{number}.xlsx"), path),
        tire=tire,
        road=section_of(RoadTruth(), table.get("road", {}), ROAD, f"{path}: road"),
        carriage=section_of(CarriageTruth(), table.get("carriage", {}), CARRIAGE, f"{path}: carriage"),
        cells=cells_of(table.get("cells", {}), f"{path}: cells"),
        acquisition=acquisition_of(recording, f"{path}: acquisition"),
        session=session_of(table.get("session", {}), f"{path}: session"),
        record=cast("Record", record),
        motion=read_motion(table.get("motion", {}), where=f"{path}: motion"),
        runs=read_runs(table["run"], slip_angles_rad=angles, loads_N=loads, where=f"{path}: run")
        if "run" in table
        else (),
        tire_file=file,
        case=read_case_plan(table.get("case", {}), where=f"{path}: case"),
    )
    return with_effects(plan, [*taken, *_texts(table.get("effects", []), f"{path}: effects")])


def with_effects(plan: Plan, given: list[str]) -> Plan:
    """Return a plan with further effects switched on, each as `effect_text` has it.

    Raises
    ------
    ConfigError
        an effect that cannot be read, that the plan's tire does not know, or that acts in none of its runs
    """
    added: list[AppliedEffect] = []
    for text in given:
        for one in parse_effect(text, plan.machine):
            _check_tire(plan, one, text)
            _check_runs(plan, one, text)
            added.append(one)
    return dataclasses.replace(plan, effects=(*plan.effects, *added))


def _check_tire(plan: Plan, one: AppliedEffect, text: str) -> None:
    file, what = plan.tire_file, one.effect.needs_tire
    has = {
        "pressure": file is not None and file.has_pressure,
        "camber": file is None or file.has_camber,
    }
    if what is not None and not has[what]:
        raise ConfigError(
            f"the plan's tire does not depend on its {what}", where=f"--effect {text}", got=one.effect.name,
            expected=f"a tire file with {what} coefficients",
            next_step=f"give the plan a .tir of MF 6.x with {what} terms, or leave the effect out",
            rule="effect-value",
        )  # fmt: skip


def _check_runs(plan: Plan, one: AppliedEffect, text: str) -> None:
    if one.condition is None or any(one.acts_under(run.conditions) for run in plan.recordings):
        return
    known = sorted({f"{k}:{v}" for run in plan.recordings for k, v in run.conditions.items()})
    raise ConfigError(
        "no run has the condition of an effect", where=f"--effect {text}",
        got=f"{one.condition[0]}:{'+'.join(one.condition[1])}", expected=", ".join(known),
        next_step="name a condition of the plan's runs", rule="effect-value",
    )  # fmt: skip


def _tire(table: dict[str, Any], path: Path) -> tuple[TireTruth, FileTire | None, tuple[str, ...]]:
    """Return the published tire, or a file's; of a model file its effects too."""
    where = f"{path}: tire"
    if not isinstance(table, dict) or "file" not in table:
        return section_of(TireTruth(), table, TIRE, where), None, ()
    name = table["file"]
    if not isinstance(name, str) or not name:
        raise ConfigError(
            "the tire's file has no name", where=f"{where}.file", got=name,
            expected='file = "tire.tir", or a model file of toolkit diagnose',
            next_step="write the path, relative to the plan", rule="wrong-value",
        )  # fmt: skip
    taken: tuple[str, ...] = ()
    if name.endswith(".toml"):
        file, taken = model_tire(path.parent / name, where=f"{where}.file")
    else:
        file = read_file_tire(path.parent / name)
    default = TireTruth(
        plysteer_rad=0.0,
        aligning_shift_rad=0.0,
        conicity_N=0.0,
        nominal_load_N=file.FNOMIN,
        free_radius_m=file.UNLOADED_RADIUS,
        vertical_stiffness_N_m=si_number(file.tir, "VERTICAL_STIFFNESS", TireTruth().vertical_stiffness_N_m),
    )
    rest = {key: entry for key, entry in table.items() if key != "file"}
    own = {key: entry for key, entry in TIRE.items() if key not in ("plysteer", "aligning_shift", "conicity")}
    return section_of(default, rest, own, where), file, taken


def _stated_pressure(file: FileTire | None) -> float:
    if file is not None and file.INFLPRES > 0:
        return file.INFLPRES
    return quantity({"value": 34, "unit": "psi"}, "pressure", "pressure")


def _texts(value: object, where: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise ConfigError(
            "effects are a list of texts", where=where, got=value,
            expected='["NAME=VALUE"], each as --effect takes it',
            next_step="write each effect in quotes", rule="wrong-value",
        )  # fmt: skip
    return list(value)


def _list(
    table: dict[str, Any], key: str, dimension: str, default: tuple[float, ...], path: Path
) -> tuple[float, ...]:
    if key not in table:
        return default
    entry, where = table[key], f"{path}: {key}"
    values = entry.get("value") if isinstance(entry, dict) else None
    if not isinstance(values, list) or not values:
        raise ConfigError(
            f"{key} is no list with a unit", where=where, got=entry,
            expected='{ value = [..], unit = ".." }', next_step="write the values and their unit",
        )  # fmt: skip
    return tuple(quantity({**entry, "value": one}, dimension, where) for one in values)


def _date(value: object, path: Path) -> str:
    if isinstance(value, dt.date) and not isinstance(value, dt.datetime):
        return value.isoformat()
    try:
        return dt.date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise ConfigError(
            "a plan needs the day on which it is run", where=f"{path}: date", got=value,
            expected="a date such as 2026-03-17", next_step="write date = 2026-03-17",
        ) from error  # fmt: skip


def _file_name(value: object, path: Path) -> str:
    name = str(value)
    if "{number}" not in name or Path(name).name != name or not name.endswith(".xlsx"):
        raise ConfigError(
            "the files' name does not count up", where=f"{path}: file_name", got=name,
            expected="a plain file name with {number} that ends in .xlsx",
            next_step='write it like "FM_run_{number}.xlsx"',
        )  # fmt: skip
    return name
