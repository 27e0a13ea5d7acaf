"""The command: its address, its end, and what is not opened to other computers."""

from __future__ import annotations

import contextlib
import datetime as dt
import http.client
import json
import os
import shutil
import signal
import ssl
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError
from toolkit.lab.signatures.people import enrol_person, revoke_key
from toolkit.trust.keys import open_signer
from toolkit.workbench.server import Listening, check_listening

START = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from toolkit.cli.main import run; run()"
)


def started(*words: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", START, "open", *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip


def test_it_prints_its_address_answers_there_and_ends_with_ctrl_c(lab: Path) -> None:
    process = started(lab, "--no-browser")
    assert process.stdout is not None
    assert process.stdout.readline() == f"workbench of {lab}\n"
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    assert process.stdout.readline() == "end it with Ctrl-C\n"
    with urllib.request.urlopen(address, timeout=20) as answer:  # noqa: S310  our own address
        assert "refresh" in answer.read().decode()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (0, "", "")


def test_the_browser_is_given_a_file_of_this_user_not_the_key(lab: Path, tmp_path: Path) -> None:
    # The command line of a browser is read by every user of the computer.
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\nprintf "%s\\n" "$1" > {tmp_path}/opened.part\n'
                       f'p="${{1#file://}}"; cat "$p" > {tmp_path}/page\n'
                       f'stat -c %a "$(dirname "$p")" >> {tmp_path}/page\n'
                       f"mv {tmp_path}/opened.part {tmp_path}/opened\n")  # fmt: skip
    browser.chmod(0o755)
    os.environ["BROWSER"] = str(browser)
    try:
        process = started(lab, "--json")
    finally:
        del os.environ["BROWSER"]
    end = time.monotonic() + 20
    while not (tmp_path / "opened").exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=20)
    address = json.loads(out)["address"]
    key = address.partition("key=")[2]
    opened = (tmp_path / "opened").read_text().strip()
    assert opened.startswith("file:///")
    assert key not in opened
    assert address in (tmp_path / "page").read_text()
    assert (tmp_path / "page").read_text().endswith("700\n")
    assert not Path(opened.removeprefix("file://")).exists()


def test_a_port_that_is_taken_is_exit_2(lab: Path) -> None:
    first = started(lab, "--no-browser", "--quiet", "--json")
    assert first.stdout is not None
    text = "".join(first.stdout.readline() for _ in range(5))
    port = json.loads(text)["address"].split(":")[2].partition("/")[0]
    second = started(lab, "--no-browser", "--json", "--port", port)
    out, _ = second.communicate(timeout=20)
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=20)
    assert (second.returncode, json.loads(out)["error"]["rule"]) == (2, "workbench-port")


@pytest.mark.parametrize("listening", [
    Listening(host="0.0.0.0"),  # noqa: S104  that it is refused is what is tested
    Listening(host="10.0.0.1", certificate=Path("c.pem"), key=Path("k.pem")),
    Listening(certificate=Path("c.pem")),
    Listening(key=Path("k.pem")),
])  # fmt: skip
def test_other_computers_need_a_certificate_and_people(lab: Path, listening: Listening) -> None:
    with pytest.raises(ConfigError) as caught:
        check_listening(listening, Registry(lab / "calibrations"))
    assert caught.value.rule == "workbench-host"


@dataclass
class Reached:
    """A workbench that other computers reach: its addresses by person, and who trusts its certificate."""

    address: dict[str, str]
    context: ssl.SSLContext
    registry: Registry
    keys: Path

    def ask(self, address: str, cookie: str | None = None) -> tuple[int, str, str]:
        """Return status, cookie and text of an address."""
        _, _, authority, *path = address.split("/")
        connection = http.client.HTTPSConnection(authority, context=self.context, timeout=20)
        with contextlib.closing(connection):
            connection.request("GET", "/" + "/".join(path), headers={"Cookie": cookie} if cookie else {})
            answer = connection.getresponse()
            return answer.status, answer.getheader("set-cookie") or "", answer.read().decode()

    def first_page(self, person: str) -> str:
        return self.address[person].partition("/open?")[0] + "/"

    def cookie(self, person: str) -> str:
        status, cookie, _ = self.ask(self.address[person])
        assert (status, "Secure" in cookie) == (200, True)
        return cookie.partition(";")[0]


@pytest.fixture
def reached(lab: Path, tmp_path: Path) -> Iterator[Reached]:
    """The workbench of a laboratory with people, at localhost by a certificate of a throw-away CA."""
    shutil.copytree(lab, tmp_path / "lab")
    registry, keys = Registry(tmp_path / "lab" / "calibrations"), tmp_path / "keys"
    keys.mkdir()
    for name in ("anna", "dora", "safe"):
        words = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(keys / name)]
        subprocess.run(words, check=True)
    registry.signers = (open_signer(keys / "anna", str),)
    for name in ("anna", "dora"):
        enrol_person(
            registry, name, name=f"{name.title()} Example", roles=("head",), key=keys / f"{name}.pub",
            reason="first", recovery=open_signer(keys / "safe", str) if name == "anna" else None,
        )  # fmt: skip
    issued(tmp_path)
    certificate = ("--certificate", tmp_path / "host.pem", "--key", tmp_path / "host.key")
    process = started(tmp_path / "lab", "--host", "localhost", *certificate, "--json")
    assert process.stdout is not None
    text = ""
    while not text.endswith("\n}\n"):
        line = process.stdout.readline()
        assert line, process.communicate()
        text += line
    answer = json.loads(text)
    assert answer["address"] is None
    yield Reached(
        answer["people"], ssl.create_default_context(cafile=str(tmp_path / "ca.pem")), registry, keys
    )
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20)[1] == ""


def issued(folder: Path) -> None:
    """Write a throw-away CA, and a certificate and key of localhost that it issued."""
    now, keys = dt.datetime.now(tz=dt.UTC), [ec.generate_private_key(ec.SECP256R1()) for _ in range(2)]
    ca = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "throw-away CA")])
    host = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    for name, subject, key in (("ca", ca, keys[0]), ("host", host, keys[1])):
        builder = (
            x509.CertificateBuilder().subject_name(subject).issuer_name(ca).public_key(key.public_key())
            .serial_number(x509.random_serial_number()).not_valid_before(now - dt.timedelta(hours=1))
            .not_valid_after(now + dt.timedelta(days=1))
            .add_extension(x509.BasicConstraints(ca=name == "ca", path_length=None), critical=True)
            .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        )  # fmt: skip
        pem = builder.sign(keys[0], hashes.SHA256()).public_bytes(Encoding.PEM)
        (folder / f"{name}.pem").write_bytes(pem)
    (folder / "host.key").write_bytes(
        keys[1].private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )


def test_other_computers_reach_it_by_its_certificate_each_person_alone(reached: Reached) -> None:
    assert set(reached.address) == {"anna", "dora", "recovery"}
    assert all(address.startswith("https://localhost:") for address in reached.address.values())
    cookies = {person: reached.cookie(person) for person in ("anna", "dora")}
    for person, cookie in cookies.items():
        status, _, text = reached.ask(reached.first_page(person), cookie)
        assert (status, f"{person.title()} Example" in text) == (200, True)
    # Neither the cookie of another person nor none opens a session.
    assert reached.ask(reached.first_page("anna"), cookies["dora"])[0] == 401
    assert reached.ask(reached.first_page("anna"))[0] == 401
    assert (
        reached.ask(reached.first_page("anna").replace(reached.first_page("anna")[-17:], "x" * 16))[0] == 404
    )


def test_a_stranger_to_the_ca_and_plain_http_get_nothing(reached: Reached) -> None:
    address = reached.address["anna"]
    with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
        urllib.request.urlopen(address, timeout=20)  # noqa: S310  our own address
    with pytest.raises((OSError, http.client.HTTPException)):
        urllib.request.urlopen(address.replace("https:", "http:"), timeout=20)  # noqa: S310


def test_a_person_whose_keys_are_revoked_is_let_in_no_more(reached: Reached) -> None:
    cookie = reached.cookie("dora")
    assert reached.ask(reached.first_page("dora"), cookie)[0] == 200
    revoke_key(reached.registry, "dora", fingerprint=None, since=reached.registry.now(), reason="lost")
    status, _, text = reached.ask(reached.first_page("dora"), cookie)
    assert (status, "let in no more" in text) == (401, True)
    assert reached.ask(reached.address["dora"])[0] == 401
    assert reached.ask(reached.first_page("anna"), reached.cookie("anna"))[0] == 200


def test_a_home_that_is_none_is_exit_2(tmp_path: Path) -> None:
    process = started(tmp_path, "--no-browser", "--json")
    out, _ = process.communicate(timeout=20)
    assert (process.returncode, json.loads(out)["error"]["rule"]) == (2, "no-home")
