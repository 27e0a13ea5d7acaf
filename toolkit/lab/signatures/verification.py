"""`toolkit verify`: who issued a document, when, over what, and whether it still holds; offline.

A seal is checked by `toolkit.trust.seal`, the proof of a document's entry by
`toolkit.lab.signatures.proofs`. What the laboratory's ledger says is asked through a function (`Ledger`), so
that a document can be verified where no ledger is. A file whose hash a signed entry holds (a Word file, a
digital certificate without a seal) is proved by it; a PDF without a seal is not: its own bytes stand in no
entry.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypedDict

from toolkit.declared import Entry
from toolkit.declared.answers import merged
from toolkit.errors import ToolkitError, TrustError
from toolkit.files import parse_json, sha256_bytes
from toolkit.inputs import PDF_FILE, read_regular
from toolkit.lab.signatures.proofs import (
    MANIFEST,
    PROOF,
    TESTED,
    Continuity,
    Ledger,
    LedgerState,
    Named,
    anchor_in,
    day_of_test,
    entry_of,
    hashes_of,
    ledger_file_state,
    no_ledger,
    reports_test,
    statements_hash,
)
from toolkit.listing import one_line
from toolkit.trust.anchor import COMPACT, Anchor, parse_anchor
from toolkit.trust.seal.check import SealCheck, Signature
from toolkit.trust.seal.pdf import carried_by, check_pdf
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import check_xml, content_hash

_DCC = "{https://ptb.de/dcc}"
_UNPROVED = "nothing proves that what it shows is what was issued"
_NAMES_NOTHING = (
    "it carries no record's hash and no proof to look up in a ledger, as documents issued by --issue do"
)
_BESIDE = ("*.pdf", "manifest.json")
"""What proves a file without a seal, in the same folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The answer of one file; ``over`` is what it was issued over, ``certificate`` the signer's SHA-256.

    ``untold``: the ledger here has its record, and the document does not say on which day it must hold.
    """

    file: str
    kind: Annotated[str, Entry("what the document is")]
    issued_by: str | None = None
    issued_at: str | None = None
    signature: Signature = "invalid"
    ledger: Annotated[Continuity, Entry("whether today's ledger continues the document's")] = "unknown"
    still_holds: Annotated[bool | None, Entry("null where nothing says")] = None
    why: str = ""
    over: Annotated[str | None, Entry("what it was issued over")] = None
    certificate: Annotated[str | None, Entry("SHA-256 of the signer's")] = None
    untold: Annotated[bool, Entry(output=False)] = False

    @property
    def code(self) -> int:
        """0: it holds; 1: it does not, or nothing proves it; 2: it is forged, or cannot be read."""
        if self.signature == "invalid":
            return 2
        broken = self.still_holds is False or self.untold or self.ledger in ("forked", "rolled_back")
        return 0 if self.signature == "valid" and not broken else 1

    @property
    def line(self) -> str:
        """The answer in one line."""
        issued = " ".join(
            part
            for part in (
                f"by {self.issued_by}" if self.issued_by else "",
                f"at {self.issued_at}" if self.issued_at else "",
                f"over {self.over}" if self.over else "",
            )
            if part
        )
        holds = {True: "still holds", False: "no longer holds", None: ""}[self.still_holds]
        if self.still_holds and _UNPROVED in self.why:
            holds = "the records that it names still hold"
        parts = [f"{self.signature.upper():<9} {self.kind}", issued, holds, self.why]
        return one_line(f"{self.file}: " + "; ".join(part for part in parts if part))


class VerifyAnswer(TypedDict):
    """Documents, verified."""

    files: Annotated[list[Verdict], "in the order of the command"]


VerifyForms = merged(VerifyAnswer, Verdict, name="SingleVerifyAnswer") | VerifyAnswer
"""Of a single document its entries stand at the top too."""


def verify_file(path: Path, trust: Trust, *, ledger: Ledger = no_ledger) -> Verdict:
    """Verify one document; what cannot be read is a verdict too."""
    try:
        data = _content(path)
        first = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1]
        if data.startswith(b"%PDF-"):
            return _pdf(path, data, trust, ledger)
        if first == b"{" and path.suffix == ".jsonl":
            return _ledger(path)
        if first == b"{":
            return _json(path, data, trust, ledger)
        if first == b"<":
            return _dcc(path, data, trust, ledger)
        if data.startswith(COMPACT.encode()):
            return _proof(path, data, ledger)
        return _by_its_issue(path, data, trust, ledger)
    except ToolkitError as error:
        reason = f"{error.what}: {error.got}" if error.got else error.what
        return Verdict(file=str(path), kind="unreadable", why=reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """What an issued PDF carries: what it is, its records, the hashes of the files beside it, its proof.

    ``manifest`` is the hash of what the manifest beside it says, None where it has none or an older version
    made it.
    """

    document: str | None = None
    names: tuple[Named, ...] = ()
    files: Mapping[str, str]
    manifest: str | None = None
    anchor: Anchor | None = None

    @property
    def broken(self) -> str | None:
        """Why its parts do not belong together; None where they do."""
        if self.anchor is None:
            return None
        entered = hashes_of(self.anchor)
        changed = [name for name, digest in self.files.items() if entered.get(name, digest) != digest]
        # A digital certificate's entry is the hash of its content, before its proof and its seal.
        changed = [name for name in changed if not name.endswith(".xml")]
        record = entry_of(self.anchor).get("id")
        if not self.anchor.proved:
            return "its proof does not hold: it was changed"
        if self.names and record not in [name.record for name in self.names]:
            return f"its proof is of another record, {record}"
        return f"its proof is of another {changed[0]}" if changed else None


def carried(attachments: Mapping[str, bytes], *, where: object) -> Carried:
    """Return what an issued document's attachments say.

    Raises
    ------
    TrustError
        ``anchor``, ``checkpoint``: its proof cannot be read
    """
    try:
        document = parse_json(attachments.get(PROOF, b"{}"))
        records = [(str(r["id"]), str(r["sha256"])) for r in document.get("records", ())]
        files = {str(f["name"]): str(f["sha256"]) for f in document.get("files", ())}
        title, proof, stated = document.get("document"), document.get("ledger"), document.get(TESTED)
        said = document.get(MANIFEST)
    except (ValueError, RecursionError, AttributeError, TypeError, KeyError):
        return Carried(files={})
    anchor = parse_anchor(proof, where=where) if isinstance(proof, dict) else None
    report, tested = reports_test(title), day_of_test(anchor, stated)
    names = tuple(Named(record=r, sha256=digest, report=report, tested=tested) for r, digest in records)
    return Carried(
        document=title and str(title), names=names, files=files, anchor=anchor,
        manifest=None if said is None else str(said),
    )  # fmt: skip


def _pdf(path: Path, data: bytes, trust: Trust, ledger: Ledger) -> Verdict:
    check, proof = _sealed(path, data, trust)
    return _verdict(path, "pdf", check, proof, proof.document, ledger)


def _sealed(path: Path, data: bytes, trust: Trust) -> tuple[SealCheck, Carried]:
    """Return the check of a PDF's seal and what the PDF carries, under the seal where it has one."""
    check = check_pdf(data, trust)
    attachments = carried_by(data) if check.signature == "unsigned" else check.attachments
    return check, carried(attachments, where=path)


def _dcc(path: Path, data: bytes, trust: Trust, ledger: Ledger) -> Verdict:
    from lxml import etree

    check = check_xml(data, trust)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    root = etree.fromstring(check.content or data, parser)
    if root.tag != f"{_DCC}digitalCalibrationCertificate":
        raise TrustError(
            "the file is no digital calibration certificate", where=path, got=str(root.tag)[:80],
            expected="dcc:digitalCalibrationCertificate", next_step="name a document as it was issued",
            rule="unreadable-document",
        )  # fmt: skip
    core = f"{_DCC}administrativeData/{_DCC}coreData"
    stated = {
        name.findtext(f"{_DCC}name/{_DCC}content"): name.findtext(f"{_DCC}value")
        for name in root.iterfind(f"{core}/{_DCC}identifications/{_DCC}identification")
    }
    record, digest = stated.get("Calibration record"), stated.get("SHA-256 of the record")
    names = (Named(record=record, sha256=digest),) if record and digest else ()
    over = root.findtext(f"{core}/{_DCC}uniqueIdentifier")
    document = check.content or data
    anchor = anchor_in(document, where=path)
    if anchor is not None and content_hash(document) not in hashes_of(anchor).values():
        why = "its proof is of another certificate, or it was changed since it was issued"
        return Verdict(file=str(path), kind="dcc", why=why)
    proof = Carried(names=names, files={}, anchor=anchor)
    return _verdict(path, "dcc", check, proof, over and f"certificate {over}", ledger, entered=True)


def _json(path: Path, data: bytes, trust: Trust, ledger: Ledger) -> Verdict:
    try:
        document = parse_json(data)
    except (ValueError, RecursionError) as error:
        raise _unreadable(path, str(error)) from error
    if isinstance(document, dict) and isinstance(document.get("outputs"), list):
        return _manifest(path, document, trust, ledger)
    if isinstance(document, dict) and isinstance(document.get("content"), dict) and "sha256" in document:
        return _record(path, data, ledger)
    if isinstance(document, dict) and "checkpoint" in document:
        return _proof(path, data, ledger)
    raise _unreadable(path, "JSON that is no manifest, no record and no proof")


def _record(path: Path, data: bytes, ledger: Ledger) -> Verdict:
    from toolkit.calibration.records.record import from_bytes

    try:
        record = from_bytes(data, where=path)
    except ToolkitError as error:
        return Verdict(file=str(path), kind="record", why=f"{error.what}: {error.got}")
    state = ledger((Named(record=record.id, sha256=record.sha256, file=sha256_bytes(data)),), None)
    if state.changed is not None:
        return Verdict(file=str(path), kind="record", over=record.id, why=state.changed)
    signed = state.decided_by is not None
    return Verdict(
        file=str(path), kind="record", signature="valid" if signed else "unsigned", over=record.id,
        issued_by=state.decided_by, still_holds=state.still_holds,
        why=f"{'its decisions are' if signed else 'a record has no seal: its decisions are not'} signed; "
        f"{state.why}",
    )  # fmt: skip


def _ledger(path: Path) -> Verdict:
    """A ledger proves itself, line by line, and is held against what witnesses have signed of it."""
    state = ledger_file_state(path)
    return Verdict(
        file=str(path), kind="ledger", signature=state.signature, ledger=state.ledger, why=state.why,
        issued_by=state.issued_by, issued_at=state.issued_at, still_holds=state.still_holds,
    )  # fmt: skip


def _proof(path: Path, data: bytes, ledger: Ledger) -> Verdict:
    """A proof by itself, as `ledger prove` prints it or a telephone reads it off a page."""
    anchor = anchor_in(data, where=path)
    if anchor is None:
        raise _unreadable(path, "no proof of a ledger")
    check = SealCheck(signature="unsigned", why="a proof of an entry")
    proof = Carried(files={}, anchor=anchor)
    return _verdict(path, "proof", check, proof, anchor.checkpoint.origin, ledger, entered=True)


def _manifest(path: Path, document: dict[str, Any], trust: Trust, ledger: Ledger) -> Verdict:
    """A sealed PDF of the manifest proves it, where that lists the other files with the same hashes."""
    hashes: dict[str, str] = {}
    for output in document["outputs"]:
        try:
            name, digest = str(output["name"]), str(output["sha256"])
        except (TypeError, KeyError) as error:
            raise _unreadable(path, "an output without name and sha256") from error
        if Path(name).name != name:
            raise _unreadable(path, f"an output outside its folder: {name}")
        try:
            data = _content(path.parent / name)
        except TrustError as error:
            why = f"{name}, which it lists, cannot be read beside it: {error.got}"
            return Verdict(file=str(path), kind="manifest", why=why)
        if (actual := sha256_bytes(data)) != digest or output.get("bytes", len(data)) != len(data):
            why = f"{name} was changed: its hash is {actual[:12]}, its length {len(data)} bytes"
            return Verdict(file=str(path), kind="manifest", why=why)
        hashes[name] = digest
    for name in hashes:
        if not name.lower().endswith(".pdf"):
            continue
        data = _content(path.parent / name)
        check, proof = _sealed(path.parent / name, data, trust)
        if check.signature == "unsigned":
            continue
        verdict = _verdict(path, "manifest", check, proof, proof.document, ledger)
        if proof.files != {file: digest for file, digest in hashes.items() if file != name}:
            why = f"{name} was issued with other files than it lists"
            return Verdict(file=str(path), kind="manifest", signature="unsigned", why=why)
        why = f"{len(hashes)} files as listed, proved by {name}: {verdict.why}"
        if verdict.signature == "invalid":
            return replace(verdict, why=why)
        if proof.manifest is None:
            why = f"{name} proves the files that it lists, and nothing else that it says; {verdict.why}"
            return replace(verdict, signature="unsigned", why=why)
        ledger_proof = None if proof.anchor is None else {"schema": 1, **proof.anchor.as_dict()}
        if proof.manifest != statements_hash(document) or document.get("ledger") != ledger_proof:
            why = f"what it says was changed since it was issued with {name}"
            return Verdict(file=str(path), kind="manifest", over=proof.document, why=why)
        return replace(verdict, why=why)
    check = SealCheck(signature="unsigned", why=f"{len(hashes)} files as listed; no sealed PDF proves it")
    content = {
        "ledger": document.get("ledger"), "records": document.get("calibrations", []),
        TESTED: document.get(TESTED),
    }  # fmt: skip
    proof = carried({PROOF: json.dumps(content).encode()}, where=path)
    if proof.anchor is not None and (broken := _manifested(proof.anchor, hashes)):
        return Verdict(file=str(path), kind="manifest", why=broken)
    return _verdict(path, "manifest", check, proof, document.get("report"), ledger)


def _manifested(anchor: Anchor, hashes: Mapping[str, str]) -> str | None:
    files = {name: digest for name, digest in hashes.items() if not name.lower().endswith(".pdf")}
    absent = [name for name in hashes_of(anchor) if name not in files]
    return f"it does not list {absent[0]}" if absent else Carried(files=files, anchor=anchor).broken


def _by_its_issue(path: Path, data: bytes, trust: Trust, ledger: Ledger) -> Verdict:
    """A Word file, a workbook, a tire file has no seal: the issue that it belongs to holds its hash.

    A sealed PDF beside it says so by its seal; a PDF or a manifest by the entry whose proof it carries.
    """
    kind = "office" if data.startswith(b"PK\x03\x04") else "file"
    digest = sha256_bytes(data)
    for beside in (file for pattern in _BESIDE for file in sorted(path.parent.glob(pattern))):
        issued = _content(beside)
        if issued.startswith(b"%PDF-"):
            check, proof = _sealed(beside, issued, trust)
        else:
            check = SealCheck(signature="unsigned", why="a manifest has no seal")
            proof = Carried(files={}, anchor=anchor_in(issued, where=beside))
        sealed = check.signature != "unsigned"
        listed = proof.files if sealed else {} if proof.anchor is None else hashes_of(proof.anchor)
        if path.name not in listed:
            continue
        if listed[path.name] != digest:
            why = f"it is not the file that {beside.name} was issued with"
            return Verdict(file=str(path), kind=kind, why=why)
        check = check if sealed else replace(check, why="it has no seal")
        verdict = _verdict(path, kind, check, proof, proof.document, ledger, entered=not sealed)
        return replace(verdict, why=f"its hash stands in {beside.name}: {verdict.why}")
    if kind == "file":
        raise _unreadable(path, "no document, and no issued PDF or manifest beside it names it")
    why = "it has no seal, and no issued PDF or manifest beside it names it"
    return Verdict(file=str(path), kind="office", signature="unsigned", why=why)


def _verdict(
    path: Path,
    kind: str,
    check: SealCheck,
    proof: Carried,
    over: str | None,
    ledger: Ledger,
    *,
    entered: bool = False,
) -> Verdict:
    """Return the verdict on a document; ``entered``: where it has no seal, its entry proves it."""
    verdict = Verdict(
        file=str(path), kind=kind, issued_by=check.issued_by, issued_at=check.time, why=check.why, over=over,
        certificate=check.certificate,
    )  # fmt: skip
    if check.signature == "invalid":
        return verdict
    if proof.broken is not None:
        return replace(verdict, why=proof.broken)
    if proof.names or proof.anchor:
        state = ledger(proof.names, proof.anchor)
    else:
        state = LedgerState(why=_NAMES_NOTHING)
    time = "time as stated by the signer" if check.at and not check.stamped else ""
    # The records that bytes name may hold; that these are the bytes that were issued, nothing says.
    unproved = _UNPROVED if check.signature == "unsigned" and not entered else ""
    of_names = "of what it names: " if unproved and proof.names else ""
    verdict = replace(
        verdict, signature=check.signature, ledger=state.ledger, still_holds=state.still_holds,
        untold=state.untold,
        why="; ".join(part for part in (check.why, unproved, time, of_names + state.why) if part),
    )  # fmt: skip
    if entered and check.signature == "unsigned":
        return replace(
            verdict, signature=state.signature, issued_by=state.issued_by, issued_at=state.issued_at
        )
    return verdict


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, PDF_FILE)
    except (OSError, ValueError) as error:
        raise _unreadable(path, getattr(error, "strerror", None) or str(error)) from error


def _unreadable(path: Path, actual: str) -> TrustError:
    return TrustError(
        "the file cannot be read as a document", where=path, got=actual,
        expected="a PDF, a digital calibration certificate, a manifest or a record",
        next_step="name it as it was issued", rule="unreadable-document",
    )  # fmt: skip
