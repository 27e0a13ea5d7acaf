"""Every gate that a record passes before it may be in force, in one place.

`judge` is pure: a record, what it is compared with, and what people stated. `calibrate` shows what it finds
as findings; an approval is blocked by what blocks or asks, and its ledger entry keeps the rest.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.calibration.fit.readings_findings import all_findings
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.gates import GateResult, check_loads, refusals
from toolkit.calibration.registry.history import (
    NO_HISTORY,
    History,
    Records,
    agreeing,
    compared,
    history_of,
    read_before,
)
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.plausible import coarse, plausible, tare_claim
from toolkit.calibration.registry.response import (
    largest_load,
    main_indications,
    response,
    same_dimension,
    tolerance,
)
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import stored_check, stored_loads, stored_session
from toolkit.calibration.session.readings import PolarityReading, polarity_readings
from toolkit.calibration.session.session_file import StatedEntries
from toolkit.calibration.session.statements import entries_of, statements_of
from toolkit.calibration.session.table import Table
from toolkit.declared import build
from toolkit.errors import ConfigError
from toolkit.files import check_keys, parse_toml, reads_as_number
from toolkit.inputs import SETTINGS_FILE, read_input
from toolkit.machine import load_machine, machine_names
from toolkit.machine.definition import Machine
from toolkit.units import si_scale

# Polarity: the signs that a record must have, whatever was there before it.


SMALLEST = 0.05  # of the largest load: what a reading must reach to tell a direction from a zero error
_EQUAL = 1e-9
_WORD = {1: "positive", -1: "negative"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmed:
    """What is confirmed: pairs (load, indication) by the machine, loads and indications by readings.

    ``evidence`` says by what, in words and numbers.
    """

    pairs: frozenset[tuple[str, str]]
    loads: frozenset[str]
    indications: frozenset[str]
    evidence: tuple[str, ...]


def machine_polarity(
    record: CalibrationRecord, machine: Machine | None
) -> tuple[tuple[GateResult, ...], Confirmed]:
    """Hold a record's responses against the signs that a machine definition states."""
    failed: list[GateResult] = []
    pairs: set[tuple[str, str]] = set()
    for fit in record.loads if machine is not None else ():
        for cell in record.cells:
            stated = machine.cell(cell.name) if machine is not None else None
            sign = None if stated is None else stated.sign(fit.load)
            if stated is None or sign is None or machine is None:
                continue
            sensitivity = response(record, fit, cell)
            limit = (
                3 * sensitivity.u
                if sensitivity.extent is None
                else max(tolerance(fit) / sensitivity.extent, 3 * sensitivity.u)
            )
            where = f"{fit.load}, {cell.name}"
            statement = f"machine {machine.name} states a {_WORD[sign]} one ({stated.source})"
            if sensitivity.value * sign <= 0 or abs(sensitivity.value) <= limit:
                size_text = (
                    "no sign of it shows" if abs(sensitivity.value) <= limit else f"it is {sensitivity}"
                )
                message = f"the response does not have the machine's sign: {size_text}, {statement}"
                failed.append(GateResult(rule="polarity", where=where, message=message))
            else:
                pairs.add((fit.load, cell.name))
    text = ", ".join(f"{load} {name}" for load, name in sorted(pairs))
    evidence = (
        (f"signs as machine {machine.name}, version {machine.version}, states them: {text}",)
        if machine and pairs
        else ()
    )
    return tuple(failed), Confirmed(
        pairs=frozenset(pairs), loads=frozenset(load for load, _ in pairs),
        indications=frozenset(name for _, name in pairs), evidence=evidence,
    )  # fmt: skip


def reading_polarity(
    record: CalibrationRecord, readings: Sequence[PolarityReading], tables: Sequence[Table]
) -> tuple[tuple[GateResult, ...], Confirmed]:
    """Hold a record's predictions against polarity readings; ``tables`` are the rows they must differ from.

    A reading confirms its load, and each indication whose reversal would have made it disagree.
    """
    failed: list[GateResult] = []
    loads: set[str] = set()
    indications: set[str] = set()
    evidence: list[str] = []
    for reading in readings:
        largest = largest_load(record.load(reading.load)) / si_scale(reading.unit)
        predicted = _predicted(record, reading)
        limit = reading.tolerance * abs(reading.value)
        unit = reading.unit
        comparison = f"{predicted:.5g} {unit} by the record where {reading.value:.5g} {unit} were applied"
        if abs(reading.value) < SMALLEST * largest:
            message = (
                f"a load of {abs(reading.value):.4g} {unit} is too small to tell a direction: at least "
                f"{SMALLEST * largest:.4g} {unit}"
            )
        elif any(_in_rows(reading, table) for table in tables):
            message = "the reading equals a row of the session: it must be one taken apart from it"
        elif predicted * reading.value < 0:
            message = f"the record has the wrong sign: {comparison}"
        elif abs(predicted - reading.value) > limit:
            message = (
                f"the record misses the reading by more than {100 * reading.tolerance:.3g} %: {comparison}"
            )
        else:
            loads.add(reading.load)
            signs = {
                name
                for name in record.indications
                if abs(_predicted(record, reading, turned=name) - reading.value) > limit
            }
            indications |= signs
            evidence.append(
                f"polarity reading of {reading.load}: {comparison}; it shows "
                f"{', '.join(sorted(signs)) or 'no cell'}"
            )
            continue
        failed.append(GateResult(rule="polarity-reading", where=reading.place, message=message))
    return tuple(failed), Confirmed(
        pairs=frozenset(), loads=frozenset(loads), indications=frozenset(indications),
        evidence=tuple(evidence),
    )  # fmt: skip


def unconfirmed(
    record: CalibrationRecord, *, loads: Collection[str], indications: Collection[str]
) -> tuple[GateResult, ...]:
    """Return what no history, machine or reading has confirmed: every load, and each main indication."""
    mains = dict.fromkeys(name for load in record.loads for name in main_indications(record, load))
    lacking = [f"load {load.load}" for load in record.loads if load.load not in loads]
    lacking += [f"indication {name}" for name in mains if name not in indications]
    if not lacking:
        return ()
    message = (
        f"nothing confirms the sign of {', '.join(lacking)}: an approval needs a reading of one load of "
        "known direction that moves it, applied apart from the session ([[polarity]] in SESSION.toml, or "
        "approve --polarity FILE), or a machine definition that states it (--machine)"
    )
    return (GateResult(rule="polarity-reading", where=record.instrument, message=message, effect="asks"),)


def _predicted(record: CalibrationRecord, reading: PolarityReading, turned: str = "") -> float:
    zero = dict(reading.zero)
    values = {}
    for name, value in reading.indications:
        at_zero = zero.get(name, 0.0)
        values[name] = np.array([2 * at_zero - value if name == turned else value])
    applied = apply_record(
        record,
        values,
        units=record.units,
        tare={name: zero.get(name, 0.0) for name in record.indications} if zero else None,
        only=(reading.load,),
    )
    return float(applied[reading.load][0]) / si_scale(reading.unit)


def _in_rows(reading: PolarityReading, table: Table) -> bool:
    names, values = zip(*reading.indications, (reading.load, reading.value), strict=True)
    rows = table.matrix(names)
    scale = np.abs(rows).max(axis=0)
    return bool((np.abs(rows - np.array(values)) <= _EQUAL * scale).all(axis=1).any())


_BY_MACHINE = re.compile(
    r"signs as machine (?P<name>.+), version (?P<version>.+), states them: (?P<pairs>.+)", re.DOTALL
)
_BY_READING = re.compile(
    r"polarity reading(?: of (?P<load>.+))?: (?P<predicted>\S+) (?P<unit>.+) by the record where "
    r"(?P<value>\S+) (?P=unit) were applied; it shows (?P<cells>.+)",
    re.DOTALL,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the evidence of an approval says of signs: by which machine (name, version), and by readings."""

    machine: tuple[str, str] | None
    stated: Confirmed
    read: Confirmed


def evidence_of(texts: Sequence[str], record: CalibrationRecord) -> Evidence:
    """Read the evidence of an approval back: the texts of `machine_polarity` and `reading_polarity`.

    A reading of earlier versions does not name its load: it is one of those in its unit.
    """
    machine: tuple[str, str] | None = None
    pairs: set[tuple[str, str]] = set()
    loads: set[str] = set()
    indications: set[str] = set()
    for text in texts:
        if match := _BY_MACHINE.fullmatch(text):
            machine = match["name"], match["version"]
            stated = (pair.rpartition(" ") for pair in match["pairs"].split(", "))
            pairs |= {(load, name) for load, _, name in stated}
        elif (match := _BY_READING.fullmatch(text)) and _agree(match["predicted"], match["value"]):
            loads |= {
                load.load for load in record.loads
                if match["load"] in (None, load.load) and same_dimension(load.unit, match["unit"])
            }  # fmt: skip
            indications |= {name for name in match["cells"].split(", ") if name in record.indications}
    stated_pairs = frozenset(pairs)
    return Evidence(
        machine=machine,
        stated=Confirmed(
            pairs=stated_pairs, loads=frozenset(load for load, _ in stated_pairs),
            indications=frozenset(name for _, name in stated_pairs), evidence=(),
        ),
        read=Confirmed(
            pairs=frozenset(), loads=frozenset(loads), indications=frozenset(indications), evidence=()
        ),
    )  # fmt: skip


def _agree(predicted: str, value: str) -> bool:
    return reads_as_number(predicted) and reads_as_number(value) and float(predicted) * float(value) > 0


def _joined(first: Confirmed, second: Confirmed) -> Confirmed:
    return Confirmed(
        pairs=first.pairs | second.pairs, loads=first.loads | second.loads,
        indications=first.indications | second.indications, evidence=(*first.evidence, *second.evidence),
    )  # fmt: skip


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
    evidence: Evidence | None = None,
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
    evidence : what an approval was shown of its signs, where it is judged again
    """
    readings = (*session_readings(record), *readings)
    tables = [table for table in (loads, check) if table is not None]
    by_machine, stated = machine_polarity(record, machine)
    by_reading, read = reading_polarity(record, readings, tables)
    if evidence is not None:
        stated, read = _joined(stated, evidence.stated), _joined(read, evidence.read)
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
    registry: Records,
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
    loads = stored_loads(registry.folder, record)
    judged = judge(
        record,
        history=history_of(registry, record, ledger, but=record.id),
        machine=machine,
        readings=readings,
        loads=loads,
        check=stored_check(registry.folder, record),
        reason=reason,
        confirmed_before=status.in_force_from is not None,
    )
    present = {(result.rule, result.where) for result in judged.results}
    of_session = [
        result
        for result in _refused_by_session(registry, record)
        if (result.rule, result.where) not in present
    ]
    again = () if loads is None else read_before(registry, record, loads, ledger, but=record.id)
    return replace(judged, results=(*judged.results, *of_session, *again))


def _refused_by_session(registry: Records, record: CalibrationRecord) -> tuple[GateResult, ...]:
    """Return what a record's own session refuses: findings that are errors, and an uncertainty too large.

    A legacy record has no session. What an approval was decided by is not asked again on every load: it costs
    the whole evaluation of a session.
    """
    if record.kind != "fit":
        return ()
    session = stored_session(registry.folder, record)
    return (
        *refusals(all_findings(fit_session(session), record)),
        *coarse(record, session.table, session.check),
    )


def _reasons(record: CalibrationRecord, reason: str | None) -> dict[str, str]:
    """Return why each cell was replaced: by its session, else by the approval."""
    entries = entries_of(record)
    stated = {name: entries.cell(name).replacement or reason for name in record.indications}
    return {name: text for name, text in stated.items() if text}


def session_readings(record: CalibrationRecord) -> tuple[PolarityReading, ...]:
    """Return the polarity readings that a record's session holds; a legacy record has none."""
    statements = statements_of(record)
    return polarity_readings(statements.entries.polarity, statements.scope)


def read_polarity_file(path: Path, record: CalibrationRecord) -> tuple[PolarityReading, ...]:
    """Read a file of polarity readings, tables [[polarity]], against a record's units.

    Raises
    ------
    ConfigError, UnitError
        not TOML, no reading, an entry that cannot be used
    """
    import dataclasses

    raw = parse_toml(read_input(path, SETTINGS_FILE), where=path)
    check_keys(raw, ("schema", "polarity"), where=path)
    stated = build(StatedEntries, raw, path).polarity
    scope = dataclasses.replace(statements_of(record).scope, where=path)
    readings = polarity_readings(stated, scope)
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
