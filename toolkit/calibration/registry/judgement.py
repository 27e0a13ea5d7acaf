"""Every gate that a record passes before it may be in force, in one place.

`judge` is pure: a record, what it is compared with, and what people stated. `calibrate` shows what it finds
as findings; an approval is blocked by what blocks or asks, and its ledger entry keeps the rest.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.calibration.registry.gates import GateResult, check_loads
from toolkit.calibration.registry.history import NO_HISTORY, History, agreeing, compared, history_of
from toolkit.calibration.registry.plausible import plausible, tare_claim
from toolkit.calibration.registry.polarity import machine_polarity, reading_polarity, unconfirmed
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import stored_check, stored_loads
from toolkit.calibration.session.polarity import PolarityReading, polarity_readings
from toolkit.calibration.session.statements import scope_of, statements_of
from toolkit.errors import ConfigError
from toolkit.files import check_keys, parse_toml, read_bytes
from toolkit.machine import load_machine, machine_names

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.ledger import Ledger
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.session.table import Table
    from toolkit.machine.definition import Machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What the gates say, and ``evidence``: by what the signs are confirmed, in words."""

    results: tuple[GateResult, ...]
    evidence: tuple[str, ...]

    @property
    def failed(self) -> tuple[GateResult, ...]:
        """What keeps the record from being approved."""
        return tuple(result for result in self.results if result.effect != "tells")

    @property
    def told(self) -> tuple[GateResult, ...]:
        """What does not, and is written down with the approval."""
        return tuple(result for result in self.results if result.effect == "tells")


def judge(
    record: CalibrationRecord,
    *,
    history: History = NO_HISTORY,
    machine: Machine | None = None,
    readings: Sequence[PolarityReading] = (),
    loads: Table | None = None,
    check: Table | None = None,
    reason: str | None = None,
    confirmed_before: bool = False,
) -> Judgement:
    """Return what every gate says about a record.

    Parameters
    ----------
    history : the approved records that its cells are compared with
    machine : the definition of the machine that the instrument belongs to
    readings : polarity readings beside those of its session
    loads, check : its reference loads and check loads, in its own units
    reason : why cells were replaced, where the session does not say it
    confirmed_before : the record was approved once, so that its signs need no other confirmation
    """
    readings = (*session_readings(record), *readings)
    tables = [table for table in (loads, check) if table is not None]
    by_machine, stated = machine_polarity(record, machine)
    by_reading, read = reading_polarity(record, readings, tables)
    # A wire turns an indication in every load: where load and indication are confirmed, their pair is.
    confirmed = {
        (load, name) for load in stated.loads | read.loads for name in stated.indications | read.indications
    }
    results = [
        *compared(record, history, confirmed=confirmed, reasons=_reasons(record, reason)),
        *by_machine,
        *by_reading,
        *plausible(record, history.last, machine),
    ]
    if not confirmed_before:
        # What has the wrong sign by one of them is not asked for: it is answered.
        pairs = {
            *agreeing(record, history, results), *stated.pairs,
            *(tuple(result.where.split(", ")) for result in results if result.rule in ("sign", "polarity")),
        }  # fmt: skip
        results += unconfirmed(
            record,
            loads={*(load for load, _ in pairs), *read.loads},
            indications={*(name for _, name in pairs), *read.indications},
        )
    if loads is not None:
        u = statements_of(record).reference
        results += tare_claim(record, tables, u_reference=[u.u(load.load) for load in record.loads])
    if check is not None:
        results += check_loads(record, check)
    return Judgement(results=tuple(results), evidence=(*stated.evidence, *read.evidence))


def judge_stored(
    registry: Registry,
    record: CalibrationRecord,
    ledger: Ledger,
    *,
    machine: Machine | None = None,
    readings: Sequence[PolarityReading] = (),
    reason: str | None = None,
) -> Judgement:
    """Return what every gate says about a record of the registry, with its stored data and its history.

    Raises
    ------
    RecordError
        a record that it is compared with fails a gate
    """
    status = status_of(record.id, ledger.of(record.id), dt.date.max)
    return judge(
        record,
        history=history_of(registry, record, ledger, but=record.id),
        machine=machine,
        readings=readings,
        loads=stored_loads(registry.folder, record),
        check=stored_check(registry.folder, record),
        reason=reason,
        confirmed_before=status.in_force_from is not None,
    )


def _reasons(record: CalibrationRecord, reason: str | None) -> dict[str, str]:
    """Return why each cell was replaced: by its session, else by the approval."""
    cells: Mapping[str, Mapping[str, object]] = json.loads(record.settings).get("cells", {})
    stated = {name: cells.get(name, {}).get("replacement") or reason for name in record.indications}
    return {name: str(text) for name, text in stated.items() if text}


def session_readings(record: CalibrationRecord) -> tuple[PolarityReading, ...]:
    """Return the polarity readings that a record's session holds; a legacy record has none."""
    entries = json.loads(record.settings).get("polarity", []) if record.kind == "fit" else []
    return polarity_readings(entries, scope_of(record)) if entries else ()


def read_polarity_file(path: Path, record: CalibrationRecord) -> tuple[PolarityReading, ...]:
    """Read a file of polarity readings, tables [[polarity]], against a record's units.

    Raises
    ------
    ConfigError, UnitError
        not TOML, no reading, an entry that cannot be used
    """
    import dataclasses

    raw = parse_toml(read_bytes(path), where=path)
    check_keys(raw, ("schema", "polarity"), where=path)
    readings = polarity_readings(raw.get("polarity", []), dataclasses.replace(scope_of(record), where=path))
    if not readings:
        raise ConfigError(
            "a file of polarity readings has none", where=path, got="no [[polarity]]",
            expected="[[polarity]] with load, value and indications", next_step="write the reading",
            rule="session",
        )  # fmt: skip
    return readings


def machine_of(instrument: str, name_or_path: str | None = None) -> Machine | None:
    """Return the machine definition of an instrument: the one that is named, else the packaged one.

    Raises
    ------
    ConfigError
        the definition cannot be read, or is that of another machine
    """
    if name_or_path is None:
        return load_machine(instrument) if instrument in machine_names() else None
    machine = load_machine(name_or_path)
    if machine.name != instrument:
        raise ConfigError(
            "the machine definition is not that of the instrument", where=name_or_path, got=machine.name,
            expected=instrument, rule="unknown-machine",
            next_step="name the definition of the machine that the instrument belongs to",
        )  # fmt: skip
    return machine
