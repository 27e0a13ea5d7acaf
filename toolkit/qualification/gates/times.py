"""Days and times that cannot be, names that may not be, and a session that cannot be read."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Any

from toolkit.calibration.registry.approval import discard, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.clock import today
from toolkit.calibration.session.read import read_session
from toolkit.qualification.gates.bench import CHECKER, Act, Bench, Demonstration, Refusals
from toolkit.qualification.gates.records import rewrite_ledger
from toolkit.qualification.gates.virtual_hub import FIRST, RIG, SECOND, Session

_DAY = dt.timedelta(days=1)
_FIRST = f"{RIG}-r1"


def _future_session(bench: Bench) -> Act:
    return _entry(bench, Session(day=today() + 3 * _DAY))


def _entry(bench: Bench, session: Session) -> Act:
    path = bench.written(session)

    def act() -> Refusals:
        calibrate(path, bench.registry)
        return ()

    return act


def _decision(name: str, rule: str, day: dt.date = SECOND, **more: Any) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        return bench.approval(bench.entered(Session()), day, **more)

    return Demonstration(name=name, stage="approval", rules=(rule,), prepare=prepare)


def _clock_set_back(bench: Bench) -> Act:
    record_id = bench.entered(Session())
    later = (dt.datetime.now(tz=dt.UTC) + _DAY).strftime("%Y-%m-%dT%H:%M:%SZ")
    rewrite_ledger(
        bench.registry.folder / RIG,
        lambda event: {**event, "time": later} if event["id"] == record_id else event,
    )
    return bench.approval(record_id, SECOND)


def _withdrawal(reason: str, on: dt.date) -> Callable[[Bench], Act]:
    def prepare(bench: Bench) -> Act:
        def act() -> Refusals:
            withdraw(bench.registry, _FIRST, on=on, reason=reason, by=CHECKER)
            return ()

        return act

    return prepare


def _approval_of_discarded(bench: Bench) -> Act:
    record_id = bench.entered(Session())
    discard(bench.registry, record_id, reason="a bridge was loose", by="B")
    return bench.approval(record_id, SECOND)


def _discarded_session(bench: Bench) -> Act:
    discard(bench.registry, bench.entered(Session()), reason="a bridge was loose", by="B")
    return _entry(bench, Session())


def _discard_of_approved(bench: Bench) -> Act:
    def act() -> Refusals:
        discard(bench.registry, _FIRST, reason="a bridge was loose", by="B")
        return ()

    return act


def _misspelt_certificate(bench: Bench) -> Act:
    path = bench.written(Session(text='[certificate]\ncustomr = "first person"\n'))

    def act() -> Refusals:
        read_session(path)
        return ()

    return act


DEMONSTRATIONS: tuple[Demonstration, ...] = (
    Demonstration(
        name="session in the future", stage="calibrate", rules=("time",), prepare=_future_session
    ),
    _decision(
        "decision before its session", "time", known_on=SECOND - _DAY, reason="entered late"
    ),
    _decision("decision in the future", "time", known_on=today() + 3 * _DAY, reason="planned"),
    _decision("decision dated back without a reason", "time", known_on=SECOND),
    _decision("in force before its session, without a reason", "approval", day=SECOND - _DAY),
    _decision("checked by the one who entered it", "names", checked_by="virtual operator"),
    _decision("recall interval that is none", "recall", recall="soon"),
    Demonstration(
        name="ledger entry before the one before it", stage="approval", rules=("time",),
        prepare=_clock_set_back,
    ),
    Demonstration(
        name="withdrawal before its session", stage="withdrawal", rules=("time",),
        prepare=_withdrawal("dropped", FIRST - _DAY),
    ),
    Demonstration(
        name="withdrawal before its approval", stage="withdrawal", rules=("time",),
        prepare=_withdrawal("dropped", SECOND),
    ),
    Demonstration(
        name="withdrawal without a reason", stage="withdrawal", rules=("withdrawal",),
        prepare=_withdrawal(" ", SECOND),
    ),
    Demonstration(
        name="discarded record approved", stage="approval", rules=("approval",),
        prepare=_approval_of_discarded,
    ),
    Demonstration(
        name="session of a discarded record", stage="calibrate", rules=("discarded",),
        prepare=_discarded_session,
    ),
    Demonstration(
        name="approved record discarded", stage="discard", rules=("discard",), prepare=_discard_of_approved
    ),
    Demonstration(
        name="unknown key in [certificate]", stage="reading", rules=("unknown-key",),
        prepare=_misspelt_certificate,
    ),
)  # fmt: skip
