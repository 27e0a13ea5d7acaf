"""A proof in a digital certificate: read back, and its content has the hash of before."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from lxml import etree

from tests.calibration.dcc.dcc_factory import plain_dcc
from tests.trust.seal.seal_factory import key, trust
from toolkit.trust.seal.xml import check_xml, content_hash, proof_in, seal_xml, with_proof

PROOF = '{"line": "<a> & \\"b\\"", "checkpoint": "m15\\n\\n— anna x\\n"}'


def test_the_content_of_a_certificate_is_hashed_without_its_proof_and_its_seal() -> None:
    plain = plain_dcc()
    canonical = etree.tostring(etree.fromstring(plain), method="c14n", with_comments=False)
    digest = hashlib.sha256(canonical).hexdigest()
    assert content_hash(plain) == digest
    assert proof_in(plain) is None
    proved = with_proof(plain, PROOF)
    assert (proof_in(proved), content_hash(proved)) == (PROOF, digest)
    sealed = seal_xml(proved, key())
    check = check_xml(sealed, trust())
    assert check.signature == "valid"
    for document in (sealed, check.content):
        assert (proof_in(document), content_hash(document)) == (PROOF, digest)


def test_every_other_change_is_one_of_the_content() -> None:
    proved = with_proof(plain_dcc(), PROOF)
    digest = content_hash(proved)
    for old, new in ((b"K-2025-17", b"K-2025-18"), (b"</dcc:comment>", b"</dcc:comment><dcc:comment/>")):
        assert old in proved
        assert content_hash(proved.replace(old, new, 1)) != digest


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</toolkit-proof>", "</toolkit-proof><note>U = 0.1 N</note>"),
        ("</toolkit-proof>", "<note>U = 0.1 N</note></toolkit-proof>"),
        ("</toolkit-proof>", "</toolkit-proof>U = 0.1 N"),
        ("<toolkit-proof>", "U = 0.1 N<toolkit-proof>"),
        ("<toolkit-proof>", '<toolkit-proof note="U = 0.1 N">'),
        ("<toolkit-proof>", "<?note U = 0.1 N?><toolkit-proof>"),
        ("<dcc:comment>", '<dcc:comment note="U = 0.1 N">'),
        ("</dcc:comment>", "</dcc:comment>U = 0.1 N"),
        ("</dcc:comment>", "</dcc:comment><dcc:comment><toolkit-proof/>U = 0.1 N</dcc:comment>"),
        ("<dcc:comment>", "<dcc:comment><toolkit-proof/>U = 0.1 N</dcc:comment><dcc:comment>"),
    ],
)
def test_what_is_left_out_of_the_hash_is_the_proof_and_nothing_beside_it(old: str, new: str) -> None:
    proved = with_proof(plain_dcc(), PROOF)
    assert proved.count(old.encode()) == 1
    assert content_hash(proved.replace(old.encode(), new.encode())) is None


def test_a_certificate_with_a_proof_keeps_the_form_of_the_schema(tmp_path: Path) -> None:
    from toolkit.calibration.dcc.structure import check_structure

    check_structure(etree.fromstring(with_proof(plain_dcc(), PROOF)), where=tmp_path)
