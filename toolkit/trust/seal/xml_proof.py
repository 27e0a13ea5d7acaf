"""The ledger's proof in a digital calibration certificate: its comment, before the certificate is sealed.

What the entry holds is the hash of the certificate's content: its canonical form (C14N 1.0, without comments)
before the proof and the seal were put into it.
"""

from __future__ import annotations

import hashlib
from typing import Any

from lxml import etree

_DCC = "{https://ptb.de/dcc}"
_SEAL = "{http://www.w3.org/2000/09/xmldsig#}Signature"
ELEMENT = "toolkit-proof"


def with_proof(data: bytes, proof: str) -> bytes:
    """Return a certificate whose comment holds a proof."""
    root = _parse(data)
    comment = etree.Element(f"{_DCC}comment")
    etree.SubElement(comment, ELEMENT).text = proof
    root.insert(list(root).index(root.find(f"{_DCC}measurementResults")) + 1, comment)
    xml: bytes = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return xml + b"\n"


def proof_in(data: bytes) -> str | None:
    """Return the proof that a certificate holds; None where there is none."""
    text: str | None = _parse(data).findtext(f"{_DCC}comment/{ELEMENT}")
    return text


def content_hash(data: bytes) -> str | None:
    """Return the SHA-256 of a certificate's content, without its proof and its seal.

    None where the document is another than its content with the proof put into it: what is left out of the
    hash is what `with_proof` writes, and nothing beside it.
    """
    root = _parse(data)
    for seal in root.findall(_SEAL):
        root.remove(seal)
    whole = _canonical(root)
    own = [comment for comment in root.findall(f"{_DCC}comment") if comment.find(ELEMENT) is not None]
    for comment in own:
        root.remove(comment)
    content = _canonical(root)
    if own and whole != _canonical(_parse(with_proof(content, own[0].findtext(ELEMENT) or ""))):
        return None
    return hashlib.sha256(content).hexdigest()


def _canonical(root: Any) -> bytes:
    return bytes(etree.tostring(root, method="c14n", with_comments=False))


def _parse(data: bytes) -> Any:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    return etree.fromstring(data, parser)
