"""Decisions that people sign: who may, what every output then holds, and what is refused when it is read."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
import rfc8785
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from toolkit.calibration.records.use import signature_of
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.clock import day_of, now
from toolkit.calibration.registry.ledger import START, head_bytes, next_line
from toolkit.calibration.registry.people_log import enrol, place_of
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import standing
from toolkit.errors import ToolkitError, TrustError
from toolkit.lab.home import packaged_home
from toolkit.lab.signatures.issuing import issuers
from toolkit.lab.signatures.proofs import registry_ledger
from toolkit.lab.signatures.verification import verify_file
from toolkit.trust.keys import Signer
from toolkit.trust.people import NAMESPACE, Demand, Key, People, Person, Policy, Role
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.ssh import public_of, sign_with

RECORD = "m15-virtual-r1"
SINCE = "2020-01-01T00:00:00Z"


def _signer() -> Signer:
    private = Ed25519PrivateKey.generate()
    return Signer(public_of(private), lambda data: sign_with(private, data))


KEYS = {name: _signer() for name in ("anna", "ben", "carl", "dora", "mallory")}
ROLES: dict[str, tuple[Role, ...]] = {
    "anna": ("head",), "ben": ("head", "auditor"), "carl": ("operator",), "dora": ("checker",),
}  # fmt: skip


def _people(policy: Policy | None = None) -> People:
    people = tuple(
        Person(id=name, name=name.title(), roles=roles, keys=(Key(key=KEYS[name].public.line, since=SINCE),))
        for name, roles in ROLES.items()
    )
    return People(person=people, policy=policy or Policy())


@pytest.fixture
def home(tmp_path: Path) -> Path:
    shutil.copytree(packaged_home() / "calibrations", tmp_path / "calibrations")
    return tmp_path


def _registry(home: Path, *signers: str) -> Registry:
    return Registry(home / "calibrations", signers=[KEYS[name] for name in signers])


def _found(home: Path, policy: Policy | None = None) -> None:
    registry = _registry(home)
    signers = [KEYS["anna"], KEYS["ben"]]
    enrol(registry.folder, _people(policy), signers, by="anna", reason="first enrolment")


def _withdraw(home: Path, *signers: str) -> Registry:
    registry = _registry(home, *signers)
    by = next(iter(signers), "anna")
    withdraw(registry, RECORD, on=date(2026, 11, 21), reason="the reference was not traceable", by=by)
    return registry


def test_a_laboratory_without_people_works_unsigned(home: Path) -> None:
    registry = _withdraw(home)
    assert registry.status(RECORD).state == "withdrawn"
    assert registry.ledger("m15-virtual").entries[-1].signatures == ()


def test_a_key_that_would_prove_nothing_is_refused(home: Path) -> None:
    """Nobody is enrolled: who gives a key would take the entry for a signed one."""
    with pytest.raises(TrustError, match="nobody is enrolled"):
        _withdraw(home, "anna")
    with pytest.raises(TrustError, match="nobody is enrolled"):
        issuers(_registry(home, "anna"), RECORD)
    assert _registry(home).status(RECORD).state != "withdrawn"
    assert issuers(_registry(home), RECORD) == ()


def test_a_signed_decision_is_proved_by_openssh_from_the_ledger_alone(home: Path, tmp_path: Path) -> None:
    _found(home)
    registry = _withdraw(home, "anna")
    assert registry.status(RECORD).state == "withdrawn"
    line = json.loads(registry.ledger("m15-virtual").lines[-1])
    assert line["action"] == "withdraw"
    assert line["meaning"] == "withdrawn"
    assert line["subject"]["record"] == RECORD
    signature = line["signatures"][0]
    assert (signature["by"], signature["key"]) == ("anna", KEYS["anna"].public.fingerprint)
    message = rfc8785.dumps(
        {key: value for key, value in line.items() if key not in ("signatures", "sha256")}
    )
    (tmp_path / "allowed").write_text(f"anna {KEYS['anna'].public.line}\n")
    (tmp_path / "sig").write_text(signature["sig"])
    command = ["ssh-keygen", "-Y", "verify", "-f", str(tmp_path / "allowed"), "-I", "anna", "-n", NAMESPACE]
    command += ["-s", str(tmp_path / "sig")]
    subprocess.run(command, input=message, check=True, capture_output=True)


@pytest.mark.parametrize(
    ("signers", "rule"),
    [
        ((), "not-signed"),
        (("carl",), "not-allowed"),
        (("dora",), "not-allowed"),
        (("mallory",), "not-allowed"),
        (("anna", "mallory"), "not-allowed"),
    ],
)
def test_a_decision_takes_the_people_of_the_policy(home: Path, signers: tuple[str, ...], rule: str) -> None:
    _found(home)
    before = (home / "calibrations/m15-virtual/ledger.jsonl").read_bytes()
    with pytest.raises(TrustError) as refusal:
        _withdraw(home, *signers)
    assert refusal.value.rule == rule
    assert (home / "calibrations/m15-virtual/ledger.jsonl").read_bytes() == before
    assert _registry(home).status(RECORD).state == "approved"


def test_two_signatures_are_of_two_people(home: Path) -> None:
    _found(home, Policy(withdraw=Demand(roles=("head",), signatures=2)))
    for signers in (("anna",), ("anna", "anna")):
        with pytest.raises(TrustError):
            _withdraw(home, *signers)
    assert _withdraw(home, "anna", "ben").status(RECORD).state == "withdrawn"


def test_the_first_enrolment_takes_two_heads(home: Path) -> None:
    with pytest.raises(TrustError) as refusal:
        enrol(home / "calibrations", _people(), [KEYS["anna"]], by="anna", reason="first")
    assert refusal.value.rule == "not-allowed"
    assert not place_of(home / "calibrations").exists()


def test_people_are_changed_by_a_head_alone(home: Path) -> None:
    _found(home)
    people = _people()
    with pytest.raises(TrustError):
        enrol(home / "calibrations", people, [KEYS["dora"]], by="dora", reason="x")
    log = enrol(home / "calibrations", people, [KEYS["ben"]], by="ben", reason="x")
    assert len(log.history.versions) == 2


# What somebody with write access to the home may do, and every reader refuses.


def _lines(home: Path) -> list[dict[str, object]]:
    return [
        json.loads(line)
        for line in (home / "calibrations/m15-virtual/ledger.jsonl").read_bytes().splitlines()
    ]


def _rewrite(home: Path, lines: list[dict[str, object]]) -> None:
    """Write a ledger whose chain of hashes and head are in order."""
    text, prev = b"", START
    for number, body in enumerate(lines, start=1):
        event = {key: value for key, value in body.items() if key not in ("seq", "prev", "sha256")}
        line, prev = next_line(number, prev, event)
        text += line
    folder = home / "calibrations/m15-virtual"
    (folder / "ledger.jsonl").write_bytes(text)
    (folder / "head.json").write_bytes(head_bytes(len(lines), prev))


def _changed(key: str, value: object) -> Callable[[list[dict[str, object]]], list[dict[str, object]]]:
    return lambda lines: [*lines[:-1], {**lines[-1], key: value}]


def _signature(key: str, value: object) -> Callable[[list[dict[str, object]]], list[dict[str, object]]]:
    def change(lines: list[dict[str, object]]) -> list[dict[str, object]]:
        row = {**lines[-1]["signatures"][0], key: value}  # type: ignore[index]
        return [*lines[:-1], {**lines[-1], "signatures": [row]}]

    return change


FORGERIES: dict[str, Callable[[list[dict[str, object]]], list[dict[str, object]]]] = {
    "signatures dropped": _changed("signatures", []),
    "signatures of no list": _changed("signatures", {}),
    "another reason": _changed("reason", "another"),
    "another day": _changed("known_on", "2026-11-20"),
    "another person typed": _changed("by", "ben"),
    "another record": _changed("id", "m15-virtual-r2"),
    "another subject": _changed("subject", {"record": RECORD, "sha256": "0" * 64}),
    "another meaning": _changed("meaning", "approved"),
    "another action": _changed("action", "approve"),
    "another event": _changed("event", "discarded"),
    "another time": _changed("time", "2026-11-22T00:00:00Z"),
    "another tree": _changed("extends", "0" * 64),
    "other people": _changed("people", "0" * 64),
    "signed by another name": _signature("by", "ben"),
    "another key named": _signature("key", KEYS["ben"].public.fingerprint),
    "another purpose": _signature("namespace", "git"),
    "no signature": _signature("sig", ""),
    "a signature of another content": _signature("sig", KEYS["anna"].armour(b"{}", NAMESPACE)),
    "a stranger's signature": _signature("sig", KEYS["mallory"].armour(b"{}", NAMESPACE)),
    "replayed": lambda lines: [*lines, lines[-1]],
    "an unsigned line behind": lambda lines: [
        *lines, {"event": "approved", "id": RECORD, "time": "2099-01-01T00:00:00Z", "by": "x"}
    ],
    "reordered": lambda lines: [*lines[:-2], lines[-1], lines[-2]],
    "the line before dropped": lambda lines: [*lines[:-2], lines[-1]],
    "an old line rewritten": lambda lines: [{**lines[0], "by": "somebody"}, *lines[1:]],
    "an old line dropped": lambda lines: lines[1:],
}  # fmt: skip


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_rewritten_ledger_is_refused_by_every_reader(home: Path, forgery: str) -> None:
    _found(home)
    _withdraw(home, "anna")
    _rewrite(home, FORGERIES[forgery](_lines(home)))
    registry = _registry(home, "anna")
    assert registry.ledger("m15-virtual").damage is not None
    with pytest.raises(ToolkitError):
        registry.status(RECORD)
    with pytest.raises(ToolkitError):
        _withdraw(home, "anna", "ben")


def test_the_log_of_people_cannot_be_removed_beside_signed_lines(home: Path) -> None:
    _found(home)
    _withdraw(home, "anna")
    shutil.rmtree(home / "people")
    assert "log of people is missing" in str(_registry(home).ledger("m15-virtual").damage)


def test_another_root_does_not_take_over(home: Path) -> None:
    _found(home)
    _withdraw(home, "anna")
    shutil.rmtree(home / "people")
    own = replace(_people(), person=tuple(
        Person(id=name, name=name, roles=("head",), keys=(Key(key=_signer().public.line, since=SINCE),))
        for name in ("anna", "ben")
    ))  # fmt: skip
    with pytest.raises(TrustError):
        enrol(home / "calibrations", own, [KEYS["mallory"]], by="anna", reason="x")


def test_a_changed_people_file_is_damage(home: Path) -> None:
    _found(home)
    path = home / "people/people-1.toml"
    path.write_text(path.read_text().replace('"operator"', '"head"', 1))
    with pytest.raises(TrustError) as refusal:
        _registry(home).ledger("m15-virtual")
    assert refusal.value.rule == "people-log"


def test_what_a_lost_key_signed_after_its_loss_decides_nothing_and_before_it_holds(home: Path) -> None:
    _found(home)
    _withdraw(home, "anna")
    time = _registry(home).ledger("m15-virtual").entries[-1].time
    for until, state in ((time, "approved"), ("2100-01-01T00:00:00Z", "withdrawn")):
        person = _people().person[0]
        lost = replace(
            person, keys=(replace(person.keys[0], until=until), Key(key=_signer().public.line, since=SINCE))
        )
        enrol(
            home / "calibrations",
            _people().with_person(lost),
            [KEYS["ben"]],
            by="ben",
            reason="lost",
        )
        registry = _registry(home)
        if until == time:
            assert registry.status(RECORD).state == state
            return


def _named(registry: Registry) -> str:
    return registry.signature(RECORD)


def test_a_record_that_was_there_before_people_is_unsigned_whoever_withdraws_it(home: Path) -> None:
    assert _named(_registry(home)) == "unsigned"
    _found(home)
    assert _named(_withdraw(home, "anna")) == "unsigned"
    assert set(_registry(home).signatures("m15").values()) == {"unsigned"}


def test_the_people_who_signed_a_record_are_named(tmp_path: Path, make_session: Callable[..., Path]) -> None:
    (tmp_path / "calibrations").mkdir()
    _found(tmp_path)
    calibrate(make_session(), _registry(tmp_path, "carl"))
    today = now()[:10]
    entered = f"entered by Carl on {today}"
    assert _registry(tmp_path).signature("hub-r1") == entered
    dora = _registry(tmp_path, "dora")
    assert approve(dora, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="Dora").done
    signed = f"{entered}, approved by Dora on {today}"
    use = standing(_registry(tmp_path), "hub", on=date(2026, 2, 3)).use(draft=False)
    assert use.signature == use.as_dict()["signature"] == signed
    assert signature_of([use]) == f"hub-r1: {signed}"
    assert signature_of([use, replace(use, id="hub-r2", signature="unsigned")]) == "unsigned"
    # A key that turns out to have been lost before: what it signed is nobody's.
    person = _people().person[2]
    lost = replace(
        person, keys=(replace(person.keys[0], until=SINCE), Key(key=_signer().public.line, since=SINCE))
    )
    enrol(
        tmp_path / "calibrations",
        _people().with_person(lost),
        [KEYS["anna"]],
        by="anna",
        reason="x",
    )
    assert _registry(tmp_path).signature("hub-r1") == "unsigned"


def test_a_signed_record_stays_signed_once_it_is_withdrawn(
    tmp_path: Path, make_session: Callable[..., Path]
) -> None:
    (tmp_path / "calibrations").mkdir()
    _found(tmp_path)
    calibrate(make_session(), _registry(tmp_path, "carl"))
    approval = {"in_force_from": date(2026, 2, 1), "checked_by": "Dora"}
    assert approve(_registry(tmp_path, "dora"), "hub-r1", **approval).done
    path, ledger = tmp_path / "calibrations/hub/hub-r1.json", registry_ledger(lambda: _registry(tmp_path))
    assert verify_file(path, Trust(), ledger=ledger).code == 0
    withdraw(_registry(tmp_path, "anna"), "hub-r1", on=day_of(now()), reason="cell", by="anna")
    verdict = verify_file(path, Trust(), ledger=ledger)
    assert (verdict.signature, verdict.still_holds, verdict.code) == ("valid", False, 1)
