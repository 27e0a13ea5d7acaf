"""Documents, keys and certificates to seal with, and tools to forge them."""

from __future__ import annotations

import datetime as dt
from functools import cache

from tests.trust.seal.authority import Authority, make_authority
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import seal_pdf
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import seal_xml

DAY = dt.timedelta(days=1)
NOW = dt.datetime.now(dt.UTC)

XMP = b"""<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:pdfaid="http://www.aiim.org/pdfa/ns/id/">
<pdfaid:part>2</pdfaid:part><pdfaid:conformance>B</pdfaid:conformance>
</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>"""

DCC = b"""<?xml version="1.0" encoding="UTF-8"?>
<!-- a note -->
<dcc:certificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" schemaVersion="3.3.0">
 <dcc:serial>4711</dcc:serial>
 <dcc:values unit="newton">0 1000 2000</dcc:values>
</dcc:certificate>
"""


@cache
def authority() -> Authority:
    return make_authority()


@cache
def key() -> SealKey:
    return authority().issue("Tire laboratory")


@cache
def trust() -> Trust:
    return Trust(certificates=(authority().certificate,))


@cache
def plain_pdf(text: str = "U = 0.61 N") -> bytes:
    """Return a PDF of two pages that says it is PDF/A-2b."""
    contents = [f"BT /F1 12 Tf 72 720 Td ({text}, page {n}) Tj ET".encode() for n in (1, 2)]
    objects = [
        b"<</Type/Catalog/Pages 2 0 R/Metadata 8 0 R>>",
        b"<</Type/Pages/Kids[3 0 R 4 0 R]/Count 2>>",
        *(
            b"<</Type/Page/Parent 2 0 R/MediaBox[0 0 595 842]/Contents %d 0 R"
            b"/Resources<</Font<</F1 7 0 R>>>>>>" % n
            for n in (5, 6)
        ),
        *(b"<</Length %d>>stream\n%s\nendstream" % (len(c), c) for c in contents),
        b"<</Type/Font/Subtype/Type1/BaseFont/Helvetica>>",
        b"<</Type/Metadata/Subtype/XML/Length %d>>stream\n%s\nendstream" % (len(XMP), XMP),
    ]
    data, places = b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n", []
    for number, body in enumerate(objects, start=1):
        places.append(len(data))
        data += b"%d 0 obj%s\nendobj\n" % (number, body)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    start, size = len(data), len(objects) + 1
    data += b"xref\n0 %d\n0000000000 65535 f \n%strailer<</Size %d/Root 1 0 R>>\n" % (size, table, size)
    return data + b"startxref\n%d\n%%%%EOF\n" % start


PROOF = b'{"schema": 1, "records": []}'


@cache
def sealed_pdf() -> bytes:
    return seal_pdf(plain_pdf(), key(), reason="issued", attachments={"toolkit.json": PROOF})


@cache
def sealed_xml() -> bytes:
    return seal_xml(DCC, key())


def flipped(data: bytes, place: int, mask: int = 1) -> bytes:
    """Return bytes with one of them changed."""
    return data[:place] + bytes((data[place] ^ mask,)) + data[place + 1 :]


def spread(size: int, count: int) -> list[int]:
    """Return places spread evenly over some bytes."""
    return [round(index * (size - 1) / (count - 1)) for index in range(count)]


def foreign_xml(data: bytes = DCC, signer: SealKey | None = None) -> bytes:
    """Return a document sealed by signxml alone: its file need not be its canonical form."""
    from lxml import etree
    from signxml.xades.xades import XAdESSigner

    signer = signer or key()
    sealed = XAdESSigner(signature_algorithm="ecdsa-sha256").sign(
        etree.fromstring(data), key=signer.private, cert=list(signer.chain), always_add_key_value=False
    )
    return bytes(etree.tostring(sealed, xml_declaration=True, encoding="UTF-8"))
