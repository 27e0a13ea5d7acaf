"""What a session states beside its data, typed: reference standard, cells, zero and creep readings.

Everything here follows from the settings' canonical JSON, which a record holds and hashes: a certificate, a
budget or a chart of ten years ago is made from the record alone. Numbers were checked when the session was
read (`statement_checks`); units are those of the record's loads and indications.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.calibration.session.statement_checks import stated
from toolkit.machine.definition import quantity
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceUncertainty:
    """Of one load: expanded uncertainty ``U`` in the load's unit, with its coverage factor ``k``."""

    load: str
    U: float
    k: float

    @property
    def u(self) -> float:
        """Standard uncertainty, in the load's unit."""
        return self.U / self.k


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The reference standard. ``shared_group`` as written: which loads share its error (see `gls`)."""

    standard: str | None
    certificate: str | None
    due: dt.date | None
    shared_group: Any
    uncertainties: tuple[ReferenceUncertainty, ...]

    def u(self, load: str) -> float | None:
        """Return the standard uncertainty of a load in its unit; None where none is stated."""
        return next((one.u for one in self.uncertainties if one.load == load), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellStatement:
    """One indication. ``resolution`` and ``u`` (standard) in its unit, ``excitation`` in V, as stated."""

    name: str
    unit: str
    serial: str | None
    resolution: float | None
    u: float | None
    excitation_V: float | None
    scale: Any
    shunt_expected: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Statements:
    """``zero`` and ``creep`` are the entries of [[zero]] and [[creep]] as written, in their order."""

    date: dt.date
    temperature_C: float | None
    phase: str | None
    reference: Reference
    cells: tuple[CellStatement, ...]
    zero: tuple[Mapping[str, Any], ...]
    creep: tuple[Mapping[str, Any], ...]
    certificate: Mapping[str, Any]

    def cell(self, name: str) -> CellStatement:
        """Return one indication's statement."""
        return next(one for one in self.cells if one.name == name)


def statements_of(record: CalibrationRecord) -> Statements:
    """Return what a record's session stated; a legacy record has stated nothing."""
    units = dict(zip(record.indications, record.indication_units, strict=True))
    return parse_statements(
        json.loads(record.settings),
        indications=units,
        loads={one.load: one.unit for one in record.loads},
        date=dt.date.fromisoformat(record.date),
        where=record.id,
    )


def parse_statements(
    settings: Mapping[str, Any],
    *,
    indications: Mapping[str, str],
    loads: Mapping[str, str],
    date: dt.date,
    where: object,
) -> Statements:
    """Return the statements of a session's settings; ``indications`` and ``loads`` name to unit."""
    entry = settings.get("reference", {})
    due = entry.get("due")
    cells = settings.get("cells", {})
    temperature = settings.get("temperature")
    zero, creep = settings.get("zero", []), settings.get("creep", [])
    return Statements(
        date=date,
        temperature_C=None
        if temperature is None
        else quantity(temperature, "temperature", f"{where}: temperature") - 273.15,
        phase=settings.get("phase"),
        reference=Reference(
            standard=entry.get("standard"),
            certificate=entry.get("certificate"),
            due=None if due is None else dt.date.fromisoformat(str(due)),
            shared_group=entry.get("shared_group"),
            uncertainties=tuple(
                _reference(name, one, loads[name]) for name, one in entry.get("uncertainty", {}).items()
            ),
        ),
        cells=tuple(_cell(name, text, cells.get(name, {}), where) for name, text in indications.items()),
        zero=tuple(zero) if isinstance(zero, list) else (),
        creep=tuple(creep) if isinstance(creep, list) else (),
        certificate=settings.get("certificate", {}),
    )


def _reference(load: str, entry: Mapping[str, Any], text: str) -> ReferenceUncertainty:
    factor = unit(str(entry["unit"])).factor / unit(text).factor
    return ReferenceUncertainty(load=load, U=float(entry["U"]) * factor, k=float(entry["k"]))


def _cell(name: str, text: str, entry: Mapping[str, Any], where: object) -> CellStatement:
    def number(key: str, in_unit: str) -> float | None:
        return stated(entry[key], in_unit, f"cells.{name}.{key}", where) if key in entry else None

    return CellStatement(
        name=name,
        unit=text,
        serial=None if entry.get("serial") is None else str(entry["serial"]),
        resolution=number("resolution", text),
        u=number("u", text),
        excitation_V=number("excitation", "V"),
        scale=entry.get("scale"),
        shunt_expected=entry.get("shunt_expected"),
    )
