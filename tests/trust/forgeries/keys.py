"""Every decision by every key that may not make it: written through the registry, and written past it."""

from __future__ import annotations

import base64
import functools
import hashlib
import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import dsa, ec, padding, rsa
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from tests.trust.forgeries.changes import Forgery
from tests.trust.forgeries.laboratory import (
    DECISIONS,
    KEYS,
    RIG,
    believed,
    decide,
    key_of,
    laboratory,
    lines_of,
    new_signer,
    signed_again,
    write_lines,
)
from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.trust.decisions import unsigned
from toolkit.trust.people import NAMESPACE, RECOVERY, Key, People, Person
from toolkit.trust.ssh import MAGIC, PublicKey, parse_public

_WITH = {"stranger": "mallory", "expired": "expired", "not yet valid": "later", "another role": "emil"}


def forgeries() -> Iterator[Forgery]:
    """Yield what a stranger, a wrong role, a key out of its time and a second key sign; and weak keys."""
    for number, (event, name, action) in enumerate(DECISIONS):
        what = f"{action or event['event']}"
        for kind, key in _WITH.items():
            yield _written(kind, f"{what} by {key}", event, (key,), action)
            yield _past(kind, f"{what} by {key}, past the registry", number, (key,))
            yield _past(kind, f"{what} by {name} and {key}, past the registry", number, (name, key))
        yield _written("unsigned", what, event, (), action)
        yield _past("swapped", f"{what} by a new key in {name}'s name, past the registry", number, None)
    approval = DECISIONS[1][0]
    for who in ("anna", "dora example jr", "D.", "nobody", "Dora Example", "DORA", "d\u043era"):
        if who in ("anna", "dora example jr", "D.", "nobody"):
            yield _written(
                "typed name", f"checked by {who}, signed by dora", {**approval, "by": who}, ("dora",), None
            )
        both = {**approval, "approved_by": who}
        yield _written("typed name", f"approved by {who}, signed by dora", both, ("dora",), None)
    for name, entered in (("dora", "dora"), ("dora-2", "dora"), ("dora", "dora-2")):
        yield Forgery(
            kind="self-approval", what=f"entered by {entered}, approved by {name}",
            accepted=functools.partial(_self_approved, entered, name),
        )  # fmt: skip
    for text in ("dora", "Dora Example", "DORA  EXAMPLE", "Dora\u200b Example"):
        yield Forgery(
            kind="self-approval", what=f"operator {text} in the session, entered by carl, approved by dora",
            accepted=functools.partial(_self_approved, "carl", "dora", operator=text),
        )  # fmt: skip
    yield Forgery(
        kind="self-approval", what="entered by anna, approved by the recovery key that she keeps",
        accepted=_by_recovery,
    )  # fmt: skip
    yield Forgery(
        kind="self-approval", what="operator dora in the session, then renamed, approved by dora",
        accepted=_renamed,
    )  # fmt: skip
    for time in (
        "2025-12-31T23:59:59-12:00",
        "2025-12-31T23:59:59",
        "2025-12-31 23:59:59Z",
        "20251231T235959Z",
    ):
        yield Forgery(
            kind="expired", what=f"at {time}", accepted=functools.partial(_in_another_spelling, time)
        )
    yield Forgery(kind="one person twice", what="two keys of one head", accepted=_two_keys)
    for until in ("2026-02-28T00:00:00Z", "2026-03-01T12:00:00Z"):
        yield Forgery(
            kind="revoked", what=f"from {until}", accepted=functools.partial(_revoked_decides, until)
        )
    for kind, armour in WEAK.items():
        yield Forgery(kind="weak algorithm", what=kind, accepted=functools.partial(_weak, armour))
    for kind, line in PUBLIC.items():
        yield Forgery(
            kind="weak algorithm", what=f"{kind}, enrolled", accepted=functools.partial(_enrolled, line)
        )


def _written(kind: str, what: str, event: Mapping[str, Any], names: tuple[str, ...], action: Any) -> Forgery:
    def accepted() -> bool:
        fresh = {**event, "id": "rig-r9"} if event["event"] == "entered" else {**event, "id": "rig-r3"}
        with laboratory() as home:
            try:
                decide(home, fresh, *names, action=action)
            except ToolkitError:
                return False
        return True

    return Forgery(kind=kind, what=what, accepted=accepted)


def _past(kind: str, what: str, number: int, names: tuple[str, ...] | None) -> Forgery:
    def accepted() -> bool:
        signers = [new_signer()] if names is None else [KEYS[name] for name in names]
        with laboratory() as home:
            lines = lines_of(home)[: number + 1]
            signed_again(home, lines, {number: signers})
            return believed(home)

    return Forgery(kind=kind, what=what, accepted=accepted)


def _self_approved(entered: str, name: str, operator: str = "somebody else") -> bool:
    entry, approval = {**DECISIONS[0][0], "id": "rig-r9", "by": operator}, {**DECISIONS[1][0], "id": "rig-r9"}
    with laboratory() as home:
        decide(home, entry, entered)
        try:
            decide(home, approval, name)
        except ToolkitError:
            return False
    return True


def _by_recovery() -> bool:
    approval = {**DECISIONS[1][0], "id": "rig-r9", "by": RECOVERY}
    with laboratory() as home:
        registry = Registry(home / "calibrations")
        version = registry.people().history.now
        assert version is not None
        kept = Person(id=RECOVERY, name="Recovery key", roles=("head",), keys=(key_of("thief"),))
        people = version.people.with_person(kept)
        enrol(registry.folder, people, [KEYS["anna"]], by="anna", reason="kept apart")
        decide(home, {**DECISIONS[0][0], "id": "rig-r9", "by": "somebody"}, "anna")
        try:
            decide(home, approval, "thief")
        except ToolkitError:
            return False
    return True


def _renamed() -> bool:
    with laboratory() as home:
        decide(home, {**DECISIONS[0][0], "id": "rig-r9", "by": "Dora Example"}, "carl")
        registry = Registry(home / "calibrations")
        version = registry.people().history.now
        assert version is not None
        dora = version.people.of("dora")
        assert dora is not None
        people = version.people.with_person(replace(dora, name="Dora Sample"))
        enrol(registry.folder, people, [KEYS["anna"]], by="anna", reason="another name")
        try:
            decide(home, {**DECISIONS[1][0], "id": "rig-r9"}, "dora")
        except ToolkitError:
            return False
    return True


def _in_another_spelling(time: str) -> bool:
    """Tell whether a key that ended with 2025 decides at a time of 2026 that is spelled as one of before."""
    with laboratory() as home:
        lines = lines_of(home)[:2]
        lines = [{**line, "time": time} for line in lines]
        signed_again(home, lines, {0: [KEYS["carl"]], 1: [KEYS["expired"]]})
        return believed(home)


def _two_keys() -> bool:
    """Tell whether two keys of one person found a laboratory, which takes two heads."""
    keys = tuple(Key(key=KEYS[name].public.line, since="2020-01-01T00:00:00Z") for name in ("anna", "thief"))
    person = Person(id="anna", name="Anna", roles=("head",), keys=keys)
    with laboratory() as home:
        new = home.parent / "new" / "calibrations"
        new.mkdir(parents=True)
        try:
            enrol(new, People(person=(person,)), [KEYS["anna"], KEYS["thief"]], by="anna", reason="x")
        except ToolkitError:
            return False
    return True


def _revoked_decides(until: str) -> bool:
    """Tell whether what dora signed after her key was lost still puts a record in force."""
    with laboratory() as home:
        registry = Registry(home / "calibrations")
        version = registry.people().history.now
        assert version is not None
        dora = version.people.of("dora")
        assert dora is not None
        lost = tuple(Key(key=key.key, since=key.since, until=max(key.since, until)) for key in dora.keys)
        people = version.people.with_person(Person(id="dora", name=dora.name, roles=dora.roles, keys=lost))
        enrol(registry.folder, people, [KEYS["ben"]], by="ben", reason="lost")
        return any(entry.event == "approved" for entry in Registry(registry.folder).ledger(RIG).of("rig-r1"))


def _string(data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + data


def _number(value: int) -> bytes:
    return _string(value.to_bytes(value.bit_length() // 8 + 1, "big"))


def _sshsig(blob: bytes, algorithm: str, sign: Any, message: bytes, digest: str = "sha512") -> str:
    """Return an armoured signature of any algorithm: what a tool without our rules could write."""
    hashed = hashlib.new(digest, message).digest()
    data = MAGIC + _string(NAMESPACE.encode()) + _string(b"") + _string(digest.encode()) + _string(hashed)
    body = (
        MAGIC + struct.pack(">I", 1) + _string(blob) + _string(NAMESPACE.encode()) + _string(b"")
        + _string(digest.encode()) + _string(_string(algorithm.encode()) + _string(sign(data)))
    )  # fmt: skip
    text = base64.b64encode(body).decode()
    rows = [text[at : at + 70] for at in range(0, len(text), 70)]
    return "\n".join(["-----BEGIN SSH SIGNATURE-----", *rows, "-----END SSH SIGNATURE-----", ""])


@functools.cache
def _rsa(bits: int) -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(public_exponent=65537, key_size=bits)


@functools.cache
def _dsa() -> dsa.DSAPrivateKey:
    return dsa.generate_private_key(key_size=2048)


def _rsa_blob(bits: int, exponent: bytes = b"\1\0\1") -> bytes:
    return _string(b"ssh-rsa") + _string(exponent) + _number(_rsa(bits).public_key().public_numbers().n)


def _point(form: PublicFormat) -> str:
    kind = b"ecdsa-sha2-nistp256"
    point = ec.derive_private_key(7, ec.SECP256R1()).public_key().public_bytes(Encoding.X962, form)
    blob = _string(kind) + _string(b"nistp256") + _string(point)
    return f"{kind.decode()} {base64.b64encode(blob).decode()}"


def _dsa_blob() -> bytes:
    numbers = _dsa().public_key().public_numbers()
    group = numbers.parameter_numbers
    return _string(b"ssh-dss") + b"".join(map(_number, (group.p, group.q, group.g, numbers.y)))


def _by_rsa(bits: int, digest: Any, algorithm: str) -> Any:
    def armour(message: bytes) -> str:
        sign = lambda data: _rsa(bits).sign(data, padding.PKCS1v15(), digest)  # noqa: E731
        return _sshsig(_rsa_blob(bits), algorithm, sign, message)

    return armour


def _ed25519(digest: str) -> Any:
    dora = KEYS["dora"]
    return lambda message: _sshsig(
        dora.public.blob, "ssh-ed25519", lambda data: dora.sign(data)[-64:], message, digest
    )


WEAK: Mapping[str, Any] = {
    "RSA of 1024 bits": _by_rsa(1024, hashes.SHA512(), "rsa-sha2-512"),
    "RSA of 2048 bits": _by_rsa(2048, hashes.SHA512(), "rsa-sha2-512"),
    "RSA of 2048 bits, SHA-256": _by_rsa(2048, hashes.SHA256(), "rsa-sha2-256"),
    "RSA of 3072 bits by SHA-1": _by_rsa(3072, hashes.SHA1(), "ssh-rsa"),  # noqa: S303
    "DSA": lambda message: _sshsig(
        _dsa_blob(),
        "ssh-dss",
        lambda data: _dsa().sign(data, hashes.SHA1()),  # noqa: S303
        message,
    ),
    "Ed25519 over SHA-1": _ed25519("sha1"),
    "Ed25519 over MD5": _ed25519("md5"),
    "Ed25519 over SHA-224": _ed25519("sha224"),
}
PUBLIC = {
    "RSA of 1024 bits": lambda: PublicKey("ssh-rsa", _rsa_blob(1024)).line,
    "RSA of 2048 bits": lambda: PublicKey("ssh-rsa", _rsa_blob(2048)).line,
    "DSA": lambda: PublicKey("ssh-dss", _dsa_blob()).line,
    "another spelling, of an RSA key": lambda: PublicKey("ssh-rsa", _rsa_blob(3072, b"\0\0\1\0\1")).line,
    "another spelling, of a point": lambda: _point(PublicFormat.CompressedPoint),
}


def _weak(armour: Any) -> bool:
    with laboratory() as home:
        lines = lines_of(home)[:2]
        message = canonical(unsigned(lines[-1])).encode()
        row = {**lines[-1]["signatures"][0], "sig": armour(message)}
        write_lines(home / "calibrations" / RIG, [lines[0], {**lines[1], "signatures": [row]}])
        return believed(home)


def _enrolled(line: Any) -> bool:
    """Tell whether a weak key can be enrolled."""
    try:
        parse_public(line())
    except ToolkitError:
        return False
    return True
