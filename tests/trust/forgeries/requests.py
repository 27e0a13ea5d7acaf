"""Requests that travel and the answers to them: every part by every change, and answers at the wrong time."""

from __future__ import annotations

import contextlib
import functools
import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from tests.trust.forgeries.changes import Forgery, changed
from tests.trust.forgeries.laboratory import KEYS, decide, event_of, laboratory
from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.trust.people import Demand, Policy
from toolkit.trust.requested import Requested
from toolkit.trust.requests import HOLDS, Request, read_request
from toolkit.trust.signing import Travel

_EVENT = event_of("discarded", "rig-r3", by="dora", reason="a slip", known_on="2026-03-01")


def request_of(home: Path, event: dict[str, Any] | None = None) -> Request:
    """Return the request of a decision."""
    path = home.parent / "request.json"
    try:
        decide(home, {**(event or _EVENT), "time": now()}, travel=Travel(request=path))
    except Requested:
        return read_request(path)
    raise AssertionError("it was entered")


def entered(home: Path, text: str, event: dict[str, Any] | None = None) -> bool:
    """Tell whether an answer enters a decision."""
    path = home.parent / "answer.json"
    path.write_text(text)
    try:
        decide(home, {**(event or _EVENT), "time": now()}, travel=Travel(answers=(read_request(path),)))
    except ToolkitError:
        return False
    return True


def forgeries() -> Iterator[Forgery]:
    """Yield every part of an answer by every change, of its message too; and answers out of place."""
    with laboratory() as home:
        request = request_of(home)
        answer = json.loads(request.signed(KEYS["dora"])[0].text)
        other = json.loads(
            request_of(home, {**_EVENT, "reason": "other", "by": "ben"}).signed(KEYS["ben"])[0].text
        )
    for kind, place, forged in changed(answer, other):
        yield _forged(kind, place, forged)
    body, elsewhere = json.loads(answer["message"]), json.loads(other["message"])
    for kind, place, forged in changed(body, elsewhere):
        text = json.dumps(forged, ensure_ascii=False, sort_keys=True, separators=(",", ":"), default=str)
        yield _forged(kind, f"message, {place}", {**answer, "message": text})
    for name, key in (("a stranger", "mallory"), ("another role", "emil"), ("an expired key", "expired")):
        yield Forgery(kind="signer of a request", what=name, accepted=functools.partial(_signed, key))
    for what, act in {
        "to an older head": _older, "entered twice": _twice, "after other people": _after_people,
        "signed twice by one person": _twice_signed, "to another decision": _another,
        "of the operator": _operator, "after a week": _old,
    }.items():  # fmt: skip
        yield Forgery(kind="answer out of place", what=what, accepted=act)


def _forged(kind: str, place: str, forged: Any) -> Forgery:
    def accepted() -> bool:
        # Of one request, its answers hold in copies of the home alone: time and head are those of the copy.
        with laboratory() as home:
            return entered(home, json.dumps(forged))

    return Forgery(kind="part of a request", what=f"{place}: {kind}", accepted=accepted)


def _signed(key: str) -> bool:
    with laboratory() as home:
        try:
            request_of(home).signed(KEYS[key])
        except ToolkitError:
            return False
    return True


def _answer(home: Path) -> str:
    return request_of(home).signed(KEYS["dora"])[0].text


def _older() -> bool:
    with laboratory() as home:
        text = _answer(home)
        decide(home, event_of("entered", "rig-r4", now(), by="Carl Example"), "carl")
        return entered(home, text)


def _twice() -> bool:
    with laboratory() as home:
        text = _answer(home)
        assert entered(home, text), "the honest answer is to be entered"
        return entered(home, text)


def _after_people() -> bool:
    with laboratory() as home:
        text = _answer(home)
        registry = Registry(home / "calibrations")
        version = registry.people().history.now
        assert version is not None
        people = replace(version.people, policy=Policy(issue=Demand(roles=("head",))))
        enrol(registry.folder, people, [KEYS["anna"]], by="anna", reason="another policy")
        return entered(home, text)


def _twice_signed() -> bool:
    with laboratory() as home:
        try:
            request_of(home).signed(KEYS["dora"])[0].signed(KEYS["dora-2"])
        except ToolkitError:
            return False
    return True


def _another() -> bool:
    with laboratory() as home:
        return entered(home, _answer(home), {**_EVENT, "reason": "something else"})


def _operator() -> bool:
    approval = event_of(
        "approved", "rig-r9", by="dora", known_on="2026-03-01", since="2026-03-01", unverifiable=[]
    )
    with laboratory() as home:
        decide(home, event_of("entered", "rig-r9", now(), by="x"), "dora")
        try:
            request_of(home, approval).signed(KEYS["dora-2"])
        except ToolkitError:
            return False
    return True


def _old() -> bool:
    past = datetime.now(tz=UTC) - HOLDS - timedelta(minutes=1)
    with laboratory() as home, tempfile.TemporaryDirectory() as place:
        path = Path(place) / "request.json"
        with contextlib.suppress(Requested):
            decide(home, {**_EVENT, "time": f"{past:%Y-%m-%dT%H:%M:%SZ}"}, travel=Travel(request=path))
        return entered(home, read_request(path).signed(KEYS["dora"])[0].text)
