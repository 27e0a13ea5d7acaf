"""A test protocol as data: what is measured, in what order, how settled, and how near is near enough.

A machine definition holds its default; ``protocol = "file.toml"`` in ``test.toml`` or ``--protocol FILE``
gives another one. The keys are the same in both:

    schema = 1
    source = "where the protocol comes from, and how it departs from that"
    slip_angles = { value = [0, 1, -1, 0], unit = "deg" }    # in the order of the test; a step that stands
    loads = { value = [250, 567], unit = "lbf" }             # twice is measured twice
    rotations = ["forward", "reverse"]                       # default: the machine's
    repeats = 1                                              # of every condition; default 1
    speed = { value = 7.66, unit = "km/h" }                  # default: the drum's
    speed_tolerance = { value = 1.0, unit = "km/h" }         # default: the drum's
    slip_angle_tolerance = { value = 0.5, unit = "deg" }
    load_tolerance = 0.05                                    # of the load
    repeat_tolerance = 0.03                                  # drift between repeats, of the largest value;
    settle_revolutions = 2.5                                 # default 0.03
    average_revolutions = 1.0
    revolutions_of = "tire"                                  # default; or "drum"
    acquisition = "after_settling"                           # or "continuous"
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

from toolkit.channels import ROTATIONS, Rotation
from toolkit.errors import ConfigError
from toolkit.files import check_keys, is_number, read_toml
from toolkit.machine.quantity import one_of, quantities, quantity

Acquisition = Literal["after_settling", "continuous"]
Shaft = Literal["tire", "drum"]

KEYS = (
    "schema source slip_angles loads rotations repeats speed speed_tolerance slip_angle_tolerance "
    "load_tolerance repeat_tolerance settle_revolutions average_revolutions revolutions_of acquisition"
).split()
_NEEDED = (
    "source slip_angles loads slip_angle_tolerance load_tolerance settle_revolutions average_revolutions "
    "acquisition"
).split()


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """The test plan that a test is checked against; loads [N], slip angles [rad] in their order.

    ``rotations`` ``speed_m_s`` ``speed_tolerance_m_s`` are None where the machine's own apply;
    ``settle_revolutions`` and ``average_revolutions`` count turns of the shaft ``revolutions_of``.
    """

    source: str
    slip_angles_rad: tuple[float, ...]
    loads_N: tuple[float, ...]
    slip_angle_tolerance_rad: float
    load_tolerance: float
    settle_revolutions: float
    average_revolutions: float
    acquisition: Acquisition
    revolutions_of: Shaft = "tire"
    repeat_tolerance: float = 0.03
    rotations: tuple[Rotation, ...] | None = None
    repeats: int = 1
    speed_m_s: float | None = None
    speed_tolerance_m_s: float | None = None

    def times(self, step_SA: float) -> int:
        """Return how often a slip angle step [rad] is measured at each load and direction."""
        return self.repeats * max(1, Counter(self.slip_angles_rad)[step_SA])


def read_protocol(path: Path) -> Protocol:
    """Read a protocol file.

    Raises
    ------
    ConfigError
        no file, not TOML, an unknown key, an entry that lacks or has a value that does not fit
    UnitError
        a unit is unknown or of another dimension
    """
    table = read_toml(path)
    check_keys(table, KEYS, where=path)
    if table.get("schema", 1) != 1:
        raise _wrong(path, "schema", table["schema"], "1")
    return build_protocol(table, path)


def build_protocol(table: dict[str, Any], where: Path) -> Protocol:
    """Return the protocol of a table whose keys are known; ``where`` is its file."""
    for key in _NEEDED:
        if key not in table:
            raise ConfigError(
                f"the protocol lacks {key!r}", where=where, got=", ".join(table) or "an empty table",
                expected=", ".join(_NEEDED),
                next_step="add it; the packaged m15.toml shows every entry", rule="missing-key",
            )  # fmt: skip
    given: dict[str, Any] = {"source": table["source"]}
    if not isinstance(given["source"], str) or not given["source"].strip():
        raise _wrong(where, "source", given["source"], "a text: where the protocol comes from")
    for key, field, dimension in (
        ("slip_angles", "slip_angles_rad", "angle"),
        ("loads", "loads_N", "force"),
    ):
        given[field] = quantities(table[key], dimension, f"{where}, {key}")
    if min(given["loads_N"]) <= 0 or len(set(given["loads_N"])) < len(given["loads_N"]):
        raise _wrong(where, "loads", table["loads"]["value"], "positive loads, each once")
    if max(abs(angle) for angle in given["slip_angles_rad"]) >= math.pi / 2:
        raise _wrong(where, "slip_angles", table["slip_angles"]["value"], "angles inside +-90 deg")
    for key, field, dimension in (
        ("slip_angle_tolerance", "slip_angle_tolerance_rad", "angle"),
        ("speed", "speed_m_s", "speed"),
        ("speed_tolerance", "speed_tolerance_m_s", "speed"),
    ):
        if key in table:
            given[field] = _positive(quantity(table[key], dimension, f"{where}, {key}"), key, where)
    for key in ("load_tolerance", "repeat_tolerance", "average_revolutions"):
        if key in table:
            given[key] = _positive(table[key], key, where)
    if "settle_revolutions" in table:
        given["settle_revolutions"] = _positive(
            table["settle_revolutions"], "settle_revolutions", where, zero=True
        )
    if "repeats" in table:
        repeats = table["repeats"]
        if isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1:
            raise _wrong(where, "repeats", repeats, "a whole number from 1")
        given["repeats"] = repeats
    if "revolutions_of" in table:
        given["revolutions_of"] = cast("Shaft", one_of(table["revolutions_of"], ("tire", "drum"), where))
    if "acquisition" in table:
        given["acquisition"] = cast(
            "Acquisition", one_of(table["acquisition"], ("after_settling", "continuous"), where)
        )
    if "rotations" in table:
        names = table["rotations"]
        if not isinstance(names, list) or not names or len(set(map(str, names))) < len(names):
            raise _wrong(where, "rotations", names, "forward, reverse or both, each once")
        given["rotations"] = tuple(cast("Rotation", one_of(name, ROTATIONS, where)) for name in names)
    return Protocol(**given)


def _positive(value: Any, key: str, where: Path, *, zero: bool = False) -> float:
    if not is_number(value) or value < 0 or (value == 0 and not zero):
        raise _wrong(where, key, value, "a number from 0" if zero else "a positive number")
    return float(value)


def _wrong(where: Path, key: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        f"{key!r} of the protocol has a value that does not fit", where=where, got=got, expected=expected,
        next_step="correct the line", rule="wrong-value",
    )  # fmt: skip
