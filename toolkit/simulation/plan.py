"""Plan: what the virtual machine is told to do, and what it really is.

A plan is a TOML file with ``kind = "test"`` or ``"session"``. Every number that is not given has its
default; the packaged plans in ``toolkit/examples/virtual`` show them. A number is written with its unit,
``plysteer = { value = 0.12, unit = "deg" }``.
"""

from __future__ import annotations

import dataclasses
import datetime as dt
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

from toolkit.channels import ROTATIONS, Rotation
from toolkit.errors import ConfigError
from toolkit.files import check_keys, read_toml
from toolkit.machine.definition import Machine, load_machine, quantity
from toolkit.simulation.acquisition import AcquisitionTruth
from toolkit.simulation.carriage import CarriageTruth
from toolkit.simulation.cells import CELLS, CellsTruth, CellTruth
from toolkit.simulation.road import RoadTruth
from toolkit.simulation.tire import TireTruth
from toolkit.units import unit

Kind = Literal["test", "session"]
Output = Literal["mV/V", "mV", "count"]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionTruth:
    """The reference-load session: largest loads, runs, and how well the reference loads are known.

    ``output`` is what the files hold: the bridge's ratio, volts at ``excitation_V``, or counts of
    ``count_V_V`` [V/V] each. ``readings`` writes zeros before and after, which drift by ``zero_drift_V_V``
    in each cell, and shunt steps.
    """

    FY_N: float = 6200.0
    MZ_Nm: float = 200.0
    MX_Nm: float = 1900.0
    runs: int = 3
    reference_FY_N: float = 0.4
    reference_MZ_Nm: float = 0.015
    reference_MX_Nm: float = 0.15
    output: Output = "mV/V"
    excitation_V: float = 10.0
    count_V_V: float = 4e-10
    readings: bool = False
    zero_drift_V_V: float = 2e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A test or session of the virtual machine: the steps, and the truth of every stage, in SI."""

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
    effects: tuple[tuple[str, float], ...] = ()


# Key of a section -> (field, dimension as `units.Unit.dimension` names it). "" is a plain number.
_TIRE = {
    "plysteer": ("plysteer_rad", "angle"),
    "aligning_shift": ("aligning_shift_rad", "angle"),
    "conicity": ("conicity_N", "force"),
    "nominal_load": ("nominal_load_N", "force"),
    "free_radius": ("free_radius_m", "length"),
    "rolling_ratio": ("rolling_ratio", "ratio"),
    "vertical_stiffness": ("vertical_stiffness_N_m", "N/m"),
}
_ROAD = {
    "drum_runout_1": ("runout_1_N", "force"),
    "drum_runout_1_phase": ("runout_1_phase_rad", "angle"),
    "drum_runout_2": ("runout_2_N", "force"),
    "drum_runout_2_phase": ("runout_2_phase_rad", "angle"),
}
_CARRIAGE = {
    "steering_zero": ("steering_zero_rad", "angle"),
    "steer_offset": ("steer_offset_rad", "angle"),
    "camber_offset": ("camber_offset_rad", "angle"),
    "load_spread": ("load_spread", "ratio"),
    "overturning": ("overturning_Nm", "moment"),
}
_CELL = {
    "zero": ("zero_V_V", "bridge_ratio"),
    "noise": ("noise_V_V", "bridge_ratio"),
    "zero_offset": ("zero_offset_V_V", "bridge_ratio"),
    "gain_error": ("gain_error", "ratio"),
}
_ACQUISITION = {
    "filter_time_constant": ("filter_time_constant_s", "time"),
    "FZ_noise": ("FZ_noise_N", "force"),
    "SA_noise": ("SA_noise_rad", "angle"),
}
_SESSION = {
    "FY": ("FY_N", "force"),
    "MZ": ("MZ_Nm", "moment"),
    "MX": ("MX_Nm", "moment"),
    "reference_FY": ("reference_FY_N", "force"),
    "reference_MZ": ("reference_MZ_Nm", "moment"),
    "reference_MX": ("reference_MX_Nm", "moment"),
    "scale": ("count_V_V", "bridge_ratio"),
    "zero_drift": ("zero_drift_V_V", "bridge_ratio"),
}
_TOP = (
    "schema kind title date machine seed rotations slip_angles loads pressure file_name label "
    "tire road carriage cells acquisition session"
).split()
_LABEL = ("size", "company", "DOT", "series", "construction", "rim")


def read_plan(path: Path, *, seed: int | None = None) -> Plan:
    """Read a plan; ``seed`` replaces the plan's own.

    Raises
    ------
    ConfigError
        no TOML, an unknown key, a number without a unit, a unit of another dimension, an unknown machine
    """
    table = read_toml(path)
    check_keys(table, _TOP, where=path)
    kind = _choice(table.get("kind", "test"), ("test", "session"), f"{path}: kind")
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
        _choice(one, ROTATIONS, f"{path}: rotations")
    label = table.get("label", {})
    check_keys(label, _LABEL, where=f"{path}: label")
    return Plan(
        kind=cast("Kind", kind),
        title=str(table.get("title", path.stem)),
        date=_date(table.get("date"), path),
        machine=machine,
        seed=_whole(table.get("seed", 0) if seed is None else seed, f"{path}: seed", least=0),
        label=tuple((key, str(value)) for key, value in label.items()),
        rotations=tuple(cast("Rotation", one) for one in rotations),
        slip_angles_rad=_list(table, "slip_angles", "angle", protocol.slip_angles_rad, path),
        loads_N=_list(table, "loads", "force", protocol.loads_N, path),
        pressure_Pa=quantity(table.get("pressure", {"value": 34, "unit": "psi"}), "pressure", path),
        file_name=_file_name(table.get("file_name", "FM_run_{number}.xlsx"), path),
        tire=_section(TireTruth(), table.get("tire", {}), _TIRE, f"{path}: tire"),
        road=_section(RoadTruth(), table.get("road", {}), _ROAD, f"{path}: road"),
        carriage=_section(CarriageTruth(), table.get("carriage", {}), _CARRIAGE, f"{path}: carriage"),
        cells=_cells(table.get("cells", {}), f"{path}: cells"),
        acquisition=_acquisition(table.get("acquisition", {}), f"{path}: acquisition"),
        session=_session(table.get("session", {}), f"{path}: session"),
    )


# Sizes of the tire that no tire can have at zero or below.
_SIZES = ("nominal_load_N", "free_radius_m", "rolling_ratio", "vertical_stiffness_N_m")


def _section(default: T, table: dict[str, Any], known: dict[str, tuple[str, str]], where: str) -> T:
    check_keys(table, known, where=where)
    values = {
        known[key][0]: quantity(entry, _dimension(known[key][1]), f"{where}.{key}")
        for key, entry in table.items()
    }
    for key, entry in table.items():
        value = values[known[key][0]]
        if not math.isfinite(value) or (known[key][0] in _SIZES and value <= 0):
            raise ConfigError(
                "a number of the plan cannot be", where=f"{where}.{key}", got=entry,
                expected="a number above zero" if known[key][0] in _SIZES else "a finite number",
                next_step="correct the line", rule="wrong-value",
            )  # fmt: skip
    return cast("T", dataclasses.replace(cast("Any", default), **values))


def _dimension(name: str) -> str:
    return unit(name).dimension if "/" in name else name


def _cells(table: dict[str, Any], where: str) -> CellsTruth:
    check_keys(table, (*CELLS, "crosstalk"), where=where)
    made = CellsTruth()
    for name in CELLS:
        if name in table:
            changed: dict[str, Any] = {name: _cell(getattr(made, name), table[name], where, name)}
            made = dataclasses.replace(made, **changed)
    if "crosstalk" in table:
        factor = quantity(table["crosstalk"], "ratio", f"{where}.crosstalk")
        made = dataclasses.replace(made, crosstalk_FZ_FY=factor)
    return made


def _cell(default: CellTruth, table: dict[str, Any], where: str, name: str) -> CellTruth:
    place = f"{where}.{name}"
    check_keys(table, (*_CELL, "rated_output", "capacity"), where=place)
    rest = {key: entry for key, entry in table.items() if key in _CELL}
    made = _section(default, rest, _CELL, place)
    if ("rated_output" in table) != ("capacity" in table):
        raise ConfigError(
            "a cell's sensitivity needs rated output and capacity",
            where=place,
            got=", ".join(table),
            expected="rated_output (mV/V) and capacity (force) together",
            next_step="give both or neither",
        )
    if "capacity" in table:
        output = quantity(table["rated_output"], "bridge_ratio", place)
        capacity = _positive(quantity(table["capacity"], "force", place), f"{place}.capacity")
        made = dataclasses.replace(made, sensitivity_per_N=_positive(output, place) / capacity)
    return made


def _acquisition(table: dict[str, Any], where: str) -> AcquisitionTruth:
    check_keys(table, (*_ACQUISITION, "rows_per_revolution", "negated"), where=where)
    numbers = {key: entry for key, entry in table.items() if key in _ACQUISITION}
    made = _section(AcquisitionTruth(), numbers, _ACQUISITION, where)
    if "rows_per_revolution" in table:
        rows = _whole(table["rows_per_revolution"], f"{where}.rows_per_revolution", least=1)
        made = dataclasses.replace(made, rows_per_revolution=rows)
    if "negated" in table:
        names = table["negated"]
        for one in names if isinstance(names, list) else [names]:
            _choice(one, CELLS, f"{where}.negated")
        made = dataclasses.replace(made, negated=tuple(names))
    return made


def _session(table: dict[str, Any], where: str) -> SessionTruth:
    check_keys(table, (*_SESSION, "runs", "output", "excitation", "readings"), where=where)
    numbers = {key: entry for key, entry in table.items() if key in _SESSION}
    made = _section(SessionTruth(), numbers, _SESSION, where)
    _positive(made.count_V_V, f"{where}.scale")
    changed: dict[str, Any] = {}
    if "runs" in table:
        changed["runs"] = _whole(table["runs"], f"{where}.runs", least=1)
    if "output" in table:
        changed["output"] = _choice(table["output"], ("mV/V", "mV", "count"), f"{where}.output")
    if "excitation" in table:
        volts = quantity(table["excitation"], unit("V").dimension, f"{where}.excitation")
        changed["excitation_V"] = _positive(volts, f"{where}.excitation")
    if "readings" in table:
        if not isinstance(table["readings"], bool):
            raise ConfigError(
                "readings is neither true nor false", where=f"{where}.readings", got=table["readings"],
                expected="true or false", next_step="correct it", rule="wrong-value",
            )  # fmt: skip
        changed["readings"] = table["readings"]
    return dataclasses.replace(made, **changed)


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


def _choice(value: object, allowed: tuple[str, ...], where: str) -> str:
    if value not in allowed:
        raise ConfigError(
            "a setting has a value that is not known", where=where, got=value,
            expected=", ".join(allowed), next_step="use one of those expected",
        )  # fmt: skip
    return str(value)


def _whole(value: object, where: str, *, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ConfigError(
            "a count is no whole number", where=where, got=value, expected=f"a whole number from {least}",
            next_step="correct it",
        )  # fmt: skip
    return value


def _positive(value: float, where: str) -> float:
    if not value > 0:
        raise ConfigError(
            "a size is not positive", where=where, got=value, expected="a number above zero",
            next_step="correct it",
        )  # fmt: skip
    return value
