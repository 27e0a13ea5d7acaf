"""Open a template: a zip that is a Word file, that cannot explode, run, or fetch anything."""

# ruff: noqa: TRY301  a refusal raised while the archive is open is the plainest reading
from __future__ import annotations

import functools
import io
import posixpath
import re
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree

from toolkit.errors import TemplateError
from toolkit.files import sha256_bytes
from toolkit.inputs import TEMPLATE_FILE, read_input
from toolkit.recording.sniff import ole_kind, sniff
from toolkit.report.word.fields import fields_of
from toolkit.report.word.xml import Element, parser, q

_KIND = "application/vnd.openxmlformats-officedocument.wordprocessingml.{}+xml"
DOCUMENT, TEMPLATE = _KIND.format("document.main"), _KIND.format("template.main")
_CT = "{http://schemas.openxmlformats.org/package/2006/content-types}"
_REL = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
MEMBERS, TOTAL, RATIO = 5000, 300 * 2**20, 400
_SNIFFED = 4096
_NO_TIME = bytes((0, 0, 0x21, 0))  # midnight of 1980-01-01, the first that an archive can state

_FORBIDDEN_RELS = {
    "oleObject": ("ole-object", "an embedded or linked OLE object"),
    "package": ("ole-object", "an embedded document"),
    "control": ("ole-object", "an ActiveX control"),
    "activeXControlBinary": ("ole-object", "an ActiveX control"),
    "subDocument": ("sub-document", "a sub-document"),
    "frame": ("frames", "a frame"),
    "aFChunk": ("alt-chunk", "an imported document (altChunk)"),
    "vbaProject": ("macros", "a macro project"),
    "wordVbaData": ("macros", "macro data"),
    "keyMapCustomizations": ("macros", "key bindings"),
    "attachedToolbars": ("macros", "attached toolbars"),
}
_FORBIDDEN_TAGS = {
    q("w:mailMerge"): ("external-content", "a source of a mail merge"),
    q("w:altChunk"): ("alt-chunk", "an imported document (altChunk)"),
    q("w:subDoc"): ("sub-document", "a sub-document"),
    q("w:frameset"): ("frames", "a frameset"),
    q("w:object"): ("ole-object", "an embedded object"),
    q("w:control"): ("ole-object", "an ActiveX control"),
    q("o:OLEObject"): ("ole-object", "an OLE object"),
}
_FIELDS = re.compile(
    r"(?:^|[\s{}\"])(INCLUDE\w*|DDE\w*|IMPORT)\b|^\s*[{\"]*\s*(LINK|EMBED|RD|DATABASE|PRINT)\b", re.IGNORECASE
)
_ANYWHERE = re.compile(r"\s*(https?://|mailto:|#|$)", re.IGNORECASE)
"""Where a link that a reader may click leads; whatever else is outside of the file is refused."""
_OUTSIDE = re.compile(r"\s*([a-z][a-z0-9+.-]*:|[\\/]{2})|.*\\", re.IGNORECASE)
_HYPERLINK = re.compile(r'[\s{"]*HYPERLINK\s+(?:"([^"]*)"|(\\[a-z])|(\S+))', re.IGNORECASE)
_OF_ITSELF = re.compile(r"\s*(#|data:|$)", re.IGNORECASE)
_STYLE_URL = re.compile(r"url\(\s*[\"']?(?!\s*(?:#|data:))|@import", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A template that is safe to open. ``data`` is a .docx even where the file was a .dotx."""

    path: Path
    sha256: str
    data: bytes


RootOf = Callable[[str], Element]
"""Returns the root of a part by its name, read once for all checks, which change nothing."""


def read_template(path: Path) -> Template:
    """Read and check a template.

    Raises
    ------
    TemplateError
        not a Word file, damaged, too large, or with content that runs, links or embeds
    """
    raw = read_input(path, TEMPLATE_FILE)
    sha256 = sha256_bytes(raw)
    members = _members(path, raw)

    @functools.cache
    def root_of(name: str) -> Element:
        return _xml(path, name, members[name])

    kind = _main_part(path, members, root_of)
    _check_relationships(path, members, root_of)
    for name, data in members.items():
        _check_member(path, name, data, root_of)
    _check_references(path, members, root_of)
    return Template(path=path, sha256=sha256, data=_document(members) if kind == TEMPLATE else raw)


def open_package(template: Template) -> Any:
    """Open a template's parts with python-docx.

    Raises
    ------
    TemplateError
        a part is missing that another one refers to, one is not declared as what it is, or the package cannot
        be put together
    """
    from docx.package import Package

    try:
        package = Package.open(io.BytesIO(template.data))
    except (KeyError, ValueError, TypeError, AttributeError, etree.LxmlError) as error:
        raise _refuse(
            template.path,
            "zip-damaged",
            "the template's parts do not fit together",
            got=error,
            expected="a file as Word saves it",
        ) from error
    _check_kinds(template.path, package)
    return package


def _check_kinds(path: Path, package: Any) -> None:
    """Refuse a part that its relation calls styles, a header, and its content type something else.

    python-docx gives such a part as plain bytes: nobody would see the tags in it.
    """
    from docx.opc.part import PartFactory

    for rel in package.main_document_part.rels.values():
        kind = _KIND.format(rel.reltype.rpartition("/")[2])
        expected = PartFactory.part_type_for.get(kind)
        if expected is not None and not rel.is_external and not isinstance(rel.target_part, expected):
            raise _refuse(
                path, "zip-damaged", "a part of the template is not declared as what it is",
                where=str(rel.target_part.partname).lstrip("/"), got=rel.target_part.content_type,
                expected=kind,
            )  # fmt: skip


# What is no Word file, or a broken one, holds nothing that could be removed.
_NEXT = {
    **dict.fromkeys(
        ("not-word", "zip-damaged"),
        "copy it again, or open it in Word and save it as .docx or .dotx, without a password",
    ),
    "strict-word": "open it in Word and save it as 'Word document (.docx)', not as 'Strict Open XML'",
}
_MAIN = "http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument"


def _refuse(
    path: Path,
    rule: str,
    what: str,
    *,
    got: object = None,
    expected: str = "a Word template without it",
    where: str = "",
) -> TemplateError:
    return TemplateError(
        what,
        where=f"{path}: {where}" if where else path,
        got=got if got is not None else where or path.name,
        expected=expected,
        rule=rule,
        next_step=_NEXT.get(rule, "remove it in Word and save the template as .docx or .dotx"),
    )


def _members(path: Path, raw: bytes) -> dict[str, bytes]:
    word = "a Word file (.docx or .dotx)"
    if not raw.startswith(b"PK"):
        kind = sniff(raw)
        raise _refuse(
            path,
            "not-word",
            "the template is not a Word file",
            got=(ole_kind(raw) if kind.id == "ole" else kind).text,
            expected=word,
        )
    total, members, names = 0, {}, set()
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            entries = archive.infolist()
            if len(entries) > MEMBERS:
                raise _refuse(
                    path,
                    "too-large",
                    "the template has too many parts",
                    got=len(entries),
                    expected=f"at most {MEMBERS}",
                )
            for entry in entries:
                name = entry.filename
                if name.startswith(("/", "\\")) or ".." in re.split(r"[/\\]", name) or name.lower() in names:
                    raise _refuse(
                        path,
                        "not-word",
                        "a part's name is doubled or leaves the file",
                        got=name,
                        expected=word,
                    )
                names.add(name.lower())
                if entry.is_dir():
                    continue
                # Declared sizes lie: read at most what is allowed and no more.
                limit = min(TOTAL - total, RATIO * max(entry.compress_size, 1) + 2**16)
                with archive.open(entry) as stream:
                    data = stream.read(limit + 1)
                if len(data) > limit:
                    raise _refuse(
                        path,
                        "too-large",
                        "a part inflates without measure",
                        where=name,
                        expected=f"at most {TOTAL // 2**20} MB in all, {RATIO} times its packed size",
                    )
                total += len(data)
                members[name] = data
    except (
        zipfile.BadZipFile,
        zipfile.LargeZipFile,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        ValueError,
    ) as error:
        raise _refuse(path, "zip-damaged", "the template is damaged", got=error, expected=word) from error
    except Exception as error:
        if isinstance(error, TemplateError):
            raise
        # zlib.error is no subclass of the above.
        raise _refuse(path, "zip-damaged", "the template is damaged", got=error, expected=word) from error
    return members


def _xml(path: Path, name: str, data: bytes) -> Element:
    try:
        root = etree.fromstring(data, parser())
    except etree.XMLSyntaxError as error:
        raise _refuse(
            path,
            "zip-damaged",
            "a part of the template is not XML",
            where=name,
            got=error,
            expected="a whole Word file",
        ) from error
    info: Any = root.getroottree().docinfo
    if info.internalDTD is not None or info.doctype:
        raise _refuse(path, "dtd", "a part declares a document type (DTD)", where=name, got="<!DOCTYPE")
    return root


def _main_part(path: Path, members: dict[str, bytes], root_of: RootOf) -> str:
    if "[Content_Types].xml" not in members or "_rels/.rels" not in members:
        raise _refuse(
            path,
            "not-word",
            "the template is not a Word file",
            got="a zip without Word's parts",
            expected="a Word file (.docx or .dotx)",
        )
    types = root_of("[Content_Types].xml")
    overrides = {
        (one.get("PartName") or "").lstrip("/"): one.get("ContentType") or ""
        for one in types.iter(f"{_CT}Override")
    }
    every = [*overrides.values(), *(one.get("ContentType") or "" for one in types.iter(f"{_CT}Default"))]
    for kind in every:
        if "macroEnabled" in kind or "vbaProject" in kind or "vbaData" in kind:
            raise _refuse(path, "macros", "the template can run macros", got=kind)
    for rel in root_of("_rels/.rels").iter(_REL):
        if (rel.get("Type") or "").endswith("/officeDocument"):
            if rel.get("Type") != _MAIN:
                raise _refuse(
                    path, "strict-word", "the template is a Strict Open XML document", got=rel.get("Type"),
                    expected=f"a Word document, whose main part is of {_MAIN}",
                )  # fmt: skip
            name = (rel.get("Target") or "").lstrip("/")
            kind = overrides.get(name, "")
            if kind in (DOCUMENT, TEMPLATE):
                if name in members:
                    return kind
                raise _refuse(
                    path, "not-word", "the template lacks its main document", got=f"no part {name}",
                    expected="a file as Word saves it",
                )  # fmt: skip
            raise _refuse(
                path,
                "not-word",
                "the template is not a Word document",
                got=kind or name,
                expected=f"{DOCUMENT} or {TEMPLATE}",
            )
    raise _refuse(
        path, "not-word", "the template has no main document", expected="a Word file (.docx or .dotx)"
    )


def _check_relationships(path: Path, members: dict[str, bytes], root_of: RootOf) -> None:
    for name in members:
        if not name.lower().endswith(".rels"):
            continue
        for rel in root_of(name).iter(_REL):
            kind = (rel.get("Type") or "").rpartition("/")[2]
            target = rel.get("Target") or ""
            if not rel.get("Id") or not kind:
                raise _refuse(
                    path, "zip-damaged", "a relation of the template has no name or no kind", where=name,
                    got=target, expected="a file as Word saves it",
                )  # fmt: skip
            if kind in _FORBIDDEN_RELS:
                rule, what = _FORBIDDEN_RELS[kind]
                raise _refuse(path, rule, f"the template holds {what}", where=name, got=target)
            inside = (rel.get("TargetMode") or "Internal").strip().lower() == "internal"
            if (inside and not _OUTSIDE.match(target)) or (kind == "hyperlink" and _ANYWHERE.match(target)):
                continue
            if kind == "attachedTemplate":
                what = "the template is attached to another one"
                raise _refuse(path, "attached-template", what, where=name, got=target)
            raise _refuse(
                path,
                "external-content",
                f"the template fetches external content ({kind})" if kind != "hyperlink"
                else "a hyperlink leads neither to the web nor to an address of mail",
                where=name,
                got=target,
            )  # fmt: skip


def _check_member(path: Path, name: str, data: bytes, root_of: RootOf) -> None:
    low = posixpath.basename(name).lower()
    if low.startswith(("vbaproject", "vbadata")):
        raise _refuse(path, "macros", "the template holds a macro project", where=name)
    if re.search(r"(^|/)(embeddings|activex)/", name, re.IGNORECASE):
        raise _refuse(path, "ole-object", "the template holds an embedded object", where=name)
    # By content too: LibreOffice asks no name what an image is.
    if data[:2] == b"\x1f\x8b":
        raise _refuse(
            path, "external-content", "a drawing is packed, so that nobody sees into it", where=name
        )
    if not low.endswith((".xml", ".rels", ".vml", ".svg")) and b"<svg" not in data[:_SNIFFED].replace(
        b"\0", b""
    ):
        return
    root = root_of(name)
    if etree.QName(root).localname == "svg":
        _check_drawing(path, name, root)
    for element in root.iter(*_FORBIDDEN_TAGS):
        rule, what = _FORBIDDEN_TAGS[element.tag]
        raise _refuse(
            path, rule, f"the template holds {what}", where=name, got=element.tag.rpartition("}")[2]
        )
    for element in root.iter("{urn:schemas-microsoft-com:vml}*"):
        for key in ("src", "href", q("r:href"), q("r:link"), q("o:href")):
            source = element.get(key)
            is_link = key == "href"
            if source and not is_link and not source.startswith(("#", "rId")):
                raise _refuse(
                    path, "external-content", "a drawing names external content", where=name, got=source
                )
    for field in fields_of(root):
        code = field.whole
        link = _HYPERLINK.match(code)
        leads = "" if link is None else link[1] or link[3] or ""
        if _FIELDS.search(code.strip()) or (leads and not _ANYWHERE.match(leads)):
            raise _refuse(
                path,
                "unsafe-field",
                "a field reads another file or program",
                where=name,
                got=code.strip()[:80],
            )


def _check_references(path: Path, members: dict[str, bytes], root_of: RootOf) -> None:
    """Refuse a part that refers to a relation it has not: Word would not open what is made of it."""
    for name in members:
        folder, file = posixpath.split(name)
        if folder != "word" or not file.endswith(".xml"):
            continue
        relations = f"word/_rels/{file}.rels"
        known = {rel.get("Id") for rel in root_of(relations).iter(_REL)} if relations in members else set()
        asked = root_of(name).iterfind(f".//*[@{q('r:id')}]")
        lost = [
            str(element.get(q("r:id"))) for element in asked if element.get(q("r:id")) not in {*known, ""}
        ]
        if lost:
            raise _refuse(
                path, "zip-damaged", "a part refers to a relation that the template lacks", where=name,
                got=lost[0], expected="a file as Word saves it",
            )  # fmt: skip


def _check_drawing(path: Path, name: str, root: Element) -> None:
    # Names without their prefixes: href and xlink:href alike. A style stands in an attribute or by itself.
    links = [
        str(value)
        for element in root.iter(etree.Element)
        for key, value in element.attrib.items()
        if etree.QName(key).localname in ("href", "src")
    ]
    styles = [
        str(text) for element in root.iter(etree.Element) for text in (*element.attrib.values(), element.text)
    ]
    remote = [link for link in links if not _OF_ITSELF.match(link)]
    remote += [style for style in styles if _STYLE_URL.search(style)]
    remote += [str(node) for node in root.xpath("/processing-instruction() | //processing-instruction()")]
    if remote:
        raise _refuse(
            path, "external-content", "a drawing fetches external content", where=name, got=remote[0][:80]
        )


def undated(archive: bytes) -> bytes:
    """Return a package whose parts bear no time: of the same content it is the same bytes, on any day."""
    data = bytearray(archive)
    with zipfile.ZipFile(io.BytesIO(archive)) as parts:
        at = parts.start_dir
        for part in parts.infolist():
            # Time and date of the part's own header, and of its entry in the directory (APPNOTE 4.3).
            data[part.header_offset + 10 : part.header_offset + 14] = _NO_TIME
            data[at + 12 : at + 16] = _NO_TIME
            at += 46 + sum(struct.unpack_from("<3H", data, at + 28))
    return bytes(data)


def _document(members: dict[str, bytes]) -> bytes:
    """Return the package of a .dotx with its main type made a document."""
    types = members["[Content_Types].xml"].replace(TEMPLATE.encode(), DOCUMENT.encode())
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in (members | {"[Content_Types].xml": types}).items():
            archive.writestr(name, data)
    return stream.getvalue()
