"""A certificate of the toolkit, sealed, is the standard of a session: every number as it was printed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from lxml import etree

from tests.report.certificate.test_certificate import DAY, STYLE, registry_of
from tests.trust.seal.seal_factory import key, trust
from toolkit.calibration.dcc.standard import Standards, certificate_of
from toolkit.calibration.dcc.structure import check_structure
from toolkit.calibration.session.read import read_session
from toolkit.calibration.session.statements import DigitalSource, parse_statements
from toolkit.estimate import round_to_uncertainty, round_uncertainty
from toolkit.files import sha256_bytes
from toolkit.report.certificate.collect import collect
from toolkit.report.certificate.content import traceability
from toolkit.report.certificate.dcc import build_dcc
from toolkit.report.certificate.dcc_xml import dsi
from toolkit.trust.seal.xml import check_xml, seal_xml


def statements_of_settings(path: Path) -> DigitalSource:
    session = read_session(path, standards=Standards(trust=trust()))
    digital = parse_statements(
        session.settings,
        indications={cell.name: cell.unit for cell in session.cells},
        loads={load.name: load.unit for load in session.loads},
        largest=dict.fromkeys((load.name for load in session.loads), 1.0),
        date=session.date,
        where=path,
    ).reference.digital
    assert digital is not None
    return digital


def test_every_number_is_read_as_it_was_printed_and_stands_in_the_session(tmp_path: Path) -> None:
    registry = registry_of(tmp_path)
    certificate = collect(registry, "pair-r1", STYLE, issued=DAY)
    sealed = seal_xml(build_dcc(certificate), key())
    root = etree.fromstring(check_xml(sealed, trust()).content)
    check_structure(root, where="certificate")
    read = certificate_of(root, where="certificate")
    assert (read.identifier, read.issued, read.calibrated) == (
        certificate.id, certificate.issued, certificate.statements.date,
    )  # fmt: skip
    assert set(read.items[0].numbers) == {"pair", "SA1", "SB2"}
    largest = {}
    for load in certificate.loads:
        factor = dsi(load.unit).factor
        printed = [
            (
                float(round_to_uncertainty(e.at * factor, e.U * factor)),
                float(round_uncertainty(e.U * factor)),
                float(f"{e.k:.2f}"),
            )
            for e in load.range
        ]
        points = [(p.value, p.U, p.k) for p in read.points if load.load in p.channels]
        assert [point for point in points if point in printed] == printed
        largest[load.load] = max(points, key=lambda point: point[1] / point[2])[1:]
    # The pair is the standard of a new session over the same loads, by nothing but its certificate.
    (tmp_path / "standard.xml").write_bytes(sealed)
    session = (tmp_path / "SESSION.toml").read_text()
    start = session.index("[reference]")
    text = session[:start] + '[reference]\ndcc = "standard.xml"\nstandard = "SA1"\n'
    (tmp_path / "NEXT.toml").write_text(text.replace("date = 2026-02-01", "date = 2026-03-01"))
    digital = statements_of_settings(tmp_path / "NEXT.toml")
    reference = replace(certificate.statements.reference, digital=digital)
    statements = replace(certificate.statements, reference=reference)
    words = traceability(replace(certificate, statements=statements))
    assert sha256_bytes(sealed) in words
    assert f"by {certificate.stated.get('laboratory')}" in words
    assert digital.signer_sha256 in words
    taken = json.loads(
        read_session(tmp_path / "NEXT.toml", standards=Standards(trust=trust())).settings
    )["reference"]  # fmt: skip
    assert taken["certificate"] == certificate.id
    assert {name: (entry["U"], entry["k"]) for name, entry in taken["uncertainty"].items()} == largest
