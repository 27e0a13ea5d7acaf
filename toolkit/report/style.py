"""The style file beside a template (``org.toml``): laboratory, language, units, decimals, names of styles."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from toolkit.errors import ConfigError
from toolkit.files import check_keys, read_toml
from toolkit.units import si_scale
from toolkit.words.catalogue import SOURCE, decimal_sign, languages
from toolkit.words.phrasebook import phrasebook

_KEYS = (
    "schema language laboratory report words alt decimal_comma dates missing required styles decimals units"
).split()
_TABLES = ("laboratory", "report", "words", "alt", "styles", "decimals", "units")
_LABORATORY = "name address contact place country accreditation".split()
_REPORT = "method authorised_by function".split()
_STYLES = ("heading", "caption", "table")
_UNITS = ("force", "moment")
_DEFAULT_REQUIRED = ("tk:calibration.hash",)


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
        own = self.words + self.alt if alternative else self.words
        if self.language != SOURCE or self.decimal_comma:
            text = phrasebook(self.language, decimal_comma=self.decimal_comma, own=own).say(text)
        return replace_terms(text, dict(own))

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
        chosen = {"N": self.force, "N*m": self.moment}.get(head)
        if chosen is None or chosen == head:
            return unit, 1.0
        return f"{chosen}{slash}{tail}", 1 / si_scale(chosen)


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
        not TOML, an unknown key, a value of the wrong type, a unit of the wrong dimension
    """
    if path is None:
        return Style()
    table = read_toml(path)
    check_keys(table, _KEYS, where=path)
    parts = {key: _typed(table, key, dict, {}, path) for key in _TABLES}
    check_keys(parts["laboratory"], _LABORATORY, where=f"{path}: laboratory")
    check_keys(parts["report"], _REPORT, where=f"{path}: report")
    check_keys(parts["styles"], _STYLES, where=f"{path}: styles")
    check_keys(parts["units"], _UNITS, where=f"{path}: units")
    for name, digits in parts["decimals"].items():
        if isinstance(digits, bool) or not isinstance(digits, int) or not 0 <= digits <= 12:
            raise _wrong(path, f"decimals.{name}", digits, "a whole number from 0 to 12")
    for name in _UNITS:
        if name in parts["units"]:
            si_scale(str(parts["units"][name]), name, where=f"{path}: units.{name}")
    language = _typed(table, "language", str, SOURCE, path)
    if language not in languages():
        raise _wrong(path, "language", language, " or ".join(languages()))
    required = _typed(table, "required", list, list(_DEFAULT_REQUIRED), path)
    missing = _typed(table, "missing", str, "n/a", path)
    if not missing.strip():
        raise _wrong(path, "missing", missing, "a visible text")
    return Style(
        language=language,
        laboratory=_text(parts["laboratory"], "name", path),
        **{key: _text(parts["laboratory"], key, path) for key in _LABORATORY[1:]},
        **{key: _text(parts["report"], key, path) for key in _REPORT},
        decimal_comma=_typed(table, "decimal_comma", bool, False, path),
        dates=_typed(table, "dates", str, "%Y-%m-%d", path),
        missing=missing,
        required=tuple(dict.fromkeys([*_DEFAULT_REQUIRED, *(str(tag) for tag in required)])),
        styles=tuple((str(k), str(v)) for k, v in parts["styles"].items()),
        decimals=tuple(parts["decimals"].items()),
        words=tuple((key, str(_text(parts["words"], key, path))) for key in parts["words"]),
        alt=tuple((key, str(_text(parts["alt"], key, path))) for key in parts["alt"]),
        force=str(parts["units"].get("force", "N")),
        moment=str(parts["units"].get("moment", "N*m")),
    )


def _text(table: dict[str, Any], key: str, path: Path) -> str | None:
    text: str | None = _typed(table, key, str, None, path)
    return text


def _typed(table: dict[str, Any], key: str, kind: type, default: Any, path: Path) -> Any:
    value = table.get(key, default)
    if value is default or isinstance(value, kind):
        return value
    names = {dict: "a table", list: "a list", str: "a text", bool: "true or false"}
    raise _wrong(path, key, value, names[kind])


def _wrong(path: Path, key: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        f"the style file has a wrong value for {key!r}",
        where=path,
        got=got,
        expected=expected,
        next_step="correct it in the style file beside the template",
    )
