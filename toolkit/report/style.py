"""The style file beside a template (``org.toml``): laboratory, language, units, decimals, names of styles."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, ClassVar

from toolkit.declared import AtLeast, AtMost, Entry, Format, Keyed, Size, Text, UnitName, read
from toolkit.units import si_scale
from toolkit.words.phrasebook import SOURCE, decimal_sign, languages, phrasebook

_DEFAULT_REQUIRED = ("tk:calibration.hash",)


def _is_language(name: str) -> bool:
    return name in languages()


_Phrases = Annotated[tuple[tuple[str, Annotated[str, Text(empty=True)]], ...], Keyed(), Size(0)]
_Maybe = Annotated[str | None, Text(empty=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class StyleLaboratory:
    """The laboratory, as documents name it."""

    name: Annotated[_Maybe, Entry("as documents print it")] = None
    address: Annotated[_Maybe, Entry("in a line, or in several")] = None
    place: Annotated[_Maybe, Entry("where certificates are issued")] = None
    contact: Annotated[_Maybe, Entry("telephone, mail address")] = None
    country: Annotated[_Maybe, Entry("ISO 3166-1, two letters")] = None
    accreditation: Annotated[_Maybe, Entry("mark and number")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StyleReport:
    """What stands in a report whose test names none."""

    method: Annotated[_Maybe, Entry("test method")] = None
    authorised_by: Annotated[_Maybe, Entry("who authorises reports")] = None
    function: Annotated[_Maybe, Entry("of that person")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StyleNames:
    """Names of the template's Word styles."""

    heading: Annotated[_Maybe, Entry("of headings", example="Heading 1")] = None
    caption: Annotated[_Maybe, Entry("of captions", example="Caption")] = None
    table: Annotated[_Maybe, Entry("of tables")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StyleUnits:
    """Units of forces and moments as documents print them."""

    force: Annotated[str, UnitName(("force",), as_written=True), Entry("N or lbf")] = "N"
    moment: Annotated[str, UnitName(("moment",), as_written=True), Entry("N*m or lbf*ft")] = "N*m"


@dataclass(frozen=True, slots=True, kw_only=True)
class StyleFile:
    """How the documents of a template write numbers and dates, and what the template must hold."""

    FORMAT: ClassVar[Format] = Format(
        title="style file", schema=1, next_step="correct {key} in the style file beside the template"
    )

    language: Annotated[
        str, Text(accepts=_is_language),
        Entry("of the toolkit's sentences", expected="en, de or fr"),
    ] = SOURCE  # fmt: skip
    decimal_comma: Annotated[bool, Entry("whether numbers have a comma")] = False
    dates: Annotated[str, Text(empty=True), Entry("form of dates, as strftime has it")] = "%Y-%m-%d"
    missing: Annotated[str, Entry("what --allow-missing prints", expected="a visible text")] = "n/a"
    required: Annotated[
        tuple[Annotated[str, Text(empty=True)], ...], Size(0), Entry("tags that the template must hold")
    ] = _DEFAULT_REQUIRED
    laboratory: Annotated[StyleLaboratory, Entry("of the documents")] = StyleLaboratory()
    report: Annotated[StyleReport, Entry("what a test may leave out")] = StyleReport()
    units: Annotated[StyleUnits, Entry("of forces and moments")] = StyleUnits()
    styles: Annotated[StyleNames, Entry("of the template")] = StyleNames()
    decimals: Annotated[
        tuple[tuple[str, int], ...], Keyed(), Size(0), AtLeast(0), AtMost(12),
        Entry("digits after the point, by unit, by tag or by table.column"),
    ] = ()  # fmt: skip
    words: Annotated[_Phrases, Entry("the organisation's own words for phrases and terms")] = ()
    alt: Annotated[_Phrases, Entry("further words, for alternative texts alone")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How an organisation writes numbers and dates, and what its templates must hold.

    ``method``, ``authorised_by``, ``function`` stand in a report whose test names none. ``decimals`` maps a
    unit, a tag's path or ``<table>.<column>`` to digits after the point; ``styles`` maps heading, caption and
    table to the names of the template's Word styles. ``language`` is that of the toolkit's sentences;
    ``words`` are the organisation's own for phrases and terms of it, ``alt`` further ones for the sentences
    of alternative texts alone.
    """

    language: str = SOURCE

    laboratory: str | None = None
    address: str | None = None
    place: str | None = None
    contact: str | None = None
    country: str | None = None
    method: str | None = None
    authorised_by: str | None = None
    function: str | None = None
    accreditation: str | None = None
    decimal_comma: bool = False
    dates: str = "%Y-%m-%d"
    missing: str = "n/a"
    required: tuple[str, ...] = _DEFAULT_REQUIRED
    styles: tuple[tuple[str, str], ...] = ()
    decimals: tuple[tuple[str, int], ...] = ()
    words: tuple[tuple[str, str], ...] = ()
    alt: tuple[tuple[str, str], ...] = ()
    force: str = "N"
    moment: str = "N*m"

    def date(self, iso: str) -> str:
        """Return an ISO date in the organisation's form; text that is no date stays as it is."""
        try:
            return dt.date.fromisoformat(iso).strftime(self.dates)
        except ValueError:
            return iso

    def decimal(self, number: str) -> str:
        """Return a number, written with a decimal point, with the organisation's decimal sign.

        >>> Style(decimal_comma=True).decimal("0.25")
        '0,25'
        """
        return number.replace(".", ",") if self.decimal_comma else number

    @property
    def texts(self) -> frozenset[str]:
        """What the organisation states of itself: nobody says it in other words."""
        values = (getattr(self, field.name) for field in fields(self))
        return frozenset(value for value in values if isinstance(value, str))

    def say(self, text: str, *, alternative: bool = False) -> str:
        """Return a text of the toolkit in the language and the words of the organisation.

        What is no phrase of the toolkit stays as it is; ``alternative`` takes the words of alternative texts
        too.
        """
        phrases = self.words + self.alt if alternative else self.words
        if self.language != SOURCE or self.decimal_comma:
            text = phrasebook(self.language, decimal_comma=self.decimal_comma, own=phrases).say(text)
        return replace_terms(text, dict(phrases))

    def lacks(self, text: str) -> bool:
        """Tell whether a sentence of the toolkit has no translation in the organisation's language."""
        return self.language != SOURCE and not phrasebook(self.language, own=self.words).knows(text)

    def digits(self, *names: str | None) -> int | None:
        """Return the decimals of the first name that the style file has."""
        table = dict(self.decimals)
        return next((table[name] for name in names if name in table), None)

    def in_units_of(self, style: Style) -> Style:
        """Return this style with the units of forces and moments of another one."""
        return replace(self, force=style.force, moment=style.moment)

    def unit(self, unit: str | None) -> tuple[str | None, float]:
        """Return a report unit in the organisation's choice, and the factor from the SI-side one."""
        if unit is None:
            return None, 1.0
        head, slash, tail = unit.partition("/")
        preferred = {"N": self.force, "N*m": self.moment}.get(head)
        if preferred is None or preferred == head:
            return unit, 1.0
        return f"{preferred}{slash}{tail}", 1 / si_scale(preferred)


def kept(spec: str, factor: float) -> str:
    """Return the format of a number in a unit that its value was scaled to by a factor.

    A declared format says how fine a value is in its own unit. In a larger one it has as many decimals more
    as it takes that the last place is worth no more than five of the declared one's: loads of 1600 N and
    2400 N are not both "2 kN".

    >>> kept(".0f", 1e-3), kept(".0f", 1 / 4.448), kept(".1f", 1.0), kept(".3g", 1e-3)
    ('.3f', '.0f', '.1f', '.3g')
    """
    declared = re.fullmatch(r"\.(\d+)f", spec)
    if declared is None:
        return spec
    return f".{int(declared[1]) + max(0, math.ceil(-math.log10(5 * factor)))}f"


def replace_terms(text: str, words: Mapping[str, str]) -> str:
    """Return a text with every term replaced, the longest first, once each place.

    >>> replace_terms("slip angle SA [deg]", {"slip angle": "Schräglaufwinkel", "angle": "Winkel"})
    'Schräglaufwinkel SA [deg]'
    """
    if not words:
        return text
    terms = sorted(words, key=len, reverse=True)
    pattern = "|".join(rf"(?<!\w){re.escape(term)}(?!\w)" for term in terms)
    return re.sub(pattern, lambda term: words[term[0]], text)


def style_file(template: Path) -> Path | None:
    """Return the style file of a template: ``<its name>.toml`` beside it, else ``org.toml`` there."""
    for path in (template.with_suffix(".toml"), template.with_name("org.toml")):
        if path.is_file():
            return path
    return None


def style_in_language(toml: str, language: str) -> str:
    """Return a style file as text for a language: its decimal sign, its word for what is missing.

    >>> print(style_in_language('language = "en"\\ndecimal_comma = false', "fr"))
    language = "fr"
    decimal_comma = true
    """
    comma = str(decimal_sign(language) == ",").lower()
    missing = phrasebook(language).say("n/a")
    for key, value in (("language", f'"{language}"'), ("decimal_comma", comma), ("missing", f'"{missing}"')):
        toml = re.sub(rf'(?m)^{key} = ("[^"]*"|\w+)', lambda _, line=f"{key} = {value}": line, toml)  # type: ignore[misc]
    return toml


def read_style(path: Path | None) -> Style:
    """Read a style file; the defaults where there is none.

    Raises
    ------
    ConfigError
        not TOML; every entry that cannot be used, with its line
    """
    if path is None:
        return Style()
    file = read(StyleFile, path)
    laboratory, styles = file.laboratory, file.styles
    names = (("heading", styles.heading), ("caption", styles.caption), ("table", styles.table))
    return Style(
        language=file.language,
        laboratory=laboratory.name,
        address=laboratory.address,
        place=laboratory.place,
        contact=laboratory.contact,
        country=laboratory.country,
        accreditation=laboratory.accreditation,
        method=file.report.method,
        authorised_by=file.report.authorised_by,
        function=file.report.function,
        decimal_comma=file.decimal_comma,
        dates=file.dates,
        missing=file.missing,
        required=tuple(dict.fromkeys([*_DEFAULT_REQUIRED, *file.required])),
        styles=tuple((key, name) for key, name in names if name is not None),
        decimals=file.decimals,
        words=file.words,
        alt=file.alt,
        force=file.units.force,
        moment=file.units.moment,
    )
