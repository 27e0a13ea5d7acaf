"""Sections of a plan: the truth of every stage, read from a TOML table, each number with its unit."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, cast

from toolkit.errors import ConfigError
from toolkit.files import check_keys
from toolkit.machine.quantity import quantity
from toolkit.simulation.acquisition import AcquisitionTruth
from toolkit.simulation.cells import CELLS, CellsTruth, CellTruth
from toolkit.units import unit

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


# Key of a section -> (field, dimension as `units.Unit.dimension` names it). "" is a plain number.
TIRE = {
    "plysteer": ("plysteer_rad", "angle"),
    "aligning_shift": ("aligning_shift_rad", "angle"),
    "conicity": ("conicity_N", "force"),
    "nominal_load": ("nominal_load_N", "force"),
    "free_radius": ("free_radius_m", "length"),
    "rolling_ratio": ("rolling_ratio", "ratio"),
    "vertical_stiffness": ("vertical_stiffness_N_m", "N/m"),
}
ROAD = {
    "drum_runout_1": ("runout_1_N", "force"),
    "drum_runout_1_phase": ("runout_1_phase_rad", "angle"),
    "drum_runout_2": ("runout_2_N", "force"),
    "drum_runout_2_phase": ("runout_2_phase_rad", "angle"),
}
CARRIAGE = {
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

# Sizes of the tire that no tire can have at zero or below.
_SIZES = ("nominal_load_N", "free_radius_m", "rolling_ratio", "vertical_stiffness_N_m")


def section_of(default: T, table: dict[str, Any], known: dict[str, tuple[str, str]], where: str) -> T:
    """Return a stage with the numbers of its section put in; each must have its unit."""
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


def cells_of(table: dict[str, Any], where: str) -> CellsTruth:
    """Return the cells that a section describes."""
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
    made = section_of(default, rest, _CELL, place)
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
        capacity = positive(quantity(table["capacity"], "force", place), f"{place}.capacity")
        made = dataclasses.replace(made, sensitivity_per_N=positive(output, place) / capacity)
    return made


def acquisition_of(table: dict[str, Any], where: str) -> AcquisitionTruth:
    """Return the acquisition that a section describes."""
    check_keys(table, (*_ACQUISITION, "rows_per_revolution", "negated"), where=where)
    numbers = {key: entry for key, entry in table.items() if key in _ACQUISITION}
    made = section_of(AcquisitionTruth(), numbers, _ACQUISITION, where)
    if "rows_per_revolution" in table:
        rows = whole(table["rows_per_revolution"], f"{where}.rows_per_revolution", least=1)
        made = dataclasses.replace(made, rows_per_revolution=rows)
    if "negated" in table:
        names = table["negated"]
        for one in names if isinstance(names, list) else [names]:
            choice(one, CELLS, f"{where}.negated")
        made = dataclasses.replace(made, negated=tuple(names))
    return made


def session_of(table: dict[str, Any], where: str) -> SessionTruth:
    """Return the reference-load session that a section describes."""
    check_keys(table, (*_SESSION, "runs", "output", "excitation", "readings"), where=where)
    numbers = {key: entry for key, entry in table.items() if key in _SESSION}
    made = section_of(SessionTruth(), numbers, _SESSION, where)
    positive(made.count_V_V, f"{where}.scale")
    changed: dict[str, Any] = {}
    if "runs" in table:
        changed["runs"] = whole(table["runs"], f"{where}.runs", least=1)
    if "output" in table:
        changed["output"] = choice(table["output"], ("mV/V", "mV", "count"), f"{where}.output")
    if "excitation" in table:
        volts = quantity(table["excitation"], unit("V").dimension, f"{where}.excitation")
        changed["excitation_V"] = positive(volts, f"{where}.excitation")
    if "readings" in table:
        if not isinstance(table["readings"], bool):
            raise ConfigError(
                "readings is neither true nor false", where=f"{where}.readings", got=table["readings"],
                expected="true or false", next_step="correct it", rule="wrong-value",
            )  # fmt: skip
        changed["readings"] = table["readings"]
    return dataclasses.replace(made, **changed)


def choice(value: object, allowed: tuple[str, ...], where: str) -> str:
    """Return one of the words that are allowed, or refuse it."""
    if value not in allowed:
        raise ConfigError(
            "a setting has a value that is not known", where=where, got=value,
            expected=", ".join(allowed), next_step="use one of those expected",
        )  # fmt: skip
    return str(value)


def whole(value: object, where: str, *, least: int) -> int:
    """Return a whole number, or refuse it."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ConfigError(
            "a count is no whole number", where=where, got=value, expected=f"a whole number from {least}",
            next_step="correct it",
        )  # fmt: skip
    return value


def positive(value: float, where: str) -> float:
    """Return a number above zero, or refuse it."""
    if not value > 0:
        raise ConfigError(
            "a size is not positive", where=where, got=value, expected="a number above zero",
            next_step="correct it",
        )  # fmt: skip
    return value
