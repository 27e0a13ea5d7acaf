"""Sealing and verifying a document, and `toolkit verify` as a whole process; aim: each under one second.

The peer is `openssl cms` on the same PDF, which signs and verifies its bytes and knows nothing of PDF or XML.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.benchmarks.timing import pairs, row
from tests.calibration.dcc.dcc_factory import plain_dcc
from tests.trust.seal.authority import to_pem
from tests.trust.seal.seal_factory import authority, key, plain_pdf, trust
from toolkit.trust.seal.pdf import check_pdf, seal_pdf
from toolkit.trust.seal.xml import check_xml, seal_xml

_SIGN = "cms -sign -binary -in plain.pdf -signer key.pem -inkey key.pem -outform DER -out seal.der"
_VERIFY = "cms -verify -binary -inform DER -in seal.der -content plain.pdf -CAfile root.pem -out content"


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time a PDF of 600 kB and a DCC."""
    pdf, xml = plain_pdf("x" * 300_000), plain_dcc()
    sealed_pdf, sealed_xml = seal_pdf(pdf, key(), reason="issued"), seal_xml(xml, key())
    for name, data in (("plain", pdf), ("sealed", sealed_pdf)):
        (folder / f"{name}.pdf").write_bytes(data)
    (folder / "key.pem").write_bytes(to_pem(key()))
    (folder / "root.pem").write_bytes(authority().pem)
    toolkit = str(Path(sys.executable).with_name("toolkit"))

    def process(*words: str) -> Callable[[], object]:
        return lambda: subprocess.run(words, cwd=folder, check=True, capture_output=True)

    sign, verify = process("openssl", *_SIGN.split()), process("openssl", *_VERIFY.split(), "-purpose", "any")
    works: list[tuple[str, Callable[[], object], Callable[[], object]]] = [
        ("seal a PDF of 600 kB", lambda: seal_pdf(pdf, key(), reason="issued"), sign),
        ("check its seal", lambda: check_pdf(sealed_pdf, trust()), verify),
        ("seal a DCC", lambda: seal_xml(xml, key()), sign),
        ("check its seal", lambda: check_xml(sealed_xml, trust()), verify),
        ("toolkit verify FILE.pdf", process(toolkit, "verify", "sealed.pdf", "--trust", "root.pem"), verify),
    ]
    rows = []
    for what, work, peer in works:
        times = pairs(work, peer, count)
        rows.append(row(what, times[0], "openssl cms, a process", times[1], "1 s"))
    return rows
