"""A session takes its standard's uncertainty from the digital certificate, or says why not."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from lxml import etree

from tests.calibration.dcc.dcc_factory import (
    FORCE,
    MOMENT,
    REFERENCE,
    STANDARDS,
    item,
    plain_dcc,
    quantity,
    write_dcc,
)
from tests.conftest import SHARED_DATA
from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import DAY, NOW, authority, key
from toolkit.calibration.dcc.standard import Standards, certificate_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_check, stored_loads, stored_session
from toolkit.calibration.session.read import read_session
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.errors import RecordError, SessionError, ToolkitError
from toolkit.files import sha256_bytes
from toolkit.trust.seal.x509 import Trust, fingerprint
from toolkit.trust.seal.xml import seal_xml

Make = Callable[..., Path]
EXAMPLES = SHARED_DATA / "dcc_examples"
SCHEMAS = SHARED_DATA / "dcc_schema"


def _entered(path: Path, registry: Path) -> Registry:
    registry.mkdir()
    result = Registry(registry)
    calibrate(path, result, standards=STANDARDS)
    return result


def test_the_record_holds_what_was_taken_and_where_it_stands(make_session: Make, tmp_path: Path) -> None:
    path = make_session(tail=REFERENCE)
    document = write_dcc(path.parent)
    registry = _entered(path, tmp_path / "cal")
    record = registry.load("hub-r1")
    reference = statements_of(record).reference
    assert (reference.standard, reference.certificate) == ("Force standard, FS-4711", "K-2025-17")
    assert str(reference.due) == "2026-06-01"
    stated = json.loads(record.settings)["reference"]
    # The largest u = U / k of each list: 0.9 / 2 N of the forces; 0.06 / 2 N·m, whose k is 2 and not 2.05.
    assert stated["uncertainty"]["FY"] == {"U": 0.9, "k": 2.0, "unit": "N"}
    assert stated["uncertainty"]["MZ"] == {"U": 0.06, "k": 2.0, "unit": "N*m"}
    assert stated["uncertainty"]["MX"] == stated["uncertainty"]["MZ"]
    taken = stated["dcc"]
    assert taken["sha256"] == sha256_bytes(document)
    assert taken["signer"]["sha256"] == fingerprint(key().certificate)
    assert taken["accreditation"] == "D-K-12345-01-00"
    assert taken["item"] == {"name": "Force standard", "serial": "FS-4711"}
    assert taken["taken"]["FY"]["range"] == [-2500.0, 2500.0]
    found = etree.fromstring(document).find(
        taken["taken"]["FY"]["xpath"]["U"], {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}
    )
    assert found is not None
    assert found.text == "0.9 0.5 0.6 0.8"


def test_the_budget_names_the_file_and_the_place_of_U(make_session: Make, tmp_path: Path) -> None:
    path = make_session(tail=REFERENCE)
    document = write_dcc(path.parent)
    registry = _entered(path, tmp_path / "cal")
    record = registry.load("hub-r1")
    rows, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    assert rows is not None
    budget = calibration_budget(record, rows, check, "FY", None)
    text = next(part.description for part in budget.components if part.name == "reference")
    assert f"standard.xml (sha256 {sha256_bytes(document)[:12]}) dcc:result[1]/dcc:data" in text
    assert "valueExpandedMUXMLList and si:coverageFactorXMLList" in text


def test_the_certificate_lies_beside_the_record_and_the_session_can_be_read_again(
    make_session: Make, tmp_path: Path
) -> None:
    path = make_session(tail=REFERENCE)
    document = write_dcc(path.parent)
    registry = _entered(path, tmp_path / "cal")
    record = registry.load("hub-r1")
    file = record.data_file("dcc")
    assert file is not None
    assert (registry.folder / "hub" / file.file).read_bytes() == document
    assert stored_session(registry.folder, record).settings == record.settings
    again = calibrate(path, registry, standards=STANDARDS)
    assert (again.existing, again.record.id) == (True, "hub-r1")


def test_a_typed_session_with_the_same_numbers_has_the_same_coefficients(
    make_session: Make, tmp_path: Path
) -> None:
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent)
    typed = make_session(
        name="typed",
        tail='[reference.uncertainty]\nFY = { U = 0.9, k = 2, unit = "N" }\n'
        'MZ = { U = 0.06, k = 2, unit = "N*m" }\nMX = { U = 0.06, k = 2, unit = "N*m" }\n',
    )
    first = _entered(path, tmp_path / "one").load("hub-r1")
    second = _entered(typed, tmp_path / "two").load("hub-r1")
    assert first.loads == second.loads
    assert statements_of(first).reference.uncertainties == statements_of(second).reference.uncertainties


def _kilo() -> str:
    return quantity("Force", r"\kilo\newton", "-2.5 2.5", "0.0009", "2") + quantity(*MOMENT)


def test_a_prefix_is_converted_exactly(make_session: Make) -> None:
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent, plain_dcc(results=_kilo()))
    reference = json.loads(read_session(path, standards=STANDARDS).settings)["reference"]
    assert reference["uncertainty"]["FY"] == {"U": 0.9, "k": 2.0, "unit": "N"}


def _both(**named: tuple[str, str, str, str]) -> str:
    return "".join(quantity(name, *rest) for name, rest in named.items())


def test_a_quantity_that_names_the_load_goes_before_others(make_session: Make) -> None:
    results = _both(
        FX=(r"\newton", "-2500 2500", "9.9", "2"),
        FY=(r"\newton", "-2500 2500", "0.7", "2"),
        Force=(r"\newton", "-2500 2500", "5", "2"),
        M=MOMENT[1:],
    )
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent, plain_dcc(results=results))
    reference = json.loads(read_session(path, standards=STANDARDS).settings)["reference"]
    assert reference["uncertainty"]["FY"]["U"] == 0.7


# What is refused: the session's tail, the certificate, and the rule.

ISSUER = b"<dcc:issuer>customer</dcc:issuer>"
RANGE = quantity("Force", r"\newton", "0 1000 2500", "0.5", "2") + quantity(*MOMENT)
REFUSED: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "another-instrument": (REFERENCE + 'standard = "FS-4712"\n', plain_dcc, "dcc-instrument"),
    "part-of-the-number": (REFERENCE + 'standard = "FS-471"\n', plain_dcc, "dcc-instrument"),
    "number-with-a-suffix": (REFERENCE + 'standard = "FS-4711-A"\n', plain_dcc, "dcc-instrument"),
    "two-items": (REFERENCE, lambda: plain_dcc(items=item("A-1") + item("A-2")), "dcc-instrument"),
    "calibrated-later": (REFERENCE, lambda: plain_dcc(calibrated="2026-01-06"), "dcc-validity"),
    "due-before": (REFERENCE, lambda: plain_dcc(due="2026-01-04"), "dcc-validity"),
    "due-by-the-session": (REFERENCE + "due = 2026-01-04\n", plain_dcc, "dcc-validity"),
    "range": (REFERENCE, lambda: plain_dcc(results=RANGE), "dcc-range"),
    "range-too-small": (
        REFERENCE,
        lambda: plain_dcc(results=quantity("F", r"\newton", "-2000 2000", "1", "2") + quantity(*MOMENT)),
        "dcc-range",
    ),
    "no-moment": (REFERENCE, lambda: plain_dcc(results=quantity(*FORCE)), "dcc-quantity"),
    "a-temperature": (
        REFERENCE,
        lambda: plain_dcc(results=quantity("T", r"\kelvin", "300 310", "0.1", "2")),
        "dcc-quantity",
    ),
    "another-channel": (
        REFERENCE,
        lambda: plain_dcc(results=quantity("FX", *FORCE[1:]) + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "no-uncertainty": (
        REFERENCE,
        lambda: plain_dcc(results=_without_uncertainty() + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "before-adjustment": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE, kind="basic_beforeAdjustment") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "error-without-reference": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE, kind="basic_measurementError") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "U-zero": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "0", "2") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "U-negative": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "-0.5", "2") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "U-not-a-number": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "NaN", "2") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "k-below-1": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "0.5", "0.5") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "too-few-U": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "0.5 0.5", "2") + quantity(*MOMENT)),
        "dcc-quantity",
    ),
    "U-in-words": (
        REFERENCE,
        lambda: plain_dcc(results=quantity(*FORCE[:3], "half", "2") + quantity(*MOMENT)),
        "dcc-schema",
    ),
    "typed-too": (
        REFERENCE + '[reference.uncertainty]\nFY = { U = 0.1, k = 2, unit = "N" }\n',
        plain_dcc,
        "dcc-stated",
    ),
    "another-certificate": (REFERENCE + 'certificate = "K-2025-18"\n', plain_dcc, "dcc-stated"),
    "unknown-element": (REFERENCE, lambda: _replaced(b"<dcc:items>", b"<dcc:items><dcc:a/>"), "dcc-schema"),
    "missing-element": (REFERENCE, lambda: _replaced(ISSUER, b""), "dcc-schema"),
    "wrong-date": (REFERENCE, lambda: plain_dcc(calibrated="2025-13-01"), "dcc-schema"),
    "wrong-issuer": (REFERENCE, lambda: _replaced(ISSUER, ISSUER.replace(b"customer", b"me")), "dcc-schema"),
    "other-version": (REFERENCE, lambda: _replaced(b'"3.3.0"', b'"4.0.0"'), "dcc-schema"),
    "other-root": (REFERENCE, lambda: b"<certificate/>", "dcc-schema"),
}  # fmt: skip


def _replaced(old: bytes, new: bytes) -> bytes:
    assert old in plain_dcc()
    return plain_dcc().replace(old, new)


def _without_uncertainty() -> str:
    text = quantity(*FORCE)
    start = text.index("<si:measurementUncertaintyUnivariateXMLList>")
    end = text.index("</si:measurementUncertaintyUnivariateXMLList>")
    return text[:start] + text[end + len("</si:measurementUncertaintyUnivariateXMLList>") :]


@pytest.mark.parametrize(("tail", "build", "rule"), REFUSED.values(), ids=REFUSED.keys())
def test_anything_else_is_refused_with_the_reason(
    make_session: Make, tmp_path: Path, tail: str, build: Callable[[], bytes], rule: str
) -> None:
    path = make_session(tail=tail)
    write_dcc(path.parent, build())
    (tmp_path / "cal").mkdir()
    with pytest.raises(SessionError) as caught:
        calibrate(path, Registry(tmp_path / "cal"), standards=STANDARDS)
    assert caught.value.rule == rule
    assert list((tmp_path / "cal").iterdir()) == []


def test_a_number_in_the_sessions_words_names_the_instrument(make_session: Make) -> None:
    path = make_session(tail=REFERENCE + 'standard = "force standard fs-4711 of room 3"\n')
    write_dcc(path.parent)
    reference = json.loads(read_session(path, standards=STANDARDS).settings)["reference"]
    assert reference["standard"] == "force standard fs-4711 of room 3"


def _expired() -> bytes:
    return seal_xml(plain_dcc(), authority().issue("S", first=NOW - 20 * DAY, last=NOW - 10 * DAY))


UNSEALED: dict[str, Callable[[], bytes]] = {
    "unsigned": plain_dcc,
    "by-a-stranger": lambda: seal_xml(plain_dcc(), make_authority().issue("Standards house")),
    "expired": _expired,
    "changed": lambda: seal_xml(plain_dcc(), key()).replace(b">0.9 0.5", b">0.1 0.5"),
    "changed-serial": lambda: seal_xml(plain_dcc(), key()).replace(b"FS-4711", b"FS-4712"),
    "cut": lambda: seal_xml(plain_dcc(), key())[:-40],
    "no-xml": lambda: b"U = 0.1",
    "dtd": lambda: plain_dcc().replace(b"?>\n", b"?>\n<!DOCTYPE a [<!ENTITY b 'c'>]>\n", 1),
}


@pytest.mark.parametrize("name", UNSEALED)
def test_a_certificate_without_a_seal_that_holds_is_refused(make_session: Make, name: str) -> None:
    path = make_session(tail=REFERENCE)
    (path.parent / "standard.xml").write_bytes(UNSEALED[name]())
    with pytest.raises(SessionError) as caught:
        read_session(path, standards=STANDARDS)
    assert caught.value.rule == "dcc-seal"
    # Nobody is told to trust the signer of a file that is unsigned or was changed.
    advised = "put the issuer's certificate into trust" in str(caught.value.next_step)
    assert advised == (name in ("by-a-stranger", "expired"))


def test_without_trusted_certificates_none_is_taken(make_session: Make) -> None:
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent)
    with pytest.raises(SessionError, match="seal") as caught:
        read_session(path)
    assert caught.value.rule == "dcc-seal"
    assert fingerprint(key().certificate) in str(caught.value.got)


def test_a_revoked_signer_is_refused(make_session: Make) -> None:
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent)
    revoked = authority().revoke(key(), on=NOW)
    trust = replace(STANDARDS.trust, revocations=(revoked,))
    with pytest.raises(SessionError, match="seal"):
        read_session(path, standards=Standards(trust=trust))


@pytest.mark.parametrize("name", ["../standard.xml", "/etc/hostname", "missing.xml"])
def test_a_certificate_elsewhere_is_refused(make_session: Make, name: str) -> None:
    path = make_session(tail=f'[reference]\ndcc = "{name}"\n')
    write_dcc(path.parent.parent)
    with pytest.raises(SessionError, match=r"outside|cannot be read"):
        read_session(path, standards=STANDARDS)


def _another(document: bytes) -> bytes:
    return seal_xml(plain_dcc(due="2026-07-01"), key())


@pytest.mark.parametrize(
    "spoil",
    [lambda d: d.replace(b">0.9 0.5", b">0.1 0.5"), lambda _: b"", _another],
    ids=["changed", "empty", "other"],
)
def test_a_record_whose_certificate_was_exchanged_may_not_be_used(
    make_session: Make, tmp_path: Path, spoil: Callable[[bytes], bytes]
) -> None:
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent)
    registry = _entered(path, tmp_path / "cal")
    file = registry.folder / "hub" / "hub-r1.dcc.xml"
    file.write_bytes(spoil(file.read_bytes()))
    with pytest.raises(RecordError):
        Registry(registry.folder).load("hub-r1")
    file.unlink()
    with pytest.raises(RecordError):
        Registry(registry.folder).load("hub-r1")


def test_a_record_stands_when_its_certificates_signer_is_no_longer_trusted(
    make_session: Make, tmp_path: Path
) -> None:
    """Trust is asked at entry; later the record holds by its hash, its seal still being whole."""
    path = make_session(tail=REFERENCE)
    write_dcc(path.parent)
    registry = _entered(path, tmp_path / "cal")
    assert Registry(registry.folder).load("hub-r1").verified


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the DCC examples are not here")
@pytest.mark.parametrize("schemas", [None, SCHEMAS], ids=["by-its-form", "by-the-schema"])
def test_every_published_example_is_read_or_refused_with_a_reason(
    make_session: Make, schemas: Path | None
) -> None:
    """Of temperatures long overdue, and of a force without a moment: none is this session's standard."""
    path = make_session(tail=REFERENCE)
    rules = {}
    for example in sorted(EXAMPLES.glob("*.xml")):
        signed = b"<ds:Signature" in example.read_bytes()
        data = example.read_bytes()
        trust = STANDARDS.trust
        if signed:
            trust = Trust(certificates=(*trust.certificates, *_certificates(data)))
        (path.parent / "standard.xml").write_bytes(data if signed else seal_xml(data, key()))
        with pytest.raises(ToolkitError) as caught:
            read_session(path, standards=Standards(trust=trust, schemas=schemas))
        rules[example.name] = caught.value.rule
    assert rules.pop("dcc_force_min.xml") == "dcc-quantity"
    assert set(rules.values()) == {"dcc-validity"}
    assert len(rules) == 3


@pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the DCC examples are not here")
def test_of_the_published_force_certificate_every_number_is_read() -> None:
    root = etree.fromstring((EXAMPLES / "dcc_force_min.xml").read_bytes())
    certificate = certificate_of(root, where="dcc_force_min.xml")
    assert (certificate.identifier, certificate.items[0].serial) == ("M15-CAL-2019-0007", "M15-HUB-1")
    # Indicated forces with U = 4.0 N, k = 2, at their reference forces.
    assert [(p.value, p.U, p.k) for p in certificate.points] == [
        (at, 4.0, 2.0) for at in (0.0, 1000.0, 2000.0)
    ]


def _certificates(data: bytes) -> tuple[object, ...]:
    from base64 import b64decode

    from toolkit.trust.seal.x509 import load_certificate

    text = etree.fromstring(data).findtext(".//{http://www.w3.org/2000/09/xmldsig#}X509Certificate")
    return (load_certificate(b64decode(str(text))),)
