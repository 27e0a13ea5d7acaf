"""What a document's styles say of a paragraph: the nearest style first, the document's defaults last."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from toolkit.report.word.controls import P_PR
from toolkit.report.word.xml import Element, q

_OFF = ("0", "false", "off")


def paragraph_styles(package: Any, paragraph: Element, kind: str) -> Iterator[Element]:
    """Yield the properties, of run or paragraph, of a paragraph's style and of those it is based on."""
    named = paragraph.find(f"{P_PR}/{q('w:pStyle')}")
    yield from style_chain(package, None if named is None else named.get(q("w:val")), kind, default=True)


def style_chain(package: Any, identity: str | None, kind: str, *, default: bool = False) -> Iterator[Element]:
    """Yield the properties of a style and of those it is based on; of no style, of the default one."""
    root = _root(package)
    styles = {} if root is None else {s.get(q("w:styleId")): s for s in root.iter(q("w:style"))}
    if identity is None and default:
        identity = next((name for name, style in styles.items() if _is_default(style)), None)
    seen: set[str] = set()
    while identity is not None and identity in styles and identity not in seen:
        seen.add(identity)
        style = styles[identity]
        if (properties := style.find(kind)) is not None:
            yield properties
        based = style.find(q("w:basedOn"))
        identity = None if based is None else based.get(q("w:val"))


def style_defaults(package: Any, name: str, kind: str) -> Iterator[Element]:
    """Yield the properties that hold where no style says otherwise."""
    root = _root(package)
    properties = None if root is None else root.find(f"{q('w:docDefaults')}/{q(name)}/{kind}")
    if properties is not None:
        yield properties


def _is_default(style: Element) -> bool:
    return style.get(q("w:type")) == "paragraph" and (style.get(q("w:default")) or "0") not in _OFF


def _root(package: Any) -> Element | None:
    part = getattr(package.main_document_part, "_styles_part", None)
    return None if part is None else part.element
