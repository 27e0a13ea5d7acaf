"""`toolkit verify`: who issued a document, when, over what, and whether it still holds; offline.

The seal is checked by `toolkit.trust.seal`. What the laboratory's ledger says of the records that a document
names is asked through a function (`Ledger`), so that a document can be verified where no ledger is.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from toolkit.errors import ToolkitError, TrustError
from toolkit.files import sha256_bytes
from toolkit.inputs import PDF_FILE, read_regular
from toolkit.lab.sealing import PROOF
from toolkit.trust.seal.check import SealCheck, Signature
from toolkit.trust.seal.pdf import check_pdf
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import check_xml

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry

Continuity = Literal["continues", "forked", "rolled_back", "unknown"]
_DCC = "{https://ptb.de/dcc}"
_NO_LEDGER = "no ledger here knows its records"


@dataclass(frozen=True, slots=True, kw_only=True)
class LedgerState:
    """What a ledger says of a document: whether it continues it, and whether its records still hold."""

    ledger: Continuity = "unknown"
    still_holds: bool | None = None
    why: str = _NO_LEDGER


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A record that a document names, with its hash."""

    record: str
    sha256: str


Ledger = Callable[[Sequence[Named], Mapping[str, bytes]], LedgerState]
"""Asked with the records that a document names and the files attached to it, such as its proof."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The answer of one file; ``over`` is what it was issued over, ``certificate`` the signer's SHA-256."""

    file: str
    kind: str
    issued_by: str | None = None
    issued_at: str | None = None
    signature: Signature = "invalid"
    ledger: Continuity = "unknown"
    still_holds: bool | None = None
    why: str = ""
    over: str | None = None
    certificate: str | None = None

    @property
    def code(self) -> int:
        """0: it holds; 1: it does not, or nothing proves it; 2: it is forged, or cannot be read."""
        if self.signature == "invalid":
            return 2
        broken = self.still_holds is False or self.ledger in ("forked", "rolled_back")
        return 0 if self.signature == "valid" and not broken else 1

    def as_dict(self) -> dict[str, Any]:
        """Return the answer as JSON values."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

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
        parts = [f"{self.signature.upper():<9} {self.kind}", issued, holds, self.why]
        return f"{self.file}: " + "; ".join(part for part in parts if part)


def verify_file(path: Path, trust: Trust, *, ledger: Ledger | None = None) -> Verdict:
    """Verify one document; what cannot be read is a verdict too."""
    try:
        data = _content(path)
        if data.startswith(b"%PDF-"):
            return _pdf(path, data, trust, ledger)
        if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"{":
            return _json(path, data, trust, ledger)
        if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<":
            return _dcc(path, data, trust, ledger)
        return _by_its_pdf(path, data, trust, ledger)
    except ToolkitError as error:
        told = f"{error.what}: {error.got}" if error.got else error.what
        return Verdict(file=str(path), kind="unreadable", why=told)


def registry_ledger(open_registry: Callable[[], Registry | None]) -> Ledger:
    """Return what a registry says of records: whether each has that hash and was not withdrawn.

    It is opened when a document names a record.
    """

    def ask(names: Sequence[Named], attachments: Mapping[str, bytes]) -> LedgerState:
        del attachments
        registry = open_registry()
        told = [] if registry is None else [_standing(registry, name) for name in names]
        known = [state for state in told if state.still_holds is not None]
        return next((state for state in known if not state.still_holds), known[0] if known else LedgerState())

    return ask


def _standing(registry: Registry, name: Named) -> LedgerState:
    try:
        record = registry.load(name.record)
        status = registry.status(name.record)
    except ToolkitError:
        return LedgerState()
    if record.sha256 != name.sha256:
        return LedgerState(still_holds=False, why=f"record {name.record} here is another one")
    if status.state in ("withdrawn", "discarded"):
        reason = f": {status.reason}" if status.reason else ""
        return LedgerState(still_holds=False, why=f"record {name.record} was {status.state} since{reason}")
    return LedgerState(still_holds=True, why=f"record {name.record} is {status.state}")


def _pdf(path: Path, data: bytes, trust: Trust, ledger: Ledger | None) -> Verdict:
    check = check_pdf(data, trust)
    proof = proof_of(check)
    names = [Named(record=str(r["id"]), sha256=str(r["sha256"])) for r in proof.get("records", ())]
    return _verdict(
        path, "pdf", check, names, str(proof["document"]) if proof.get("document") else None, ledger
    )


def _dcc(path: Path, data: bytes, trust: Trust, ledger: Ledger | None) -> Verdict:
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
    names = [Named(record=record, sha256=digest)] if record and digest else []
    over = root.findtext(f"{core}/{_DCC}uniqueIdentifier")
    return _verdict(path, "dcc", check, names, over and f"certificate {over}", ledger)


def _json(path: Path, data: bytes, trust: Trust, ledger: Ledger | None) -> Verdict:
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise _unreadable(path, str(error)) from error
    if isinstance(document, dict) and isinstance(document.get("outputs"), list):
        return _manifest(path, document, trust, ledger)
    if isinstance(document, dict) and isinstance(document.get("content"), dict) and "sha256" in document:
        return _record(path, data, ledger)
    raise _unreadable(path, "JSON that is no manifest and no record")


def _record(path: Path, data: bytes, ledger: Ledger | None) -> Verdict:
    from toolkit.calibration.records.record import from_bytes

    try:
        record = from_bytes(data, where=path)
    except ToolkitError as error:
        return Verdict(file=str(path), kind="record", why=f"{error.what}: {error.got}")
    check = SealCheck(signature="unsigned", why="a record has no seal; the ledger signs it")
    return _verdict(path, "record", check, [Named(record=record.id, sha256=record.sha256)], record.id, ledger)


def _manifest(path: Path, document: dict[str, Any], trust: Trust, ledger: Ledger | None) -> Verdict:
    """A sealed PDF of the manifest proves it, where that lists the other files with the same hashes."""
    hashes: dict[str, str] = {}
    for output in document["outputs"]:
        try:
            name, digest = str(output["name"]), str(output["sha256"])
        except (TypeError, KeyError) as error:
            raise _unreadable(path, "an output without name and sha256") from error
        if Path(name).name != name:
            raise _unreadable(path, f"an output outside its folder: {name}")
        if (actual := sha256_bytes(_content(path.parent / name))) != digest:
            return Verdict(
                file=str(path), kind="manifest", why=f"{name} was changed: its hash is {actual[:12]}"
            )
        hashes[name] = digest
    for name in hashes:
        if not name.lower().endswith(".pdf"):
            continue
        data = _content(path.parent / name)
        verdict, proved = _pdf(path.parent / name, data, trust, ledger), proof_of(check_pdf(data, trust))
        listed = {str(f["name"]): str(f["sha256"]) for f in proved.get("files", ())}
        if verdict.signature == "unsigned":
            continue
        if all(listed.get(other) == digest for other, digest in hashes.items() if other != name):
            why = f"{len(hashes)} files as listed, proved by {name}: {verdict.why}"
        else:
            why = f"{name} does not list the other files"
            verdict = Verdict(file="", kind="", signature="unsigned")
        return _renamed(verdict, path, "manifest", why)
    why = f"{len(hashes)} files as listed; no sealed PDF proves it"
    return Verdict(file=str(path), kind="manifest", signature="unsigned", why=why)


def _by_its_pdf(path: Path, data: bytes, trust: Trust, ledger: Ledger | None) -> Verdict:
    """A Word file, a workbook, a tire file has no seal: a sealed PDF beside it proves its hash."""
    kind = "office" if data.startswith(b"PK\x03\x04") else "file"
    digest = sha256_bytes(data)
    for beside in sorted(path.parent.glob("*.pdf")):
        pdf = _content(beside)
        listed = {str(f["name"]): str(f["sha256"]) for f in proof_of(check_pdf(pdf, trust)).get("files", ())}
        if path.name not in listed:
            continue
        if listed[path.name] != digest:
            why = f"it is not the file that {beside.name} was issued with"
            return Verdict(file=str(path), kind=kind, why=why)
        verdict = _pdf(beside, pdf, trust, ledger)
        return _renamed(verdict, path, kind, f"its hash stands in {beside.name}: {verdict.why}")
    if kind == "file":
        raise _unreadable(path, "no document, and no sealed PDF beside it names it")
    why = "it has no seal, and no sealed PDF beside it names it"
    return Verdict(file=str(path), kind="office", signature="unsigned", why=why)


def _renamed(verdict: Verdict, path: Path, kind: str, why: str) -> Verdict:
    return Verdict(**verdict.as_dict() | {"file": str(path), "kind": kind, "why": why})


def _verdict(
    path: Path, kind: str, check: SealCheck, names: Sequence[Named], over: str | None, ledger: Ledger | None
) -> Verdict:
    state = LedgerState()
    if check.signature != "invalid" and ledger is not None and names:
        state = ledger(names, check.attachments)
    time = "time as stated by the signer" if check.at and not check.stamped else ""
    why = "; ".join(part for part in (check.why, time, state.why if names or ledger else "") if part)
    return Verdict(
        file=str(path),
        kind=kind,
        issued_by=check.issued_by,
        issued_at=check.time,
        signature=check.signature,
        ledger=state.ledger,
        still_holds=state.still_holds,
        why=why,
        over=over,
        certificate=check.certificate,
    )


def proof_of(check: SealCheck) -> dict[str, Any]:
    """Return the JSON that was attached to a document when it was issued; empty where there is none."""
    try:
        document = json.loads(check.attachments.get(PROOF, b"{}"))
    except (ValueError, RecursionError):
        return {}
    entries = document if isinstance(document, dict) else {}
    for key in ("records", "files"):
        listed = entries.get(key, [])
        if not isinstance(listed, list) or not all(
            isinstance(entry, dict) and "sha256" in entry for entry in listed
        ):
            return {}
    return entries


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, PDF_FILE)
    except (OSError, ValueError) as error:
        raise _unreadable(path, getattr(error, "strerror", None) or str(error)) from error


def _unreadable(path: Path, got: str) -> TrustError:
    return TrustError(
        "the file cannot be read as a document", where=path, got=got,
        expected="a PDF, a digital calibration certificate, a manifest or a record",
        next_step="name it as it was issued", rule="unreadable-document",
    )  # fmt: skip
