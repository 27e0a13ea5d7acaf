"""SESSION.toml, declared once: sessions, the settings that records hold, and certificates are read by it.

What an entry may be stands here. What depends on the data (whether a unit is of the column's dimension, a
term of the model) is judged where it is read; all of it happens before anything is fitted or written.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

from toolkit.calibration.records.record import Zero
from toolkit.calibration.session.certificate import Certificate
from toolkit.calibration.terms import INTERCEPT, NAME, NAME_FORM
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
    build,
)
from toolkit.units import si_scale, unit

# It is a folder's name and the beginning of files' names, which file systems limit to 255 bytes.
INSTRUMENT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,199}\Z")
INSTRUMENT_FORM = "letters, digits, '-', '_' and '.', 200 at most"
_FORMAT = Format(
    title="session", wrong="session", missing="session", schema=1,
    next_step="correct {key}; nothing was written",
)  # fmt: skip
_LOADS, _INDICATIONS = Names(of="loads"), Names(of="indications")
_RESERVED = {"run", "direction", "rotation", INTERCEPT, "abs"}


_Date = Annotated[str | None, Day()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """A number with its unit."""

    value: Annotated[float, Entry(expected="a finite number", rule="wrong-value", example=1)]
    unit: Annotated[str, Entry(expected="a unit such as 'N'", rule="no-unit", example="N")]

    def __str__(self) -> str:
        """Return it as a session writes it."""
        return f'{{ value = {self.value}, unit = "{self.unit}" }}'

    def si(self, dimension: str, where: object) -> float:
        """Return it in SI; ``unit-dimension`` where its unit is of another dimension."""
        stated = unit(self.unit, where=where)
        if stated.dimension == dimension:
            return self.value * stated.factor + stated.offset
        return self.value * si_scale(self.unit, dimension, where=where)


Stated = float | Amount
_ByIndication = Annotated[Mapping[str, Stated], _INDICATIONS]
_WithUnit = Annotated[Amount, Entry(expected="{ value, unit }", rule="no-unit")]
_PLAIN = "a number in the column's unit, or { value, unit }"
_POSITIVE = f"{_PLAIN}, above zero; leave out what is not known"
_SIZE = "a number above zero; leave out what is not known"
_ONE_COUNT = (
    "a number above zero; a reversed bridge shows in the sign of its coefficient, which has a gate of its own"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Indications without load, or with the shunt, at a moment of the session."""

    when: Annotated[str, Entry(expected='a text: "before", "after", "run 1", "shunt"', example="before")]
    values: Annotated[
        _ByIndication | tuple[Stated, ...] | Stated,
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

    load: Annotated[str | Stated, Entry(expected="a load, a number, or { value, unit }", example="FY")]
    seconds: Annotated[
        float, Unit("s", plain=True), AtLeast(0), Entry(expected="seconds, zero or more", example=30)
    ]
    value: Annotated[
        _ByIndication | tuple[Stated, ...] | Stated,
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
        float, AtLeast(0), Entry(expected="a standard deviation at the largest load, zero or more", example=0)
    ]
    unit: Annotated[str, Text(numbers="int"), Entry(expected="a unit of the load such as 'N'", example="N")]


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureCoefficient:
    """What a kelvin does to a cell."""

    span: Annotated[
        Stated | None, Entry("relative", expected="a number per kelvin, or { value, unit } in %/K")
    ] = None
    zero: Annotated[
        Stated | None, Entry("in the column's unit", expected="a number per kelvin, or { value, unit }")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CellEntries:
    """What is stated of a load cell."""

    serial: Annotated[
        str | None, Text(numbers="int"), Entry("serial number", expected='a text: serial = "..."')
    ] = None
    resolution: Annotated[Stated | None, Above(0), Entry("the smallest step", expected=_POSITIVE)] = None
    scale: Annotated[
        Stated | None, Above(0),
        Entry("of one count", expected='a number above zero, or { value, unit = "mV/V" } of one count'),
    ] = None  # fmt: skip
    excitation: Annotated[
        float | None, Unit("V", plain=True), Above(0), Entry("of the bridge", expected="volts above zero")
    ] = None
    shunt_expected: Annotated[Stated | None, Entry("the step that the shunt makes", expected=_PLAIN)] = None
    shunt_measured: Annotated[
        Stated | None, Entry("the step that was read", expected=_PLAIN, together="shunt_expected")
    ] = None
    shunt_tolerance: Annotated[
        float | None, Unit("%", plain=True), Above(0),
        Entry("of the expected step; default 0.1 %", expected="per cent, above zero",
              together="shunt_expected"),
    ] = None  # fmt: skip
    u: Annotated[Stated | None, Above(0), Entry("standard uncertainty", expected=_POSITIVE)] = None
    bridge: Annotated[
        Literal["foil", "semiconductor"] | None,
        Entry("the gauges; a foil bridge gives at most 10 mV/V", example="semiconductor"),
    ] = None
    temperature_coefficient: Annotated[
        TemperatureCoefficient | Stated | None, Entry("of the span, or of span and zero, per kelvin")
    ] = None
    replacement: Annotated[
        str | None, Entry("why a cell was replaced", expected="a text: why the cell was replaced")
    ] = None

    def faults(self) -> Iterator[Fault]:
        """Yield sizes with a unit that are not above zero, and a shunt that is held against nothing."""
        for key, expected in (("resolution", _SIZE), ("u", _SIZE), ("scale", _ONE_COUNT)):
            entry = getattr(self, key)
            if isinstance(entry, Amount) and entry.value <= 0:
                yield Fault(key=(key, "value"), got=entry.value, expected=expected)
        step = self.shunt_expected
        if (step.value if isinstance(step, Amount) else step) == 0:
            yield Fault(key=("shunt_expected",), got=0, expected="a step that is not zero")
        lone = [key for key in ("shunt_measured", "shunt_tolerance") if getattr(self, key) is not None]
        if step is None and lone:
            expected = f"the step that {lone[0]} is held against"
            yield Fault(key=("shunt_expected",), expected=expected, kind="missing")


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
    # Beyond a half, a reading of half the size, or of half again, would agree.
    tolerance: Annotated[float, Above(0), AtMost(0.5), Entry("as a share of the load")] = 0.2

    def faults(self) -> Iterator[Fault]:
        """Yield a load of zero, which has no direction."""
        if self.value.value == 0:
            yield Fault(key=("value", "value"), got=0, expected="a load that is not zero")


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


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """What was calibrated, by whom, and how it is fitted."""

    instrument: Annotated[
        str, Text(strip=True),
        Entry("what was calibrated", expected='a text: instrument = "..."', example="hub"),
    ]  # fmt: skip
    date: Annotated[str, Day(), Entry("of the session")]
    operator: Annotated[
        str, Text(strip=True), Entry("who calibrated", expected='a text: operator = "..."')
    ]  # fmt: skip
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


@dataclass(frozen=True, kw_only=True)
class StatedEntries:
    """What is stated beside the fit; the settings that a record holds have it, but for ``check``."""

    FORMAT: ClassVar[Format] = _FORMAT

    phase: Annotated[Literal["as_found", "as_left"] | None, Entry("of the instrument", example="as_left")] = (
        None
    )
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

    @property
    def fit_zero(self) -> Zero:
        """How the zero enters the fit; readings of it say nothing of that."""
        zero = self.zero.fit if isinstance(self.zero, ZeroTable) else self.zero
        return "included" if isinstance(zero, tuple) else zero

    @property
    def zero_readings(self) -> tuple[Reading, ...]:
        """The entries of [[zero]], or of [[zero.readings]] below a table ``[zero]`` with ``fit``."""
        readings = self.zero.readings if isinstance(self.zero, ZeroTable) else self.zero
        return readings if isinstance(readings, tuple) else ()

    @property
    def check_file(self) -> str | None:
        """The name of the check loads' file; None where none is named."""
        return self.check.file or self.check.data if isinstance(self.check, CheckTable) else self.check

    def cell(self, name: str) -> CellEntries:
        """Return what is stated of an indication."""
        return dict(self.cells).get(name, CellEntries())


@dataclass(frozen=True, kw_only=True)
class SessionFile(StatedEntries, Fitted):
    """A calibration session: what was calibrated, against what, and how it is fitted."""

    FORMAT: ClassVar[Format] = _FORMAT

    def faults(self) -> Iterator[Fault]:
        """Yield names that cannot be, and a degree without a polynomial or a polynomial without one."""
        if not INSTRUMENT.match(self.instrument):
            yield Fault(key=("instrument",), got=self.instrument, expected=INSTRUMENT_FORM)
        for key, names in (("indications", self.indications), ("loads", self.loads)):
            if unfit := [name for name in names if not NAME.match(name)]:
                yield Fault(key=(key,), got=unfit, expected=NAME_FORM)
            if _RESERVED & set(names):
                expected = "different names, none of them run, direction or rotation"
                yield Fault(key=(key,), got=names, expected=expected)
        if set(self.indications) & set(self.loads):
            yield Fault(key=("loads",), got=self.loads, expected="names that are no indications")
        if self.model == "polynomial" and self.degree is None:
            yield Fault(key=("degree",), expected="a whole number from 1 to 9", kind="missing")
        if self.model != "polynomial" and self.degree is not None:
            expected = 'no degree, or model = "polynomial"'
            yield Fault(key=("degree",), got=self.degree, expected=expected)


def session_faults(raw: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return every entry of a parsed session that is unknown, missing or of the wrong kind."""
    return attempt(SessionFile, raw)[1]


def session_entries(raw: Mapping[str, Any], *, where: object) -> SessionFile:
    """Return the entries of a parsed session that was accepted: by `session_faults`, or by a version before.

    Raises
    ------
    ConfigError
        an entry that a record depends on cannot be used
    """
    return build(SessionFile, _read_here(raw), where, accepted=True)


@lru_cache(maxsize=64)
def stated_entries(settings: str, where: object) -> StatedEntries:
    """Return the entries of the settings (JSON) of a record, or of a session that is fitted; errors as above.

    The settings of a legacy import state nothing.
    """
    return build(StatedEntries, _read_here(json.loads(settings)), where, accepted=True)


def _read_here(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries without those that are judged elsewhere, since versions before took anything there.

    A certificate says of itself what it cannot print; who shares a standard is asked by gls alone; and of
    the name of the standard's certificate became what was taken from it.
    """
    entries = {key: entry for key, entry in raw.items() if key != "certificate"}
    reference = entries.get("reference")
    if isinstance(reference, dict):
        elsewhere = {"shared_group"} | ({"dcc"} if isinstance(reference.get("dcc"), dict) else set())
        entries["reference"] = {key: entry for key, entry in reference.items() if key not in elsewhere}
    return entries
