"""SESSION.toml, declared once: the session's reader and the certificate both go by it.

Values whose meaning depends on the data or on one another (units, models, readings) are ``Any`` in this file
and judged where they are read; all of it happens before anything is fitted or written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from toolkit.declared import AtLeast, AtMost, Day, Entry, Fault, Format, Keyed, Names, Text, attempt

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
_LOADS, _INDICATIONS = Names(of="loads"), Names(of="indications")


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Indications without load, or with the shunt, at a moment of the session."""

    when: Annotated[Any, Entry(expected='a text: "before", "after", "run 1", "shunt"', example="before")]
    values: Annotated[
        Any, Entry(expected="{ indication = number }, or a list of numbers", example={"D51": 0})
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroTable:
    """The zero of the fit, and readings of it."""

    fit: Annotated[Any, Entry("included, tared or run", example="included")] = None
    readings: Annotated[tuple[Reading, ...], Entry("of the unloaded cells")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Creep:
    """A reading under a constant load."""

    load: Annotated[Any, Entry(expected="a load, a number, or { value, unit }", example="FY")]
    seconds: Annotated[Any, Entry(expected="seconds, zero or more", example=30)]
    value: Annotated[Any, Entry(expected="{ indication = number }", example={"D51": 0})]


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Expanded uncertainty of a reference load."""

    U: Annotated[Any, Entry("expanded uncertainty", expected="a number, zero or more", example=1)]
    k: Annotated[Any, Entry("coverage factor", expected="a positive number", example=2)]
    unit: Annotated[
        str, Text(empty=True),
        Entry(
            expected="a unit of the load such as 'N', or '%' of the applied load", rule="no-unit", example="N"
        ),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class BetweenRuns:
    """Scatter from run to run of a load."""

    zero: Annotated[Any, Entry(expected="a standard deviation, zero or more", example=0)]
    gain: Annotated[Any, Entry(expected="a standard deviation at the largest load, zero or more", example=0)]
    unit: Annotated[str, Text(numbers="int"), Entry(expected="a unit of the load such as 'N'", example="N")]


@dataclass(frozen=True, slots=True, kw_only=True)
class CellEntries:
    """What is stated of a load cell."""

    serial: Annotated[
        str | None, Text(numbers="int"), Entry("serial number", expected='a text: serial = "..."')
    ] = None
    resolution: Any = None
    scale: Any = None
    excitation: Any = None
    shunt_expected: Any = None
    shunt_measured: Any = None
    shunt_tolerance: Any = None
    u: Any = None
    temperature_coefficient: Any = None
    replacement: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedGroup:
    """Rows whose reference loads share an error."""

    column: Any = None
    error: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The standard that the loads were measured with."""

    standard: Annotated[
        str | None, Text(numbers="int"), Entry("name or number", expected='a text: standard = "..."')
    ] = None
    dcc: Annotated[
        str | None,
        Entry(
            "its digital certificate: U, k, range, number, dates are taken from it",
            expected='the name of a file, such as dcc = "standard.xml"', example="standard.xml",
        ),
    ] = None  # fmt: skip
    certificate: Annotated[
        str | None, Text(numbers="int"), Entry("of the standard", expected='a text: certificate = "..."')
    ] = None
    due: Annotated[_Date, Entry("when the standard is to be calibrated again")] = None
    shared_group: SharedGroup | Any = None
    uncertainty: Annotated[tuple[tuple[str, Uncertainty], ...], Keyed(), _LOADS, Entry("by load")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckTable:
    """The check loads."""

    file: Annotated[Any, Entry("name of their file", example="check.csv")] = None
    data: Annotated[Any, Entry("the same", example="check.csv")] = None
    tolerance: Annotated[tuple[tuple[str, Any], ...], Keyed(), _LOADS, Entry("by load, { value, unit }")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """A number with its unit."""

    value: Annotated[Any, Entry(expected="a number", example=1)]
    unit: Annotated[Any, Entry(expected="a unit such as 'N'", example="N")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Polarity:
    """A reading that tells the sign of indications: a load put on by hand."""

    load: Annotated[Any, Entry(expected='the name of a load, such as load = "FY"', example="FY")]
    value: Annotated[Amount | Any, Entry(expected="the load that was applied: { value, unit }", example=1)]
    indications: Annotated[
        Mapping[str, Amount | Any], Entry(expected="what it made: { NAME = { value, unit } }", example={})
    ]
    zero: Any = None
    tolerance: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StandardEntries:
    """What a standard's classification needs."""

    preloads: Annotated[
        int | None, AtLeast(0), AtMost(99),
        Entry(
            "how often the largest load was applied before the first run",
            expected="a whole number from 0 to 99",
        ),
    ] = None  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionFile:
    """A calibration session: what was calibrated, against what, and how it is fitted."""

    FORMAT: ClassVar[Format] = Format(
        title="session", wrong="session", missing="session", schema=1,
        next_step="correct {key}; nothing was written",
    )  # fmt: skip

    instrument: Annotated[
        Any, Entry("what was calibrated", expected='a text: instrument = "..."', example="hub")
    ]
    date: Annotated[str, Day(), Entry("of the session")]
    operator: Annotated[str, Entry("who calibrated", expected='a text: operator = "..."')]
    indications: Annotated[
        Any, Entry("columns of the cells", expected='a list of names such as ["FY", "MZ"]', example=["D51"])
    ]
    loads: Annotated[
        Any, Entry("columns of the loads", expected='a list of names such as ["FY", "MZ"]', example=["FY"])
    ]
    data: Annotated[
        Any,
        Entry(
            "the reference loads", example="loads.csv",
            expected='the name of a file, such as data = "loads.csv" or "loads.xlsx"',
        ),
    ]  # fmt: skip
    phase: Annotated[Literal["as_found", "as_left"] | None, Entry("of the instrument", example="as_left")] = (
        None
    )
    model: Annotated[Literal["linear", "polynomial", "balance"] | None, Entry("of the loads")] = None
    degree: Annotated[
        int | None, AtLeast(1), AtMost(9), Entry("of a polynomial", expected="a whole number from 1 to 9")
    ] = None
    method: Annotated[Literal["ols", "wls", "gls", "odr"] | None, Entry("of the fit")] = None
    drop: Annotated[tuple[str, ...], Entry("terms that are left out", expected="a list of term names")] = ()
    temperature: Annotated[
        Mapping[str, Any] | None,
        Entry("of the room", expected='{ value = 20, unit = "degC" }', example={"value": 20, "unit": "degC"}),
    ] = None
    check: Annotated[
        str | CheckTable | None,
        Entry("check loads", expected='check = "check.csv", or a table [check] with file and tolerance'),
    ] = None
    reference: Annotated[Reference | None, Entry("the standard that the loads were measured with")] = None
    between_runs: Annotated[tuple[tuple[str, BetweenRuns], ...], Keyed(), _LOADS, Entry("by load")] = ()
    cells: Annotated[tuple[tuple[str, CellEntries], ...], Keyed(), _INDICATIONS, Entry("by indication")] = ()
    zero: Annotated[
        tuple[Reading, ...] | ZeroTable | Any,
        Entry("included, tared or run; or readings", example="included"),
    ] = None
    creep: Annotated[tuple[Creep, ...], Entry("readings under a constant load")] = ()
    polarity: Annotated[tuple[Polarity, ...], Entry("readings that tell a sign")] = ()
    certificate: Annotated[Certificate | None, Entry("what it prints besides results")] = None
    standard: Annotated[StandardEntries | None, Entry("what a class of ISO 376 needs")] = None


def session_faults(raw: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return every entry of a parsed session that is unknown, missing or of the wrong kind."""
    return attempt(SessionFile, raw)[1]


def certificate_faults(table: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return the faults of a session's ``[certificate]``: records from before these checks may have some."""
    return attempt(Certificate, table)[1]
