"""Open a template: a zip that is a Word file, that cannot explode, run, or fetch anything."""

# ruff: noqa: TRY301  a refusal raised while the archive is open is the plainest reading
from __future__ import annotations

import io
import posixpath
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree

from toolkit.errors import TemplateError
from toolkit.files import sha256_bytes
from toolkit.report.word.xml import Element, parser, q, walk_fields

_MAIN = "application/vnd.openxmlformats-officedocument.wordprocessingml.{}.main+xml"
DOCUMENT, TEMPLATE = _MAIN.format("document"), _MAIN.format("template")
_CT = "{http://schemas.openxmlformats.org/package/2006/content-types}"
_REL = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
MEMBERS, TOTAL, RATIO = 5000, 300 * 2**20, 400

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
    q("w:altChunk"): ("alt-chunk", "an imported document (altChunk)"),
    q("w:subDoc"): ("sub-document", "a sub-document"),
    q("w:frameset"): ("frames", "a frameset"),
    q("w:object"): ("ole-object", "an embedded object"),
    q("w:control"): ("ole-object", "an ActiveX control"),
    q("o:OLEObject"): ("ole-object", "an OLE object"),
}
_FIELDS = re.compile(
    r"(?:^|[\s{}\"])(INCLUDE\w*|DDE\w*|IMPORT)\b|^\s*[{\"]*\s*(LINK|EMBED|RD|DATABASE)\b", re.IGNORECASE
)
_REMOTE = re.compile(
    rb"(?:href|src|url)\s*(?:=\s*[\"']|\()\s*[\"']?\s*(?:[a-z][a-z0-9+.-]*:)?//|file:", re.IGNORECASE
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A template that is safe to open. ``data`` is a .docx even where the file was a .dotx."""

    path: Path
    sha256: str
    data: bytes
    dropped: tuple[str, ...]


def read_template(path: Path) -> Template:
    """Read and check a template.

    Raises
    ------
    TemplateError
        not a Word file, damaged, too large, or with content that runs, links or embeds
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise TemplateError(
            "the template cannot be read",
            where=path,
            got=error.strerror,
            expected="a Word file (.docx or .dotx)",
            next_step="check --template, or make one with 'toolkit template new'",
            rule="no-template",
        ) from error
    members = _members(path, raw)
    main, kind = _main_part(path, members)
    dropped = _check_relationships(path, members)
    for name, data in members.items():
        _check_member(path, name, data)
    if kind == TEMPLATE or dropped:
        raw = _rewritten(members, main if kind == TEMPLATE else None, dropped)
    return Template(
        path=path, sha256=sha256_bytes(path.read_bytes()), data=raw, dropped=tuple(t for _, _, t in dropped)
    )


def open_package(template: Template) -> Any:
    """Open a template's parts with python-docx.

    Raises
    ------
    TemplateError
        a part is missing that another one refers to, or the package cannot be put together
    """
    from docx.package import Package
    from lxml import etree

    try:
        return Package.open(io.BytesIO(template.data))
    except (KeyError, ValueError, TypeError, AttributeError, etree.LxmlError) as error:
        raise _refuse(
            template.path,
            "zip-damaged",
            "the template's parts do not fit together",
            got=error,
            expected="a file as Word saves it",
        ) from error


# What is no Word file, or a broken one, holds nothing that could be removed.
_NEXT = dict.fromkeys(
    ("not-word", "zip-damaged"),
    "copy it again, or open it in Word and save it as .docx or .dotx",
)


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
        raise _refuse(
            path,
            "not-word",
            "the template is not a Word file",
            got=f"{raw[:8]!r}..." if raw else "an empty file",
            expected=word,
        )
    total, members = 0, {}
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
                if name.startswith(("/", "\\")) or ".." in re.split(r"[/\\]", name) or name in members:
                    raise _refuse(
                        path,
                        "not-word",
                        "a part's name is doubled or leaves the file",
                        got=name,
                        expected=word,
                    )
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


def _main_part(path: Path, members: dict[str, bytes]) -> tuple[str, str]:
    if "[Content_Types].xml" not in members or "_rels/.rels" not in members:
        raise _refuse(
            path,
            "not-word",
            "the template is not a Word file",
            got="a zip without Word's parts",
            expected="a Word file (.docx or .dotx)",
        )
    types = _xml(path, "[Content_Types].xml", members["[Content_Types].xml"])
    overrides = {
        (one.get("PartName") or "").lstrip("/"): one.get("ContentType") or ""
        for one in types.iter(f"{_CT}Override")
    }
    every = [*overrides.values(), *(one.get("ContentType") or "" for one in types.iter(f"{_CT}Default"))]
    for kind in every:
        if "macroEnabled" in kind or "vbaProject" in kind or "vbaData" in kind:
            raise _refuse(path, "macros", "the template can run macros", got=kind)
    for rel in _xml(path, "_rels/.rels", members["_rels/.rels"]).iter(_REL):
        if (rel.get("Type") or "").endswith("/officeDocument"):
            name = (rel.get("Target") or "").lstrip("/")
            kind = overrides.get(name, "")
            if kind in (DOCUMENT, TEMPLATE) and name in members:
                return name, kind
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


def _check_relationships(path: Path, members: dict[str, bytes]) -> list[tuple[str, str, str]]:
    dropped = []
    for name, data in members.items():
        if not name.endswith(".rels"):
            continue
        for rel in _xml(path, name, data).iter(_REL):
            kind = (rel.get("Type") or "").rpartition("/")[2]
            target = rel.get("Target") or ""
            if kind in _FORBIDDEN_RELS:
                rule, what = _FORBIDDEN_RELS[kind]
                raise _refuse(path, rule, f"the template holds {what}", where=name, got=target)
            if rel.get("TargetMode") != "External":
                continue
            if kind == "hyperlink":
                continue
            if kind == "attachedTemplate":
                if re.match(r"\s*(?!file:|[a-z]:[\\/])[a-z][a-z0-9+.-]*:", target, re.IGNORECASE):
                    raise _refuse(
                        path,
                        "attached-template",
                        "the template is attached to one on a network",
                        where=name,
                        got=target,
                    )
                dropped.append((name, rel.get("Id") or "", target))
                continue
            raise _refuse(
                path,
                "external-content",
                f"the template fetches external content ({kind})",
                where=name,
                got=target,
            )
    return dropped


def _check_member(path: Path, name: str, data: bytes) -> None:
    low = posixpath.basename(name).lower()
    if low.startswith(("vbaproject", "vbadata")):
        raise _refuse(path, "macros", "the template holds a macro project", where=name)
    if re.search(r"(^|/)(embeddings|activex)/", name, re.IGNORECASE):
        raise _refuse(path, "ole-object", "the template holds an embedded object", where=name)
    if low.endswith(".svg") and _REMOTE.search(data):
        raise _refuse(path, "external-content", "a drawing fetches external content", where=name)
    if not low.endswith((".xml", ".rels", ".vml", ".svg")):
        return
    root = _xml(path, name, data)
    if not name.startswith("word/"):
        return
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
    for _, code in walk_fields(root):
        if _FIELDS.search(code.strip()):
            raise _refuse(
                path,
                "unsafe-field",
                "a field reads another file or program",
                where=name,
                got=code.strip()[:80],
            )


def _rewritten(members: dict[str, bytes], main: str | None, dropped: list[tuple[str, str, str]]) -> bytes:
    """Return the package with its main type made a document and the dropped relations left out."""
    changed = dict(members)
    if main is not None:
        changed["[Content_Types].xml"] = members["[Content_Types].xml"].replace(
            TEMPLATE.encode(), DOCUMENT.encode()
        )
    for name, identity, _ in dropped:
        root = etree.fromstring(changed[name], parser())
        for rel in list(root.iter(_REL)):
            if rel.get("Id") == identity:
                root.remove(rel)
        changed[name] = etree.tostring(root, xml_declaration=True, encoding="UTF-8", standalone=True)
        settings = posixpath.join(
            posixpath.dirname(posixpath.dirname(name)), posixpath.basename(name)[: -len(".rels")]
        )
        if settings in changed:
            tree = etree.fromstring(changed[settings], parser())
            for element in list(tree.iter(q("w:attachedTemplate"))):
                element.getparent().remove(element)
            changed[settings] = etree.tostring(tree, xml_declaration=True, encoding="UTF-8", standalone=True)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, data in changed.items():
            archive.writestr(name, data)
    return stream.getvalue()
