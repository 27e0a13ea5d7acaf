"""Read a machine definition (TOML) into a frozen `Machine`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

from toolkit.channels import AXES, ROTATIONS, Axes, Rotation
from toolkit.errors import ConfigError
from toolkit.files import check_keys, is_number, read_toml
from toolkit.machine.correction import Correction, read_corrections
from toolkit.machine.polarity import CellPolarity, read_polarity, read_rated_loads
from toolkit.machine.protocol import KEYS as PROTOCOL_KEYS
from toolkit.machine.protocol import Protocol, build_protocol
from toolkit.machine.quantity import one_of, quantity
from toolkit.units import si_scale, unit

__all__ = [
    "CellPolarity",
    "Column",
    "Correction",
    "Drum",
    "Machine",
    "Protocol",
    "Role",
    "TypeB",
    "load_machine",
    "machine_names",
    "quantity",
]

Role = Literal["load", "indication", "slip_angle", "acquired", "time", "angle", "covariate"]

_PACKAGED = Path(__file__).parent
_KEYS = (
    "schema name extends title kind axes rotations column drum cell cells rated_load protocol type_b "
    "indication_unit sample_rate version supersedes correction"
).split()


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the machine's own files: ``header`` as written there, ``unit`` as meant there."""

    symbol: str
    header: str
    unit: str
    role: Role


@dataclass(frozen=True, slots=True, kw_only=True)
class Drum:
    """The road: circumference [m], surface speed and its tolerance [m/s]."""

    surface: str
    circumference_m: float
    speed_m_s: float
    speed_tolerance_m_s: float

    @property
    def radius_m(self) -> float:
        """Radius of the drum [m]."""
        return self.circumference_m / (2 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeB:
    """A stated standard uncertainty: ``u`` [SI] and ``relative`` of the value, and its source.

    ``common`` says who draws it: one error of the ``machine``, the same in all its tests, or another one in
    each ``test``. ``effect`` is that of a condition which is not measured in a force: the relative change
    of a force for a relative change of the condition.
    """

    symbol: str
    u: float
    relative: float
    source: str
    common: Literal["machine", "test"] = "test"
    effect: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """A tire test machine as data.

    ``version`` counts its definitions; ``supersedes`` is the SHA-256 of the file that this one was made from,
    and ``corrections`` what the reduction of every test on it puts right. ``cells`` are the signs that its
    load cells must have, ``rated_loads`` pairs of a load and its rated value [N, N*m].
    """

    name: str
    title: str
    simulated: bool
    axes: Axes
    rotations: tuple[Rotation, ...]
    columns: tuple[Column, ...]
    drum: Drum
    cell_pitch_diameter_m: float
    overturning_lever_m: tuple[tuple[str, float], ...]
    protocol: Protocol
    type_b: tuple[TypeB, ...]
    sample_rate_Hz: float | None = None
    version: int = 1
    supersedes: str | None = None
    corrections: tuple[Correction, ...] = ()
    cells: tuple[CellPolarity, ...] = ()
    rated_loads: tuple[tuple[str, float], ...] = ()

    @property
    def indications(self) -> tuple[Column, ...]:
        """The load cells' columns, in file order."""
        return tuple(column for column in self.columns if column.role == "indication")

    def cell(self, name: str) -> CellPolarity | None:
        """Return the stated signs of a cell; None where the definition states none."""
        return next((one for one in self.cells if one.name == name), None)

    def column(self, symbol: str) -> Column:
        """Return the column of a symbol; KeyError where the machine has none."""
        for column in self.columns:
            if column.symbol == symbol:
                return column
        raise KeyError(symbol)

    def stated_uncertainty(self, symbol: str) -> TypeB:
        """Return the stated uncertainty of a channel, zero where none is stated."""
        for stated in self.type_b:
            if stated.symbol == symbol:
                return stated
        return TypeB(symbol=symbol, u=0.0, relative=0.0, source="not stated")


def machine_names() -> tuple[str, ...]:
    """Return the names of the packaged machines."""
    return tuple(sorted(path.stem for path in _PACKAGED.glob("*.toml")))


@lru_cache(maxsize=32)
def load_machine(name_or_path: str) -> Machine:
    """Return a packaged machine by name, or one from a .toml file by path.

    Raises
    ------
    ConfigError
        unknown name, unknown key, missing entry, a unit of the wrong dimension

    Examples
    --------
    >>> m15 = load_machine("m15")
    >>> [column.symbol for column in m15.columns]
    ['FZ', 'D52', 'D51', 'E5', 'SA', 'FY', 'MZ']
    >>> round(m15.drum.radius_m, 3)
    1.353
    """
    path = machine_file(name_or_path)
    if not path.is_file():
        raise ConfigError(
            f"unknown machine {name_or_path!r}",
            where=path if name_or_path.endswith(".toml") else None,
            got=name_or_path,
            expected=", ".join(machine_names()),
            next_step="name one of those, or give the path of a machine definition (.toml)",
            rule="unknown-machine",
        )
    return _build(_merged(path), path)


def machine_file(name_or_path: str) -> Path:
    """Return the file of a packaged machine, or the path of a .toml that was given."""
    return Path(name_or_path) if name_or_path.endswith(".toml") else _PACKAGED / f"{name_or_path}.toml"


def build_machine(table: dict[str, Any], path: Path) -> Machine:
    """Return the machine of a parsed definition; ``path`` names it in messages, errors as `load_machine`."""
    return _build(_extended(table, path), path)


def _merged(path: Path) -> dict[str, Any]:
    return _extended(read_toml(path), path)


def _extended(table: dict[str, Any], path: Path) -> dict[str, Any]:
    check_keys(table, _KEYS, where=path)
    if "extends" in table:
        base = _merged(_PACKAGED / f"{table.pop('extends')}.toml")
        stated = table.get("type_b", {})
        if isinstance(stated, dict):  # one new figure must not silently drop the others
            stated = {**base.get("type_b", {}), **stated}
        table = {**base, **table, "type_b": stated}
    return table


def _build(table: dict[str, Any], path: Path) -> Machine:
    check_keys(table.get("type_b", {}), list(_STATED), where=f"{path}: type_b")
    try:
        indication_unit = table.get("indication_unit")
        columns = tuple(
            Column(
                symbol=entry["symbol"],
                header=entry["header"],
                unit=unit(
                    indication_unit if indication_unit and entry["role"] == "indication" else entry["unit"],
                    where=path,
                ).text,
                role=entry["role"],
            )
            for entry in table["column"]
        )
        drum, cells = table["drum"], table["cells"]
        return Machine(
            name=table["name"],
            title=table["title"],
            simulated=one_of(table["kind"], ("real", "simulated"), path) == "simulated",
            axes=cast("Axes", one_of(table["axes"], AXES, path)),
            rotations=tuple(cast("Rotation", one_of(r, ROTATIONS, path)) for r in table["rotations"]),
            columns=columns,
            drum=Drum(
                surface=drum["surface"],
                circumference_m=quantity(drum["circumference"], "length", path),
                speed_m_s=quantity(drum["speed"], "speed", path),
                speed_tolerance_m_s=quantity(drum["speed_tolerance"], "speed", path),
            ),
            cell_pitch_diameter_m=quantity(cells["pitch_diameter"], "length", path),
            overturning_lever_m=tuple((k, float(v)) for k, v in cells["overturning_lever"].items()),
            protocol=_protocol(table["protocol"], path),
            type_b=tuple(_type_b(symbol, entry, path) for symbol, entry in table.get("type_b", {}).items()),
            sample_rate_Hz=quantity(table["sample_rate"], "frequency", path)
            if "sample_rate" in table
            else None,
            version=_version(table.get("version", 1), path),
            supersedes=table.get("supersedes"),
            corrections=read_corrections(table.get("correction", []), f"{path}: correction"),
            cells=read_polarity(
                table.get("cell", []),
                [one.symbol for one in columns if one.role == "indication"],
                f"{path}: cell",
            ),
            rated_loads=read_rated_loads(table.get("rated_load", {}), f"{path}: rated_load"),
        )
    except KeyError as error:
        raise ConfigError(
            "a machine definition lacks an entry",
            where=path,
            got="nothing",
            expected=error.args[0],
            next_step="add it; the packaged m15.toml shows every entry",
        ) from error


def _version(value: object, path: Path) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ConfigError(
            "a machine definition's version is no whole number", where=f"{path}: version", got=value,
            expected="1, 2, 3, ...", next_step="correct it", rule="wrong-value",
        )  # fmt: skip
    return value


def _protocol(entry: object, path: Path) -> Protocol:
    if not isinstance(entry, dict):
        raise ConfigError(
            "the protocol of a machine definition is no table", where=path, got=entry, expected="[protocol]",
            next_step="write the protocol into the definition; a test may name a file", rule="wrong-value",
        )  # fmt: skip
    check_keys(entry, PROTOCOL_KEYS, where=f"{path}: protocol")
    return build_protocol(entry, path)


# What may be stated, and with which of u and relative: what is not used is not accepted either.
_STATED = {
    "FZ": ("u", "relative"),
    "zero": ("relative",),
    "SA": ("u",),
    "SA_scale": ("relative",),
    "P": ("u", "relative", "effect"),
}


def _type_b(symbol: str, entry: dict[str, Any], where: Path) -> TypeB:
    here = f"{where}: type_b.{symbol}"
    check_keys(entry, (*_STATED[symbol], "unit", "source", "common"), where=here)
    for key in ("u", "relative", "effect"):
        value = entry.get(key, 0.0)
        if not is_number(value) or (value < 0 and key != "effect"):
            raise ConfigError(
                f"a stated uncertainty has a wrong {key!r}", where=here, got=value,
                expected="a number" if key == "effect" else "a number from 0",
                next_step="correct it", rule="wrong-value",
            )  # fmt: skip
    u = float(entry.get("u", 0.0)) * (si_scale(entry["unit"], where=where) if "unit" in entry else 1.0)
    return TypeB(
        symbol=symbol,
        u=u,
        relative=float(entry.get("relative", 0.0)),
        source=entry["source"],
        common=cast(
            "Literal['machine', 'test']", one_of(entry.get("common", "test"), ("machine", "test"), here)
        ),
        effect=float(entry.get("effect", 0.0)),
    )
