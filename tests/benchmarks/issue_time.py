"""What trust costs: proving a signed ledger when it is read, issuing a document, verifying it.

The peer of a ledger's proof is `ssh-keygen -Y verify`, a process for one line; that of an issue is the
`openssl cms` signature of the same PDF. Aims: under 5 ms a record, which rests on two decisions, and under a
second for a document beside its conversion by LibreOffice.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import rfc8785

from tests.benchmarks.seal_time import _SIGN
from tests.benchmarks.timing import pairs, row
from tests.calibration.registry.test_signatures import KEYS, RECORD, _found, _registry
from tests.trust.seal.authority import to_pem
from tests.trust.seal.seal_factory import authority, key, plain_pdf, trust
from toolkit.lab.home import packaged_home
from toolkit.lab.signatures.issuing import issue
from toolkit.lab.signatures.people import checkpoint_of, lines_of
from toolkit.lab.signatures.proofs import registry_ledger
from toolkit.lab.signatures.verification import verify_file
from toolkit.trust.anchor import anchor_of
from toolkit.trust.people import NAMESPACE
from toolkit.trust.seal.pdf import proved_pdf, seal_pdf
from toolkit.trust.seal.qr import Place

_LINES = 100
_INSTRUMENT = "m15-virtual"
_DOCUMENT = {"name": "certificate CC-1", "content": "c" * 64}


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time a ledger of signed lines, and a PDF of 600 kB."""
    shutil.copytree(packaged_home() / "calibrations", folder / "calibrations")
    _found(folder)
    decided = _registry(folder).ledger(_INSTRUMENT).decided
    for _ in range(_LINES):
        issue(_registry(folder, "anna"), RECORD, _DOCUMENT, decided=decided)
    return [_proving(folder, count), *_document(folder, count, decided)]


def _proving(folder: Path, count: int) -> dict[str, object]:
    line = json.loads(_registry(folder).ledger(_INSTRUMENT).lines[-1])
    message = rfc8785.dumps({k: v for k, v in line.items() if k not in ("signatures", "sha256")})
    (folder / "allowed").write_text(f"anna {KEYS['anna'].public.line}\n")
    (folder / "line.sig").write_text(line["signatures"][0]["sig"])
    words = f"ssh-keygen -Y verify -f allowed -I anna -n {NAMESPACE} -s line.sig".split()

    def ours() -> None:
        if _registry(folder).ledger(_INSTRUMENT).damage is not None:
            raise RuntimeError("the ledger does not hold")

    def peer() -> object:
        return subprocess.run(words, cwd=folder, input=message, check=True, capture_output=True)

    times = pairs(ours, peer, count)
    a_record = [2 * seconds / _LINES for seconds in times[0]]
    return row("prove the decisions of a record", a_record, "ssh-keygen, one of them", times[1], "5 ms")


def _document(folder: Path, count: int, decided: str) -> list[dict[str, object]]:
    pdf, place = plain_pdf("x" * 300_000), Place(page=1, left=60, top=60, size=170)
    (folder / "plain.pdf").write_bytes(pdf)
    (folder / "key.pem").write_bytes(to_pem(key()))
    (folder / "root.pem").write_bytes(authority().pem)

    def ours() -> None:
        registry = _registry(folder, "anna")
        seq = issue(registry, RECORD, _DOCUMENT, decided=decided)
        anchor = anchor_of(lines_of(registry, _INSTRUMENT), seq - 1, checkpoint_of(registry, _INSTRUMENT))
        proof = {
            "records": [{"id": RECORD, "sha256": registry.load(RECORD).sha256}],
            "ledger": anchor.as_dict(),
        }
        data = proved_pdf(pdf, {"toolkit.json": json.dumps(proof).encode()}, anchor.compact, place)
        (folder / "issued.pdf").write_bytes(seal_pdf(data, key(), reason="issued"))

    def sign() -> object:
        return subprocess.run(["openssl", *_SIGN.split()], cwd=folder, check=True, capture_output=True)

    def verify() -> None:
        verdict = verify_file(
            folder / "issued.pdf", trust(), ledger=registry_ledger(lambda: _registry(folder))
        )
        if verdict.code != 0 or verdict.ledger != "continues":
            raise RuntimeError(verdict.why)

    issued, peer = pairs(ours, sign, count)
    verified, _ = pairs(verify, lambda: None, count)
    return [
        row(
            f"issue and seal a PDF, ledger of {_LINES} entries", issued, "openssl cms, a process", peer, "1 s"
        ),
        row("verify it, the ledger too", verified, "", None, "1 s"),
    ]
