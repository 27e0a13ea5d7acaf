"""SESSION.toml, declared once: the session's reader and the certificate both go by it.

What an entry may be stands here. What depends on the data or on other entries (whether a unit is of the
column's dimension, a term of the model) is judged where it is read; all of it happens before anything is
fitted or written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from toolkit.declared import (
    Above,
    AtLeast,
    AtMost,
    Day,
    Distinct,
    Entry,
    Fault,
    Format,
    Keyed,
    Names,
    Size,
    Text,
    Unit,
    attempt,
)

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
class Amount:
    """A number with its unit."""

    value: Annotated[float, Entry(expected="a finite number", rule="wrong-value", example=1)]
    unit: Annotated[str, Entry(expected="a unit such as 'N'", rule="no-unit", example="N")]


_Stated = float | Amount
_Named = Mapping[str, _Stated]
_WithUnit = Annotated[Amount, Entry(expected="{ value, unit }", rule="no-unit")]
_PLAIN = "a number in the column's unit, or { value, unit }"
_POSITIVE = f"{_PLAIN}, above zero; leave out what is not known"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Indications without load, or with the shunt, at a moment of the session."""

    when: Annotated[str, Entry(expected='a text: "before", "after", "run 1", "shunt"', example="before")]
    values: Annotated[
        _Named | tuple[_Stated, ...] | _Stated,
        Entry(expected="{ indication = number }, or a list of numbers", example={"D51": 0}),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroTable:
    """The zero of the fit, and readings of it."""

    fit: Annotated[Literal["included", "tared", "run"], Entry("how the zero enters the fit")] = "included"
    readings: Annotated[tuple[Reading, ...], Entry("of the unloaded cells")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Creep:
    """A reading under a constant load."""

    load: Annotated[str | _Stated, Entry(expected="a load, a number, or { value, unit }", example="FY")]
    seconds: Annotated[
        float,
        Unit("s", plain=True),
        AtLeast(0),
        Entry(expected="seconds, zero or more", example=30),
    ]
    value: Annotated[
        _Named | tuple[_Stated, ...] | _Stated,
        Entry(expected="{ indication = number }", example={"D51": 0}),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Expanded uncertainty of a reference load."""

    U: Annotated[
        float, AtLeast(0), Entry("expanded uncertainty", expected="a number, zero or more", example=1)
    ]
    k: Annotated[float, Above(0), Entry("coverage factor", example=2)]
    unit: Annotated[
        str, Text(empty=True),
        Entry(
            expected="a unit of the load such as 'N', or '%' of the applied load", rule="no-unit", example="N"
        ),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class BetweenRuns:
    """Scatter from run to run of a load."""

    zero: Annotated[float, AtLeast(0), Entry(expected="a standard deviation, zero or more", example=0)]
    gain: Annotated[
        float,
        AtLeast(0),
        Entry(expected="a standard deviation at the largest load, zero or more", example=0),
    ]
    unit: Annotated[str, Text(numbers="int"), Entry(expected="a unit of the load such as 'N'", example="N")]


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureCoefficient:
    """What a kelvin does to a cell."""

    span: Annotated[
        _Stated | None, Entry("relative", expected="a number per kelvin, or { value, unit } in %/K")
    ] = None
    zero: Annotated[
        _Stated | None, Entry("in the column's unit", expected="a number per kelvin, or { value, unit }")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CellEntries:
    """What is stated of a load cell."""

    serial: Annotated[
        str | None, Text(numbers="int"), Entry("serial number", expected='a text: serial = "..."')
    ] = None
    resolution: Annotated[_Stated | None, Above(0), Entry("the smallest step", expected=_POSITIVE)] = None
    scale: Annotated[
        _Stated | None, Above(0),
        Entry("of one count", expected='a number above zero, or { value, unit = "mV/V" } of one count'),
    ] = None  # fmt: skip
    excitation: Annotated[
        float | None,
        Unit("V", plain=True),
        Above(0),
        Entry("of the bridge", expected="volts above zero"),
    ] = None
    shunt_expected: Annotated[_Stated | None, Entry("the step that the shunt makes", expected=_PLAIN)] = None
    shunt_measured: Annotated[
        _Stated | None, Entry("the step that was read", expected=_PLAIN, together="shunt_expected")
    ] = None
    shunt_tolerance: Annotated[
        float | None, Unit("%", plain=True), Above(0),
        Entry("of the expected step; default 0.1 %", expected="per cent, above zero",
              together="shunt_expected"),
    ] = None  # fmt: skip
    u: Annotated[_Stated | None, Above(0), Entry("standard uncertainty", expected=_POSITIVE)] = None
    bridge: Annotated[
        Literal["foil", "semiconductor"] | None,
        Entry("the gauges; a foil bridge gives at most 10 mV/V", example="semiconductor"),
    ] = None
    temperature_coefficient: Annotated[
        TemperatureCoefficient | _Stated | None, Entry("of the span, or of span and zero, per kelvin")
    ] = None
    replacement: Annotated[
        str | None, Entry("why a cell was replaced", expected="a text: why the cell was replaced")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedGroup:
    """Rows whose reference loads share an error."""

    column: Annotated[
        str | None, Entry("that tells the groups; none: every row", expected="the name of a column")
    ] = None
    error: Annotated[Literal["proportional", "constant"], Entry("how the shared error acts")] = "proportional"


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
    shared_group: Annotated[
        str | SharedGroup | None,
        Entry("rows whose loads share an error", expected="run | rotation | direction | a load | a column"),
    ] = None
    uncertainty: Annotated[tuple[tuple[str, Uncertainty], ...], Keyed(), _LOADS, Entry("by load")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckTable:
    """The check loads."""

    file: Annotated[str | None, Entry("name of their file", example="check.csv")] = None
    data: Annotated[str | None, Entry("the same", example="check.csv")] = None
    tolerance: Annotated[tuple[tuple[str, _WithUnit], ...], Keyed(), _LOADS, Entry("by load")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Polarity:
    """A reading that tells the sign of indications: a load put on by hand."""

    load: Annotated[
        str,
        _LOADS,
        Entry("that was put on", expected='the name of a load, such as load = "FY"', example="FY"),
    ]
    value: Annotated[Amount, Entry("the load that was applied", expected="{ value, unit }")]
    indications: Annotated[
        tuple[tuple[str, _WithUnit], ...], Keyed(), _INDICATIONS,
        Entry("what it made", expected="{ NAME = { value, unit } }",
              example={"D51": {"value": 0.1, "unit": "mV/V"}}),
    ]  # fmt: skip
    zero: Annotated[
        tuple[tuple[str, _WithUnit], ...], Keyed(), _INDICATIONS,
        Entry("without load, where it is not zero", expected="{ NAME = { value, unit } }",
              example={"D51": {"value": 0.0, "unit": "mV/V"}}),
    ] = ()  # fmt: skip
    tolerance: Annotated[float, Above(0), AtMost(0.5), Entry("as a share of the load")] = 0.2


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
        str, Entry("what was calibrated", expected='a text: instrument = "..."', example="hub")
    ]
    date: Annotated[str, Day(), Entry("of the session")]
    operator: Annotated[str, Entry("who calibrated", expected='a text: operator = "..."')]
    indications: Annotated[
        tuple[str, ...], Size(), Distinct(),
        Entry(
            "columns of the cells", expected='a list of different names such as ["D51", "D52"]',
            example=["D51"],
        ),
    ]  # fmt: skip
    loads: Annotated[
        tuple[str, ...], Size(), Distinct(),
        Entry(
            "columns of the loads", expected='a list of different names such as ["FY", "MZ"]',
            example=["FY"],
        ),
    ]  # fmt: skip
    data: Annotated[
        str,
        Entry(
            "the reference loads", example="loads.csv",
            expected='the name of a file, such as data = "loads.csv" or "loads.xlsx"',
        ),
    ]  # fmt: skip
    phase: Annotated[Literal["as_found", "as_left"] | None, Entry("of the instrument", example="as_left")] = (
        None
    )
    model: Annotated[
        Literal["linear", "polynomial", "balance"],
        Entry("of the loads; a polynomial has a degree", example="polynomial", together="degree"),
    ] = "linear"
    degree: Annotated[
        int | None,
        AtLeast(1),
        AtMost(9),
        Entry("of a polynomial", expected="a whole number from 1 to 9", example=2, together="model"),
    ] = None
    method: Annotated[Literal["ols", "wls", "gls", "odr"], Entry("of the fit")] = "ols"
    drop: Annotated[
        tuple[str, ...],
        Entry("terms that are left out", expected="a list of term names", example=["intercept"]),
    ] = ()
    temperature: Annotated[
        Amount | None,
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
        Literal["included", "tared", "run"] | tuple[Reading, ...] | ZeroTable,
        Entry("how the zero enters the fit, or readings of it", example="included"),
    ] = "included"
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
