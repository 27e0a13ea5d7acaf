"""``[certificate]`` of a SESSION.toml: what a certificate prints besides the results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from toolkit.declared import Day, Entry, Fault, Text, attempt

TEXTS = (
    "number laboratory address place country accreditation customer customer_address item method "
    "decision_rule interval opinions"
).split()
DECISION_RULES: Mapping[str, str] = {
    "simple": "simple",
    "simple acceptance": "simple",
    "guard band": "guard_band",
    "guard band w=u": "guard_band",
    "guarded acceptance": "guard_band",
    "guarded": "guard_band",
    "w=u": "guard_band",
}


def rule_of(text: str) -> str | None:
    """Return the decision rule that a session names; None for a text that names none.

    >>> rule_of("guard band, w = U"), rule_of("Simple acceptance"), rule_of("by eye")
    ('guard_band', 'simple', None)
    """
    plain = " ".join(text.lower().replace("_", " ").replace("-", " ").replace(",", " ").split())
    return DECISION_RULES.get(plain.replace(" = ", "=").replace("= ", "=").replace(" =", "="))


_Text = Annotated[str | None, Text(numbers="int")]
_Date = Annotated[str | None, Day()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What a certificate prints besides the results."""

    number: Annotated[_Text, Entry("of the certificate")] = None
    laboratory: Annotated[_Text, Entry("name of the laboratory")] = None
    address: Annotated[_Text, Entry("of the laboratory")] = None
    place: Annotated[_Text, Entry("where the calibration was made")] = None
    # As the digital certificate's schema has it: DCC 3.3.0, stringISO3166Type.
    country: Annotated[
        str | None, Text(pattern="[A-Z]{2}"), Entry(expected='an ISO 3166-1 code, such as "US"', example="US")
    ] = None
    accreditation: Annotated[_Text, Entry("number of the accreditation")] = None
    customer: _Text = None
    customer_address: _Text = None
    item: Annotated[_Text, Entry("what was calibrated")] = None
    method: Annotated[_Text, Entry("of the calibration")] = None
    decision_rule: Annotated[
        str | None, Text(accepts=rule_of),
        Entry("how conformity is decided", expected="simple | guard_band", example="simple"),
    ] = None  # fmt: skip
    interval: Annotated[_Text, Entry("until the next calibration")] = None
    interval_agreed: Annotated[bool, Entry("whether the customer agreed to the interval")] = False
    opinions: Annotated[_Text, Entry("and interpretations")] = None
    received: Annotated[_Date, Entry("when the item came")] = None
    due: Annotated[_Date, Entry("when it is to be calibrated again")] = None


def certificate_faults(table: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return the faults of a session's ``[certificate]``: records from before these checks may have some."""
    return attempt(Certificate, table)[1]
