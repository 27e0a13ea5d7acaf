"""Answers on decisions and on who makes them, as types: records, people, ledger, `verify`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NotRequired, TypedDict

from toolkit.declared.answers import merged
from toolkit.findings import FindingEntry
from toolkit.lab.record_answer_types import RecordRow
from toolkit.lab.verification import Verdict


class RequestedAnswer(TypedDict):
    """With ``--request``: what is to be signed was written, and nothing was entered."""

    requested: bool
    request: Annotated[str, "file that was written"]
    action: Annotated[str, "enter, approve, withdraw, discard, import, issue or enrol"]
    id: Annotated[str, "record or person"]
    takes: Annotated[str, "whose signatures it takes, in words"]


class VerifiedRecord(TypedDict):
    """What came of refitting a record from its stored data."""

    id: str
    ok: Annotated[bool, "whether it reproduces and every file is as it was entered"]
    verified: Annotated[bool, "false of a legacy import, which has no data"]
    reason: Annotated[str | None, "why it is not ok"]


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


class KeyAnswer(TypedDict):
    """A new key."""

    key: Annotated[str, "file of the private half"]
    public: Annotated[str, "line of the public half"]
    fingerprint: str


class SignAnswer(TypedDict):
    """A signed request."""

    answer: Annotated[str, "file that goes back to where the request was made"]
    by: Annotated[str, "person who signed"]
    key: Annotated[str, "fingerprint"]


class CheckLedgerAnswer(TypedDict):
    """Whether today's ledger continues that of an earlier document."""

    instrument: str
    ledger: Annotated[str, "continues, forked, rolled_back or unknown"]
    why: str
    time_stamp: NotRequired[Annotated[str, "moment of the document's time stamp"]]
    time_stamp_by: NotRequired[Annotated[str | None, "who stamped it"]]
    time_stamp_state: NotRequired[str]


class WitnessAnswer(TypedDict):
    """A ledger that a second place has countersigned."""

    instrument: str
    size: Annotated[int, "entries"]
    before: Annotated[int, "entries that it had signed before"]
    checkpoint: str


class VerifyAnswer(TypedDict):
    """Documents, verified."""

    files: Annotated[list[Verdict], "in the order of the command"]


VerifyForms = merged(VerifyAnswer, Verdict, name="SingleVerifyAnswer") | VerifyAnswer
"""Of a single document its entries stand at the top too."""
