"""What the pages share: the home, its registry, and answers that hold until the registry changes."""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from starlette.exceptions import HTTPException

from toolkit.calibration.registry.clock import today
from toolkit.errors import ToolkitError
from toolkit.lab.desk.pending import agent_people, pending_request
from toolkit.lab.desk.versions import Versions

if TYPE_CHECKING:
    from starlette.requests import Request

    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.desk.audited import Audited
    from toolkit.lab.desk.holdings import Holdings, Kind, Reported
    from toolkit.trust.people import Person
    from toolkit.workbench.guard import Keys


Answer = TypeVar("Answer")
_MOST_ANSWERS = 64
_MOST_AUDITS = 2


class Bench:
    """The workbench of one home. Answers that cost seconds are remembered by what they rest on.

    ``person``: whose session it is, where other computers reach the workbench; None: that of the server's own
    user.
    """

    def __init__(self, home: Path, registry: Registry, keys: Keys, *, person: Person | None = None) -> None:
        self.home, self.registry, self.keys, self.person = home, registry, keys, person
        self.versions = Versions()
        self._answers: dict[tuple[object, ...], object] = {}
        self._asked: dict[tuple[str, str | None], threading.Lock] = {}
        self._holdings: Holdings | None = None
        self._audited: dict[Path, tuple[object, Audited]] = {}
        self._reading = threading.Lock()
        self._reported: tuple[Holdings, Reported] | None = None

    @property
    def is_own(self) -> bool:
        """Whether only the computer of the server's own user reaches it."""
        return self.person is None

    @property
    def today(self) -> dt.date:
        """The day by which things are due."""
        return today()

    def holdings(self, *, again: bool = False) -> Holdings:
        """Return what the home holds, as it was when it was last looked through; ``again`` looks now."""
        from toolkit.lab.desk.holdings import holdings_of

        if self._holdings is None or again:
            self._holdings = holdings_of(self.home)
        return self._holdings

    def path_of(self, kind: Kind, holding_id: str) -> Path | None:
        """Return the folder of a holding by its id; the home is looked through where it is not known."""
        path = self.holdings().path(kind, holding_id)
        return path or self.holdings(again=True).path(kind, holding_id)

    def reported(self) -> Reported:
        """Return what the reports of the home rest on, read once for each look through it."""
        from toolkit.lab.desk.holdings import reported_inputs

        holdings = self.holdings()
        if self._reported is None or self._reported[0] is not holdings:
            self._reported = (holdings, reported_inputs(holdings))
        return self._reported[1]

    def audited(self, audit_id: str) -> Audited | None:
        """Return the answer of an audit, read again once it is another; None where none has this id."""
        from toolkit.lab.desk.audited import read_audited, stamp

        folder = self.path_of("audit", audit_id)
        if folder is None:
            return None
        with self._reading:
            now = stamp(folder)
            before, answer = self._audited.get(folder, (None, None))
            if answer is None or before != now:
                answer = read_audited(folder)
                while len(self._audited) >= _MOST_AUDITS:
                    self._audited.pop(next(iter(self._audited)))
                self._audited[folder] = (now, answer)
        return answer

    def remembered(
        self, question: str, instrument: str | None, ask: Callable[[], Answer], *, rests_on: object = None
    ) -> Answer:
        """Return an answer about an instrument's records (None: all), asked again when a byte changed.

        ``rests_on`` is what else it rests on, such as the hash of a file. Who asks the same meanwhile waits
        for that answer; who asks something else does not.
        """
        names = self.registry.instruments() if instrument is None else (instrument,)
        with self._asked.setdefault((question, instrument), threading.Lock()):
            state = tuple((name, self.registry.digest(name)) for name in names)
            key = (question, instrument, self.today, state, rests_on)
            if key not in self._answers:
                answer = ask()
                while len(self._answers) >= _MOST_ANSWERS:
                    self._answers.pop(next(iter(self._answers)), None)
                self._answers[key] = answer
                return answer
            return self._answers[key]  # type: ignore[return-value]


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


def holding(request: Request, kind: Kind) -> tuple[Bench, str, Path]:
    """Return the bench, the id in the address and the folder of that holding; 404 where there is none."""
    bench: Bench = request.app.state.bench
    name = request.path_params[kind]
    folder = bench.path_of(kind, name)
    if folder is None:
        raise HTTPException(404)
    return bench, name, folder
