"""A digital calibration certificate as a whole: what was calibrated, when, by whom, with what uncertainty."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Any

from toolkit.calibration.dcc.quantities import Point, points_of
from toolkit.calibration.dcc.structure import DCC
from toolkit.errors import SessionError

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
    items = [_item(node) for node in root.iterfind("dcc:administrativeData/dcc:items/dcc:item", _SPACES)]
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


def _item(node: Any) -> Item:
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
