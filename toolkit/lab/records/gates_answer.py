"""What every gate of an approval says about a record: passed, failed, asked for, or not judged and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, TypedDict

from toolkit.calibration.control.as_found import AsFoundLoad
from toolkit.declared.answers import entry_of
from toolkit.listing import or_dash, table

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry


class Gate(TypedDict):
    """A gate of an approval."""

    rule: str
    state: Annotated[str, "fail, asks, note, pass, not judged"]
    where: str
    message: str


class JudgedMachine(TypedDict):
    """A machine definition."""

    name: str
    version: int


class Judged(TypedDict):
    """What an approval meets today."""

    id: str
    compared_with: Annotated[str | None, "the last approved record"]
    blocked: bool
    gates: list[Gate]
    evidence: Annotated[list[str], "of its signs"]
    machine: Annotated[JudgedMachine | None, "definition that states its signs"]


class Response(TypedDict):
    """The response of a load to an indication."""

    load: str
    indication: str
    unit: str
    value: Annotated[float, "in SI"]
    u: Annotated[float | None, "standard uncertainty"]
    before: Annotated[float | None, "that of the last approved record"]
    unit_before: str | None
    change_percent: float | None


class Responses(TypedDict):
    """Responses in SI beside those of the last approved record."""

    record: str
    before: str | None
    responses: list[Response]


class Found(TypedDict):
    """As found."""

    phase: Annotated[str | None, "as_found or as_left, where the session states it"]
    session: Annotated[str | None, "record of the session that was judged"]
    record: Annotated[str | None, "in force before it"]
    within: bool | None
    reason: Annotated[str | None, "why nothing could be compared"]
    loads: Sequence[AsFoundLoad]


class FullRecord(TypedDict):
    """What stands beside a record on its page."""

    judged: Judged
    responses: Responses
    as_found: Found | None


_HISTORY, _MACHINE, _CHECK = "an earlier approved record", "a machine definition", "check loads"
_SESSION = "a session"
GATES: dict[str, str | None] = {
    "sign": _HISTORY,
    "span": _HISTORY,
    "serial": _HISTORY,
    "replacement": _HISTORY,
    "readings-again": _HISTORY,
    "layout-changed": _HISTORY,
    "unit-changed": _HISTORY,
    "polarity": _MACHINE,
    "lever": _MACHINE,
    "polarity-reading": None,
    "range": None,
    "bridge-range": None,
    "tared": None,
    "check-tolerance": None,
    "check-load": _CHECK,
    "coarse-uncertainty": _SESSION,
}
"""The rules that `judgement.judge` may name, and what each needs to say anything; None: nothing besides.

Findings of the record's own session are gates too where their rule declares that it refuses an approval.
"""

_STATES = {"blocks": "fail", "asks": "asks", "tells": "note"}


def gates_answer(registry: Registry, record_id: str) -> Judged:
    """Return the gates of a record as an approval meets them today, and by what its signs are confirmed.

    ``state`` of a gate: ``fail``, ``asks``, ``note``, ``pass``; ``not judged`` where something is missing.

    Raises
    ------
    RecordError, RegistryError
        the record, or one that it is compared with, fails a gate of its loading
    """
    from toolkit.calibration.registry.history import history_of
    from toolkit.calibration.registry.judgement import judge_stored, machine_of
    from toolkit.calibration.registry.stored import stored_check
    from toolkit.lab.rules import rules_catalogue

    record = registry.load(record_id)
    ledger = registry.ledger(record.instrument)
    machine = machine_of(record.instrument)
    judged = judge_stored(registry, record, ledger, machine=machine)
    before = history_of(registry, record, ledger, but=record.id).last
    present = {
        _HISTORY: before is not None,
        _MACHINE: machine is not None,
        _CHECK: stored_check(registry.folder, record) is not None,
        _SESSION: record.kind == "fit",
    }
    gates = [entry_of(Gate, result, state=_STATES[result.effect]) for result in judged.results]
    judged_rules = {result.rule for result in judged.results}
    of_session = {rule: _SESSION for rule, entry in rules_catalogue().items() if "refuses" in entry}
    for rule, need in {**of_session, **GATES}.items():
        if rule not in judged_rules:
            judgeable = need is None or present[need]
            state, message = ("pass", "") if judgeable else ("not judged", f"it needs {need}")
            gates.append({"rule": rule, "state": state, "where": "", "message": message})
    return {
        "id": record_id,
        "compared_with": None if before is None else before.id,
        "blocked": bool(judged.failed),
        "gates": gates,
        "evidence": list(judged.evidence),
        "machine": None if machine is None else {"name": machine.name, "version": machine.version},
    }


def as_found_answer(registry: Registry, record_id: str) -> Found:
    """Return what the record in force before a session makes of the session's rows: as found, load by load.

    ``phase`` is what the session states: as_found, as_left, or None.

    Raises
    ------
    RecordError, RegistryError
        a record fails a gate of its loading
    """
    from toolkit.calibration.control.as_found import as_found, as_found_before, phase_of

    record = registry.load(record_id)
    phase = phase_of(record)
    result = as_found_before(registry, record) if phase == "as_left" else as_found(registry, record)
    if result is None:
        return {"phase": phase, "session": None, "record": None, "loads": [], "within": None,
                "reason": "no as-found session belongs to this as-left one"}  # fmt: skip
    return entry_of(Found, result, phase=phase, session=result.session_record)


def responses_answer(registry: Registry, record_id: str) -> Responses:
    """Return each load's response to each indication in SI, beside that of the last approved record.

    The responses are those that the gates of sign and span compare.

    Raises
    ------
    RecordError, RegistryError
        a record fails a gate of its loading
    """
    from toolkit.calibration.registry.history import history_of
    from toolkit.calibration.registry.response import range_of, response

    record = registry.load(record_id)
    before = history_of(registry, record, registry.ledger(record.instrument), but=record.id).last
    rows: list[Response] = []
    for load in record.loads:
        old_load = None if before is None else next((o for o in before.loads if o.load == load.load), None)
        for cell in record.cells:
            old_cell = (
                None if before is None else next((c for c in before.cells if c.name == cell.name), None)
            )
            # Both over one range, as the gates do: of a curve the secant depends on it.
            over = range_of(cell)
            new = response(record, load, cell, over)
            old = None
            if before is not None and old_load is not None and old_cell is not None:
                old = response(before, old_load, old_cell, over)
            change = None
            if old is not None and old.per == new.per and old.value != 0:
                change = 100 * (new.value - old.value) / abs(old.value)
            rows.append(
                {
                    "load": load.load, "indication": cell.name, "unit": new.per,
                    "value": new.value, "u": new.u, "before": None if old is None else old.value,
                    "unit_before": None if old is None else old.per, "change_percent": change,
                }
            )  # fmt: skip
    return {"record": record_id, "before": None if before is None else before.id, "responses": rows}


def full_record(registry: Registry, record_id: str) -> tuple[FullRecord, str]:
    """Return the gates, the responses and as found of a record, as JSON and as text.

    Raises
    ------
    RecordError, RegistryError
        a record fails a gate of its loading
    """
    judged, compared = gates_answer(registry, record_id), responses_answer(registry, record_id)
    found = as_found_answer(registry, record_id) if registry.load(record_id).kind == "fit" else None
    rows = [[gate["state"], gate["rule"], gate["where"], gate["message"]] for gate in judged["gates"]]
    responses = [
        [row["load"], row["indication"], or_dash(row["value"], ".6g"), or_dash(row["before"], ".6g"),
         row["unit"], or_dash(row["change_percent"], ".6g")]
        for row in compared["responses"]
    ]  # fmt: skip
    errors = [
        [row.load, or_dash(row.max_error, ".6g"), or_dash(row.tolerance, ".6g"), row.unit,
         "within" if row.within else "OUT"]
        for row in (found["loads"] if found else ())
    ]  # fmt: skip
    before = compared["before"] or "-"
    text = "\n".join([
        table(["gate", "rule", "where", "message"], rows, align="<<<<"), "",
        table(["load", "indication", record_id, before, "unit", "change %"], responses, align="<<>><>"),
        *(["", table(["as found", "largest error", "tolerance", "unit", ""], errors, align="<>><<")]
          if errors else []),
    ])  # fmt: skip
    return {"judged": judged, "responses": compared, "as_found": found}, text
