"""Records that may not make a number of a test: refused by the one rule that every command goes by."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable

from toolkit.calibration.registry.approval import withdraw
from toolkit.calibration.registry.discard import discard
from toolkit.calibration.registry.standing import standing
from toolkit.qualification.gates.bench import Act, Bench, Demonstration, Refusals
from toolkit.qualification.gates.virtual_hub import FIRST, HUB, RIG, Session

_FIRST = f"{RIG}-r1"
_TEST = dt.date(2020, 7, 1)
_DAY = dt.timedelta(days=1)


def _use(
    name: str,
    rule: str,
    record_id: str | None,
    *,
    before: Callable[[Bench], object] | None = None,
    instrument: str = RIG,
    on: dt.date | None = _TEST,
    draft: bool = False,
) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        if before is not None:
            before(bench)

        def act() -> Refusals:
            use = standing(bench.registry, instrument, on=on, named=record_id).use(draft=draft)
            if bool(use.draft_reasons) is not draft:
                raise ValueError(f"the mark of a draft is wrong: {use.draft_reasons}")
            return ()

        return act

    rules = (rule,) if rule else ()
    return Demonstration(name=name, stage="use in a test", rules=rules, prepare=prepare)


def _candidate(bench: Bench) -> str:
    return bench.entered(Session())


def _refused(bench: Bench) -> str:
    return bench.entered(Session(factors={"E5": -1}))


def _withdrawn(bench: Bench) -> None:
    withdraw(bench.registry, _FIRST, on=_TEST, reason="a cell was overloaded")


def _superseded(bench: Bench) -> None:
    bench.approved(Session())


def _expired(bench: Bench) -> None:
    bench.approval(_FIRST, FIRST, recall="2 months", reason="its interval was set late")()


def _discarded(bench: Bench) -> None:
    discard(bench.registry, bench.entered(Session()), reason="a bridge was loose")


DEMONSTRATIONS: tuple[Demonstration, ...] = (
    _use("record in force", "", None),
    _use("candidate", "not-in-force", f"{RIG}-r2", before=_candidate),
    _use("candidate that its gates refuse", "not-in-force", f"{RIG}-r2", before=_refused),
    _use("candidate as a draft that says so", "", f"{RIG}-r2", before=_candidate, draft=True),
    _use("withdrawn record", "not-in-force", _FIRST, before=_withdrawn),
    _use("superseded record", "not-in-force", _FIRST, before=_superseded),
    _use("expired record", "not-in-force", _FIRST, before=_expired),
    _use("record of another machine", "not-in-force", _FIRST, instrument=HUB),
    _use("record that is not in force yet", "not-in-force", _FIRST, on=FIRST - _DAY),
    _use("test without a date", "not-in-force", _FIRST, on=None),
    _use("no record in force on the test's day", "no-record-in-force", None, on=FIRST - _DAY),
    _use("discarded record", "not-in-force", f"{RIG}-r2", before=_discarded),
    _use("discarded record as a draft", "not-in-force", f"{RIG}-r2", before=_discarded, draft=True),
    _use("record that the registry has not", "missing", f"{RIG}-r9"),
)
