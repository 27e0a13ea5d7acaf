"""Tables of very many rows: cast from one mould and kept as bytes beside the tree until the file is written.

A row of eight controls is 40 kB as a tree and 5 kB as bytes. Five hundred pages of rows would be a gigabyte
of tree, walked again by everything that looks for captions, headings and tables of contents in a body; such
rows hold none of them.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

from lxml import etree

from toolkit.report.tags import Tag
from toolkit.report.word.pictures import Ids
from toolkit.report.word.xml import (
    W_P,
    W_TBL,
    W_TC,
    W_TR,
    Element,
    Story,
    ancestor,
    clean,
    paragraph_text,
    q,
    right_to_left,
)

MANY = 20  # rows; fewer stay in the tree
_PI = "toolkit-rows"
_STANDIN = re.compile(rb"<\?toolkit-rows (\d+)\?>")
_MARK = "\ufdd1"  # a noncharacter, as no template has it
_VALUE = re.compile(f"{_MARK}(\\d+){_MARK}")
_PLACE = re.compile(f"{_MARK}([cd]|\\d+){_MARK}".encode())
_ROW = re.compile(rb"<!--.*?-->|<w:tr(?:\s[^>]*?)?(/?)>|</w:tr>", re.DOTALL)
_FIELDS = (q("w:fldChar"), q("w:fldSimple"), q("w:instrText"))
_AT_ONCE = 1000  # rows that are written together
_LARGE = 2 * 2**20  # bytes of a part, below which its rows are parsed with the rest
_LOOKED_FOR = (b"<w:fldChar", b"<w:instrText", b"<w:docPartObj")

Text = Callable[[Tag], str]
Put = Callable[[Element, Text], None]


@dataclass(slots=True)
class Bulk:
    """The rows that a document holds as bytes; a processing instruction stands in the tree for each run.

    ``levelled`` gives the ids of the styles that make a heading, once they are asked for.
    """

    levelled: Callable[[], frozenset[str]]
    runs: list[list[bytes]] = field(default_factory=list)

    @classmethod
    def of(cls, parts: Sequence[Story], levelled: Callable[[], frozenset[str]]) -> Bulk:
        """Begin for a template's parts; what looks like a stand-in already is no longer taken for one."""
        for story in parts:
            for mark in story.root.iter(etree.ProcessingInstruction):
                if mark.target == _PI:
                    mark.text = "of another program"
        return cls(levelled)

    def takes(self, table: Element, pattern: Element) -> bool:
        """Tell whether nothing that is done to a filled body later can concern the rows of a table.

        Fields in the rows are numbered; headings, and whatever style a ``\\t`` switch names, go into tables
        of contents; the text of a bookmark around the table may be wanted elsewhere.
        """
        if next(pattern.iter(*_FIELDS, q("w:outlineLvl")), None) is not None:
            return False
        styles = {element.get(q("w:val")) for element in pattern.iter(q("w:pStyle"))}
        root = table.getroottree().getroot()
        codes = "".join(element.text or "" for element in root.iter(q("w:instrText")))
        return not (
            styles & self.levelled()
            or re.search(r"TOC\b.*\\t", codes, re.IGNORECASE)
            or _marked(root, table)
            or _MARK in "".join(pattern.itertext())
        )

    def add(self, prototype: Element, rows: list[bytes]) -> None:
        """Put a stand-in for rows behind the prototype row."""
        prototype.addnext(etree.ProcessingInstruction(_PI, str(len(self.runs))))
        self.runs.append(rows)

    def written(self, docx: bytes) -> bytes:
        """Return a saved file with the rows in place of their stand-ins."""
        if not self.runs:
            return docx
        stream = io.BytesIO()
        with (
            zipfile.ZipFile(io.BytesIO(docx)) as source,
            zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target,
        ):
            for item in source.infolist():
                data = source.read(item)
                if not item.filename.endswith(".xml") or _STANDIN.search(data) is None:
                    target.writestr(item, data)
                    continue
                with target.open(item, "w", force_zip64=True) as part:
                    for i, piece in enumerate(_STANDIN.split(data)):
                        rows = self.runs[int(piece)] if i % 2 else [piece]
                        for at in range(0, len(rows), _AT_ONCE):
                            part.write(b"".join(rows[at : at + _AT_ONCE]))
        return stream.getvalue()


class Mould:
    """A row's XML, cut at the places of its values."""

    def __init__(self, pattern: Element, put: Put, ids: Ids, root: Element) -> None:
        """Fill the pattern once with marks; ``root`` declares the names of the part that it goes into."""
        self.pattern, self.put, self.ids = pattern, put, ids
        self.known = [f' xmlns:{prefix}="{name}"'.encode() for prefix, name in root.nsmap.items() if prefix]
        row = deepcopy(pattern)
        self.tags: list[Tag] = []
        put(row, self._mark)
        for element in row.iter(q("w:id"), q("wp:docPr")):
            if element.tag == q("wp:docPr"):
                element.set("id", f"{_MARK}d{_MARK}")
            elif element.getparent().tag == q("w:sdtPr"):
                element.set(q("w:val"), f"{_MARK}c{_MARK}")
        self.pieces = _PLACE.split(self._xml(row))
        self.cells = [_VALUE.split(text) for text in row_texts(row)]

    def _mark(self, tag: Tag) -> str:
        self.tags.append(tag)
        return f"{_MARK}{len(self.tags) - 1}{_MARK}"

    def cast(self, texts: Iterable[Text]) -> Iterator[tuple[bytes, tuple[str, ...]]]:
        """Yield each row as bytes, with the texts of its cells."""
        for text in texts:
            contents = [text(tag) for tag in self.tags]
            if not all(map(_plain, contents)):
                yield self._filled(contents)
                continue
            packed = [escape(part).encode() for part in contents]
            pieces = list(self.pieces)
            for i in range(1, len(pieces), 2):
                pieces[i] = self._fresh(pieces[i]) or packed[int(pieces[i])]
            yield (
                b"".join(pieces),
                tuple(
                    "".join(contents[int(part)] if i % 2 else part for i, part in enumerate(cell))
                    for cell in self.cells
                ),
            )

    def _filled(self, texts: Sequence[str]) -> tuple[bytes, tuple[str, ...]]:
        """Fill a row as a tree: line breaks, tabs, spaces at the ends, scripts that run from the right."""
        row, values = deepcopy(self.pattern), iter(texts)
        self.put(row, lambda _tag: next(values))
        fresh_ids(row, self.ids)
        return self._xml(row), row_texts(row)

    def _fresh(self, place: bytes) -> bytes | None:
        if place == b"c":
            self.ids.control += 1
            return str(self.ids.control).encode()
        return str(self.ids.next_drawing()).encode() if place == b"d" else None

    def _xml(self, row: Element) -> bytes:
        xml: bytes = etree.tostring(row, encoding="UTF-8", xml_declaration=False)
        head, end, tail = xml.partition(b">")
        for declaration in self.known:
            head = head.replace(declaration, b"")
        return head + end + tail


def fresh_ids(row: Element, ids: Ids) -> None:
    """Give the controls and drawings of a row ids of their own."""
    for element in row.iter(q("w:id")):
        if element.getparent().tag == q("w:sdtPr"):
            ids.control += 1
            element.set(q("w:val"), str(ids.control))
    for element in row.iter(q("wp:docPr")):
        element.set("id", str(ids.next_drawing()))


def row_texts(row: Element) -> tuple[str, ...]:
    """Return the texts of a row's own cells, without those of a table within."""
    return tuple(_cell_text(cell) for cell in row.iter(W_TC) if ancestor(cell, W_TR) is row)


def _cell_text(cell: Element) -> str:
    return "".join(paragraph_text(p) for p in cell.iter(W_P) if ancestor(p, W_TBL) is ancestor(cell, W_TBL))


def _plain(text: str) -> bool:
    return (
        text != ""
        and text == text.strip()
        and not {"\n", "\t", "\r"} & set(text)
        and (text.isascii() or not right_to_left(text))
        and clean(text) == text
    )


def _marked(root: Element, table: Element) -> bool:
    """Tell whether a bookmark that began before a table ends behind it."""
    names = (q("w:bookmarkStart"), q("w:bookmarkEnd"))
    open_: set[str | None] = set()
    for element in root.iter(*names, W_TBL):
        if element is table:
            return bool(open_)
        if element.tag == names[0]:
            open_.add(element.get(q("w:id")))
        else:
            open_.discard(element.get(q("w:id")))
    return False


def without_rows(xml: bytes) -> tuple[bytes, list[bytes]]:
    """Return a part with stand-ins for its long runs of rows, and the runs: it is parsed without them.

    A row with a field stays: tables of contents are looked for by theirs.
    """
    if len(xml) < _LARGE or _STANDIN.search(xml):
        return xml, []
    pieces: list[bytes] = []
    runs: list[bytes] = []
    at = 0
    for start, end, count in _runs(xml):
        if count > MANY:
            pieces += [xml[at:start], f"<?{_PI} {len(runs)}?>".encode()]
            runs.append(xml[start:end])
            at = end
    return b"".join([*pieces, xml[at:]]), runs


def with_rows(xml: bytes, runs: Sequence[bytes]) -> bytes:
    """Return a part with its rows back in their places."""
    return _STANDIN.sub(lambda match: runs[int(match[1])], xml) if runs else xml


def _runs(xml: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (start, end, rows) of rows that follow one another without a field, tables within included."""
    depth, start, begin, end, count = 0, 0, 0, -1, 0
    for token in _ROW.finditer(xml):
        if token[0].startswith(b"<!--") or token[1]:
            continue
        if token[0] != b"</w:tr>":
            if depth == 0:
                begin = token.start()
            depth += 1
            continue
        depth -= 1
        if depth:
            continue
        if any(xml.find(name, begin, token.end()) >= 0 for name in _LOOKED_FOR):
            continue
        if begin != end:
            if count:
                yield start, end, count
            start, count = begin, 0
        end, count = token.end(), count + 1
    if count:
        yield start, end, count
