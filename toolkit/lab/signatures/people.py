"""The people of a laboratory: enrol, change, revoke; and the ledger as documents and witnesses know it."""

from __future__ import annotations

import json
import re
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NotRequired, TypedDict

from toolkit.calibration.registry.people_log import PeopleLog, enrol
from toolkit.calibration.registry.witnessed import ORIGIN
from toolkit.errors import RegistryError, ToolkitError, TrustError
from toolkit.files import write_atomic
from toolkit.inputs import PDF_FILE, read_regular
from toolkit.lab.signatures.proofs import anchor_in, damage_of, ledgers_of, raw_lines
from toolkit.publication import check_file
from toolkit.trust.anchor import Comparison, anchor_of, compare
from toolkit.trust.checkpoint import SUFFIX, Checkpoint, countersign, parse_checkpoint, place, remembered
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import leaf_hash, root_of
from toolkit.trust.people import MEANINGS, RECOVERY, Action, Demand, Key, People, Person, Role
from toolkit.trust.ssh import parse_public

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry


EnrolledPerson = TypedDict(
    "EnrolledPerson",
    {
        "id": Annotated[str, "of the person"],
        "name": str,
        "roles": list[str],
        "key": Annotated[str, "fingerprint"],
        "from": Annotated[str, "first moment at which it signs"],
        "until": Annotated[str | None, "moment from which it signs nothing"],
    },
)
EnrolledPerson.__doc__ = "A key of a person, and from when until when it signs."


class PolicyDemand(TypedDict):
    """Whose signatures a decision takes."""

    roles: list[str]
    signatures: Annotated[int, "of different people"]


class PeopleAnswer(TypedDict):
    """Who is enrolled, and whose signatures decisions take."""

    people: Annotated[list[EnrolledPerson], "a row for each key"]
    versions: Annotated[int, "of the list of people"]
    since: NotRequired[Annotated[str, "moment from which this version holds"]]
    policy: NotRequired[Annotated[Mapping[str, PolicyDemand], "by action"]]


class CheckLedgerAnswer(TypedDict):
    """Whether today's ledger continues that of an earlier document."""

    instrument: str
    ledger: Annotated[str, "continues, forked, rolled_back or unknown"]
    why: str
    time_stamp: NotRequired[Annotated[str, "moment of the document's time stamp"]]
    time_stamp_by: NotRequired[Annotated[str | None, "who stamped it"]]
    time_stamp_state: NotRequired[str]


class ProofAnswer(TypedDict):
    """An entry of a ledger, with the proof that it is there."""

    line: Annotated[str, "the entry as it stands in the ledger"]
    index: Annotated[int, "its place, from 0"]
    path: Annotated[list[str], "hashes from the entry to the root, base64"]
    checkpoint: Annotated[str, "name, size and root of the ledger, with the signatures of it"]
    time_stamp: NotRequired[Annotated[str, "RFC 3161 token of the checkpoint, base64"]]


class WitnessAnswer(TypedDict):
    """A ledger that a second place has countersigned."""

    instrument: str
    size: Annotated[int, "entries"]
    before: Annotated[int, "entries that it had signed before"]
    checkpoint: str


_HEAD = re.compile(r"\b[0-9a-f]{64}\b")


def enrol_person(
    registry: Registry, person_id: str, *, name: str, roles: Sequence[Role], key: Path, reason: str,
    recovery: Signer | None = None, by: str | None = None,
) -> PeopleLog:  # fmt: skip
    """Enrol a person, or add a key to one; the first enrolment is signed by two heads.

    ``recovery`` is a second head's key, printed and kept apart, for a laboratory with one head. ``by`` is who
    decides; default: the first whose key signs.

    Raises
    ------
    TrustError
        the key is refused, or the signers may not enrol; nothing is changed
    """
    log = registry.people()
    since = registry.now()
    public = parse_public(_text(key), where=key)
    people = log.history.now.people.person if log.history.now is not None else ()
    enrolled = next((person for person in people if person.id == person_id), None)
    person = Person(
        id=person_id, name=name, roles=tuple(roles),
        keys=(*(enrolled.keys if enrolled is not None else ()), Key(key=public.line, since=since)),
    )  # fmt: skip
    if log.history.now is not None:
        changed = log.history.now.people.with_person(person)
        return _enter(registry, changed, registry.signers, reason, by)
    first = [person]
    signers = list(registry.signers)
    if recovery is not None:
        keys = (Key(key=recovery.public.line, since=since),)
        first.append(Person(id=RECOVERY, name="Recovery key", roles=("head",), keys=keys))
        signers.append(recovery)
    return _enter(registry, People(person=tuple(first)), signers, reason, by)


def revoke_key(
    registry: Registry, person_id: str, *, fingerprint: str | None, since: str, reason: str,
    by: str | None = None,
) -> PeopleLog:  # fmt: skip
    """End a person's key, or all of them, from a time on; what it signed before holds.

    Raises
    ------
    TrustError
        ``person``: nobody of that id, or no such key; or the signers may not
    """
    version = registry.people().history.now
    person = None if version is None else version.people.of(person_id)
    if version is None or person is None:
        raise _nobody(person_id, () if version is None else [p.id for p in version.people.person])
    chosen = [
        key for key in person.keys if fingerprint in (None, key.public.fingerprint) and key.until is None
    ]
    if not chosen:
        raise _nobody(fingerprint or person_id, [key.public.fingerprint for key in person.keys])
    keys = tuple(replace(key, until=max(since, key.since)) if key in chosen else key for key in person.keys)
    people = version.people.with_person(replace(person, keys=keys))
    return _enter(registry, people, registry.signers, reason, by)


def set_demand(
    registry: Registry, action: Action, *, roles: Sequence[Role], signatures: int, reason: str,
    by: str | None = None,
) -> PeopleLog:  # fmt: skip
    """Say whose signatures a decision takes from now on, and how many.

    Raises
    ------
    TrustError
        ``person``: nobody is enrolled; or the signers may not
    ConfigError
        roles or number cannot be, or nobody could make the decision
    """
    version = registry.people().history.now
    if version is None:
        raise _nobody(action, ())
    demand = Demand(roles=tuple(dict.fromkeys(roles)), signatures=signatures)
    policy = replace(version.people.policy, **{"import_" if action == "import" else action: demand})
    return _enter(registry, replace(version.people, policy=policy), registry.signers, reason, by)


def people_answer(log: PeopleLog) -> tuple[PeopleAnswer, str]:
    """Return who is enrolled, as a payload and for people."""
    from toolkit.listing import table

    version = log.history.now
    if version is None:
        return {"people": [], "versions": 0}, "nobody is enrolled: decisions are unsigned"
    keys = [(person, key) for person in version.people.person for key in person.keys]
    rows: list[EnrolledPerson] = [
        {
            "id": person.id, "name": person.name, "roles": list(person.roles), "key": key.public.fingerprint,
            "from": key.since, "until": key.until,
        }
        for person, key in keys
    ]  # fmt: skip
    cells = [
        [person.id, person.name, ", ".join(person.roles), key.public.fingerprint, key.since, key.until or ""]
        for person, key in keys
    ]
    demands = {action: version.people.policy.demand(action) for action in MEANINGS}
    payload: PeopleAnswer = {
        "people": rows, "versions": len(log.history.versions), "since": version.since,
        "policy": {
            action: {"roles": list(demand.roles), "signatures": demand.signatures}
            for action, demand in demands.items()
        },
    }  # fmt: skip
    takes = [[action, str(d.signatures), " or ".join(d.roles)] for action, d in demands.items()]
    text = table(["id", "name", "roles", "key", "from", "until"], cells, align="<<<<<<")
    return payload, text + "\n\n" + table(["to", "takes", "of"], takes, align="<><")


def checkpoint_of(registry: Registry, instrument: str, signers: Sequence[Signer] | None = None) -> Checkpoint:
    """Return the checkpoint of an instrument's ledger as it stands, signed by ``signers``: the keys at hand.

    Raises
    ------
    TrustError
        ``weak-key``: a key that is not Ed25519; ``not-allowed``: one of nobody who is enrolled
    """
    texts = lines_of(registry, instrument)
    root = root_of([leaf_hash(text.encode()) for text in texts])
    checkpoint = Checkpoint(origin=f"{ORIGIN}{instrument}", size=len(texts), root=root)
    version = registry.people().history.now
    for signer in registry.signers if signers is None else signers:
        person = None if version is None else version.people.owner(signer.public)
        if person is None:
            raise TrustError(
                "a checkpoint is signed by people who are enrolled", where=instrument,
                got=signer.public.fingerprint, expected="the key of a person: toolkit person list",
                next_step="enrol the person first", rule="not-allowed",
            )  # fmt: skip
        checkpoint = checkpoint.signed(person.id, signer)
    return checkpoint


def anchor_document(registry: Registry, instrument: str, seq: int | None, checkpoint: Checkpoint) -> str:
    """Return the JSON that a document carries: a line (from 1; default: the last) and its proof.

    Raises
    ------
    RegistryError
        ``missing``: the ledger has no such line; the ledger is damaged
    """
    texts = lines_of(registry, instrument)
    index = len(texts) - 1 if seq is None else seq - 1
    if not 0 <= index < len(texts):
        raise RegistryError(
            "the ledger has no such entry", where=registry.folder / instrument,
            got="the last one" if seq is None else f"entry {seq}", expected=f"1 to {len(texts)}",
            next_step="see 'toolkit calibration list' and 'toolkit calibration history'", rule="missing",
        )  # fmt: skip
    return json.dumps({"schema": 1, **anchor_of(texts, index, checkpoint).as_dict()}, indent=2) + "\n"


def lines_of(registry: Registry, instrument: str) -> list[str]:
    """Return the lines of an instrument's ledger, or of the log of ``people``.

    Raises
    ------
    RegistryError
        ``missing``: there is no such instrument; the ledger is damaged
    TrustError
        ``people-log``
    """
    from toolkit.calibration.registry.settled import damaged

    if instrument not in ledgers_of(registry):
        raise registry.no_instrument(instrument)
    if instrument not in registry.instruments():
        registry.people()  # every version of it is proved
        return raw_lines(registry, instrument)
    ledger = registry.ledger(instrument)
    if ledger.damage is not None:
        raise damaged(registry.folder / instrument, ledger.damage)
    return [line.decode() for line in ledger.lines]


def check_against(registry: Registry, instrument: str | None, document: Path) -> tuple[str, Comparison]:
    """Hold today's ledger against a document of earlier; return its instrument and how it stands.

    The document is a PDF, a digital certificate or a manifest as it was issued, a proof, the text of a QR
    code, a checkpoint, or a PDF that prints a hash of the ledger; ``instrument`` is asked of the last alone.

    Raises
    ------
    TrustError
        ``anchor``: the document holds nothing of this ledger
    """
    data = _content(document)
    anchor = anchor_in(data, where=document)
    if anchor is None and data.startswith(b"%PDF-"):
        if instrument is None:
            raise _without(document, "no proof")
        return instrument, _of_sound(
            registry, instrument, _printed(raw_lines(registry, instrument), document)
        )
    if anchor is not None:
        checkpoint = anchor.checkpoint
    else:
        checkpoint = parse_checkpoint(data.decode(errors="replace"), where=document)
    instrument_named = checkpoint.origin.removeprefix(ORIGIN)
    if instrument_named != (instrument or instrument_named) or instrument_named not in ledgers_of(registry):
        raise _without(document, f"a proof of the ledger {checkpoint.origin}")
    if anchor is not None and not anchor.proved:
        return instrument_named, Comparison(
            "forked", "the document's own proof does not hold: it was changed"
        )
    # A ledger that is damaged is compared, too: where it broke is what was asked.
    compared = compare(raw_lines(registry, instrument_named), checkpoint, anchor)
    return instrument_named, _of_sound(registry, instrument_named, compared)


def _of_sound(registry: Registry, instrument: str, compared: Comparison) -> Comparison:
    """Return a comparison that stands: a ledger that does not hold by itself continues nothing."""
    if compared.continuity != "continues":
        return compared
    damage = damage_of(registry, instrument)
    if damage is None:
        return compared
    return Comparison("unknown", f"the ledger is damaged: {damage}; of its older lines: {compared.why}")


def witness(
    registry: Registry, instrument: str, folder: Path, *, name: str, signer: Signer
) -> tuple[Checkpoint, int]:
    """Let a witness countersign an instrument's ledger; return the checkpoint and the size it knew before.

    Raises
    ------
    TrustError
        ``not-allowed``: a key of the laboratory's own people; ``ledger-fork``, ``ledger-rollback``
    """
    versions = registry.people().history.versions
    owner = next((person for v in versions if (person := v.people.owner(signer.public)) is not None), None)
    if owner is not None:
        raise TrustError(
            "a witness is somebody else than the laboratory", where="--key", got=f"the key of {owner.id}",
            expected="a key of the second place, with which nobody decides here",
            next_step="make the witness a key of its own: toolkit person key FILE; nothing was signed",
            rule="not-allowed",
        )  # fmt: skip
    texts = lines_of(registry, instrument)
    copy = registry.folder.parent / "trust" / "witnessed" / f"{instrument}-{name}{SUFFIX}"
    check_file(copy)  # before the witness signs: it never forgets
    _demand_memory(folder, f"{ORIGIN}{instrument}", copy)
    signed = countersign(
        folder, name, signer, checkpoint_of(registry, instrument), texts, time=int(time.time())
    )
    write_atomic(copy, signed.checkpoint.text)
    return signed.checkpoint, signed.before


def _demand_memory(folder: Path, origin: str, copy: Path) -> None:
    """Refuse a witness that knows less than it has signed here: it would sign a fork of what it forgot."""
    signed, known = remembered(copy), remembered(place(folder, origin))
    if signed is not None and (known is None or known.size < signed.size):
        raise TrustError(
            "the witness has forgotten what it signed", where=folder,
            got="no checkpoint of this ledger" if known is None else f"a checkpoint of {known.size} entries",
            expected=f"its checkpoint of {signed.size} entries, as in {copy}",
            next_step="find out who changed the witness's folder, and put its file there again; a new place "
            "is a witness by another --name; nothing was signed", rule="ledger-rollback",
        )  # fmt: skip


def _printed(texts: Sequence[str], document: Path) -> Comparison:
    """Look for the hashes of ledger lines that documents print."""
    try:
        done = subprocess.run(["pdftotext", str(document), "-"], capture_output=True, check=True, timeout=60)
    except (OSError, subprocess.SubprocessError) as error:
        raise _without(document, error) from error
    printed = set(_HEAD.findall(done.stdout.decode(errors="replace")))
    places = [place for place, text in enumerate(texts, start=1) if _head(text) in printed]
    if not places:
        raise _without(document, "no hash of a line of this ledger")
    return Comparison("continues", f"entry {places[-1]}, whose hash the document prints, is in the ledger")


def _head(text: str) -> str | None:
    """Return the hash that a ledger's line states; None of a line that is none any more."""
    try:
        return str(json.loads(text)["sha256"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _enter(
    registry: Registry, people: People, signers: Sequence[Signer], reason: str, by: str | None
) -> PeopleLog:
    now = registry.people().history.now
    deciding = people if now is None else now.people
    answered = [str(answer.body["by"]) for answer in registry.travel.answers]
    owners = [person.id for signer in registry.signers if (person := deciding.owner(signer.public))]
    decider = by or next(iter((*answered, *owners)), None)
    if decider is None and registry.travel.request is not None:
        raise TrustError(
            "a request says who decides", where="--by", got="nobody", expected="the id of who will sign",
            next_step="add --by ID; nothing was changed", rule="person",
        )  # fmt: skip
    return enrol(
        registry.folder, people, signers, by=decider or "nobody", reason=reason,
        lock_file=registry.lock_file, travel=registry.travel,
    )  # fmt: skip


def _text(path: Path) -> str:
    return _content(path).decode(errors="replace")


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, PDF_FILE)
    except OSError as error:
        raise TrustError(
            "a file cannot be read", where=path, got=getattr(error, "strerror", None) or error,
            expected="a public key, a checkpoint, a proof, or a document as it was issued",
            next_step="check the path", rule="no-file",
        ) from error  # fmt: skip


def _nobody(actual: str, expected: Sequence[str]) -> ToolkitError:
    return TrustError(
        "there is no such person or key", where="people", got=actual,
        expected=", ".join(expected) or "nobody is enrolled",
        next_step="see 'toolkit person list'; nothing was changed", rule="person",
    )  # fmt: skip


def _without(document: Path, reason: object) -> TrustError:
    return TrustError(
        "a document holds nothing of this ledger", where=document, got=reason,
        expected="an issued document, a proof, a checkpoint, or a PDF that prints a hash of the ledger",
        next_step="name the instrument whose record the document used: toolkit ledger check INSTRUMENT",
        rule="anchor",
    )  # fmt: skip
