"""Lines that state a time at which they were not there: before a key ended, before a version of the people.

The forger has a copy of the home from before the laboratory's people changed, and a key that held then. The
clock of a forger says what the forger wants: what tells is the place of a line, which each version of the
people names.
"""

from __future__ import annotations

import functools
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.trust.forgeries.changes import Forgery
from tests.trust.forgeries.laboratory import (
    DECISIONS,
    KEYS,
    RIG,
    believed,
    decide,
    event_of,
    laboratory,
    lines_of,
    signed_again,
    write_lines,
)
from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.trust.people import Demand, Person, Policy
from toolkit.trust.requested import Requested
from toolkit.trust.requests import read_request
from toolkit.trust.signing import HERE, Travel


def forgeries() -> Iterator[Forgery]:
    """Yield every decision by a key that was revoked since; ledgers cut and rewritten since; late answers."""
    for number, (event, name, _) in enumerate(DECISIONS):
        for what in ("revoked", "given another role"):
            yield Forgery(
                kind="dated back", what=f"{event['event']} by {name}, {what} since",
                accepted=functools.partial(_dated_back, number, what),
            )  # fmt: skip
        yield Forgery(kind="cut since", what=f"to {number} lines", accepted=functools.partial(_cut, number))
        yield Forgery(
            kind="rewritten since", what=f"from line {number + 1} on, all keys stolen",
            accepted=functools.partial(_rewritten, number),
        )  # fmt: skip
    yield Forgery(kind="answered late", what="people, after an entry", accepted=_answered_late)


@contextmanager
def _changed(act: Callable[[Path], object], name: str = "emil", *, revoked: bool = True) -> Iterator[Path]:
    """Yield a home whose people changed, with the ledger that ``act`` makes of a copy from before that."""
    with laboratory() as home:
        old = home.parent / "old"
        shutil.copytree(home, old)
        act(old)
        change_people(home, name, revoked=revoked)
        assert believed(home), "the honest ledger is to be in order"
        shutil.copytree(old / "calibrations", home / "calibrations", dirs_exist_ok=True)
        yield home


def change_people(home: Path, name: str, *, revoked: bool = True, travel: Travel = HERE) -> None:
    """Revoke a person's keys, or make an auditor of the person."""
    registry = Registry(home / "calibrations")
    version = registry.people().history.now
    assert version is not None
    person = version.people.of(name)
    assert person is not None
    keys = tuple(replace(key, until=max(key.since, now())) for key in person.keys)
    changed = Person(id=name, name=person.name, roles=person.roles, keys=keys)
    people = version.people.with_person(changed if revoked else replace(person, roles=("auditor",)))
    signers = () if travel != HERE else (KEYS["ben"],)
    enrol(registry.folder, people, signers, by="ben", reason="lost", travel=travel)


def _dated_back(number: int, what: str) -> bool:
    event, name, action = DECISIONS[number]
    fresh: Mapping[str, Any] = {**event, "id": "rig-r9" if event["event"] == "entered" else "rig-r3"}
    with _changed(
        lambda old: decide(old, fresh, name, action=action), name, revoked=what == "revoked"
    ) as home:
        return believed(home)


def _cut(count: int) -> bool:
    with _changed(lambda old: write_lines(old / "calibrations" / RIG, lines_of(old)[:count])) as home:
        return believed(home)


def _rewritten(number: int) -> bool:
    def rewrite(old: Path) -> None:
        lines = lines_of(old)
        lines[number] = {**lines[number], "note": "another"}
        keys = {at: [KEYS[DECISIONS[at][1]]] for at in range(number, len(lines))}
        signed_again(old, lines, keys)
        assert believed(old), "by itself it is to be in order"

    with _changed(rewrite) as home:
        return believed(home)


def _answered_late() -> bool:
    """Tell whether a change of people is entered that would judge an entry made after it was asked for."""
    with laboratory() as home:
        registry, path = Registry(home / "calibrations"), home.parent / "request.json"
        version = registry.people().history.now
        assert version is not None
        people = replace(version.people, policy=Policy(issue=Demand(roles=("head",))))

        def ask(travel: Travel) -> None:
            enrol(registry.folder, people, (), by="ben", reason="another policy", travel=travel)

        with suppress(Requested):
            ask(Travel(request=path))
        asked = now()
        while now() == asked:  # within one second the entry would not be later
            time.sleep(0.05)
        decide(home, event_of("entered", "rig-r9", now(), by="Carl Example"), "carl")
        path.write_text(read_request(path).signed(KEYS["ben"])[0].text)
        try:
            ask(Travel(answers=(read_request(path),)))
        except ToolkitError:
            assert believed(home), "the entry is to stand"
            return False
        return True
