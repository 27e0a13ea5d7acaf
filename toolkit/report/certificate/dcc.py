"""The certificate as a Digital Calibration Certificate: PTB's DCC 3.3.0 with D-SI 2.2.1.

Values are in SI (``\\newton``, ``\\newton\\metre``, ``\\milli\\volt\\per\\volt``); a record's own unit
outside SI is told as a ``nonSIUnit`` statement with its definition and in the descriptions. The
same certificate and day of issue give the same bytes.
"""

from __future__ import annotations

from toolkit.errors import ConfigError
from toolkit.estimate import round_to_uncertainty, round_uncertainty
from toolkit.recording.marks import OWN_OUTPUT
from toolkit.report.certificate import content as words
from toolkit.report.certificate.dcc_xml import (
    Node,
    dsi,
    dsi_of_term,
    node,
    quantity,
    quantity_list,
    release,
    rich,
    text,
)
from toolkit.report.certificate.model import Certificate, LoadResult
from toolkit.report.certificate.statements import RULES
from toolkit.units import unit
from toolkit.version import __version__

VERSION = "3.3.0"


def build_dcc(certificate: Certificate) -> bytes:
    """Return the DCC as XML bytes.

    Raises
    ------
    ConfigError
        ``certificate-country``: no country of the laboratory is stated, which the schema demands
    """
    from lxml import etree

    root = node(
        "dcc:digitalCalibrationCertificate",
        _administrative(certificate),
        _results(certificate),
        schemaVersion=VERSION,
    )
    place = "{http://www.w3.org/2001/XMLSchema-instance}schemaLocation"
    root.set(place, f"https://ptb.de/dcc https://ptb.de/dcc/v{VERSION}/dcc.xsd")
    root.insert(0, etree.Comment(f" {OWN_OUTPUT}; toolkit {__version__} "))
    etree.indent(root, " ")
    xml: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return xml + b"\n"


def _administrative(c: Certificate) -> Node:
    stated, record = c.stated.get, c.record
    if (country := stated("country")) is None:
        raise ConfigError(
            "the digital certificate needs the laboratory's country",
            where=f"{record.id}: [certificate] country",
            got="nothing",
            expected='an ISO 3166-1 code, such as country = "US"',
            next_step="state it under [laboratory] of the style file beside the template, or leave out --dcc",
            rule="certificate-country",
        )
    day = c.statements.date.isoformat()
    return node(
        "dcc:administrativeData",
        node("dcc:dccSoftware", _software("toolkit", __version__)),
        node(
            "dcc:coreData",
            node("dcc:countryCodeISO3166_1", country),
            node("dcc:usedLangCodeISO639_1", "en"),
            node("dcc:mandatoryLangCodeISO639_1", "en"),
            node("dcc:uniqueIdentifier", ("DRAFT " if c.draft else "") + c.id),
            node(
                "dcc:identifications",
                _identification("calibrationLaboratory", record.id, "Calibration record"),
                _identification("calibrationLaboratory", record.sha256, "SHA-256 of the record"),
                _identification("calibrationLaboratory", c.ledger_head, "Head of the ledger"),
                _identification("calibrationLaboratory", c.signature, "Signatures of the record"),
            ),
            c.stated.received and node("dcc:receiptDate", c.stated.received.isoformat()),
            node("dcc:beginPerformanceDate", day),
            node("dcc:endPerformanceDate", day),
            node("dcc:performanceLocation", "other" if stated("place") else "laboratory"),
            node("dcc:issueDate", c.issued.isoformat()),
            c.replaces
            and node(
                "dcc:reportAmendedSubstituted",
                node("dcc:typeOfChange", "amended"),
                node("dcc:replacedUniqueIdentifier", c.replaces),
            ),
        ),
        node(
            "dcc:items",
            node(
                "dcc:item",
                text("dcc:name", c.item),
                node(
                    "dcc:identifications",
                    _identification("calibrationLaboratory", record.instrument, "Instrument"),
                    *(
                        _identification("manufacturer", cell.serial, f"Serial number of {cell.name}")
                        for cell in record.cells
                        if cell.serial
                    ),
                ),
            ),
        ),
        node("dcc:calibrationLaboratory", _contact("dcc:contact", stated("laboratory"), stated("address"))),
        node("dcc:respPersons", *_persons(c)),
        _contact("dcc:customer", stated("customer"), stated("customer_address")),
        node("dcc:statements", *_statements(c)),
    )


def _persons(c: Certificate) -> list[Node]:
    roles = [("calibrated", c.entered_by), ("checked", c.checked_by), ("approved", c.approved_by)]
    persons = [(role, name) for role, name in roles if name]
    return [
        node(
            "dcc:respPerson",
            node("dcc:person", text("dcc:name", name)),
            node("dcc:role", role),
            node("dcc:mainSigner", "true" if at == len(persons) - 1 and not c.draft else "false"),
        )
        for at, (role, name) in enumerate(persons)
    ]


def _statements(c: Certificate) -> list[Node]:
    statements: list[tuple[str, str | None]] = [
        ("State", words.draft_text(c) if c.draft else None),
        ("Simulation", words.SIMULATED if c.simulated else None),
        ("Withdrawal", c.withdrawn),
        ("Items", "The results relate only to the items calibrated."),
        ("Place", c.stated.get("place")),
        ("Accreditation", c.stated.get("accreditation")),
        ("Amendment", f"Replaces {c.replaces}. Reason: {c.amendment}" if c.replaces else None),
        ("Metrological traceability", words.traceability(c)),
        ("Decision rule", RULES[c.stated.rule] if c.stated.rule else None),
        ("Conformity", words.conformity(c)),
        ("Unverified terms", _unverified(c)),
        ("Adjustment", c.adjustment),
        ("Opinion, not a result", c.stated.get("opinions")),
        ("Agreed with the customer", c.stated.interval),
        ("Not stated", "; ".join(c.gaps) or None),
    ]
    nodes = [
        node("dcc:statement", text("dcc:name", name), rich("dcc:declaration", words_))
        for name, words_ in statements
        if words_
    ]
    outside = dict.fromkeys(
        unit_text
        for unit_text in [*(o.unit for o in c.loads), *c.record.indication_units]
        if _not_si(unit_text)
    )
    nodes += [
        node(
            "dcc:statement",
            text("dcc:name", f"Unit {text_unit} of the record"),
            node("dcc:nonSIDefinition", f"1 {text_unit} = {dsi(text_unit).factor!r} {dsi(text_unit).text}"),
            node("dcc:nonSIUnit", f"|{text_unit}"),
        )
        for text_unit in outside
    ]
    return nodes


def _unverified(c: Certificate) -> str:
    names = ", ".join(f"{load}: {term}" for load, term in c.unverifiable)
    return words.unverifiable(c) + (f" {names}." if names else "")


def _not_si(name: str) -> bool:
    return unit(name).dimension in ("force", "moment") and dsi(name).factor != 1.0


def _results(c: Certificate) -> Node:
    reference = c.statements.reference
    return node(
        "dcc:measurementResults",
        node(
            "dcc:measurementResult",
            text("dcc:name", f"Calibration of {c.record.instrument}"),
            node(
                "dcc:usedMethods",
                node(
                    "dcc:usedMethod",
                    text("dcc:name", c.stated.get("method") or words.GAP),
                    rich("dcc:description", c.model),
                ),
                node(
                    "dcc:usedMethod",
                    text("dcc:name", "Expanded uncertainty"),
                    rich("dcc:description", words.uncertainty(c)),
                    node("dcc:norm", "JCGM 100:2008"),
                    refType="basic_uncertainty",
                ),
            ),
            node("dcc:usedSoftware", _software("toolkit", __version__)),
            reference.standard
            and node(
                "dcc:measuringEquipments",
                node(
                    "dcc:measuringEquipment",
                    text("dcc:name", reference.standard),
                    rich("dcc:description", f"certificate {reference.certificate or words.GAP}"),
                    refType="basic_measurementStandard",
                ),
            ),
            _conditions(c),
            node("dcc:results", *(result for load in c.loads for result in _load(c, load))),
        ),
    )


def _conditions(c: Certificate) -> Node | None:
    if c.statements.temperature_C is None:
        return None
    kelvin = f"{c.statements.temperature_C + 273.15:.2f}"
    data = node("dcc:data", quantity("Temperature", kelvin, r"\kelvin"))
    status = {"as_found": "beforeAdjustment", "as_left": "afterAdjustment"}.get(c.statements.phase or "")
    return node(
        "dcc:influenceConditions",
        node(
            "dcc:influenceCondition",
            text("dcc:name", "Ambient temperature"),
            status and node("dcc:status", status),
            data,
            refType="basic_temperature",
        ),
    )


def _load(c: Certificate, load: LoadResult) -> list[Node]:
    nodes = [_equation(c, load), _range(load)]
    if load.checks:
        nodes.append(_check(load))
    if load.adjustment:
        nodes.append(_adjustment(load))
    return nodes


def _equation(c: Certificate, load: LoadResult) -> Node:
    units = c.record.units
    lines = []
    for term in load.terms:
        coefficient_unit = dsi_of_term(load.unit, term.term, units)
        u = f"{abs(term.standard_error * coefficient_unit.factor):.2g}"
        comment = f"issued: {term.issued} {term.unit}; full: {term.full!r} {term.unit}"
        lines.append(
            quantity(
                term.term,
                repr(term.full * coefficient_unit.factor),
                coefficient_unit.text,
                told=comment,
                standard=u,
            )
        )
    return node(
        "dcc:result",
        text("dcc:name", f"Coefficients of {load.load}"),
        rich("dcc:description", f"{load.load} is the sum of coefficient x term; the terms are named below."),
        node("dcc:data", *lines),
    )


def _range(load: LoadResult) -> Node:
    load_unit = dsi(load.unit)
    at = [e.at * load_unit.factor for e in load.range]
    U = [e.U * load_unit.factor for e in load.range]
    return node(
        "dcc:result",
        text("dcc:name", f"Expanded uncertainty of {load.load} over the calibrated range"),
        node(
            "dcc:data",
            quantity_list(
                load.load,
                [round_to_uncertainty(v, u) for v, u in zip(at, U, strict=True)],
                load_unit.text,
                U=[round_uncertainty(u) for u in U],
                k=[f"{e.k:.2f}" for e in load.range],
                p=[f"{e.probability:g}" for e in load.range],
                told=f"in the record: {load.unit}",
            ),
        ),
    )


def _check(load: LoadResult) -> Node:
    load_unit = dsi(load.unit)
    U = [line.uncertainty.U * load_unit.factor for line in load.checks]
    rounded_U = [round_uncertainty(u) for u in U]
    k = [f"{line.uncertainty.k:.2f}" for line in load.checks]
    p = [f"{line.uncertainty.probability:g}" for line in load.checks]

    def rounded(values: list[float]) -> list[str]:
        return [round_to_uncertainty(v * load_unit.factor, u) for v, u in zip(values, U, strict=True)]

    deviation = quantity_list(
        f"Deviation of {load.load}",
        rounded([line.deviation for line in load.checks]),
        load_unit.text,
        kind="basic_measurementError",
        U=rounded_U,
        k=k,
        p=p,
    )
    stated = [line.verdict for line in load.checks]
    if all(stated):
        deviation.append(
            node(
                "dcc:measurementMetaData",
                node(
                    "dcc:metaData",
                    rich(
                        "dcc:declaration", f"Tolerance {load.tolerance:.6g} {load.unit} by the decision rule"
                    ),
                    node("dcc:conformityXMLList", " ".join(str(v) for v in stated)),
                    refType="basic_conformity",
                ),
            )
        )
    return node(
        "dcc:result",
        text("dcc:name", f"Check loads, {load.load}"),
        node(
            "dcc:data",
            node(
                "dcc:list",
                quantity_list(
                    f"Reference {load.load}",
                    [f"{line.reference * load_unit.factor:.10g}" for line in load.checks],
                    load_unit.text,
                    kind="basic_referenceValue",
                ),
                quantity_list(
                    f"Result {load.load}",
                    rounded([line.result for line in load.checks]),
                    load_unit.text,
                    kind="basic_measuredValue",
                    U=rounded_U,
                    k=k,
                    p=p,
                ),
                deviation,
            ),
        ),
    )


def _adjustment(load: LoadResult) -> Node:
    change = load.adjustment
    assert change is not None  # noqa: S101  the caller asked
    load_unit = dsi(load.unit)
    lines = [("as found", change.as_found, change.found, "basic_beforeAdjustment")]
    if change.as_left is not None and change.left is not None:
        lines.append(("as left", change.as_left, change.left, "basic_afterAdjustment"))
    return node(
        "dcc:result",
        text("dcc:name", f"Largest deviation of {load.load} before and after adjustment"),
        node(
            "dcc:data",
            *(
                quantity(
                    name,
                    round_to_uncertainty(value * load_unit.factor, of.U * load_unit.factor),
                    load_unit.text,
                    kind=kind,
                    expanded=(
                        round_uncertainty(of.U * load_unit.factor),
                        f"{of.k:.2f}",
                        f"{of.probability:g}",
                    ),
                )
                for name, value, of, kind in lines
            ),
        ),
    )


def _software(name: str, version: str) -> Node:
    return node("dcc:software", text("dcc:name", name), node("dcc:release", release(version)))


def _identification(issuer: str, value: str, name: str) -> Node:
    return node(
        "dcc:identification", node("dcc:issuer", issuer), node("dcc:value", value), text("dcc:name", name)
    )


def _contact(tag: str, name: str | None, address: str | None) -> Node:
    place = node("dcc:location", rich("dcc:further", address or words.GAP))
    return node(tag, text("dcc:name", name or words.GAP), place)
