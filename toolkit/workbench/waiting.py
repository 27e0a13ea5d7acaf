"""What waits for signatures, as its form shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from toolkit.errors import ToolkitError
from toolkit.lab.pending import agent_people, pending_request

if TYPE_CHECKING:
    from toolkit.workbench.bench import Bench


def waiting(bench: Bench, name: str) -> dict[str, Any]:
    """Return what waits under a name as its form shows it: in words, and who can sign it here."""
    from toolkit.trust.requests import words

    try:
        pending = pending_request(bench.home, bench.registry, name)
    except ToolkitError as error:
        return {"pending": None, "unreadable": error.as_dict()}
    if pending is None:
        return {"pending": None, "unreadable": None}
    able = agent_people(bench.registry, pending) if bench.is_own and pending.obstacle is None else ()
    names = {person.id: person.name for person in pending.request.version.people.person}
    return {
        "pending": pending, "unreadable": None, "words": words(pending.request),
        "agent": [(person, names[person]) for person in able],
        "signers": [names.get(person, person) for person in pending.signers],
    }  # fmt: skip
