"""Decisions about sessions and records: as data, carried out alike however made, and their answers."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

from toolkit.calibration.registry.approval import Decision
from toolkit.calibration.registry.candidate import Candidate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.status import RecordStatus
from toolkit.calibration.registry.verify import VerifiedRecord, verify_registry
from toolkit.declared.answers import entry_of
from toolkit.findings import FindingEntry
from toolkit.lab.answers import finding_lines
from toolkit.lab.records.registry_answer import RecordRow, record_row, void_day
from toolkit.listing import table


class VerifyRegistryAnswer(TypedDict):
    """Every record of a registry, refitted."""

    records: list[VerifiedRecord]


class ImportedRecord(RecordRow):
    """A legacy record and where it lies."""

    existing: Annotated[bool, "whether it was entered before, and nothing was written"]
    path: str


class ImportAnswer(TypedDict):
    """A legacy record, entered."""

    ok: bool
    verified: Annotated[bool, "always false: its data are not known"]
    record: ImportedRecord


class ApproveAnswer(TypedDict):
    """A decision on a candidate, and the gates that it failed."""

    id: str
    approved: bool
    in_force_from: Annotated[str | None, "first day in force"]
    findings: Annotated[list[FindingEntry], "failed gates"]
    unverifiable: Annotated[list[str], "terms that no check load verifies"]
    note: Annotated[str | None, "what the ledger notes of the dates"]
    evidence: Annotated[list[str], "what the gates were judged by"]
    recall: str | None
    signature: Annotated[str, "who signed, or unsigned"]
    head: Annotated[str, "of the ledger"]


class WithdrawAnswer(TypedDict):
    """A withdrawn record."""

    id: str
    status: str
    void_from: Annotated[str | None, "first void day; null where every day is void"]
    void_always: bool
    head: Annotated[str, "of the ledger"]


class DiscardAnswer(TypedDict):
    """A discarded candidate."""

    id: str
    status: str
    reason: str | None
    head: Annotated[str, "of the ledger"]


Kind = Literal["enter", "approve", "withdraw", "discard"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A decision and its options, as those of the commands: ``by`` who checked, withdraws or discards.

    ``record`` is the id of what is decided about; ``session`` the file that is entered.
    """

    action: Kind
    record: str = ""
    session: Path = Path("SESSION.toml")
    by: str = ""
    approved_by: str | None = None
    reason: str | None = None
    on: dt.date | None = None
    since: dt.date | None = None
    recall: str | None = None


def order_of(body: Mapping[str, Any], session: Path) -> Order:
    """Return the order whose decision a line of a ledger is: a request says by itself how it was made."""

    def day(key: str) -> dt.date | None:
        return dt.date.fromisoformat(body[key]) if body.get(key) else None

    return Order(
        action=body["action"], record=body["id"], session=session, by=body["by"],
        approved_by=body.get("approved_by"), reason=body.get("reason"), recall=body.get("recall"),
        on=day("known_on"), since=day("since"),
    )  # fmt: skip


def carry_out(registry: Registry, order: Order) -> Candidate | Decision | RecordStatus:
    """Make a decision: `calibrate`, `approve`, `withdraw` or `discard`.

    Raises
    ------
    ToolkitError
        as these do; nothing was changed
    Requested
        the registry writes a request in place of the decision
    """
    from toolkit.calibration.control.calibrate import calibrate
    from toolkit.calibration.registry.approval import approve, discard, withdraw

    if order.action == "enter":
        from toolkit.lab.signatures.sealing import standards_of

        return calibrate(order.session, registry, standards=standards_of(registry.folder.parent))
    if order.action == "approve":
        return approve(
            registry, order.record, in_force_from=order.since or dt.date.max, checked_by=order.by,
            approved_by=order.approved_by, reason=order.reason, known_on=order.on, recall=order.recall,
        )  # fmt: skip
    if order.action == "withdraw":
        return withdraw(
            registry, order.record, on=order.on or dt.date.max, void_from=order.since,
            reason=order.reason or "", by=order.by,
        )  # fmt: skip
    return discard(registry, order.record, reason=order.reason or "", by=order.by)


def verified_answer(registry: Registry, head: str | None) -> tuple[VerifyRegistryAnswer, str]:
    """Return what came of refitting every record, as JSON and text; ``head`` is an earlier ledger's hash."""
    rows = list(verify_registry(registry, head))
    cells = [
        [row.id, "ok" if row.ok else "NOT OK", "yes" if row.verified else "no", row.reason or ""]
        for row in rows
    ]
    text = table(["id", "result", "verified", "reason"], cells, align="<<<<")
    return {"records": rows}, text or "no records"


def import_answer(registry: Registry, file: Path, *, again: bool) -> tuple[ImportAnswer, str]:
    """Enter a legacy record; return it as JSON and as text."""
    from toolkit.calibration.registry.candidate import import_legacy

    record, existing = import_legacy(file, registry, again=again)
    entered: ImportedRecord = {
        **record_row(record, registry.status(record.id), registry.signature(record.id)),
        "existing": existing,
        "path": str(registry.folder / record.instrument / f"{record.id}.json"),
    }
    text = (
        f"{record.id}  unverified legacy import{'  (already entered)' if existing else ''}\n"
        f"sha256 {record.sha256}\nsignature: {entered['signature']}\n"
        f"next: toolkit calibration approve {record.id} --in-force-from DATE --checked-by NAME --reason TEXT"
    )
    return {"ok": True, "verified": False, "record": entered}, text


def approval_answer(
    registry: Registry, decision: Decision, in_force_from: dt.date
) -> tuple[ApproveAnswer, str]:
    """Return what became of an approval as JSON and as text."""
    signature = registry.signature(decision.id)
    payload = entry_of(
        ApproveAnswer, decision,
        approved=decision.done, in_force_from=in_force_from.isoformat(),
        recall=registry.status(decision.id).recall, signature=signature, head=_head(registry, decision.id),
    )  # fmt: skip
    outcome = f"approved, in force from {in_force_from}" if decision.done else "NOT approved"
    lines = [f"{decision.id}  {outcome}"]
    lines += ["failed gates:", *finding_lines(decision.findings)] if decision.findings else []
    lines += [f"note: {decision.note}"] if decision.note else []
    lines += ["evidence:", *(f"  {text}" for text in decision.evidence)] if decision.evidence else []
    if decision.unverifiable:
        lines += ["terms that the check loads cannot verify:", *(f"  {t}" for t in decision.unverifiable)]
    return payload, "\n".join([*lines, f"signature: {signature}"])


def withdrawal_answer(registry: Registry, record_id: str, status: RecordStatus) -> tuple[WithdrawAnswer, str]:
    """Return a withdrawn record as JSON and as text."""
    void = void_day(status)
    payload = entry_of(
        WithdrawAnswer, status,
        id=record_id, status=status.state, void_from=void, head=_head(registry, record_id),
    )  # fmt: skip
    return payload, f"{record_id}  withdrawn, void {'on every day' if status.void_always else f'from {void}'}"


def discarded_answer(registry: Registry, record_id: str, status: RecordStatus) -> tuple[DiscardAnswer, str]:
    """Return a discarded candidate as JSON and as text."""
    payload = entry_of(
        DiscardAnswer, status, id=record_id, status=status.state, head=_head(registry, record_id)
    )
    return payload, f"{record_id}  discarded: {status.reason}"


def _head(registry: Registry, record_id: str) -> str:
    from toolkit.calibration.registry.registry import instrument_of

    return registry.head(instrument_of(record_id))
