"""Which headers, footers and notes a page can show."""

from __future__ import annotations

from typing import Any

from toolkit.report.template.scan import LITERAL, visible_texts
from toolkit.report.template.xml import W_P, Story, in_fallback, q

_NOTES = ("footnote", "endnote")
_OFF = ("0", "false", "off")


def headers_shown(
    package: Any, parts: list[Story]
) -> tuple[tuple[str, ...], tuple[tuple[str, tuple[str, ...]], ...]]:
    """Return the headers, footers and notes that no page shows, and the headers that some page may show.

    Call it before the template is filled: the words are its own, without tags.

    A section's first page has a header of its own only with ``titlePg``, even pages only where the settings
    ask for them; the others then depend on how many pages there are.
    """
    main = package.main_document_part
    even = switched_on(getattr(settings_of(main), "element", None), "w:evenAndOddHeaders")
    certain: set[str] = set()
    possible: set[str] = set()
    title_somewhere = any(switched_on(s, "w:titlePg") for s in main.element.iter(q("w:sectPr")))
    for section in main.element.iter(q("w:sectPr")):
        for reference in section.iter(q("w:headerReference"), q("w:footerReference")):
            rel = main.rels.get(reference.get(q("r:id")))
            if rel is None or rel.is_external:
                continue
            name = str(rel.target_part.partname).lstrip("/")
            kind = reference.get(q("w:type")) or "default"
            # A later section may show the first page's header of the one before.
            if kind == "default" and not even and not switched_on(section, "w:titlePg"):
                certain.add(name)
            elif kind == "default" or (kind == "first" and title_somewhere) or (kind == "even" and even):
                possible.add(name)
    own = {story.name: story for story in parts if story.root.tag in (q("w:hdr"), q("w:ftr"))}
    noted = {kind for kind, _ in notes_used(main.element)}
    unseen = {
        story.name
        for story in parts
        for kind in _NOTES
        if story.root.tag == q(f"w:{kind}s") and kind not in noted
    }
    never = tuple(sorted((set(own) - certain - possible) | unseen))
    perhaps = tuple(
        (
            name,
            tuple(
                words
                for p in own[name].root.iter(W_P)
                if not in_fallback(p)
                for words in LITERAL.split("".join(t.text or "" for t in visible_texts(p)))[::2]
            ),
        )
        for name in sorted((possible - certain) & set(own))
    )
    return never, perhaps


def notes_used(body: Any) -> set[tuple[str, str]]:
    """Return (kind, id) of the footnotes and endnotes that a body refers to."""
    return {(kind, one.get(q("w:id")) or "") for kind in _NOTES for one in body.iter(q(f"w:{kind}Reference"))}


def drop_notes(parts: list[Story]) -> None:
    """Take out the footnotes and endnotes that no mark refers to, or none any more: nothing prints them.

    Separators have a type, and stay.
    """
    used = notes_used(parts[0].root)
    for story in parts:
        for kind in _NOTES:
            if story.root.tag != q(f"w:{kind}s"):
                continue
            for note in list(story.root.findall(q(f"w:{kind}"))):
                special = (note.get(q("w:type")) or "normal") != "normal"
                if not special and (kind, note.get(q("w:id")) or "") not in used:
                    story.root.remove(note)


def settings_of(main: Any) -> Any:
    """Return the part with the document's settings, None where it has none."""
    return next(
        (
            rel.target_part
            for rel in main.rels.values()
            if not rel.is_external and rel.reltype.endswith("/settings")
        ),
        None,
    )


def switched_on(element: Any, name: str) -> bool:
    """Tell whether a child that is a switch is on."""
    found = None if element is None else element.find(q(name))
    return found is not None and (found.get(q("w:val")) or "1").lower() not in _OFF
