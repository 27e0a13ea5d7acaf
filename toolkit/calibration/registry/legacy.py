"""The file of a legacy import: read into a record without a number, and checked for what cannot be.

Reading and checking are apart: a stored record is read again on every load and compared with its file, and
a stricter check of a later version must not refuse what an earlier one entered.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit, canonical
from toolkit.calibration.registry.refit import polarity
from toolkit.calibration.session.session_file import INSTRUMENT, INSTRUMENT_FORM
from toolkit.calibration.session.settings import wrong
from toolkit.calibration.session.statement_checks import check_load_unit
from toolkit.calibration.terms import INTERCEPT, NAME, parse_term
from toolkit.declared import Day, Entry, Fault, Format, Keyed, Size, Text, UnitName, plain, read_text
from toolkit.errors import ConfigError, ToolkitError, UnitError
from toolkit.files import sha256_bytes
from toolkit.units import si_scale, unit


@dataclass(frozen=True, slots=True, kw_only=True)
class LegacySource:
    """Where the coefficients come from."""

    title: Annotated[str, Entry("of the document", example="Calibration sheet 17")]
    place: Annotated[str | None, Text(empty=True, numbers="any"), Entry("section, page, table")] = None
    text: Annotated[
        str, Entry("the equations as printed, or how they were found", example="FY = 0.997 D51 + 0.647")
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class LegacyIndication:
    """An indication that the coefficients take."""

    name: Annotated[str, Entry("as the coefficients name it", example="D51")]
    unit: Annotated[str, UnitName(), Entry("in which the coefficients take it", example="lbf")]
    serial: Annotated[str | None, Text(empty=True, numbers="any"), Entry("of the cell")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LegacyLoad:
    """The equation of one load."""

    load: Annotated[str, Entry("its name", example="FY")]
    unit: Annotated[str, UnitName(), Entry("of the load", example="lbf")]
    coefficients: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Size(1),
        Entry("by term; 0 where an indication has none, the intercept last", example={"D51": 0.99719}),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class LegacyFile:
    """Coefficients that a source names, without the data behind them."""

    FORMAT: ClassVar[Format] = Format(
        title="legacy import", schema=1, wrong="legacy", missing="legacy",
        next_step="correct {key}; nothing was written",
    )  # fmt: skip

    instrument: Annotated[
        str, Text(pattern=INSTRUMENT.pattern),
        Entry("what was calibrated", example="rig", expected=INSTRUMENT_FORM),
    ]  # fmt: skip
    date: Annotated[str, Day(), Entry("of the source", example="2021-12-31")]
    entered_by: Annotated[str, Text(strip=True), Entry("who enters it", example="first person")]
    zero: Annotated[
        Literal["included", "tared"], Entry("whether the indications hold the zero", example="included")
    ]
    source: Annotated[LegacySource, Entry("where the coefficients come from")]
    indications: Annotated[tuple[LegacyIndication, ...], Size(1), Entry("of the load cells")]
    loads: Annotated[tuple[LegacyLoad, ...], Size(1), Entry("an equation each")]

    def faults(self) -> Iterator[Fault]:
        """Yield terms that cannot be read or take no indication, and an intercept that is not last."""
        cells = [cell.name for cell in self.indications]
        for number, load in enumerate(self.loads):
            terms = [term for term, _ in load.coefficients]
            for term in terms:
                key = ("loads", number, "coefficients", term)
                try:
                    parsed = parse_term(term)
                except ToolkitError as error:
                    yield Fault(
                        key=key, got=term, expected=str(error.expected), what="the term cannot be read"
                    )
                    continue
                if not set(parsed.indications) <= set(cells):
                    expected = ", ".join((*sorted(cells), INTERCEPT))
                    yield Fault(key=key, got=term, expected=expected, what="the term takes no indication")
            if INTERCEPT in terms[:-1]:
                place = ("loads", number, "coefficients")
                yield Fault(key=place, got=", ".join(terms), expected="the intercept last")


def read_legacy(data: bytes, *, where: object) -> CalibrationRecord:
    """Read a legacy file into a record that has no id yet.

    Raises
    ------
    ConfigError
        ``not-toml``, ``unknown-key``, ``unknown-unit``; ``legacy``: a value that is missing or cannot be used
    """
    file = read_text(LegacyFile, data, where=where)
    return CalibrationRecord(
        id="",
        instrument=file.instrument,
        kind="legacy",
        date=file.date,
        entered_by=file.entered_by,
        zero=file.zero,
        cells=tuple(Indication(name=c.name, unit=c.unit, serial=c.serial) for c in file.indications),
        loads=tuple(map(_fit, file.loads)),
        golden=Golden(),
        data=(),
        settings=canonical({"source": plain(file.source)}),
        inputs_sha256=sha256_bytes(data),
    )


def _fit(load: LegacyLoad) -> LoadFit:
    values = tuple(value for _, value in load.coefficients)
    return LoadFit(
        load=load.load, unit=load.unit, terms=tuple(term for term, _ in load.coefficients),
        coefficients=values, issued=values, polarity=polarity(values), method="legacy",
    )  # fmt: skip


def check_possible(record: CalibrationRecord, *, where: object) -> None:
    """Refuse a legacy record that no calibration can have given.

    Raises
    ------
    ConfigError
        ``legacy``: a name that stands twice, an indication that a load does not state; a coefficient of
        zero is stated too
    UnitError
        ``unit-dimension``: a force or moment in another unit, an indication without a dimension
    """
    names = [cell.name for cell in record.cells]
    loads = [load.load for load in record.loads]
    for key, entries in (("indications", names), ("loads", loads)):
        if any(not NAME.match(name) or name in (INTERCEPT, "abs") for name in entries):
            raise _wrong(where, key, ", ".join(entries), "names such as FY, MZ, D51")
        if twice := [name for name in dict.fromkeys(entries) if entries.count(name) > 1]:
            raise _wrong(where, key, f"{', '.join(twice)} more than once", f"each of the {key} once")
    if shared := set(names) & set(loads):
        raise _wrong(where, "loads", ", ".join(sorted(shared)), "names that are no indications")
    for cell in record.cells:
        place = f"{where}: indications, {cell.name}"
        si_scale(cell.unit, where=place)
        if unit(cell.unit).dimension in ("ratio", "angle"):
            raise UnitError(
                f"the unit of {cell.name} has no dimension",
                where=place, got=cell.unit, expected="what a load cell gives: lbf, N, mV/V, V, counts",
                next_step="state the unit in which the coefficients take it; nothing was written",
                rule="unit-dimension",
            )  # fmt: skip
    for load in record.loads:
        check_load_unit(load.load, load.unit, where=f"{where}: {load.load}.unit")
        missing = [name for name in names if name not in load.terms]
        if missing:
            raise _wrong(
                where, f"{load.load}.coefficients", f"no {', '.join(missing)} among {', '.join(load.terms)}",
                f"a coefficient of every indication ({', '.join(names)}); write 0 where it has none",
            )  # fmt: skip


def _wrong(where: object, key: str, actual: object, expected: str) -> ConfigError:
    return wrong(where, key, actual, expected, "legacy")
