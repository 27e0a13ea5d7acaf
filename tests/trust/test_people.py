"""A person whom a text names by id is titled by name and id, and nobody else is."""

from __future__ import annotations

import pytest

from tests.calibration.registry.test_signatures import KEYS, SINCE
from toolkit.trust.people import History, Key, People, Person, Version


def _version(since: str, **names: str) -> Version:
    people = tuple(
        Person(id=key, name=name, roles=("head",), keys=(Key(key=KEYS[key].public.line, since=SINCE),))
        for key, name in names.items()
    )
    return Version(since=since, sha256="", people=People(person=people), text="")


HISTORY = History(
    (
        _version("2026-01-01T00:00:00Z", anna="Anna Old", ben="ben"),
        _version("2026-06-01T00:00:00Z", anna="Anna New"),
    )
)


@pytest.mark.parametrize(
    ("text", "titled"),
    [
        ("anna", "Anna New (anna)"),
        (" Anna ", "Anna New (anna)"),
        ("Anna New", "Anna New"),
        ("ben", "ben"),
        ("somebody else", "somebody else"),
        ("", ""),
    ],
)
def test_an_id_is_titled_by_the_newest_name(text: str, titled: str) -> None:
    assert HISTORY.titled(text) == titled
    assert History().titled(text) == text
