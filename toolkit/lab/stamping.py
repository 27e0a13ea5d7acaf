"""Time stamps of a ledger's checkpoints: that it was so at a time, by the word of somebody outside."""

from __future__ import annotations

import base64
import binascii
import json
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ToolkitError
from toolkit.inputs import REQUEST_FILE, read_input
from toolkit.trust.anchor import parse_anchor

if TYPE_CHECKING:
    from toolkit.trust.seal.stamps import Stamp
    from toolkit.trust.seal.x509 import Trust

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
        entries = json.loads(read_input(document, REQUEST_FILE))
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
