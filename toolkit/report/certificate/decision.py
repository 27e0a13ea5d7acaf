"""Decision rules of a conformity statement: ILAC-G8:09/2019, clauses 4.2.1 and 4.2.3.

The assessed quantity is the deviation e of a check load, TL its tolerance and U the expanded uncertainty
for about 95 %. The risks are those of a normal distribution about e: the standard's worst cases.
"""

from __future__ import annotations

from toolkit.report.certificate.model import Verdict

RULES = {
    "simple": (
        "Simple acceptance (ILAC-G8:09/2019, 4.2.1): pass where |deviation| does not exceed the tolerance, "
        "else fail. The uncertainty is not part of the limit: for a deviation at the tolerance the risk of a "
        "false acceptance, or of a false rejection, is up to 50 %."
    ),
    "guard_band": (
        "Guard band w = U (ILAC-G8:09/2019, 4.2.3): pass where |deviation| does not exceed tolerance - U; "
        "conditional pass up to the tolerance; conditional fail up to tolerance + U; fail beyond. The risk "
        "of a false acceptance is at most 2.5 % for pass and 50 % for conditional pass; the risk of a false "
        "rejection is at most 2.5 % for fail and 50 % for conditional fail."
    ),
}


def decide(rule: str, deviation: float, tolerance: float, U: float) -> Verdict:
    """Return the statement of one deviation; all three in one unit.

    >>> [decide("guard_band", e, 1.0, 0.2) for e in (0.8, -0.9, 1.1, 1.3)]
    ['pass', 'conditionalPass', 'conditionalFail', 'fail']
    >>> decide("simple", 1.0, 1.0, 0.2), decide("simple", -1.01, 1.0, 0.2)
    ('pass', 'fail')
    """
    size = abs(deviation)
    if rule == "simple":
        return "pass" if size <= tolerance else "fail"
    if size <= tolerance - U:
        return "pass"
    if size <= tolerance:
        return "conditionalPass"
    return "conditionalFail" if size <= tolerance + U else "fail"
