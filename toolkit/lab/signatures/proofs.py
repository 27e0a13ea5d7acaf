"""The ledger's proof that a document carries, and what the ledger of a home says of it.

A document's entry of the ledger names it and the hashes of its files. Who signed the entry is proved by the
home's own ledger, whose every line is held against the people of its time; without one the proof stands
alone, and its signer is nobody that is known here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from toolkit.calibration.records.use import UNSIGNED
from toolkit.calibration.registry.witnessed import ORIGIN, witnessed
from toolkit.days import parse_day
from toolkit.errors import ToolkitError
from toolkit.files import parse_json, sha256_bytes
from toolkit.trust.anchor import COMPACT, Anchor, compare, parse_anchor, parse_compact
from toolkit.trust.seal.check import Signature

if TYPE_CHECKING:
    from toolkit.calibration.registry.ledger import Entry
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.status import RecordStatus

CERTIFICATE = "certificate"
"""First word of the name of a document about a record itself; any other reports a test."""
TESTED = "tested"
"""Key of the day of the test, in the entry of a report and in its manifest."""
PROOF = "toolkit.json"
"""Name of the JSON document in an issued PDF: its records, its ledger's proof, the files issued with it."""

MANIFEST = "manifest"
"""In it, the hash of what the manifest beside the PDF says."""
_BESIDE_WHAT_IT_SAYS = ("outputs", "ledger")
"""Of a manifest: the files, whose hashes are proved one by one, and the proof itself."""

Continuity = Literal["continues", "forked", "rolled_back", "unknown"]
_NO_LEDGER = "no ledger here knows its records"


def anchor_in(data: bytes, *, where: object = None) -> Anchor | None:
    """Return the proof in a PDF, a digital certificate, a manifest, or a text of its own; None without one.

    Raises
    ------
    TrustError
        ``anchor``, ``checkpoint``: what stands there is none; ``unreadable-document``
    """
    text: str | None
    if data.startswith(b"%PDF-"):
        from toolkit.trust.seal.pdf import carried_by

        text = carried_by(data).get(PROOF, b"").decode(errors="replace")
    elif data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<":
        from toolkit.trust.seal.xml import proof_in

        text = proof_in(data)
    else:
        text = data.decode(errors="replace")
    return None if not text else _anchor(text, where)


def _anchor(text: str, where: object) -> Anchor | None:
    if text.startswith(COMPACT):
        return parse_compact(text, where=where)
    try:
        document = parse_json(text)
    except (ValueError, RecursionError):
        return None
    entries = document.get("ledger", document) if isinstance(document, dict) else None
    if not isinstance(entries, dict) or "checkpoint" not in entries:
        return None
    return parse_anchor(entries, where=where)


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A record that a document names, with its hash; ``file``: that of the bytes, of a record's own file.

    ``report``: the document reports a test, on the day ``tested``; None where it does not say on which.
    """

    record: str
    sha256: str
    file: str | None = None
    report: bool = False
    tested: date | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LedgerState:
    """What a ledger says of a document: whether it continues it, and whether its records still hold.

    ``signature``, ``issued_by`` and ``issued_at`` are those of the document's entry; ``unsigned`` and None
    where it has none. ``decided_by``: who signed the decisions that its record rests on. ``changed``: why a
    record's file is not the one that was entered, None where it is. ``untold``: whether its record still
    holds cannot be told, because the document does not say the day of its test.
    """

    ledger: Continuity = "unknown"
    still_holds: bool | None = None
    why: str = _NO_LEDGER
    signature: Signature = "unsigned"
    issued_by: str | None = None
    issued_at: str | None = None
    decided_by: str | None = None
    changed: str | None = None
    untold: bool = False


Ledger = Callable[[Sequence[Named], Anchor | None], LedgerState]
"""Asked with the records that a document names, and with the proof that it carries."""


def entry_of(anchor: Anchor) -> Mapping[str, Any]:
    """Return the entry of a proof as JSON values; empty where the proof holds its hash alone."""
    try:
        body = parse_json(anchor.line or "{}")
    except (ValueError, RecursionError):
        return {}
    return body if isinstance(body, dict) else {}


def hashes_of(anchor: Anchor) -> Mapping[str, str]:
    """Return the hashes that the entry of an issued document holds of its files, by name."""
    document = _document_of(anchor)
    return {n: str(value) for n, value in document.items() if n not in ("name", "content", TESTED)}


def statements_hash(manifest: Mapping[str, Any]) -> str:
    """Return the SHA-256 of what a manifest says beside the files that it lists and its proof."""
    said = {name: value for name, value in manifest.items() if name not in _BESIDE_WHAT_IT_SAYS}
    return sha256_bytes(json.dumps(said, sort_keys=True, separators=(",", ":")).encode())


def day_of_test(anchor: Anchor | None, stated: object = None) -> date | None:
    """Return the day of the test that a report's entry has, else the one ``stated`` beside; None without."""
    return _day(stated if anchor is None else _document_of(anchor).get(TESTED, stated))


def _document_of(anchor: Anchor) -> Mapping[str, Any]:
    document = entry_of(anchor).get("document")
    return document if isinstance(document, dict) else {}


def _day(stated: object) -> date | None:
    try:
        return parse_day(stated) if isinstance(stated, str) else None
    except ValueError:
        return None


def reports_test(document: object) -> bool:
    """Tell by a document's name whether it reports a test: then its record must hold on that test's day."""
    return str(document).partition(" ")[0] != CERTIFICATE


def no_ledger(_names: Sequence[Named], anchor: Anchor | None) -> LedgerState:
    """Return what is known of a document where there is no ledger: what its proof says of itself."""
    if anchor is None:
        return LedgerState()
    signed = bool(entry_of(anchor).get("signatures"))
    why = "who signed its entry is not known here" if signed else _NO_LEDGER
    return LedgerState(signature="untrusted" if signed else "unsigned", why=why)


def registry_ledger(open_registry: Callable[[], Registry | None]) -> Ledger:
    """Return what a registry says of documents: whether it continues their proof, and their records hold.

    It is opened when a document names a record or carries a proof.
    """

    def ask(names: Sequence[Named], anchor: Anchor | None) -> LedgerState:
        registry = open_registry()
        if registry is None:
            return no_ledger(names, anchor)
        states = []
        if anchor is not None:
            states.append(_continuity(registry, anchor, names))
            if states[0].ledger == "continues" and states[0].still_holds is None:
                names = names or _named_by(registry, anchor)
        states += [_standing(registry, name) for name in names]
        return _joined(states, no_ledger(names, anchor))

    return ask


def _named_by(registry: Registry, anchor: Anchor) -> tuple[Named, ...]:
    """Return the record that an entry of a sound ledger here is about: a code on a page names none itself."""
    instrument = anchor.checkpoint.origin.removeprefix(ORIGIN)
    if instrument not in registry.instruments():
        return ()
    ledger = registry.ledger(instrument)
    entry = ledger.entries[anchor.index]
    document = entry.document or {}
    record = Named(
        record=entry.id, sha256=str(ledger.entered()[entry.id].record),
        report=entry.document is not None and reports_test(document.get("name")),
        tested=_day(document.get(TESTED)),
    )  # fmt: skip
    return (record,)


def _joined(states: Sequence[LedgerState], nothing: LedgerState) -> LedgerState:
    held = [state for state in states if state.still_holds is not None or state.untold]
    known = [state for state in states if state in held or state.ledger != "unknown"]
    if not known:
        return nothing
    proof = next((state for state in known if state.ledger != "unknown"), nothing)
    worst = min(held, key=lambda state: (state.still_holds is not False, not state.untold), default=None)
    whys = [state.why for state in (proof, worst) if state is not None and state in known]
    return LedgerState(
        ledger=proof.ledger,
        still_holds=None if worst is None else worst.still_holds,
        why="; ".join(dict.fromkeys(whys)),
        signature=proof.signature,
        issued_by=proof.issued_by,
        issued_at=proof.issued_at,
        decided_by=None if worst is None else worst.decided_by,
        changed=next((state.changed for state in held if state.changed is not None), None),
        untold=worst is not None and worst.untold,
    )


def _continuity(registry: Registry, anchor: Anchor, names: Sequence[Named]) -> LedgerState:
    """Return how a registry's ledger stands to a proof, and who signed the entry where it has it.

    Two laboratories may call an instrument alike. Where no entry holds a record that the document names, that
    is said too: whoever removed entries and whoever never made them leave the same ledger.
    """
    instrument = anchor.checkpoint.origin.removeprefix(ORIGIN)
    if instrument not in ledgers_of(registry):
        return LedgerState()
    lines = raw_lines(registry, instrument)
    comparison = compare(lines, anchor.checkpoint, anchor)
    if comparison.continuity != "continues":
        why = f"the ledger of {instrument}: {comparison.why}"
        if names and not any(name.sha256 in line for line in lines for name in names):
            why += (
                f", or the document is of another laboratory's {instrument}: no entry here holds its record"
            )
        return LedgerState(ledger=comparison.continuity, still_holds=False, why=why)
    damage = damage_of(registry, instrument)
    if damage is not None:
        why = f"the ledger of {instrument} is damaged: {damage}"
        return LedgerState(ledger="continues", still_holds=False, why=why)
    if instrument not in registry.instruments():
        why = f"entry {anchor.index + 1} of the log of people"
        return LedgerState(ledger="continues", why=why, signature="valid")
    ledger = registry.ledger(instrument)
    return _signed(registry, ledger.entries[anchor.index], ledger.void)


def damage_of(registry: Registry, instrument: str) -> str | None:
    """Return why a ledger does not hold by itself, whatever a document says of it; None where it does.

    Raises
    ------
    TrustError
        ``people-log``: the log of people is damaged
    """
    if instrument not in registry.instruments():
        registry.people()  # every version of it is proved
        return None
    return registry.ledger(instrument).damage


def _signed(registry: Registry, entry: Entry, void: frozenset[int]) -> LedgerState:
    """Return the entry's signature: every line of a sound ledger is what its people signed."""
    from toolkit.calibration.registry.signatures import names_of

    why = f"entry {entry.seq} of the ledger"
    if not entry.signatures:
        return LedgerState(ledger="continues", why=f"{why}, unsigned", issued_at=entry.time)
    names = names_of(entry, registry.people().history)
    if entry.seq in void:
        why = f"{why} is signed by a key of {names} that was revoked from before that time on"
        return LedgerState(ledger="continues", still_holds=False, why=why, signature="untrusted")
    return LedgerState(
        ledger="continues", why=f"{why}, signed by {names}", signature="valid", issued_by=names,
        issued_at=entry.time,
    )  # fmt: skip


def ledgers_of(registry: Registry) -> tuple[str, ...]:
    """Return the names of what can be witnessed and proved: the instruments, and the log of people."""
    from toolkit.calibration.registry.people_log import place_of

    people = place_of(registry.folder)
    instruments = registry.instruments()
    # Where an instrument is called so, it has the name: documents of it were issued under it.
    return (*instruments, *([people.name] if people.is_dir() and people.name not in instruments else []))


def raw_lines(registry: Registry, instrument: str) -> list[str]:
    """Return the lines of a ledger as they stand, whole or damaged: a proof tells where it was changed."""
    from toolkit.calibration.registry.ledger import LEDGER
    from toolkit.calibration.registry.lock import content
    from toolkit.calibration.registry.people_log import place_of

    own = instrument in registry.instruments() or instrument not in ledgers_of(registry)
    folder = registry.folder / instrument if own else place_of(registry.folder)
    data = content(folder / LEDGER) or b""
    return [line.decode(errors="replace") for line in data.split(b"\n") if line]


def ledger_file_state(path: Path) -> LedgerState:
    """Return what is true of a ledger's file: whether its lines hold, and what witnesses signed of it.

    Raises
    ------
    RegistryError
        it is damaged, or a line of it is no decision of the laboratory's people
    TrustError
        ``people-log``; a witness's checkpoint cannot be read
    """
    from toolkit.calibration.registry.people_log import FOLDER
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.settled import damaged

    folder = path.absolute().parent
    of_people = folder.name == FOLDER and (folder / f"{FOLDER}-1.toml").is_file()
    registry = Registry(folder.parent / "calibrations" if of_people else folder.parent)
    continuity, compared = _witnessed(registry, folder.name)
    if continuity not in ("continues", "unknown"):
        # What was cut off or rewritten is told as that, not as damage: its own chain may be in order.
        return LedgerState(ledger=continuity, signature="untrusted", still_holds=False, why=compared)
    signature: Signature = "valid"
    if of_people:
        why, doubt = f"{len(registry.people().history.versions)} versions, each signed", None
    else:
        ledger = registry.ledger(folder.name)
        if ledger.damage is not None:
            raise damaged(folder, ledger.damage)
        doubt = ledger.doubt
        signed = sum(bool(entry.signatures) for entry in ledger.entries)
        why = f"{len(ledger.entries)} entries, {signed} of them signed by people who were enrolled then"
        signature = "valid" if signed and registry.people().history.now else "unsigned"
    return LedgerState(
        ledger=continuity, signature=signature, still_holds=None if doubt is None else False,
        why="; ".join(filter(None, (doubt, why, compared))),
    )  # fmt: skip


def _witnessed(registry: Registry, name: str) -> tuple[Continuity, str]:
    """Return how a ledger stands to what witnesses have signed of it, and by which files that is known."""
    continuity: Continuity = "unknown"
    whys = []
    for file, comparison in witnessed(registry.folder, name, lambda: raw_lines(registry, name)):
        continuity = comparison.continuity
        whys.append(f"{file}: {comparison.why}")
        if continuity != "continues":
            break
    return continuity, "; ".join(whys)


def _not_entered(registry: Registry, record_id: str, digest: str) -> str | None:
    """Return why a file is not the one that the ledger's entry of a record holds the hash of."""
    from toolkit.calibration.registry.registry import instrument_of

    ledger = registry.ledger(instrument_of(record_id))
    entry = None if ledger.damage is not None else ledger.entered().get(record_id)
    entered = None if entry is None else entry.file
    if entered is None or entered == digest:
        return None
    return (
        f"it is not the file of {record_id} that was entered: the SHA-256 of its bytes is {digest[:12]}, "
        f"the ledger holds {entered[:12]}"
    )


def _standing(registry: Registry, name: Named) -> LedgerState:
    from toolkit.calibration.registry.registry import instrument_of

    try:
        if name.record not in registry.ids(instrument_of(name.record)):
            return LedgerState()
    except ToolkitError:
        return LedgerState()  # no name of a record
    # Asked before the record is loaded: what here fails to load may be the file that is asked about.
    if name.file is not None and (changed := _not_entered(registry, name.record, name.file)) is not None:
        return LedgerState(still_holds=False, why=changed, changed=changed)
    try:
        record = registry.load(name.record)
        status, signed = registry.status(name.record), registry.signature(name.record)
    except ToolkitError as error:
        return LedgerState(
            still_holds=False, why=f"record {name.record} fails here: {error.what}: {error.got}"
        )
    decided_by = None if signed == UNSIGNED else signed
    if record.sha256 != name.sha256:
        return LedgerState(still_holds=False, why=f"record {name.record} here is another one")
    reason = f": {status.reason}" if status.reason else ""
    if name.report and not status.void_always:
        return _on_its_day(registry, name, status, decided_by)
    if status.ended:
        why = f"record {name.record} was {status.state} since{reason}"
        return LedgerState(still_holds=False, why=why, decided_by=decided_by)
    return LedgerState(still_holds=True, why=f"record {name.record} is {status.state}", decided_by=decided_by)


def _on_its_day(registry: Registry, name: Named, status: RecordStatus, decided_by: str | None) -> LedgerState:
    """Return whether a report's record is the one in force on the day of its test, by the rule of audits."""
    from toolkit.calibration.registry.registry import instrument_of
    from toolkit.calibration.registry.standing import out_of_force

    ended = f"{status.state} since, void from {status.void_from}: {status.reason}" if status.ended else ""
    if name.tested is None:
        why = f"whether record {name.record} is the one in force on the day of the test cannot be told: " + (
            "the document does not state that day"
        )
        return LedgerState(
            untold=True, why=f"{why}; the record was {ended}" if ended else why, decided_by=decided_by
        )
    when = f"in force on {name.tested.isoformat()}, the day of the test"
    objection = out_of_force(registry, instrument_of(name.record), name.record, on=name.tested)
    if objection is not None:
        why = f"record {name.record} is not {when}: {objection}"
        return LedgerState(still_holds=False, why=why, decided_by=decided_by)
    why = f"record {name.record} is {when}" + (f", and was {ended}" if ended else "")
    return LedgerState(still_holds=True, why=why, decided_by=decided_by)
