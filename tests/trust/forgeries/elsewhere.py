"""What is honest somewhere else: of another home, another log, another purpose, another spelling."""

from __future__ import annotations

import functools
import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest import mock

from tests.trust.forgeries.changes import Forgery
from tests.trust.forgeries.laboratory import (
    DECISIONS,
    KEYS,
    RIG,
    ROLES,
    SINCE,
    believed,
    decide,
    event_of,
    key_of,
    laboratory,
    lines_of,
    new_signer,
    people,
    signed_again,
    write_lines,
)
from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry import people_log
from toolkit.calibration.registry.ledger import head_bytes
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes
from toolkit.lab.signatures.people import anchor_document, check_against, checkpoint_of
from toolkit.trust.decisions import unsigned
from toolkit.trust.people import Key, People, Person, parse_people
from toolkit.trust.requests import parse_request

_APPROVAL = 1  # its place among the decisions


def forgeries() -> Iterator[Forgery]:
    """Yield what a reader would believe who looked at the signature alone."""
    for purpose in ("file", "git", "toolkit-ledger@v2", "toolkit-ledger", "TOOLKIT-LEDGER@V1", ""):
        for stated in (True, False):
            yield Forgery(
                kind="another purpose",
                what=f"signed for {purpose!r}, {'as it says' if stated else 'not told'}",
                accepted=functools.partial(_of_purpose, purpose, stated=stated),
            )  # fmt: skip
    for number, (event, name, _) in enumerate(DECISIONS):
        yield Forgery(
            kind="replay from another home", what=f"{event['event']}, of the same people, keys and records",
            accepted=functools.partial(_replayed, number),
        )  # fmt: skip
        if name != "carl":
            yield Forgery(
                kind="a stolen operator's key", what=f"{event['event']}, and all after it, by carl",
                accepted=functools.partial(_by_operator, number),
            )  # fmt: skip
    for what, accepted in {
        "a ledger of the same people, keys and serials": _substituted,
        "a laboratory founded by a stranger, its names the same": _founded_by_stranger,
    }.items():
        yield Forgery(kind="another home in its place", what=what, accepted=accepted)
    for number in range(len(DECISIONS)):
        yield Forgery(
            kind="another log's checkpoint", what=f"entry {number + 1}, of the same origin",
            accepted=functools.partial(_other_log, number),
        )  # fmt: skip
    for member in ("by", "event", "id", "time", "signatures", "sha256", "prev"):
        for place in ("before", "behind"):
            yield Forgery(
                kind="a name twice", what=f"{member} of a line, {place}",
                accepted=functools.partial(_twice, member, place),
            )  # fmt: skip
        yield Forgery(
            kind="a name twice",
            what=f"{member} of a request",
            accepted=functools.partial(_twice_asked, member),
        )
    for text in ("dor\u0430", "d\u03bfra", "DORA", "dora\u200b", "dora ", "\uff44ora"):
        yield Forgery(
            kind="look-alike",
            what=f"a person of id {text!a}",
            accepted=functools.partial(_enrolled_as, text, "X"),
        )
    for text in ("Dor\u0430 Example", "Dora\u00a0Example", "DORA EXAMPLE", "Dora \u200bExample", "dora"):
        yield Forgery(
            kind="look-alike", what=f"a person named {text!a}",
            accepted=functools.partial(_enrolled_as, "zoe", text),
        )  # fmt: skip
    for name in ("ledger.jsonl", "head.json"):
        yield Forgery(kind="of the log of people", what=name, accepted=functools.partial(_of_people, name))
    yield Forgery(kind="of the log of people", what="an enrolment among the decisions", accepted=_enrolment)


def _of_purpose(purpose: str, *, stated: bool) -> bool:
    with laboratory() as home:
        lines = lines_of(home)[: _APPROVAL + 1]
        line = lines[_APPROVAL]
        signed = KEYS["dora"].armour(canonical(unsigned(line)).encode(), purpose)
        row = {**line["signatures"][0], "sig": signed, **({"namespace": purpose} if stated else {})}
        write_lines(home / "calibrations" / RIG, [lines[0], {**line, "signatures": [row]}])
        return believed(home)


def _second_home(place: Path) -> Path:
    """Found a laboratory of the same people and keys, a second after the first, with the same decisions."""
    home, text = place / "second", people().text()
    (home / "calibrations").mkdir(parents=True)
    # As enrolment writes it: a key is of the laboratory from the second on in which it was enrolled there.
    again = parse_people(text.replace(SINCE, "2020-01-01T00:00:01Z").encode(), where=home)
    with mock.patch.object(people_log, "now", return_value="2025-10-01T00:00:01Z"):
        heads = [KEYS["anna"], KEYS["ben"]]
        enrol(home / "calibrations", again, heads, by="anna", reason="first enrolment")
    for event, name, action in DECISIONS:
        decide(home, event, name, action=action)
    return home


def _replayed(number: int) -> bool:
    """Put a decision of the other home at its place, the chain after it in order."""
    with laboratory() as home:
        lines = lines_of(home)[:number]
        write_lines(home / "calibrations" / RIG, [*lines, lines_of(_second_home(home.parent))[number]])
        return believed(home)


def _by_operator(number: int) -> bool:
    with laboratory() as home:
        lines = lines_of(home)
        signed_again(home, lines, {at: [KEYS["carl"]] for at in range(number, len(lines))})
        return believed(home)


def _held(home: Path, documents: Sequence[str]) -> bool:
    """Tell whether any document of another ledger is continued by the one of a home."""
    with tempfile.TemporaryDirectory() as place:
        path, held = Path(place) / "document.json", []
        for document in documents:
            path.write_text(document)
            held.append(
                check_against(Registry(home / "calibrations"), RIG, path)[1].continuity == "continues"
            )
        return any(held)


def _documents(home: Path) -> list[str]:
    registry = Registry(home / "calibrations", signers=[KEYS["anna"]])
    checkpoint, count = checkpoint_of(registry, RIG), len(registry.ledger(RIG).entries)
    proofs = [anchor_document(registry, RIG, seq, checkpoint) for seq in range(1, count + 1)]
    return [*proofs, checkpoint.text]


def _substituted() -> bool:
    with laboratory() as home:
        other = _second_home(home.parent)
        assert believed(other), "the other home is in order by itself: what was issued tells it"
        return _held(other, _documents(home))


def _founded_by_stranger() -> bool:
    """Tell whether what others hold takes a home for the laboratory's whose every key is a stranger's."""
    thieves = {name: new_signer() for name in ROLES}
    persons = tuple(
        Person(
            id=name, name=f"{name.title()} Example", roles=roles,
            keys=(Key(key=thieves[name].public.line, since="2020-01-01T00:00:00Z"),),
        )
        for name, roles in ROLES.items()
    )  # fmt: skip
    with laboratory() as home:
        documents = _documents(home)
        other = home.parent / "other"
        (other / "calibrations").mkdir(parents=True)
        with mock.patch.object(people_log, "now", return_value="2025-10-01T00:00:00Z"):
            heads = [thieves["anna"], thieves["ben"]]
            enrol(other / "calibrations", People(person=persons), heads, by="anna", reason="x")
        with mock.patch.dict(KEYS, thieves):
            for event, name, action in DECISIONS:
                decide(other, event, name, action=action)
        assert believed(other)
        return _held(other, documents)


def _other_log(number: int) -> bool:
    with laboratory() as home:
        return _held(home, [_documents(_second_home(home.parent))[number]])


def _twice(member: str, place: str) -> bool:
    """Write a name twice into a line: readers differ in which of the two they take."""
    with laboratory() as home:
        folder = home / "calibrations" / RIG
        lines = (folder / "ledger.jsonl").read_text().splitlines()
        body = json.loads(lines[-1])
        forged = f'"{member}":{json.dumps("mallory")}'
        inner = lines[-1][1:-1].replace(f'"sha256":"{body["sha256"]}",', "")
        text = f"{{{forged},{inner}}}" if place == "before" else f"{{{inner},{forged}}}"
        digest = sha256_bytes(text.encode())
        line = text.replace('"time":', f'"sha256":"{digest}","time":', 1)
        (folder / "ledger.jsonl").write_text("\n".join([*lines[:-1], line, ""]))
        (folder / "head.json").write_bytes(head_bytes(len(lines), digest))
        return believed(home)


def _twice_asked(member: str) -> bool:
    with laboratory() as home:
        line = unsigned(lines_of(home)[-1])
        people_text = max((home / "people").glob("people-*.toml")).read_text()
        message = canonical(line)
        parts = {"schema": 1, "people": people_text, "file": None, "operators": [], "signatures": []}
        try:
            parse_request(json.dumps({**parts, "message": message}).encode(), home / "r.json")
        except ToolkitError as error:
            raise AssertionError("the honest request is to be read") from error
        forged = message.replace("{", f'{{"{member}":"mallory",', 1)
        try:
            parse_request(json.dumps({**parts, "message": forged}).encode(), home / "r.json")
        except ToolkitError:
            return False
    return True


def _enrolled_as(person_id: str, name: str) -> bool:
    twin = Person(id=person_id, name=name, roles=("checker",), keys=(key_of("mallory"),))
    text = People(person=(*people().person, twin)).text()
    try:
        parse_people(text.encode(), where="people.toml")
    except ToolkitError:
        return False
    return True


def _of_people(name: str) -> bool:
    """Lay a file of the log of people, whose every line is signed, in the place of a ledger's."""
    with laboratory() as home:
        shutil.copyfile(home / "people" / name, home / "calibrations" / RIG / name)
        return believed(home)


def _enrolment() -> bool:
    """Tell whether a head's enrolment, entered among the decisions of an instrument, enrols anybody."""
    before = len(ROLES)
    with laboratory() as home:
        event = event_of("enrolled", "people-4", by="anna", reason="x", file="a" * 64)
        try:
            decide(home, event, "anna")
        except ToolkitError:
            return False
        now = Registry(home / "calibrations").people().history.now
        return now is None or len(now.people.person) != before
