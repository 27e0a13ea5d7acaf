"""XAdES: an XML document is sealed as a whole, enveloped in its root, and read from what was signed alone.

ETSI EN 319 132-1, B-B: the signed properties hold time and certificate. A check accepts one form only: one
signature, a child of the root, with a reference to the whole document, made canonical, and one to its own
signed properties. A document that hides the signed content elsewhere (signature wrapping) has another form.

Canonical XML drops comments, quotes and spaces inside tags, so that their bytes are nobody's. A document
that the toolkit seals therefore says among its signed properties that its file is its canonical form: every
byte of such a file counts.

The ledger's proof stands in a digital calibration certificate as a comment, put in before the certificate is
sealed. What the entry holds is the hash of the certificate's content: its canonical form (C14N 1.0, without
comments) before the proof and the seal were put into it.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import re
from base64 import b64decode, b64encode
from typing import Any

from cryptography import x509
from lxml import etree

from toolkit.errors import TrustError
from toolkit.trust.seal.check import Forged, SealCheck, Sealed, judged
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.x509 import Trust, load_certificate, weak_certificate

DS, XADES = "http://www.w3.org/2000/09/xmldsig#", "http://uri.etsi.org/01903/v1.3.2#"
EXACT = "The file is the canonical form of this document."
# The mark by which the toolkit knows its own files again (`recording.marks.OWN_OUTPUT`).
_HEAD = b'<?xml version="1.0" encoding="UTF-8"?>\n<!-- toolkit-output -->\n'
_ENVELOPED = f"{DS}enveloped-signature"
_CANONICAL = (
    "http://www.w3.org/2001/10/xml-exc-c14n#",
    "http://www.w3.org/2006/12/xml-c14n11",
    "http://www.w3.org/TR/2001/REC-xml-c14n-20010315",
)
_STRONG = re.compile(r"(?:rsa-sha|ecdsa-sha|sha)(?:256|384|512)(?:-rsa-MGF1)?\Z")
_DIGEST = re.compile(r"#sha(?:256|384|512)\Z")
_OF_A_SEAL = frozenset(("Signature", "SignedInfo", "SignatureValue"))
_MOST_BYTES = 32 * 2**20
_IDS = frozenset(("id", "{http://www.w3.org/XML/1998/namespace}id"))


def seal_xml(data: bytes, key: SealKey, *, at: dt.datetime | None = None) -> bytes:
    """Return a document with its seal, as the canonical bytes of the whole; comments are dropped.

    ``at`` is the time of the seal, default now.

    Raises
    ------
    TrustError
        ``seal``: no XML that can be sealed, or one that has a seal already
    """
    from signxml.algorithms import CanonicalizationMethod
    from signxml.exceptions import SignXMLException
    from signxml.xades.xades import XAdESDataObjectFormat, XAdESSigner

    moment = (at or dt.datetime.now(dt.UTC)).astimezone(dt.UTC)

    class Signer(XAdESSigner):
        """States the time that it is given, in UTC with a Z, and no key beside the certificate."""

        def add_signing_time(
            self,
            signed_signature_properties: Any,
            sig_root: Any,  # noqa: ARG002
            signing_settings: Any,  # noqa: ARG002
        ) -> None:
            time = etree.SubElement(signed_signature_properties, f"{{{XADES}}}SigningTime")
            time.text = moment.strftime("%Y-%m-%dT%H:%M:%SZ")

    try:
        root = _unsealed(data)
        etree.strip_tags(root, etree.Comment, etree.ProcessingInstruction)
        signer = Signer(
            signature_algorithm=_algorithm(key), digest_algorithm="sha256",
            c14n_algorithm=CanonicalizationMethod.CANONICAL_XML_1_1,
            data_object_format=XAdESDataObjectFormat(Description=EXACT, MimeType="text/xml"),
        )  # fmt: skip
        signed: Any = signer.sign(root, key=key.private, cert=list(key.chain), always_add_key_value=False)
    except (Forged, SignXMLException, ValueError, TypeError) as error:
        raise TrustError(
            "the document cannot be sealed", where="XML", got=" ".join(str(error).split())[:200],
            expected="an XML document without a seal and without a DTD",
            next_step="nothing was sealed; issue the document again", rule="seal",
        ) from error  # fmt: skip
    # Its line breaks are nobody's bytes.
    value = signed.find(f"{{{DS}}}Signature/{{{DS}}}SignatureValue")
    value.text = value.text.replace("\n", "")
    return _exact(signed)


def _unsealed(data: bytes) -> Any:
    root = _parse(data)
    if next(root.iter(f"{{{DS}}}Signature"), None) is not None:
        raise Forged("the document has a seal already")
    return root


def check_xml(data: bytes, trust: Trust, *, now: dt.datetime | None = None) -> SealCheck:
    """Return whether the seal of an XML document holds; `SealCheck.content` is what was signed.

    Raises
    ------
    TrustError
        ``unreadable-document``: no XML, or one with a DTD or entities
    """
    try:
        root = _parse(data)
    except Forged as error:
        raise TrustError(
            "the file is no XML document that may be read", where="XML", got=str(error),
            expected="well-formed XML without a DTD", next_step="name the file as it was issued",
            rule="unreadable-document",
        ) from error  # fmt: skip
    # By their names alone: a seal whose namespace was broken must not pass for a document without one.
    if not any(etree.QName(e).localname in _OF_A_SEAL for e in root.iter("*")):
        return SealCheck(signature="unsigned", why="the document has no seal")
    try:
        sealed = _signature(data, root)
    except Forged as error:
        return SealCheck(signature="invalid", why=str(error))
    except Exception as error:  # noqa: BLE001  hostile bytes; what cannot be checked does not hold
        return SealCheck(signature="invalid", why=f"the signature cannot be read: {type(error).__name__}")
    return judged(sealed, trust, now=now)


def _signature(data: bytes, root: Any) -> Sealed:
    from signxml.exceptions import SignXMLException
    from signxml.xades.xades import XAdESSignatureConfiguration, XAdESVerifier

    signature = _only_signature(root)
    references = _demand_form(root, signature)
    certificates = _certificates(signature)
    signer = certificates[0]
    if weakness := weak_certificate(signer, anchor=True):
        raise Forged(weakness)
    config = XAdESSignatureConfiguration(
        location="./", expect_references=len(references), verification_time=signer.not_valid_before_utc
    )
    try:
        results = XAdESVerifier().verify(data, x509_cert=signer, expect_config=config)
    except SignXMLException as error:
        raise Forged(f"changed after it was sealed: {' '.join(str(error).split())[:160]}") from error
    by_reference = dict(zip(references, results, strict=True))
    content = by_reference[""].signed_data
    signed = _parse(content)
    if signed.tag != root.tag or next(signed.iter(f"{{{DS}}}Signature"), None) is not None:
        raise Forged("what was signed is not the document")
    properties: Any = next(
        result.signed_xml for uri, result in by_reference.items() if _names_properties(uri, signature)
    )
    if properties.findtext(f".//{{{XADES}}}DataObjectFormat/{{{XADES}}}Description") == EXACT:
        _demand_exact(data, root, signature)
    return Sealed(
        signer=signer, intermediates=certificates[1:], at=_signing_time(properties), content=content
    )


def _only_signature(root: Any) -> Any:
    signatures = list(root.iter(f"{{{DS}}}Signature"))
    if len(signatures) != 1:
        raise Forged(f"{len(signatures)} signatures in one document")
    if signatures[0].getparent() is not root:
        raise Forged("the signature does not stand in the root: what it signs may have been moved")
    return signatures[0]


def _demand_form(root: Any, signature: Any) -> list[str]:
    """Return the URIs of the references, in order, of a signature that has the form of a seal."""
    ids = [value for e in root.iter("*") for name, value in e.attrib.items() if name.lower() in _IDS]
    if len(ids) != len(set(ids)):
        raise Forged("two elements have the same id: a reference could mean either")
    info = _only(signature, "SignedInfo")
    _demand_canonical(_only(info, "CanonicalizationMethod"))
    method = str(_only(info, "SignatureMethod").get("Algorithm"))
    if not _STRONG.search(method.rpartition("#")[2]):
        raise Forged(f"weak algorithm: the signature method is {method}")
    references: list[str] = []
    for reference in info.iterfind(f"{{{DS}}}Reference"):
        uri = reference.get("URI")
        if uri is None or uri in references:
            raise Forged("a reference without a target, or two to the same")
        references.append(uri)
        _demand_transforms(reference, uri)
        digest = str(_only(reference, "DigestMethod").get("Algorithm"))
        if not _DIGEST.search(digest):
            raise Forged(f"weak algorithm: a digest is {digest}")
        if (
            uri
            and not _names_properties(uri, signature)
            and uri != f"#{_only(signature, 'KeyInfo').get('Id')}"
        ):
            raise Forged(f"a reference to another part of the document: {uri}")
    if "" not in references or not any(_names_properties(uri, signature) for uri in references):
        raise Forged("the signature does not cover document, time and certificate (XAdES)")
    return references


def _demand_transforms(reference: Any, uri: str) -> None:
    transforms = reference.findall(f"{{{DS}}}Transforms/{{{DS}}}Transform")
    algorithms = [str(transform.get("Algorithm")) for transform in transforms]
    if uri == "":
        if algorithms[:1] != [_ENVELOPED]:
            raise Forged("the document is not signed as a whole")
        transforms, algorithms = transforms[1:], algorithms[1:]
    if len(algorithms) > 1:
        raise Forged("more transforms than a seal has")
    for transform in transforms:
        _demand_canonical(transform)


def _demand_canonical(element: Any) -> None:
    algorithm = element.get("Algorithm")
    if algorithm not in _CANONICAL or len(element):
        raise Forged(f"a transform that a seal does not have: {algorithm}")


def _names_properties(uri: str, signature: Any) -> bool:
    path = f"{{{DS}}}Object/{{{XADES}}}QualifyingProperties/{{{XADES}}}SignedProperties"
    elements = signature.findall(path)
    return len(elements) == 1 and uri == f"#{elements[0].get('Id')}"


def _certificates(signature: Any) -> tuple[x509.Certificate, ...]:
    texts = [
        e.text or "" for e in signature.iterfind(f"{{{DS}}}KeyInfo/{{{DS}}}X509Data/{{{DS}}}X509Certificate")
    ]
    if not texts:
        raise Forged("the signature holds no certificate")
    try:
        return tuple(load_certificate(b64decode(text)) for text in texts)
    except ValueError as error:
        raise Forged("a certificate of the signature cannot be read") from error


def _signing_time(properties: Any) -> dt.datetime:
    text = properties.findtext(f".//{{{XADES}}}SigningTime")
    try:
        moment = dt.datetime.fromisoformat(str(text).strip())
    except ValueError as error:
        raise Forged("the signature states no time") from error
    return moment if moment.tzinfo else moment.replace(tzinfo=dt.UTC)


def _demand_exact(data: bytes, root: Any, signature: Any) -> None:
    """Refuse a file that is not the canonical form of its document, or whose seal has more parts."""
    if data != _exact(root):
        raise Forged("changed after it was sealed: the file is not the canonical form that it says it is")
    value = _only(signature, "SignatureValue").text or ""
    if b64encode(b64decode(value)).decode() != value:
        raise Forged("changed after it was sealed: a value that is not plain base64")
    if any(element.tail or (len(element) and element.text) for element in signature.iter()):
        raise Forged("changed after it was sealed: text in the signature")
    names = [etree.QName(e).localname for e in signature]
    target = signature.find(f"{{{DS}}}Object/{{{XADES}}}QualifyingProperties")
    if names != ["SignedInfo", "SignatureValue", "KeyInfo", "Object"] or target.get("Target") != (
        f"#{signature.get('Id')}"
    ):
        raise Forged("changed after it was sealed: the parts of the signature")


def _exact(root: Any) -> bytes:
    return _HEAD + bytes(etree.tostring(root, method="c14n", with_comments=False)) + b"\n"


def _only(parent: Any, name: str) -> Any:
    elements = parent.findall(f"{{{DS}}}{name}")
    if len(elements) != 1:
        raise Forged(f"{len(elements)} elements {name} where a seal has one")
    return elements[0]


def _parse(data: bytes) -> Any:
    if len(data) > _MOST_BYTES:
        raise Forged(f"{len(data)} bytes")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise Forged(" ".join(str(error).split())[:160]) from error
    info: Any = root.getroottree().docinfo
    if info.doctype or info.internalDTD is not None or info.externalDTD is not None:
        raise Forged("a document type definition")
    if next(root.iter(etree.Entity), None) is not None:
        raise Forged("an entity")
    return root


def _algorithm(key: SealKey) -> str:
    from cryptography.hazmat.primitives.asymmetric import ec

    return "ecdsa-sha256" if isinstance(key.private, ec.EllipticCurvePrivateKey) else "rsa-sha256"


_DCC = "{https://ptb.de/dcc}"
_SEAL = "{http://www.w3.org/2000/09/xmldsig#}Signature"
ELEMENT = "toolkit-proof"


def with_proof(data: bytes, proof: str) -> bytes:
    """Return a certificate whose comment holds a proof."""
    root = _parsed_proof(data)
    comment = etree.Element(f"{_DCC}comment")
    etree.SubElement(comment, ELEMENT).text = proof
    root.insert(list(root).index(root.find(f"{_DCC}measurementResults")) + 1, comment)
    xml: bytes = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return xml + b"\n"


def proof_in(data: bytes) -> str | None:
    """Return the proof that a certificate holds; None where there is none."""
    text: str | None = _parsed_proof(data).findtext(f"{_DCC}comment/{ELEMENT}")
    return text


def content_hash(data: bytes) -> str | None:
    """Return the SHA-256 of a certificate's content, without its proof and its seal.

    None where the document is another than its content with the proof put into it: what is left out of the
    hash is what `with_proof` writes, and nothing beside it.
    """
    root = _parsed_proof(data)
    for seal in root.findall(_SEAL):
        root.remove(seal)
    whole = _canonical(root)
    own = [comment for comment in root.findall(f"{_DCC}comment") if comment.find(ELEMENT) is not None]
    for comment in own:
        root.remove(comment)
    content = _canonical(root)
    if own and whole != _canonical(_parsed_proof(with_proof(content, own[0].findtext(ELEMENT) or ""))):
        return None
    return hashlib.sha256(content).hexdigest()


def _canonical(root: Any) -> bytes:
    return bytes(etree.tostring(root, method="c14n", with_comments=False))


def _parsed_proof(data: bytes) -> Any:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    return etree.fromstring(data, parser)
