"""The form of a DCC 3.x: which elements stand in which, in which order, and what their texts are.

The facts are those of PTB's schema, versions 3.1 to 3.3, in a notation of its own: a line an element, its
children in order with ``? * +`` and ``( | )``. An element whose name stands in no line is refused. The
schema files themselves decide where a laboratory has put them into ``trust/schema`` of its home.
"""

from __future__ import annotations

import datetime as dt
import re
from functools import cache
from pathlib import Path
from typing import Any

from lxml import etree

from toolkit.errors import SessionError

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
_DS = "http://www.w3.org/2000/09/xmldsig#"
_VERSION = re.compile(r"3\.[123]\.\d{1,2}(-rc\.\d+)?\Z")

_NESTED = "usedMethods? usedSoftware? measuringEquipments? influenceConditions? measurementMetaData?"
_VALUE = (
    "(noQuantity|charsXMLList|si_real|si_list|si_hybrid|si_complex|si_constant|si_realListXMLList|"
    "si_complexListXMLList)"
)
_CHILDREN = f"""
digitalCalibrationCertificate: administrativeData measurementResults comment? document? ds_Signature*
administrativeData: dccSoftware refTypeDefinitions? coreData items calibrationLaboratory respPersons
  customer statements?
dccSoftware usedSoftware installedSoftware installedSoftwares: software+
software: name release type? description?
refTypeDefinitions: refTypeDefinition+
refTypeDefinition: name description? namespace link release? value? procedure?
coreData: countryCodeISO3166_1 usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ uniqueIdentifier
  identifications? receiptDate? beginPerformanceDate endPerformanceDate performanceLocation issueDate?
  reportAmendedSubstituted? previousReport?
reportAmendedSubstituted: typeOfChange replacedUniqueIdentifier
identifications: identification+
identification: issuer value name?
items subItems: name? equipmentClass* description? owner? manufacturer? identifications? item+
item: name equipmentClass* description? owner? installedSoftwares? manufacturer? model? identifications
  itemQuantities? subItems?
equipmentClass: reference classID link?
itemQuantities: itemQuantity+
usedMethodQuantities: usedMethodQuantity+
measuringEquipmentQuantities: measuringEquipmentQuantity+
itemQuantity usedMethodQuantity measuringEquipmentQuantity: name? description? {_VALUE}
calibrationLaboratory: calibrationLaboratoryCode? contact cryptElectronicSeal? cryptElectronicSignature?
  cryptElectronicTimeStamp?
contact customer owner respAuthority: name eMail? phone? fax? link? location descriptionData?
person manufacturer: name eMail? phone? fax? link? location? descriptionData?
location: (city|countryCode|postCode|postOfficeBox|state|street|streetNo|further|positionCoordinates)+
positionCoordinates: positionCoordinateSystem reference? declaration? positionCoordinate1
  positionCoordinate2 positionCoordinate3? link?
respPersons: respPerson+
respPerson: person description? role? mainSigner? cryptElectronicSeal? cryptElectronicSignature?
  cryptElectronicTimeStamp?
statements: statement+
measurementMetaData: metaData+
statement metaData: name? description? countryCodeISO3166_1* convention? traceable? norm* reference* link*
  declaration? (valid|validXMLList)? date? period? respAuthority? (conformity|conformityXMLList)? data?
  nonSIDefinition? nonSIUnit? location?
measurementResults: usedMethods? usedSoftware? measuringEquipments? influenceConditions?
  measurementMetaData? measurementResult+
measurementResult: name description? usedMethods? usedSoftware? measuringEquipments? influenceConditions?
  results measurementMetaData?
usedMethods: usedMethod+
usedMethod: name description? norm* reference* link* usedMethodQuantities?
measuringEquipments: name? equipmentClass* description? owner? identifications? measuringEquipment+
measuringEquipment: name equipmentClass* description? certificate? manufacturer? model? identifications?
  measuringEquipmentQuantities? installedSoftware?
influenceConditions: influenceCondition+
influenceCondition: name description? status? certificate? data
results: result+
result: name description? data
data: (text|formula|byteData|xml|quantity|list)+
quantity: name? description? {_VALUE} relativeUncertainty? {_NESTED}
list: name? description? (dateTime|dateTimeXMLList)? (list|quantity)+ {_NESTED}
relativeUncertainty: (relativeUncertaintyXmlList|relativeUncertaintySingle)
certificate previousReport linkedReport: referral referralID procedure value description? inValidityRange?
  traceable? linkedReport?
formula: (latex|mathml)
file byteData document descriptionData: name? description? fileName mimeType dataBase64
"""
_DSI = """
real: label? quantityType? quantityTypeQUDT? value unit significantDigit? dateTime?
  (measurementUncertaintyUnivariate|expandedUnc|coverageInterval)?
realListXMLList: labelXMLList? quantityTypeXMLList? quantityTypeQUDTXMLList? valueXMLList unitXMLList
  significantDigitXMLList? dateTimeXMLList?
  (measurementUncertaintyUnivariateXMLList|expandedUncXMLList|coverageIntervalXMLList)?
  (measurementUncertaintyMultivariateXMLList|ellipsoidalRegionXMLList|rectangularRegionXMLList)?
hybrid: (real+|complex+|list+|realList+|realListXMLList+|complexList+|complexListXMLList+|constant+)
measurementUncertaintyUnivariate: (standardMU|expandedMU|coverageIntervalMU)
measurementUncertaintyUnivariateXMLList: (standardMUXMLList|expandedMUXMLList|coverageIntervalMUXMLList)
standardMU: valueStandardMU distribution?
expandedMU: valueExpandedMU coverageFactor coverageProbability distribution?
expandedUnc: uncertainty coverageFactor coverageProbability distribution?
standardMUXMLList: valueStandardMUXMLList distributionXMLList?
expandedMUXMLList: valueExpandedMUXMLList coverageFactorXMLList coverageProbabilityXMLList
  distributionXMLList?
expandedUncXMLList: uncertaintyXMLList coverageFactorXMLList coverageProbabilityXMLList distributionXMLList?
"""
_DSI_NUMBERS = re.compile(
    r"(value|valueStandardMU|valueExpandedMU|uncertainty|coverageFactor|coverageProbability)(XMLList)?\Z"
)
_NUMBER = re.compile(r"([-+]?(\d+\.?\d*|\.\d+)([Ee][-+]?\d+)?|NaN)\Z")
_PREFIX = {DCC: "", SI: "si_", _DS: "ds_"}
_RICH = "description declaration further text noQuantity"
_ANY_ORDER = frozenset(("administrativeData",))
_ANYTHING = frozenset(
    """comment xml mathml positionCoordinate1 positionCoordinate2 positionCoordinate3
    relativeUncertaintyXmlList relativeUncertaintySingle""".split()
)
_DATES = frozenset("receiptDate beginPerformanceDate endPerformanceDate issueDate date".split())
_BOOLEANS = frozenset(
    """mainSigner traceable valid inValidityRange cryptElectronicSeal cryptElectronicSignature
    cryptElectronicTimeStamp""".split()
)
_CONFORMITY = "pass fail conditionalPass conditionalFail noPass noFail"
_CHOICES = {
    "issuer": "manufacturer calibrationLaboratory customer owner other",
    "performanceLocation": "laboratory customer laboratoryBranch customerBranch other",
    "status": "beforeAdjustment afterAdjustment beforeRepair afterRepair",
    "conformity": _CONFORMITY,
}
_PATTERNS = {
    "countryCodeISO3166_1": r"[A-Z]{2}", "countryCode": r"[A-Z]{2}", "usedLangCodeISO639_1": r"[a-z]{2}",
    "mandatoryLangCodeISO639_1": r"[a-z]{2}",
}  # fmt: skip
_NOT_EMPTY = frozenset(
    """uniqueIdentifier value release eMail phone fax city postCode postOfficeBox state street streetNo norm
    reference link convention role model classID namespace procedure referralID fileName mimeType
    calibrationLaboratoryCode replacedUniqueIdentifier nonSIDefinition nonSIUnit
    positionCoordinateSystem""".split()
)
_FREE = frozenset(
    "content latex type typeOfChange period dateTime dateTimeXMLList charsXMLList dataBase64".split()
)
_LISTS = frozenset(("validXMLList", "conformityXMLList"))


def check_structure(root: Any, *, where: object, schemas: Path | None = None) -> None:
    """Refuse a document that has not the form of a DCC.

    ``schemas`` is a folder in which PTB's schema files may lie, ``**/v3.3.0/dcc.xsd``: they decide then.

    Raises
    ------
    SessionError
        ``dcc-schema``, naming the first element that is wrong
    """
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise _wrong(where, str(root.tag)[:80], "a dcc:digitalCalibrationCertificate")
    version = str(root.get("schemaVersion"))
    if not _VERSION.match(version):
        raise _wrong(where, f"schemaVersion {version}", "a version from 3.1 to 3.3")
    for element in root.iter("*"):
        name = etree.QName(element)
        if name.namespace == DCC:
            _check(element, name.localname, where)
        elif name.namespace == SI:
            _check_dsi(element, name.localname, where)
    ids = [element.get("id") for element in root.iter("*") if element.get("id") is not None]
    if len(ids) != len(set(ids)):
        raise _wrong(where, "an id that stands twice", "ids that differ")
    _by_the_schema(root, version, where, schemas)


def _check(element: Any, name: str, where: object) -> None:
    if name in _ANYTHING:
        return
    parent = etree.QName(element.getparent()).localname if element.getparent() is not None else ""
    order = _grammar().get(name)
    children = [_PREFIX.get(_space(child), "x_") + _name(child) for child in element.iterchildren("*")]
    text = (element.text or "").strip()
    if order is not None:
        if name in _ANY_ORDER:
            canonical = re.findall(r"\w+", _lines(_CHILDREN)[name])
            children.sort(key=lambda child: canonical.index(child) if child in canonical else -1)
        if not order.fullmatch("".join(f"{child} " for child in children)):
            raise _wrong(_place(element, where), " ".join(children) or "nothing", _order(name))
        if text:
            raise _wrong(_place(element, where), text[:60], "elements alone")
    elif children:
        raise _wrong(_place(element, where), " ".join(children), "a text")
    elif not _text_fits(name, text):
        raise _wrong(_place(element, where), text or "nothing", _expected(name, parent))


def _check_dsi(element: Any, name: str, where: object) -> None:
    """Hold a value that is read against D-SI; of complex numbers, constants and regions nothing is read."""
    order = _dsi_grammar().get(name)
    text = (element.text or "").strip()
    if order is not None:
        children = [("" if _space(c) == SI else "x_") + _name(c) for c in element.iterchildren("*")]
        if text or not order.fullmatch("".join(f"{child} " for child in children)):
            expected = f"in this order: {_lines(_DSI)[name]}"
            raise _wrong(_place(element, where), text[:60] or " ".join(children) or "nothing", expected)
    elif _DSI_NUMBERS.match(name):
        words = text.split()
        single = not name.endswith("XMLList")
        if not words or (single and len(words) > 1) or not all(_NUMBER.match(word) for word in words):
            raise _wrong(_place(element, where), text[:60] or "nothing", "numbers")


def _name(element: Any) -> str:
    return str(etree.QName(element).localname)


def _text_fits(name: str, text: str) -> bool:
    if name in _DATES:
        try:
            dt.date.fromisoformat(text.removesuffix("Z"))
        except ValueError:
            return False
        return True
    if name in _BOOLEANS:
        return text in ("true", "false", "1", "0")
    if name in _CHOICES:
        return text in _CHOICES[name].split()
    if name in _PATTERNS:
        return re.fullmatch(_PATTERNS[name], text) is not None
    if name in _LISTS:
        return all(word in f"{_CONFORMITY} true false 1 0".split() for word in text.split())
    return bool(text) if name in _NOT_EMPTY else name in _FREE


def _expected(name: str, parent: str) -> str:
    if name in _DATES:
        return "a date, YYYY-MM-DD"
    if name in _CHOICES:
        return _CHOICES[name].replace(" ", " | ")
    ruled = name in _NOT_EMPTY | _BOOLEANS | _LISTS or name in _PATTERNS
    return "another text" if ruled else f"no element of this name in {parent}"


@cache
def _lines(table: str) -> dict[str, str]:
    lines = dict(line.split(": ", 1) for line in re.sub(r"\n +", " ", table).strip().splitlines())
    return {name: order for names, order in lines.items() for name in names.split()}


@cache
def _grammar() -> dict[str, re.Pattern[str]]:
    rich = dict.fromkeys(_RICH.split(), "name? (content|file|formula)*")
    texts = dict.fromkeys(("name", "referral"), "content+")
    return {name: _pattern(order) for name, order in (_lines(_CHILDREN) | rich | texts).items()}


@cache
def _dsi_grammar() -> dict[str, re.Pattern[str]]:
    return {name: _pattern(order) for name, order in _lines(_DSI).items()}


def _pattern(order: str) -> re.Pattern[str]:
    # Each name ends with a space, so that none is the beginning of another.
    return re.compile(re.sub(r"(\w+)|\s+", lambda m: f"(?:{m[1]}\\x20)" if m[1] else "", order))


def _order(name: str) -> str:
    return f"in this order: {_lines(_CHILDREN).get(name, 'name? content')}"


def _space(element: Any) -> str:
    return str(etree.QName(element).namespace)


def _place(element: Any, where: object) -> str:
    path = element.getroottree().getelementpath(element)
    return f"{where}: {re.sub(r'{[^}]*}', '', path)}"


def _by_the_schema(root: Any, version: str, where: object, schemas: Path | None) -> None:
    files = sorted(schemas.glob(f"**/v{version}/dcc.xsd")) if schemas is not None and schemas.is_dir() else []
    if not files:
        return
    parser = etree.XMLParser(no_network=True, resolve_entities=False)
    try:
        schema = etree.XMLSchema(etree.parse(files[0], parser))
    except (etree.XMLSchemaParseError, etree.XMLSyntaxError) as error:
        raise _wrong(files[0], " ".join(str(error).split())[:160], "PTB's schema files, complete") from error
    if not schema.validate(root):
        log: Any = schema.error_log
        entry = log[0]
        raise _wrong(f"{where}: line {entry.line}", entry.message[:200], f"the schema, version {version}")


def _wrong(where: object, actual: str, expected: str) -> SessionError:
    return SessionError(
        "the digital certificate has not the form of its schema",
        where=where,
        got=actual,
        expected=expected,
        next_step="ask the issuer for a valid DCC; nothing was written",
        rule="dcc-schema",
    )
