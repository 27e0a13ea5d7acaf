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
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.session.indications import bridge_of, bridges_of
from toolkit.calibration.session.readings import Scope
from toolkit.calibration.session.settings import preloads_of, quantity, zero_readings
from toolkit.calibration.session.statement_checks import temperature_effect
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from toolkit.calibration.records.record import CalibrationRecord


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

    def u_at(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
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

    def u_at(self, load: str, value: ArrayLike) -> NDArray[np.float64] | None:
        """Return the standard uncertainty at applied loads (any shape) in their unit; None: not stated."""
        stated = self.of(load)
        return None if stated is None else stated.u_at(np.asarray(value, dtype=np.float64))

    def of(self, load: str) -> ReferenceUncertainty | None:
        """Return what was stated of a load; None where nothing was."""
        return next((uncertainty for uncertainty in self.uncertainties if uncertainty.load == load), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellStatement:
    """One indication. ``resolution`` and ``u`` (standard) in its unit, as stated.

    ``found``: the resolution is not stated, it is the step that the readings show (`fit.reading_steps`).
    ``span_per_K`` [1/K] and ``zero_per_K`` [unit/K] are its temperature coefficients, None where not stated.
    ``column_unit`` is the unit of the stored data, and of bare numbers in ``scale``.
    """

    name: str
    unit: str
    serial: str | None
    resolution: float | None
    u: float | None
    scale: Any
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
    """``zero`` and ``creep`` are the entries of [[zero]] and [[creep]] as written, in their order.

    ``preloads`` to the largest load before the first run (ISO 376); None where not stated.
    """

    date: dt.date
    temperature_C: float | None
    phase: str | None
    reference: Reference
    cells: tuple[CellStatement, ...]
    zero: tuple[Mapping[str, Any], ...]
    creep: tuple[Mapping[str, Any], ...]
    certificate: Mapping[str, Any]
    preloads: int | None = None
    between_runs: tuple[BetweenRuns, ...] = ()

    def between(self, load: str) -> BetweenRuns | None:
        """Return what is stated of a load's differences between runs; None where nothing is."""
        return next((between_run for between_run in self.between_runs if between_run.load == load), None)

    def cell(self, name: str) -> CellStatement:
        """Return one indication's statement."""
        return next(cell for cell in self.cells if cell.name == name)


def statements_of(record: CalibrationRecord) -> Statements:
    """Return what a record's session stated; a legacy record has stated nothing."""
    units = dict(zip(record.indications, record.indication_units, strict=True))
    columns = {cell.name: cell.column_unit or cell.unit for cell in record.cells}
    return parse_statements(
        json.loads(record.settings),
        indications=units,
        loads={load.load: load.unit for load in record.loads},
        largest={load.load: load.largest for load in record.loads},
        date=dt.date.fromisoformat(record.date),
        where=record.id,
        columns=columns,
        steps={cell.name: cell.step for cell in record.cells if cell.step is not None},
    )


def scope_of(record: CalibrationRecord) -> Scope:
    """Return what the zero, shunt and creep entries of a record's settings are read against."""
    cells = json.loads(record.settings).get("cells", {})
    return Scope(
        bridges=bridges_of(cells, record.indications, where=record.id),
        columns={cell.name: cell.column_unit or cell.unit for cell in record.cells},
        loads={load.load: load.unit for load in record.loads},
        where=record.id,
    )


def parse_statements(
    settings: Mapping[str, Any],
    *,
    indications: Mapping[str, str],
    loads: Mapping[str, str],
    date: dt.date,
    where: object,
    columns: Mapping[str, str] | None = None,
    largest: Mapping[str, float],
    steps: Mapping[str, float] = _NONE,
) -> Statements:
    """Return the statements of a session's settings.

    ``indications`` and ``loads`` are name to unit of the fit, ``columns`` name to unit of the data where an
    indication was converted, ``largest`` name to the largest absolute load of the fit, ``steps`` name to the
    step of readings whose resolution is not stated.
    """
    entry = settings.get("reference", {})
    due = entry.get("due")
    cells = settings.get("cells", {})
    temperature = settings.get("temperature")
    zero, creep = zero_readings(settings), settings.get("creep", [])
    return Statements(
        date=date,
        temperature_C=None
        if temperature is None
        else quantity(temperature, "temperature", f"{where}: temperature") - 273.15,
        phase=settings.get("phase"),
        reference=Reference(
            standard=None if "standard" not in entry else str(entry["standard"]),
            certificate=None if "certificate" not in entry else str(entry["certificate"]),
            due=None if due is None else dt.date.fromisoformat(str(due)),
            shared_group=entry.get("shared_group"),
            uncertainties=tuple(
                _reference(name, one, loads[name], largest[name])
                for name, one in entry.get("uncertainty", {}).items()
            ),
            digital=_digital(entry.get("dcc")),
        ),
        cells=tuple(
            _cell(name, text, (columns or indications)[name], cells.get(name, {}), where, steps.get(name))
            for name, text in indications.items()
        ),
        zero=tuple(zero) if isinstance(zero, list) else (),
        creep=tuple(creep) if isinstance(creep, list) else (),
        certificate=settings.get("certificate", {}),
        preloads=preloads_of(settings, where),
        between_runs=tuple(
            _between(name, between_run, loads[name])
            for name, between_run in settings.get("between_runs", {}).items()
        ),
    )


def _digital(entry: Any) -> DigitalSource | None:
    if not isinstance(entry, Mapping):
        return None
    places = [(load, taken["xpath"]) for load, taken in entry["taken"].items()]
    return DigitalSource(
        file=entry["file"],
        sha256=entry["sha256"],
        signer=entry["signer"]["name"],
        signer_sha256=entry["signer"]["sha256"],
        laboratory=entry["laboratory"],
        accreditation=entry["accreditation"],
        places=tuple((load, path["U"], path["k"], "; ".join(path["range"])) for load, path in places),
    )


def _between(load: str, entry: Mapping[str, Any], text: str) -> BetweenRuns:
    factor = unit(str(entry["unit"])).factor / unit(text).factor
    return BetweenRuns(load=load, zero=float(entry["zero"]) * factor, gain=float(entry["gain"]) * factor)


def _reference(load: str, entry: Mapping[str, Any], text: str, largest: float) -> ReferenceUncertainty:
    U, k, found = float(entry["U"]), float(entry["k"]), unit(str(entry["unit"]))
    if found.dimension == "ratio":
        relative = U * found.factor
        return ReferenceUncertainty(load=load, U=relative * largest, k=k, relative=relative)
    return ReferenceUncertainty(load=load, U=U * (found.factor / unit(text).factor), k=k)


def _cell(
    name: str, text: str, column: str, entry: Mapping[str, Any], where: object, step: float | None
) -> CellStatement:
    bridge = bridge_of(name, entry, where=where)

    def number(key: str) -> float | None:
        if key not in entry:
            return None
        return bridge.stated(entry[key], f"cells.{name}.{key}", column=column, target=text)

    resolution = number("resolution")
    span, zero = temperature_effect(entry.get("temperature_coefficient"), bridge, column, text)
    return CellStatement(
        name=name,
        unit=text,
        serial=None if entry.get("serial") is None else str(entry["serial"]),
        resolution=step if resolution is None else resolution,
        found=resolution is None and step is not None,
        u=number("u"),
        scale=entry.get("scale"),
        column_unit=column,
        span_per_K=span,
        zero_per_K=zero,
    )
