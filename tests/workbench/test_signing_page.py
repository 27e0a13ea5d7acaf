"""Decisions of people with keys: requested, signed elsewhere or by the agent; forged ones are refused."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.workbench.conftest import Answer, Served, plain
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.signatures.people import enrol_person, set_demand
from toolkit.trust.keys import open_signer
from toolkit.trust.people import Role
from toolkit.trust.requests import read_request

APPROVAL = {"in_force_from": "2024-03-01", "checked_by": "dora", "reason": "", "recall": "12 months"}
PEOPLE: dict[str, Role] = {"anna": "head", "dora": "checker", "carl": "operator", "a": "checker"}


@dataclass
class People:
    """A laboratory whose people have keys outside of its home."""

    bench: Served
    keys: Path

    def decide(self, decision: str = "approve", **form: str) -> Answer:
        return self.bench.send(f"/record/cell-r7/decide/{decision}", APPROVAL | form)

    def signed(self, name: str, request: str | None = None) -> str:
        """Return the answer of `toolkit sign` to the request that the page hands out."""
        text = request or self.bench.page("/request/cell-r7").body
        path = self.keys / "request.json"
        path.write_text(text)
        answer, _ = read_request(path).signed(open_signer(self.keys / name, str))
        return answer.text

    def hand_in(self, answer: str, request: str = "cell-r7") -> Answer:
        files = [("answer", "answer.json", answer.encode())]
        return self.bench.upload(f"/request/{request}/answer", files)

    @property
    def state(self) -> str:
        return self.bench.registry.status("cell-r7").state


@pytest.fixture
def people(own: Served, tmp_path_factory: pytest.TempPathFactory) -> People:
    """Four people: a head, a checker, an operator, and the checker who entered the sessions."""
    keys = tmp_path_factory.mktemp("keys")
    for name in (*PEOPLE, "safe"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", str(keys / name)]
        subprocess.run(command, check=True)
    registry = Registry(own.registry.folder, signers=(open_signer(keys / "anna", str),))
    for name, role in PEOPLE.items():
        enrol_person(
            registry, name, name=name.upper() if name == "a" else f"{name.title()} Example", roles=(role,),
            key=keys / f"{name}.pub", reason="first",
            recovery=open_signer(keys / "safe", str) if name == "anna" else None,
        )  # fmt: skip
    return People(own, keys)


def test_an_approval_is_requested_signed_elsewhere_and_entered(people: People) -> None:
    before = people.bench.registry.ledger("cell").entries
    requested = people.decide()
    assert requested.status == 303
    assert people.bench.registry.ledger("cell").entries == before
    body = people.bench.page("/record/cell-r7").body
    for text in ("To be signed", "Approve", "cell-r7", "dora", "1 of checker or head", "2024-03-01"):
        assert text.lower() in plain(body).lower()
    assert people.bench.page("/agenda/requests").data(count="requests") == ["1"]
    done = people.hand_in(people.signed("dora"))
    assert (done.status, done.headers["location"]) == (303, f"{people.bench.place}/record/cell-r7")
    entry = people.bench.registry.ledger("cell").entries[-1]
    assert (people.state, [row["by"] for row in entry.signatures]) == ("approved", ["dora"])
    assert people.bench.registry.ledger("cell").damage is None
    assert not list((people.bench.home / "requests").glob("*"))
    assert people.bench.page("/agenda/requests").data(count="requests") == ["0"]


def test_the_request_is_the_file_that_the_command_writes(
    people: People, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from toolkit.cli.main import run

    assert people.decide().status == 303
    words = ["calibration", "approve", "cell-r7", "--in-force-from", "2024-03-01", "--checked-by", "dora"]
    words += [
        "--recall",
        "12 months",
        "--home",
        str(people.bench.home),
        "--request",
        str(tmp_path / "r.json"),
    ]
    with pytest.raises(SystemExit):
        run(words)
    capsys.readouterr()

    def content(text: str) -> dict[str, object]:
        parts = json.loads(text)
        return {**parts, "message": {**json.loads(parts["message"]), "time": "", "clock": ""}}

    page = people.bench.page("/request/cell-r7")
    assert content(page.body) == content((tmp_path / "r.json").read_text())
    assert page.headers["content-disposition"] == 'attachment; filename="cell-r7.request.json"'
    # The answer of one is the answer of the command too.
    (tmp_path / "answer.json").write_text(people.signed("dora"))
    with pytest.raises(SystemExit) as ended:
        run([*words[:-2], "--answer", str(tmp_path / "answer.json")])
    assert (ended.value.code, people.state) == (0, "approved")


@pytest.mark.parametrize(("person", "reason"), [
    ("carl", "carl is operator"), ("a", "entered"), ("nobody", "nobody of this name"), ("", "names"),
])  # fmt: skip
def test_who_cannot_approve_is_refused_at_the_form(people: People, person: str, reason: str) -> None:
    answer = people.decide(checked_by=person, reason="typed already")
    assert answer.status == 400
    assert reason in plain(answer.body)
    assert "typed already" in answer.body
    assert not list((people.bench.home / "requests").glob("*"))


def test_two_people_and_two_keys(people: People) -> None:
    set_demand(
        Registry(people.bench.registry.folder, signers=(open_signer(people.keys / "anna", str),)),
        "approve", roles=("checker", "head"), signatures=2, reason="two",
    )  # fmt: skip
    same = people.decide(approved_by="dora")
    assert (same.status, "different names" in plain(same.body)) == (400, True)
    assert people.decide(approved_by="anna").status == 303
    waiting = people.decide(approved_by="anna")
    assert (waiting.status, "waits for its signatures already" in plain(waiting.body)) == (400, True)
    assert people.hand_in(people.signed("dora")).status == 303
    assert people.state == "candidate"
    body = people.bench.page("/record/cell-r7").body
    assert 'data-signers="1"' in body
    assert "1 of 2 signatures" in plain(body)
    # The second signs the file that the page hands out now: it has the first signature.
    assert people.hand_in(people.signed("anna")).status == 303
    assert people.state == "approved"
    entry = people.bench.registry.ledger("cell").entries[-1]
    assert sorted(row["by"] for row in entry.signatures) == ["anna", "dora"]


def test_two_who_sign_apart_and_one_who_signs_twice(people: People) -> None:
    set_demand(
        Registry(people.bench.registry.folder, signers=(open_signer(people.keys / "anna", str),)),
        "withdraw", roles=("checker", "head"), signatures=2, reason="two",
    )  # fmt: skip
    on = str(people.bench.guard.app.state.bench.today)  # type: ignore[attr-defined]
    assert people.hand_in(people.signed("dora") if people.decide().status == 303 else "").status == 303
    assert people.decide("withdraw", on=on, by="anna", reason="dropped").status == 303
    request = people.bench.page("/request/cell-r7").body
    first = people.signed("anna", request)
    assert people.hand_in(first).status == 303
    again = people.hand_in(first)
    assert (again.status, "had not signed it before" in plain(again.body)) == (400, True)
    assert people.state == "approved"
    assert people.hand_in(people.signed("dora", request)).status == 303
    assert people.state == "withdrawn"


def test_forged_and_foreign_answers_are_refused_with_the_reason(people: People) -> None:
    people.decide()
    good = people.signed("dora")
    parts = json.loads(good)
    signature = parts["signatures"][0]
    later = {**parts, "message": parts["message"].replace("2024-03-01", "2020-01-01")}
    other = {**parts, "signatures": [{**signature, "by": "anna"}]}
    lines = signature["sig"].split("\n")
    lines[2] = lines[2][:10] + ("A" if lines[2][10] != "A" else "B") + lines[2][11:]
    forged = {**parts, "signatures": [{**signature, "sig": "\n".join(lines)}]}
    unsigned = {**parts, "signatures": []}
    people_changed = {**parts, "people": parts["people"].replace("Dora", "Doro")}
    answers: tuple[object, ...] = (later, other, forged, unsigned, people_changed, {}, [])
    for answer in answers:
        refused = people.hand_in(json.dumps(answer))
        assert refused.status == 400, answer
        assert "next step" in plain(refused.body)
        assert people.state == "candidate"
    for text in ("", "{", "\x00" * 1000, "[" * 100_000):
        assert people.hand_in(text).status == 400
    carl = people.keys / "carl.json"
    carl.write_text(good)
    assert people.hand_in(good).status == 303


def test_a_decision_that_the_ledger_overtook_can_only_be_dropped(people: People) -> None:
    people.decide()
    answer = people.signed("dora")
    from toolkit.calibration.registry.approval import discard

    signing = Registry(people.bench.registry.folder, signers=(open_signer(people.keys / "dora", str),))
    discard(signing, "cell-r6", reason="x", by="dora")
    refused = people.hand_in(answer)
    assert (refused.status, "1 entry later" in plain(refused.body)) == (400, True)
    body = people.bench.page("/record/cell-r7").body
    assert "Hand in the answer" not in body
    assert "1 entry later" in people.bench.page("/agenda/requests").body
    assert people.bench.send("/request/cell-r7/drop", {}).status == 303
    assert "Request approval" in people.bench.page("/record/cell-r7").body
    assert people.bench.send("/request/cell-r7/drop", {}).status == 404


def test_a_gate_that_blocks_meanwhile_keeps_the_request(
    people: People, monkeypatch: pytest.MonkeyPatch
) -> None:
    from toolkit.calibration.registry import approval
    from toolkit.calibration.registry.gates import GateResult
    from toolkit.calibration.registry.judgement import Judgement

    people.decide()
    answer = people.signed("dora")
    blocked = GateResult(rule="span", effect="blocks", where="FY", message="10 % off")
    with monkeypatch.context() as patch:
        patch.setattr(approval, "judge_stored", lambda *_, **__: Judgement(results=(blocked,), evidence=()))
        refused = people.hand_in(answer)
    assert (refused.status, "10 % off" in plain(refused.body)) == (400, True)
    assert people.state == "candidate"
    assert people.hand_in(answer).status == 303
    assert people.state == "approved"


def test_a_damaged_request_says_so_and_can_be_dropped(people: People) -> None:
    (people.bench.home / "requests").mkdir()
    (people.bench.home / "requests" / "cell-r7.json").write_text("{}")
    assert "no signing request" in plain(people.bench.page("/record/cell-r7").body)
    assert people.bench.page("/agenda/requests").data(count="requests") == ["1"]
    assert people.bench.send("/request/cell-r7/drop", {}).status == 303
    assert "Request approval" in people.bench.page("/record/cell-r7").body


@pytest.fixture
def agent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An SSH agent of the test's own."""
    place = tmp_path / "agent"
    process = subprocess.Popen(["ssh-agent", "-D", "-a", str(place)], stdout=subprocess.DEVNULL)
    monkeypatch.setenv("SSH_AUTH_SOCK", str(place))
    end = time.monotonic() + 30
    while not place.exists() and time.monotonic() < end:
        time.sleep(0.02)
    yield
    process.terminate()
    process.wait()


@pytest.mark.usefixtures("agent")
def test_the_agent_of_this_computer_signs_for_whom_it_has_a_key(people: People) -> None:
    people.decide()
    assert "/sign" not in people.bench.page("/record/cell-r7").body
    assert people.bench.send("/request/cell-r7/sign", {"person": "dora"}).status == 400
    for name in ("carl", "dora"):
        subprocess.run(
            ["ssh-add", "-q", str(people.keys / name)], check=True, capture_output=True, env=os.environ
        )
    body = people.bench.page("/record/cell-r7").body
    assert "Sign as Dora Example" in plain(body)
    assert "Sign as Carl" not in plain(body)
    for person, reason in (
        ("carl", "carl is operator"),
        ("anna", "no key of this person"),
        ("x", "enrolled"),
    ):
        refused = people.bench.send("/request/cell-r7/sign", {"person": person})
        assert (refused.status, reason in plain(refused.body)) == (400, True), person
    assert people.bench.send("/request/cell-r7/sign", {"person": "dora"}).status == 303
    assert people.state == "approved"


@pytest.mark.usefixtures("agent")
def test_the_agent_signs_nothing_for_other_computers(people: People) -> None:
    subprocess.run(["ssh-add", "-q", str(people.keys / "dora")], check=True, capture_output=True)
    people.decide()
    version = people.bench.registry.people().history.now
    assert version is not None
    bench = people.bench.guard.app.state.bench  # type: ignore[attr-defined]
    bench.person = version.people.of("dora")
    assert "Sign as" not in people.bench.page("/record/cell-r7").body
    assert people.bench.send("/request/cell-r7/sign", {"person": "dora"}).status == 400
    assert people.state == "candidate"


@pytest.mark.parametrize("name", ["..%2f..%2fpeople", "cell-r99", "../people", ".hidden", "cell-r7%00"])
def test_no_address_of_a_request_names_a_file(people: People, name: str) -> None:
    people.decide()
    assert people.bench.page(f"/request/{name}").status in (400, 404)
    assert people.bench.send(f"/request/{name}/drop", {}).status in (400, 404)
    assert (people.bench.home / "requests" / "cell-r7.json").exists()
