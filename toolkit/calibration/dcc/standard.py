"""`[reference] dcc = "standard.xml"`: what a session takes from its reference standard's own certificate.

The taken entries replace those that a person would type; they and where each stands in the certificate
(file hash, XPath, signer) become settings of the session, which the record holds and hashes. The document
lies beside the record, and a record is held against it on every load: seal, form and numbers again. Whether
its signer is trusted is asked when the session is entered.

U is the largest u = U / k of the certificate's range, with its k: no smaller one is claimed at any load.

`DigitalCertificate`, the whole of it, says what was calibrated, when, by whom, with what uncertainty.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from lxml import etree

from toolkit.arrays import Array
from toolkit.calibration.dcc.quantities import Point, points_of
from toolkit.calibration.dcc.structure import DCC, check_structure
from toolkit.channels import load_dimension
from toolkit.errors import SessionError, TrustError
from toolkit.files import sha256_bytes
from toolkit.trust.seal.check import SealCheck
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import check_xml
from toolkit.units import unit

_SPACES = {"dcc": DCC}
_CORE = "dcc:administrativeData/dcc:coreData"
_LABORATORY = "dcc:administrativeData/dcc:calibrationLaboratory"
_STATEMENT = "dcc:administrativeData/dcc:statements/dcc:statement"


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """What was calibrated: its name, and the numbers it is known by, the maker's first."""

    name: str
    numbers: tuple[str, ...]

    @property
    def serial(self) -> str:
        """The maker's number, else the first."""
        return self.numbers[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class DigitalCertificate:
    """What a DCC says; dates as stated, ``due`` where it states a day of recalibration."""

    identifier: str
    laboratory: str
    accreditation: str | None
    calibrated: dt.date
    issued: dt.date | None
    due: dt.date | None
    items: tuple[Item, ...]
    points: tuple[Point, ...]


def certificate_of(root: Any, *, where: object) -> DigitalCertificate:
    """Return what a document of the right form (`structure`) says.

    Raises
    ------
    SessionError
        ``dcc-quantity``, ``dcc-instrument``: it names no item by a number
    """
    items = [
        _identified(node) for node in root.iterfind("dcc:administrativeData/dcc:items/dcc:item", _SPACES)
    ]
    if not all(item.numbers for item in items):
        raise SessionError(
            "the digital certificate names its item by no number", where=where, got="no identification",
            expected="a serial number", next_step="ask its issuer; nothing was written",
            rule="dcc-instrument",
        )  # fmt: skip
    issued = root.findtext(f"{_CORE}/dcc:issueDate", None, _SPACES)
    return DigitalCertificate(
        identifier=_text(root, f"{_CORE}/dcc:uniqueIdentifier"),
        laboratory=_content(root.find(f"{_LABORATORY}/dcc:contact/dcc:name", _SPACES)),
        accreditation=_accreditation(root),
        calibrated=_date(_text(root, f"{_CORE}/dcc:endPerformanceDate")),
        issued=None if issued is None else _date(issued),
        due=_due(root),
        items=tuple(items),
        points=points_of(root, where=where),
    )


def _identified(node: Any) -> Item:
    listed = [
        (_text(entry, "dcc:issuer") != "manufacturer", _text(entry, "dcc:value"))
        for entry in node.iterfind("dcc:identifications/dcc:identification", _SPACES)
    ]
    numbers = [number for _, number in sorted(listed, key=lambda pair: pair[0])]
    return Item(name=_content(node.find("dcc:name", _SPACES)), numbers=tuple(numbers))


def _accreditation(root: Any) -> str | None:
    code = root.findtext(f"{_LABORATORY}/dcc:calibrationLaboratoryCode", None, _SPACES)
    if code is not None and code.strip():
        return str(code.strip())
    for statement in root.iterfind(_STATEMENT, _SPACES):
        if _content(statement.find("dcc:name", _SPACES)).casefold() == "accreditation":
            return _content(statement.find("dcc:declaration", _SPACES)) or None
    return None


def _due(root: Any) -> dt.date | None:
    days = [
        _date(text)
        for statement in root.iterfind(_STATEMENT, _SPACES)
        if "basic_recalibration" in (statement.get("refType") or "").split()
        and (text := statement.findtext("dcc:date", None, _SPACES)) is not None
    ]
    return min(days, default=None)


def _date(text: str) -> dt.date:
    return dt.date.fromisoformat(text.strip().removesuffix("Z"))


def _text(node: Any, path: str) -> str:
    return str(node.findtext(path, "", _SPACES)).strip()


def _content(node: Any) -> str:
    """Return a text in English where there is one, else its first."""
    if node is None:
        return ""
    contents = node.findall("dcc:content", _SPACES)
    english = [content for content in contents if content.get("lang") == "en"] or contents
    return " ".join((english[0].text or "").split()) if english else ""


_UNITS = {"force": "N", "moment": "N*m"}


class Columns(Protocol):
    """A table of loads, as a session has it."""

    def has(self, name: str) -> bool:
        """Tell whether it has a column."""

    def unit(self, name: str) -> str:
        """Return a column's unit."""

    def column(self, name: str) -> Array:
        """Return a column (rows,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standards:
    """Whose certificates a laboratory takes numbers from, and where PTB's schema files may lie."""

    trust: Trust = Trust()  # noqa: RUF009  frozen
    schemas: Path | None = None


def with_standard(
    raw: Mapping[str, Any], document: bytes, *, where: object, standards: Standards | None = None
) -> dict[str, Any]:
    """Return a parsed session whose ``[reference]`` holds what its DCC says.

    Parameters
    ----------
    raw : the session as parsed, ``[reference] dcc`` a name
    document : the DCC's bytes
    standards : asked whether the signer is trusted; None for a session that was entered before

    Raises
    ------
    SessionError
        ``dcc-seal dcc-schema dcc-quantity dcc-instrument dcc-validity dcc-range dcc-stated``
    """
    reference = dict(raw["reference"])
    place = f"{where}: reference.dcc = {reference['dcc']!r}"
    check = _sealed(document, place, standards)
    root = etree.fromstring(check.content)
    check_structure(root, where=place, schemas=None if standards is None else standards.schemas)
    certificate = certificate_of(root, where=place)
    item = _item(certificate, reference.get("standard"), place)
    _demand_same(reference, "certificate", certificate.identifier, place)
    _demand_valid(raw, certificate, reference, place)
    loads = {name: _points_for(certificate, str(name), place) for name in raw["loads"]}
    typed = dict(reference.get("uncertainty", {}))
    for name, points in loads.items():
        if name in typed and points:
            raise _refused(
                "an uncertainty stands in the digital certificate and in the session", place,
                f"reference.uncertainty.{name}", "one of the two",
                "leave it out of the session", "dcc-stated",
            )  # fmt: skip
    points_by_load = {name: points for name, points in loads.items() if points}
    if missing := [name for name in loads if name not in points_by_load and name not in typed]:
        raise _refused(
            "the digital certificate does not cover a load of the session", place,
            f"no expanded uncertainty of {', '.join(missing)}", "one in N or N·m, with its coverage factor",
            "name another certificate, or state the uncertainty of that load", "dcc-quantity",
        )  # fmt: skip
    largest = {name: max(points, key=lambda p: p.U / p.k) for name, points in points_by_load.items()}
    reference["uncertainty"] = typed | {
        name: {"U": point.U, "k": point.k, "unit": _UNITS[point.dimension]} for name, point in largest.items()
    }
    reference |= {"standard": reference.get("standard", f"{item.name}, {item.serial}"),
                  "certificate": certificate.identifier}  # fmt: skip
    if certificate.due is not None:
        reference.setdefault("due", certificate.due.isoformat())
    reference["dcc"] = {
        "file": str(reference["dcc"]),
        "sha256": sha256_bytes(document),
        "signer": {"name": check.issued_by, "sha256": check.certificate, "at": check.time},
        "laboratory": certificate.laboratory,
        "accreditation": certificate.accreditation,
        "calibrated": certificate.calibrated.isoformat(),
        "issued": certificate.issued and certificate.issued.isoformat(),
        "item": {"name": item.name, "serial": item.serial},
        "taken": {name: _provenance(points_by_load[name], point) for name, point in largest.items()},
    }
    return dict(raw) | {"reference": reference}


def check_covered(reference: Mapping[str, Any], tables: Sequence[Columns | None], where: object) -> None:
    """Refuse loads outside the range that the standard was calibrated over; no load needs no standard.

    The ends of the range are printed to the places of their U, so that what lies within U of them is inside.

    ``reference`` is the session's, as `with_standard` returns it; ``tables`` are its loads and check loads.

    Raises
    ------
    SessionError
        ``dcc-range``
    """
    stated = reference.get("dcc")
    for load, entry in stated["taken"].items() if isinstance(stated, Mapping) else ():
        low, high = entry["range"]
        for table in tables:
            if table is None or not table.has(load):
                continue
            values = table.column(load) * unit(table.unit(load)).factor
            beyond = (values < low - entry["U"]) | (values > high + entry["U"])
            outside = beyond & (abs(values) > entry["U"])
            if outside.any():
                row = int(outside.argmax())
                raise _refused(
                    "a load lies outside the range of the standard's certificate",
                    f"{where}, row {row + 1}, column {load}", f"{values[row]:.6g} {entry['unit']}",
                    f"from {low:.6g} to {high:.6g} {entry['unit']}", "use a standard that covers it",
                    "dcc-range",
                )  # fmt: skip


def _sealed(document: bytes, place: str, standards: Standards | None) -> SealCheck:
    try:
        check = check_xml(document, Trust() if standards is None else standards.trust)
    except TrustError as error:
        raise _refused(
            "the digital certificate cannot be read", place, error.got, "a sealed DCC, without a DTD",
            "ask its issuer for the file as it was issued", "dcc-seal",
        ) from error  # fmt: skip
    if check.signature == "valid" or (standards is None and check.signature == "untrusted"):
        return check
    # Nobody is told to trust the signer of a file that has no seal, or was changed.
    next_step = "ask its issuer for the sealed file, as it was issued"
    if check.signature == "untrusted":
        place_of_trust = "trust/certificates of the home"
        next_step = f"put the issuer's certificate into {place_of_trust} once you have it from the issuer"
    signer = f" ({check.issued_by}, certificate {check.certificate})" if check.issued_by else ""
    raise _refused(
        "the seal of the digital certificate does not hold", place, f"{check.signature}: {check.why}{signer}",
        "a seal by a certificate that the laboratory trusts",
        next_step, "dcc-seal",
    )  # fmt: skip


def _item(certificate: DigitalCertificate, standard: object, place: str) -> Item:
    """Return the item that the session means: the only one, or the one whose number it states."""
    items = certificate.items
    if standard is not None:
        words = str(standard).casefold()
        items = tuple(item for item in items if any(_names(words, number) for number in item.numbers))
    if len(items) == 1:
        return items[0]
    numbers = "; ".join(", ".join(item.numbers) for item in certificate.items)
    raise _refused(
        "the digital certificate is not of the standard that the session names", place,
        f"items {numbers}",
        f"one with the number in standard = {str(standard)!r}" if standard else "one item",
        "name the certificate of that standard, or correct reference.standard", "dcc-instrument",
    )  # fmt: skip


def _names(words: str, number: str) -> bool:
    number = number.casefold().strip()
    return words == number or (
        len(number) > 2 and re.search(rf"(?<![\w-]){re.escape(number)}(?![\w-])", words) is not None
    )


def _demand_same(reference: Mapping[str, Any], key: str, stated: str, place: str) -> None:
    if key in reference and str(reference[key]).strip() != stated:
        raise _refused(
            "the session and the digital certificate differ", place, f"{key} = {reference[key]!r}",
            repr(stated), f"leave out reference.{key}: it is taken from the certificate", "dcc-stated",
        )  # fmt: skip


def _demand_valid(
    raw: Mapping[str, Any], certificate: DigitalCertificate, reference: Mapping[str, Any], place: str
) -> None:
    try:
        day = dt.date.fromisoformat(str(raw["date"]))
        stated = dt.date.fromisoformat(str(reference["due"])) if "due" in reference else None
    except ValueError:
        return  # the session's own reader tells it
    last = min((due for due in (certificate.due, stated) if due is not None), default=None)
    if day < certificate.calibrated or (last is not None and day > last):
        raise _refused(
            "the standard's calibration did not hold on the day of the session", place, day.isoformat(),
            f"from {certificate.calibrated.isoformat()}" + (f" to {last.isoformat()}" if last else ""),
            "name the certificate that held on that day", "dcc-validity",
        )  # fmt: skip


def _points_for(certificate: DigitalCertificate, load: str, place: str) -> tuple[Point, ...]:
    """Return the points of a load: those that name it, else those that name no channel."""
    quantity = load_dimension(load)
    points = [p for p in certificate.points if quantity in (None, p.dimension)]
    points = [p for p in points if load in p.channels] or [p for p in points if not p.channels]
    if len({point.dimension for point in points}) > 1:
        raise _refused(
            "the digital certificate has forces and moments, and the load's name tells neither", place, load,
            "a load such as FY or MZ", "name the load by its axis", "dcc-quantity",
        )  # fmt: skip
    return tuple(points)


def _provenance(points: Sequence[Point], point: Point) -> dict[str, Any]:
    values = [p.value for p in points]
    return {
        "U": point.U,
        "unit": _UNITS[point.dimension],
        "range": [min(values), max(values)],
        "xpath": {"U": point.U_path, "k": point.k_path, "range": sorted({p.value_path for p in points})},
    }


def _refused(
    problem: str, where: object, actual: object, expected: object, next_step: str, rule: str
) -> SessionError:
    return SessionError(
        problem,
        where=where,
        got=actual,
        expected=expected,
        next_step=f"{next_step}; nothing was written",
        rule=rule,
    )
