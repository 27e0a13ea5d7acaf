"""Polarity: the signs that a record must have, whatever was there before it.

A sign can be wrong in two places: at an indication (a cell's wires) and at a load (the direction of the
reference). Each of them must be confirmed: by the machine definition, by an approved record of the same cell,
or by a reading of one load of known direction, applied apart from the session.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.calibration.registry.gates import GateResult
from toolkit.calibration.registry.response import largest_load, main_indications, response, tolerance
from toolkit.units import si_scale

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.session.polarity import PolarityReading
    from toolkit.calibration.session.table import Table
    from toolkit.machine.definition import Machine

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
    for one in record.loads if machine is not None else ():
        for cell in record.cells:
            stated = machine.cell(cell.name) if machine is not None else None
            sign = None if stated is None else stated.sign(one.load)
            if stated is None or sign is None or machine is None:
                continue
            sensitivity = response(record, one, cell)
            limit = (
                3 * sensitivity.u
                if sensitivity.extent is None
                else max(tolerance(one) / sensitivity.extent, 3 * sensitivity.u)
            )
            where = f"{one.load}, {cell.name}"
            statement = f"machine {machine.name} states a {_WORD[sign]} one ({stated.source})"
            if sensitivity.value * sign <= 0 or abs(sensitivity.value) <= limit:
                shown = "no sign of it shows" if abs(sensitivity.value) <= limit else f"it is {sensitivity}"
                message = f"the response has not the machine's sign: {shown}, {statement}"
                failed.append(GateResult(rule="polarity", where=where, message=message))
            else:
                pairs.add((one.load, cell.name))
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
            shown = {
                name
                for name in record.indications
                if abs(_predicted(record, reading, turned=name) - reading.value) > limit
            }
            indications |= shown
            evidence.append(
                f"polarity reading: {comparison}; it shows {', '.join(sorted(shown)) or 'no cell'}"
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
        units=dict(zip(record.indications, record.indication_units, strict=True)),
        tare={name: zero.get(name, 0.0) for name in record.indications} if zero else None,
        only=(reading.load,),
    )
    return float(applied[reading.load][0]) / si_scale(reading.unit)


def _in_rows(reading: PolarityReading, table: Table) -> bool:
    names, values = zip(*reading.indications, (reading.load, reading.value), strict=True)
    rows = table.matrix(names)
    scale = np.abs(rows).max(axis=0)
    return bool((np.abs(rows - np.array(values)) <= _EQUAL * scale).all(axis=1).any())
