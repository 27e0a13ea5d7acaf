"""Runs of a plan: which slip angles and loads, which way, how fast; read from the plan's ``[[run]]``.

A run is one recording. Without ``[[run]]`` there is one for each direction and slip angle, through all
loads, as the machine's protocol has it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, Literal, cast

from toolkit.channels import ROTATIONS, Rotation
from toolkit.errors import ConfigError
from toolkit.files import check_keys
from toolkit.machine.definition import Machine
from toolkit.machine.quantity import one_of, quantities, quantity
from toolkit.units import unit

Mounting = Literal["normal", "turned"]
Outer = Literal["slip_angle", "load"]
MOUNTINGS: tuple[Mounting, ...] = ("normal", "turned")

_KEYS = (
    "rotation mounting slip_angles loads outer speed pressure steer_rate load_rate dwell times conditions"
).split()
_MOTION = (
    "steer_rate",
    "load_rate",
    "dwell",
    "between_files",
    "ambient",
    "ambient_drift",
    "tread_heating",
    "tread_cooling",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How the machine moves and what it stands in.

    ``steer_rate_rad_s`` of the rack, ``load_rate_N_s`` of the load actuator, ``dwell_s`` at each condition
    (None: the protocol's revolutions), ``between_files_s`` until the next recording begins; ``ambient_K`` and
    its drift are the room's. Slip work heats the tread by ``tread_heating_K_J`` (some 2 kJ/K of rubber) and
    it cools to the room with ``tread_cooling_s``, a minute for a rolling passenger tire.
    """

    steer_rate_rad_s: float = 0.0698131700797732  # 4 deg/s
    load_rate_N_s: float = 5000.0
    dwell_s: float | None = None
    between_files_s: float = 30.0
    ambient_K: float = 294.15
    ambient_drift_K_s: float = 0.0
    tread_heating_K_J: float = 0.5e-3
    tread_cooling_s: float = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSteps:
    """One recording: every slip angle [rad] at every load [N], in the order of ``outer``, and how.

    ``conditions`` are what a case says of it, rotation and mounting among them.
    """

    rotation: Rotation
    slip_angles_rad: tuple[float, ...]
    loads_N: tuple[float, ...]
    outer: Outer = "slip_angle"
    mounting: Mounting = "normal"
    speed_m_s: float | None = None
    pressure_Pa: float | None = None
    steer_rate_rad_s: float | None = None
    load_rate_N_s: float | None = None
    dwell_s: float | None = None
    extra: tuple[tuple[str, str], ...] = ()

    @property
    def conditions(self) -> dict[str, str]:
        """Conditions of the run by name."""
        return {"rotation": self.rotation, "mounting": self.mounting, **dict(self.extra)}

    @property
    def steps(self) -> tuple[tuple[float, float], ...]:
        """Slip angle [rad] and load [N] of each condition, in their order."""
        if self.outer == "slip_angle":
            return tuple(itertools.product(self.slip_angles_rad, self.loads_N))
        return tuple((angle, load) for load, angle in itertools.product(self.loads_N, self.slip_angles_rad))


def protocol_runs(
    rotations: tuple[Rotation, ...], slip_angles_rad: tuple[float, ...], loads_N: tuple[float, ...]
) -> tuple[RunSteps, ...]:
    """Return one run for each direction and slip angle."""
    return tuple(
        RunSteps(rotation=rotation, slip_angles_rad=(angle,), loads_N=loads_N)
        for rotation in rotations
        for angle in slip_angles_rad
    )


def read_runs(
    entries: Any, *, slip_angles_rad: tuple[float, ...], loads_N: tuple[float, ...], where: str
) -> tuple[RunSteps, ...]:
    """Read ``[[run]]``; what a run does not say is the plan's.

    Raises
    ------
    ConfigError
        an unknown key, a number without its unit, a rate or speed that is not positive
    """
    if not isinstance(entries, list) or not entries:
        raise _wrong("run is no list of tables", where, entries, "[[run]] with its keys")
    run_stepses: list[RunSteps] = []
    for number, entry in enumerate(entries, start=1):
        place = f"{where}[{number}]"
        if not isinstance(entry, dict):
            raise _wrong("a run is no table", place, entry, "[[run]] with its keys")
        check_keys(entry, _KEYS, where=place)
        run = RunSteps(
            rotation=cast(
                "Rotation", one_of(entry.get("rotation", "forward"), ROTATIONS, f"{place}.rotation")
            ),
            mounting=cast(
                "Mounting", one_of(entry.get("mounting", "normal"), MOUNTINGS, f"{place}.mounting")
            ),
            outer=cast(
                "Outer", one_of(entry.get("outer", "slip_angle"), ("slip_angle", "load"), f"{place}.outer")
            ),
            slip_angles_rad=quantities(entry["slip_angles"], "angle", f"{place}.slip_angles")
            if "slip_angles" in entry
            else slip_angles_rad,
            loads_N=quantities(entry["loads"], "force", f"{place}.loads") if "loads" in entry else loads_N,
            speed_m_s=_positive(entry, "speed", "speed", place),
            pressure_Pa=_positive(entry, "pressure", "pressure", place),
            steer_rate_rad_s=_positive(entry, "steer_rate", "rad/s", place),
            load_rate_N_s=_positive(entry, "load_rate", "N/s", place),
            dwell_s=_positive(entry, "dwell", "time", place),
            extra=_conditions(entry.get("conditions", {}), f"{place}.conditions"),
        )
        times = entry.get("times", 1)
        if isinstance(times, bool) or not isinstance(times, int) or not 1 <= times <= 1000:
            raise _wrong("a count is no whole number", f"{place}.times", times, "a whole number from 1")
        run_stepses += [run] * times
    return tuple(run_stepses)


def read_motion(table: Any, *, where: str) -> Motion:
    """Read ``[motion]``; errors as `read_runs`."""
    if not isinstance(table, dict):
        raise _wrong("motion is no table", where, table, "[motion] with its keys")
    check_keys(table, _MOTION, where=where)
    default = Motion()
    ambient = quantity(table["ambient"], "temperature", f"{where}.ambient") if "ambient" in table else None
    drift = 0.0
    if "ambient_drift" in table:
        drift = quantity(table["ambient_drift"], unit("K/s").dimension, f"{where}.ambient_drift")
    return Motion(
        steer_rate_rad_s=_positive(table, "steer_rate", "rad/s", where) or default.steer_rate_rad_s,
        load_rate_N_s=_positive(table, "load_rate", "N/s", where) or default.load_rate_N_s,
        dwell_s=_positive(table, "dwell", "time", where),
        between_files_s=_positive(table, "between_files", "time", where) or default.between_files_s,
        ambient_K=default.ambient_K if ambient is None else ambient,
        ambient_drift_K_s=drift,
        tread_heating_K_J=_positive(table, "tread_heating", "K/J", where) or default.tread_heating_K_J,
        tread_cooling_s=_positive(table, "tread_cooling", "time", where) or default.tread_cooling_s,
    )


def machine_speed(run: RunSteps, machine: Machine) -> float:
    """Return the surface speed of a run [m/s]."""
    return machine.drum.speed_m_s if run.speed_m_s is None else run.speed_m_s


def _positive(table: dict[str, Any], key: str, dimension: str, where: str) -> float | None:
    if key not in table:
        return None
    name_of = unit(dimension).dimension if "/" in dimension else dimension
    value = quantity(table[key], name_of, f"{where}.{key}")
    if not 0 < value < float("inf"):
        raise _wrong("a size is not positive", f"{where}.{key}", table[key], "a number above zero")
    return value


def _conditions(table: Any, where: str) -> tuple[tuple[str, str], ...]:
    if not isinstance(table, dict):
        raise _wrong("conditions are no table", where, table, 'conditions = { surface = "steel" }')
    for key, value in table.items():
        if key in ("rotation", "mounting", "file", "phase"):
            raise _wrong(
                "a condition has a key of its own", f"{where}.{key}", value, f"{key} of the run itself"
            )
        if not isinstance(value, str | int) or isinstance(value, bool):
            raise _wrong(
                "a condition is neither text nor number", f"{where}.{key}", value, "text or a whole number"
            )
    return tuple((key, str(value)) for key, value in table.items())


def _wrong(what: str, where: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        what, where=where, got=got, expected=expected, next_step="correct the plan", rule="wrong-value"
    )
