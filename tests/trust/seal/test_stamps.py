"""Time stamps over a server on loopback: what they prove, and what they do not."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from asn1crypto import keys, tsp
from asn1crypto import x509 as asn1
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from pyhanko.sign.timestamps import DummyTimeStamper

from tests import commands
from tests.trust.seal.authority import Authority, make_authority
from tests.trust.seal.seal_factory import key, plain_pdf
from toolkit.errors import TrustError
from toolkit.lab.home import packaged_home
from toolkit.lab.signatures.sealing import Sealing
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import check_pdf
from toolkit.trust.seal.stamps import StampServer, check_stamp, stamp
from toolkit.trust.seal.x509 import Trust


@cache
def stamps() -> tuple[Authority, SealKey]:
    root = make_authority("Stamps")
    private = rsa.generate_private_key(public_exponent=65537, key_size=3072)
    return root, root.issue("Time", private=private, time_stamps=True)


@contextmanager
def served(kind: str = "application/timestamp-reply") -> Iterator[str]:
    """Yield the address of a time-stamp server on loopback."""
    _, server = stamps()
    private = server.private.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption())
    stamper = DummyTimeStamper(
        asn1.Certificate.load(server.certificate.public_bytes(Encoding.DER)),
        keys.PrivateKeyInfo.load(private),
    )

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked = tsp.TimeStampReq.load(self.rfile.read(int(self.headers["Content-Length"])))
            data = stamper.request_tsa_response(asked).dump()
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_args: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as listening:
        thread = threading.Thread(target=listening.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{listening.server_port}/"
        listening.shutdown()
        thread.join()


def test_a_stamp_is_of_its_data_and_by_whom_the_laboratory_trusts() -> None:
    root, _ = stamps()
    with served() as url:
        token = stamp(b"data", StampServer(url))
    proved = check_stamp(token, b"data", Trust(certificates=(root.certificate,)))
    assert (proved.state, proved.by) == ("valid", "Time")
    assert check_stamp(token, b"data", Trust()).state == "untrusted"
    with pytest.raises(TrustError):
        check_stamp(token, b"other", Trust(certificates=(root.certificate,)))
    for place in range(0, len(token), 97):
        changed = token[:place] + bytes([token[place] ^ 1]) + token[place + 1 :]
        try:
            state = check_stamp(changed, b"data", Trust(certificates=(root.certificate,))).state
        except TrustError:
            continue
        assert state == "untrusted" or check_stamp(changed, b"data", Trust()).at == proved.at


def test_a_server_that_gives_none_is_an_error_that_says_so() -> None:
    with served("text/html") as url, pytest.raises(TrustError) as refusal:
        stamp(b"data", StampServer(url))
    assert refusal.value.rule == "time-stamp"
    for address in (url, "file:///etc/hostname", "ftp://x", "http://127.0.0.1:1/"):
        with pytest.raises(TrustError):
            stamp(b"data", StampServer(address))


def test_a_sealed_document_takes_its_stamp_from_the_same_server(tmp_path: Path) -> None:
    root, _ = stamps()
    path = tmp_path / "report.pdf"
    with served() as url:
        path.write_bytes(Sealing(key=key(), stamps=url).seal_pdf(plain_pdf(), "report"))
    trust = Trust(certificates=(root.certificate, *key().chain))
    assert check_pdf(path.read_bytes(), trust).stamped


def test_ledger_prove_stamps_its_checkpoint_and_check_tells_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(packaged_home() / "calibrations", tmp_path / "calibrations")
    monkeypatch.chdir(tmp_path)

    with served() as url:
        code, proof, _ = commands.said("ledger", "prove", "m15", "--time-stamp", url)
    assert code == 0
    Path("proof.json").write_text(proof)
    checked = ("ledger", "check", "m15", "--against", "proof.json")
    assert commands.answer(*checked)[1]["time_stamp_state"] == "untrusted"
    (tmp_path / "trust/certificates").mkdir(parents=True)
    (tmp_path / "trust/certificates/stamps.pem").write_bytes(stamps()[0].pem)
    _, answer = commands.answer(*checked)
    assert (answer["ledger"], answer["time_stamp_state"], answer["time_stamp_by"]) == (
        "continues",
        "valid",
        "Time",
    )
    other = json.loads(commands.said("ledger", "prove", "m15-virtual").out)
    Path("proof.json").write_text(json.dumps({**other, "time_stamp": json.loads(proof)["time_stamp"]}))
    assert commands.said("ledger", "check", "m15-virtual", "--against", "proof.json").code == 2
