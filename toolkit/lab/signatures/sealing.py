"""The laboratory's seal at the end of an issue, whom it trusts, and time stamps of a ledger's checkpoints."""

from __future__ import annotations

import base64
import binascii
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import parse_json
from toolkit.inputs import CERTIFICATE_FILE, REQUEST_FILE, read_input
from toolkit.lab.home import find_home
from toolkit.trust.anchor import parse_anchor

if TYPE_CHECKING:
    from toolkit.calibration.dcc.standard import Standards
    from toolkit.trust.seal.key import Ask, SealKey
    from toolkit.trust.seal.stamps import Stamp
    from toolkit.trust.seal.x509 import Trust


TRUST, KEY = "trust", "TOOLKIT_SEAL_KEY"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sealing:
    """The seal of one issue. ``stamps`` is the address of a time-stamp server, None for none."""

    key: SealKey
    stamps: str | None = None

    def seal_xml(self, data: bytes) -> bytes:
        """Return a digital calibration certificate with its seal."""
        from toolkit.trust.seal.xml import seal_xml

        return seal_xml(data, self.key)

    def seal_pdf(self, data: bytes, document: str) -> bytes:
        """Return a PDF with its seal; ``document`` is what it is, such as ``certificate CC-1``."""
        from toolkit.trust.seal.pdf import seal_pdf

        stamps = None
        if self.stamps is not None:
            from toolkit.trust.seal.stamps import StampServer

            stamps = StampServer(self.stamps)
        return seal_pdf(data, self.key, reason=f"issued: {document}", stamps=stamps)


def open_sealing(
    seal: Path | None, home: Path, *, ask: Ask, stamps: str | None = None, draft: bool = False
) -> Sealing | None:
    """Return the seal of an issue: by ``--seal``, else by the environment; None where neither names a key.

    Raises
    ------
    TrustError
        the key cannot be used, or a file among the trusted certificates holds none
    ConfigError
        ``usage``: a draft is never sealed, a time stamp never stands alone
    """
    from toolkit.trust.seal.key import open_key

    path = seal or (Path(os.environ[KEY]) if os.environ.get(KEY) else None)
    if path is None and stamps is not None:
        raise ConfigError(
            "a time stamp belongs to a seal", where="--time-stamp", got="no key", expected="--seal KEY too",
            next_step="name the key, or leave out --time-stamp; nothing was made", rule="usage",
        )  # fmt: skip
    if path is None or (draft and seal is None):
        return None
    if draft:
        raise ConfigError(
            "a draft is never sealed", where="--draft, --seal", got="both", expected="one of the two",
            next_step="approve the record first, or leave out --seal; nothing was made", rule="usage",
        )  # fmt: skip
    folder = home / TRUST
    key = open_key(path, ask=ask, chain=folder / "laboratory.pem", home=home, trust=trusted(folder))
    return Sealing(key=key, stamps=stamps)


def home_trust(home: Path | None) -> Trust:
    """Return the certificates that a home trusts, its own chain among them; without a home, nobody.

    Raises
    ------
    ConfigError
        ``home`` was given and is none
    TrustError
        a file among them holds no certificate
    """
    from toolkit.trust.seal.x509 import Trust

    try:
        return trusted(find_home(home) / TRUST)
    except ConfigError:
        if home is not None:
            raise
        return Trust()


def standards_of(home: Path) -> Standards:
    """Return whose digital certificates of reference standards a home takes numbers from.

    Raises
    ------
    TrustError
        a file among the trusted certificates holds none
    """
    from toolkit.calibration.dcc.standard import Standards

    return Standards(trust=trusted(home / TRUST), schemas=home / TRUST / "schema")


def trusted(folder: Path) -> Trust:
    """Return what the folder ``trust`` of a home trusts: ``certificates/``, and ``laboratory.pem``."""
    from toolkit.trust.seal.x509 import Trust, read_certificates, read_trust

    enrolled, root_file = read_trust(folder / "certificates"), folder / "laboratory.pem"
    if not root_file.is_file():
        return enrolled
    chain = read_certificates(read_input(root_file, CERTIFICATE_FILE), where=root_file)
    return Trust(certificates=(*enrolled.certificates, *chain), revocations=enrolled.revocations)


STAMP = "time_stamp"


def stamped(document: str, url: str) -> str:
    """Return a proof of `toolkit ledger prove` with a time stamp of its checkpoint's body.

    Raises
    ------
    TrustError
        ``time-stamp``: the server gives none
    """
    from toolkit.trust.seal.stamps import StampServer, stamp

    entries = json.loads(document)
    body = parse_anchor(entries).checkpoint.body.encode()
    token = base64.b64encode(stamp(body, StampServer(url))).decode()
    return json.dumps({**entries, STAMP: token}, indent=2) + "\n"


def stamp_of(document: Path, trust: Trust) -> Stamp | None:
    """Return what the time stamp of a proof says; None where a document has none.

    Raises
    ------
    TrustError
        ``time-stamp``: it is not of the proof's checkpoint, or none
    """
    try:
        entries = parse_json(read_input(document, REQUEST_FILE))
    except (ToolkitError, ValueError, RecursionError):
        return None  # a checkpoint or a PDF: nothing in them is a time stamp of a checkpoint
    if not isinstance(entries, dict) or STAMP not in entries:
        return None
    from toolkit.trust.seal.stamps import check_stamp

    try:
        token = base64.b64decode(entries[STAMP], validate=True)
    except (TypeError, ValueError, binascii.Error):
        token = b""
    return check_stamp(token, parse_anchor(entries, where=document).checkpoint.body.encode(), trust)
