"""What an approval refuses: signs, sizes, units, zeros, check loads and cells."""

from __future__ import annotations

from typing import Any

from toolkit.qualification.gates.bench import Act, Bench, Demonstration
from toolkit.qualification.gates.virtual_hub import HUB, Session

_NEW = {"E5": "QUALIFY-NEW"}


def _approval(name: str, rules: str, session: Session, **more: Any) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        return bench.judged(session, **more)

    return Demonstration(name=name, stage="approval", rules=tuple(rules.split()), prepare=prepare)


DEMONSTRATIONS: tuple[Demonstration, ...] = (
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
    _approval('zero = "tared" with 0.7 mV/V left on D51', "tared", Session(offsets={"D51": 0.7})),
    _approval(
        'zero = "tared" with 0.7 mV/V left on D51, no row at zero load', "tared",
        Session(offsets={"D51": 0.7}, zero_rows=False),
    ),
    _approval("check loads 1 % off", "check-load", Session(check_factors={"FY": 1.01})),
    _approval(
        "tolerance of the check loads as large as a load", "check-tolerance",
        Session(tolerance='{ FY = { value = 3, unit = "kN" } }'),
    ),
)  # fmt: skip
