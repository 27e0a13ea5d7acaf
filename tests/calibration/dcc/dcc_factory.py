"""Certificates of a reference standard: a whole DCC of few lines, to be sealed and to be spoilt."""

from __future__ import annotations

from pathlib import Path

from tests.trust.seal.seal_factory import authority, key
from toolkit.calibration.dcc.standard import Standards
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import seal_xml

STANDARDS = Standards(trust=Trust(certificates=(authority().certificate,)))

FORCE = ("Force", r"\newton", "-2500 0 1000 2500", "0.9 0.5 0.6 0.8", "2")
MOMENT = ("Moment", r"\newton\metre", "-250 0 250", "0.06", "2.05 2 2")


def quantity(name: str, unit: str, values: str, U: str, k: str, *, kind: str = "basic_measuredValue") -> str:
    """Return a quantity of D-SI 2 as XML."""
    return f"""<dcc:result><dcc:name><dcc:content>{name}</dcc:content></dcc:name><dcc:data>
<dcc:quantity refType="{kind}"><si:realListXMLList><si:valueXMLList>{values}</si:valueXMLList>
<si:unitXMLList>{unit}</si:unitXMLList><si:measurementUncertaintyUnivariateXMLList><si:expandedMUXMLList>
<si:valueExpandedMUXMLList>{U}</si:valueExpandedMUXMLList><si:coverageFactorXMLList>{k}</si:coverageFactorXMLList>
<si:coverageProbabilityXMLList>0.95</si:coverageProbabilityXMLList></si:expandedMUXMLList>
</si:measurementUncertaintyUnivariateXMLList></si:realListXMLList></dcc:quantity></dcc:data></dcc:result>"""


def item(serial: str) -> str:
    return f"""<dcc:item><dcc:name><dcc:content>Force standard</dcc:content></dcc:name>
<dcc:identifications><dcc:identification><dcc:issuer>customer</dcc:issuer><dcc:value>INV-9</dcc:value>
</dcc:identification><dcc:identification><dcc:issuer>manufacturer</dcc:issuer><dcc:value>{serial}</dcc:value>
</dcc:identification></dcc:identifications></dcc:item>"""


def plain_dcc(
    *,
    results: str | None = None,
    items: str | None = None,
    serial: str = "FS-4711",
    calibrated: str = "2025-06-01",
    due: str | None = "2026-06-01",
) -> bytes:
    """Return the certificate of a standard for FY, MZ and MX of the hub, not sealed."""
    results = quantity(*FORCE) + quantity(*MOMENT) if results is None else results
    recall = f"""<dcc:statements><dcc:statement refType="basic_recalibration"><dcc:date>{due}</dcc:date>
</dcc:statement></dcc:statements>"""
    place = "<dcc:location><dcc:city>Town</dcc:city></dcc:location>"
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si"
 schemaVersion="3.3.0">
<dcc:administrativeData><dcc:dccSoftware><dcc:software><dcc:name><dcc:content>editor</dcc:content></dcc:name>
<dcc:release>v1</dcc:release></dcc:software></dcc:dccSoftware>
<dcc:coreData><dcc:countryCodeISO3166_1>DE</dcc:countryCodeISO3166_1>
<dcc:usedLangCodeISO639_1>en</dcc:usedLangCodeISO639_1>
<dcc:mandatoryLangCodeISO639_1>en</dcc:mandatoryLangCodeISO639_1>
<dcc:uniqueIdentifier>K-2025-17</dcc:uniqueIdentifier>
<dcc:beginPerformanceDate>{calibrated}</dcc:beginPerformanceDate>
<dcc:endPerformanceDate>{calibrated}</dcc:endPerformanceDate>
<dcc:performanceLocation>laboratory</dcc:performanceLocation></dcc:coreData>
<dcc:items>{item(serial) if items is None else items}</dcc:items>
<dcc:calibrationLaboratory><dcc:calibrationLaboratoryCode>D-K-12345-01-00</dcc:calibrationLaboratoryCode>
<dcc:contact><dcc:name><dcc:content>Standards house</dcc:content></dcc:name>{place}</dcc:contact>
</dcc:calibrationLaboratory>
<dcc:respPersons><dcc:respPerson><dcc:person><dcc:name><dcc:content>P</dcc:content></dcc:name></dcc:person>
</dcc:respPerson></dcc:respPersons>
<dcc:customer><dcc:name><dcc:content>Tire laboratory</dcc:content></dcc:name>{place}</dcc:customer>
{recall if due else ""}</dcc:administrativeData>
<dcc:measurementResults><dcc:measurementResult><dcc:name><dcc:content>Calibration</dcc:content></dcc:name>
<dcc:results>{results}</dcc:results></dcc:measurementResult></dcc:measurementResults>
</dcc:digitalCalibrationCertificate>
""".encode()


def write_dcc(folder: Path, data: bytes | None = None, *, signer: SealKey | None = None) -> bytes:
    """Seal a certificate, write it as ``standard.xml`` and return it."""
    sealed = seal_xml(plain_dcc() if data is None else data, signer or key())
    (folder / "standard.xml").write_bytes(sealed)
    return sealed


REFERENCE = '[reference]\ndcc = "standard.xml"\n'
