"""What a session states beside its data, typed: reference standard, cells, zero and creep readings.

Everything here follows from the settings' canonical JSON, which a record holds and hashes: a certificate, a
budget or a chart of ten years ago is made from the record alone. Numbers were checked when the session was
read (`statement_checks`); units are those of the record's loads and indications.
"""

from __future__ import annotations

import datetime as dt
import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.session.readings import (
    CreepEntry,
    Scope,
    ZeroEntry,
    creep_entries,
    scope_of_entries,
    zero_entries,
)
from toolkit.calibration.session.session_file import BetweenRuns as BetweenEntries
from toolkit.calibration.session.session_file import (
    CellEntries,
    Stated,
    StatedEntries,
    Uncertainty,
    stated_entries,
)
from toolkit.calibration.session.session_file import Reference as ReferenceEntries
from toolkit.calibration.session.statement_checks import temperature_effect
from toolkit.units import unit

_NONE: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceUncertainty:
    """Of one load: expanded uncertainty ``U`` in the load's unit, with its coverage factor ``k``.

    ``relative`` is the expanded uncertainty as a share of the applied load, None where it was not stated so;
    ``U`` is then that at the largest load.
    """

    load: str
    U: float
    k: float
    relative: float | None = None

    @property
    def u(self) -> float:
        """Standard uncertainty in the load's unit; of a relative one, that at the largest load."""
        return self.U / self.k

    def u_at(self, value: Array) -> Array:
        """Return the standard uncertainty at applied loads; both in the load's unit, of one shape."""
        if self.relative is None:
            return np.full_like(value, self.u, dtype=np.float64)
        return np.asarray(np.abs(value) * (self.relative / self.k), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class BetweenRuns:
    """What one run cannot tell: standard deviations of the runs' ``zero`` and ``gain`` (at the largest load).

    Both in the load's unit, known from other sessions of the instrument, from its maker, or judged.
    """

    load: str
    zero: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DigitalSource:
    """The standard's digital certificate, from which its numbers were taken (`dcc.standard`).

    ``signer`` and ``signer_sha256`` name the certificate of its seal; ``places`` of each load the XPaths of
    U, of k and of the range in the file.
    """

    file: str
    sha256: str
    signer: str
    signer_sha256: str
    laboratory: str
    accreditation: str | None
    places: tuple[tuple[str, str, str, str], ...]

    def place(self, load: str) -> str | None:
        """Return where U and k of a load stand, from the result on; None where they were not taken."""
        for name, U, k, _ in self.places:
            if name == load:
                return f"{_from_result(U)} and {_from_result(k).rpartition('/')[2]}"
        return None


def _from_result(path: str) -> str:
    return path.partition("dcc:results/")[2] or path


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The reference standard. ``shared_group`` as written: which loads share its error (see `gls`)."""

    standard: str | None
    certificate: str | None
    due: dt.date | None
    shared_group: Any
    uncertainties: tuple[ReferenceUncertainty, ...]
    digital: DigitalSource | None = None

    def u(self, load: str) -> float | None:
        """Return the standard uncertainty of a load in its unit; None where none is stated.

        Of one that was stated as a share of the applied load, it is that at the largest load.
        """
        stated = self.of(load)
        return None if stated is None else stated.u

    def u_at(self, load: str, value: ArrayLike) -> Array | None:
        """Return the standard uncertainty at applied loads (any shape) in their unit; None: not stated."""
        stated = self.of(load)
        return None if stated is None else stated.u_at(np.asarray(value, dtype=np.float64))

    def of(self, load: str) -> ReferenceUncertainty | None:
        """Return what was stated of a load; None where nothing was."""
        return next((uncertainty for uncertainty in self.uncertainties if uncertainty.load == load), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellStatement:
    """One indication. ``resolution`` and ``u`` (standard) in its unit, as stated.

    ``found``: the resolution is not stated, it is the step that the readings show (`fit.rounding`).
    ``span_per_K`` [1/K] and ``zero_per_K`` [unit/K] are its temperature coefficients, None where not stated.
    ``column_unit`` is the unit of the stored data.
    """

    name: str
    unit: str
    serial: str | None
    resolution: float | None
    u: float | None
    column_unit: str
    span_per_K: float | None
    zero_per_K: float | None
    found: bool = False

    @property
    def stated_resolution(self) -> float | None:
        """The resolution where it is stated."""
        return None if self.found else self.resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class Statements:
    """``entries`` as written, and the ``scope`` that its readings are read against.

    ``preloads`` to the largest load before the first run (ISO 376); None where not stated.
    """

    date: dt.date
    temperature_C: float | None
    phase: str | None
    reference: Reference
    cells: tuple[CellStatement, ...]
    entries: StatedEntries
    scope: Scope
    certificate: Mapping[str, Any]
    preloads: int | None = None
    between_runs: tuple[BetweenRuns, ...] = ()

    @property
    def zero(self) -> tuple[ZeroEntry, ...]:
        """The readings of [[zero]]."""
        return zero_entries(self.entries.zero_readings, self.scope)

    @property
    def creep(self) -> tuple[CreepEntry, ...]:
        """The readings of [[creep]]."""
        return creep_entries(self.entries.creep, self.scope)

    def between(self, load: str) -> BetweenRuns | None:
        """Return what is stated of a load's differences between runs; None where nothing is."""
        return next((between_run for between_run in self.between_runs if between_run.load == load), None)

    def cell(self, name: str) -> CellStatement:
        """Return one indication's statement."""
        return next(cell for cell in self.cells if cell.name == name)


@functools.lru_cache(maxsize=8)
def statements_of(record: CalibrationRecord) -> Statements:
    """Return what a record's session stated; a legacy record has stated nothing."""
    return parse_statements(
        record.settings,
        indications=record.units,
        loads={load.load: load.unit for load in record.loads},
        largest={load.load: load.largest for load in record.loads},
        date=dt.date.fromisoformat(record.date),
        where=record.id,
        columns={cell.name: cell.column_unit or cell.unit for cell in record.cells},
        steps={cell.name: cell.step for cell in record.cells if cell.step is not None},
    )


def entries_of(record: CalibrationRecord) -> StatedEntries:
    """Return the entries of a record's session, as written."""
    return stated_entries(record.settings, record.id)


def parse_statements(
    settings: str,
    *,
    indications: Mapping[str, str],
    loads: Mapping[str, str],
    date: dt.date,
    where: object,
    columns: Mapping[str, str] | None = None,
    largest: Mapping[str, float],
    steps: Mapping[str, float] = _NONE,
) -> Statements:
    """Return the statements of a session's settings (JSON).

    ``indications`` and ``loads`` are name to unit of the fit, ``columns`` name to unit of the data where an
    indication was converted, ``largest`` name to the largest absolute load of the fit, ``steps`` name to the
    step of readings whose resolution is not stated.
    """
    entries, written = stated_entries(settings, where), json.loads(settings)
    scope = scope_of_entries(entries, columns=columns or indications, loads=loads, where=where)
    reference, temperature = entries.reference or ReferenceEntries(), entries.temperature
    stated = written.get("reference", {})
    return Statements(
        date=date,
        temperature_C=None
        if temperature is None
        else temperature.si("temperature", f"{where}: temperature") - 273.15,
        phase=entries.phase,
        reference=Reference(
            standard=reference.standard,
            certificate=reference.certificate,
            due=None if reference.due is None else dt.date.fromisoformat(reference.due),
            shared_group=stated.get("shared_group"),
            uncertainties=tuple(
                _reference(name, uncertainty, loads[name], largest[name])
                for name, uncertainty in reference.uncertainty
            ),
            digital=_digital(stated.get("dcc")),
        ),
        cells=tuple(
            _cell(name, text, entries.cell(name), scope, steps.get(name))
            for name, text in indications.items()
        ),
        entries=entries,
        scope=scope,
        certificate=written.get("certificate", {}),
        preloads=None if entries.standard is None else entries.standard.preloads,
        between_runs=tuple(_between(name, between, loads[name]) for name, between in entries.between_runs),
    )


def _digital(entry: Any) -> DigitalSource | None:
    if not isinstance(entry, Mapping):
        return None
    places = [(load, point["xpath"]) for load, point in entry["taken"].items()]
    return DigitalSource(
        file=entry["file"],
        sha256=entry["sha256"],
        signer=entry["signer"]["name"],
        signer_sha256=entry["signer"]["sha256"],
        laboratory=entry["laboratory"],
        accreditation=entry["accreditation"],
        places=tuple((load, path["U"], path["k"], "; ".join(path["range"])) for load, path in places),
    )


def _between(load: str, entry: BetweenEntries, text: str) -> BetweenRuns:
    factor = unit(entry.unit).factor / unit(text).factor
    return BetweenRuns(load=load, zero=entry.zero * factor, gain=entry.gain * factor)


def _reference(load: str, entry: Uncertainty, text: str, largest: float) -> ReferenceUncertainty:
    scale = unit(entry.unit)
    if scale.dimension == "ratio":
        relative = entry.U * scale.factor
        return ReferenceUncertainty(load=load, U=relative * largest, k=entry.k, relative=relative)
    return ReferenceUncertainty(load=load, U=entry.U * (scale.factor / unit(text).factor), k=entry.k)


def _cell(name: str, text: str, entries: CellEntries, scope: Scope, step: float | None) -> CellStatement:
    bridge, column = scope.bridges[name], scope.columns[name]

    def number(entry: Stated | None, key: str) -> float | None:
        if entry is None:
            return None
        return bridge.stated(entry, f"cells.{name}.{key}", column=column, target=text)

    resolution = number(entries.resolution, "resolution")
    span, zero = temperature_effect(entries, bridge, column, text)
    return CellStatement(
        name=name,
        unit=text,
        serial=entries.serial,
        resolution=step if resolution is None else resolution,
        found=resolution is None and step is not None,
        u=number(entries.u, "u"),
        column_unit=column,
        span_per_K=span,
        zero_per_K=zero,
    )
