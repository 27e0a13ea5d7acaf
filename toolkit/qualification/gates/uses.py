"""Records that may not make a number of a test: refused by the one rule that every command goes by."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Any

from toolkit.calibration.registry.approval import discard, withdraw
from toolkit.calibration.registry.clock import today
from toolkit.calibration.registry.standing import standing
from toolkit.qualification.gates.bench import CHECKER, Act, Bench, Demonstration, Refusals
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
    withdraw(bench.registry, _FIRST, on=today(), void_from=_TEST, reason="a cell was overloaded", by=CHECKER)


def _superseded(bench: Bench) -> None:
    bench.approved(Session())


def _expired(bench: Bench) -> None:
    bench.approval(_FIRST, FIRST, recall="2 months", reason="its interval was set late")()


def _discarded(bench: Bench) -> None:
    discard(bench.registry, bench.entered(Session()), reason="a bridge was loose", by="B")


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


# What an approval refuses: signs, sizes, units, zeros, check loads and cells.


_NEW = {"E5": "QUALIFY-NEW"}


def _approval(name: str, rules: str, session: Session, **more: Any) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        return bench.judged(session, **more)

    return Demonstration(name=name, stage="approval", rules=tuple(rules.split()), prepare=prepare)


APPROVALS: tuple[Demonstration, ...] = (
    _approval("session as it should be, with a history", "", Session()),
    _approval("first session as it should be, with a machine definition", "", Session(instrument=HUB)),
    _approval("first session of a rig with polarity readings", "", Session(instrument="rig-2", reading=1)),
    _approval("E5 negated, against the history", "sign", Session(factors={"E5": -1})),
    _approval(
        "E5 negated, first session, against the machine definition", "polarity",
        Session(instrument=HUB, factors={"E5": -1}),
    ),
    _approval(
        "first session of a rig without polarity readings", "polarity-reading", Session(instrument="rig-2")
    ),
    _approval(
        "polarity readings of the opposite sign", "polarity-reading",
        Session(instrument="rig-2", reading=-1),
    ),
    _approval("FY in N headed kN, against the history", "range span", Session(units={"FY": "kN"})),
    _approval(
        "FY in N headed kN, first session, against the machine definition", "lever range",
        Session(instrument=HUB, units={"FY": "kN"}),
    ),
    _approval(
        "indications in mV/V headed V/V", "bridge-range range span",
        Session(units=dict.fromkeys(("D51", "D52", "E5"), "V/V")),
    ),
    _approval("FY and its unit both changed to kN", "", Session(factors={"FY": 1e-3}, units={"FY": "kN"})),
    _approval("D51 reads 5 % more", "span", Session(factors={"D51": 1.05})),
    _approval("E5 replaced without a reason", "replacement", Session(serials=_NEW, reading=1)),
    _approval("E5 replaced, with polarity readings and a reason", "", Session(
        serials=_NEW, reading=1), reason="E5 was overloaded"),
    _approval(
        "E5 replaced, its sign turned, with a reason", "sign",
        Session(serials=_NEW, factors={"E5": -1}), reason="E5 was overloaded",
    ),
    _approval("one serial stated for two cells", "serial", Session(
        serials={"D51": "QUALIFY-D52"}, reading=1), reason="D51 was exchanged"),
    _approval('zero = "tared" with 0.7 mV/V left on D51', "coarse-uncertainty tared",
              Session(offsets={"D51": 0.7})),
    _approval(
        'zero = "tared" with 0.7 mV/V left on D51, no row at zero load', "coarse-uncertainty tared",
        Session(offsets={"D51": 0.7}, zero_rows=False),
    ),
    _approval(
        "0.5 mV/V stated as the standard uncertainty of E5", "coarse-uncertainty",
        Session(text='u = { value = 0.5, unit = "mV/V" }\n'),
    ),
    _approval(
        "a reference of U = 0", "reference-zero",
        Session(text='[reference.uncertainty]\nFY = { U = 0.0, k = 2, unit = "N" }\n'),
    ),
    _approval("check loads 1 % off", "check-load", Session(check_factors={"FY": 1.01})),
    _approval(
        "tolerance of the check loads as large as a load", "check-tolerance",
        Session(tolerance='{ FY = { value = 3, unit = "kN" } }'),
    ),
)  # fmt: skip
