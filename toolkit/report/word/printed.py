"""Whether the PDF prints what the Word file says, place by place.

A value that was cut off at one place may stand at another, and a text of the template's own stands in no
list of values. So each text of the Word file takes its place in the text of the PDF, and no place is taken
twice: what finds none is not printed. What a program writes by itself (fields, tables of contents, numbers of
lists and notes), and what nobody sees in Word either, is left out.
"""

from __future__ import annotations

import io
import re
import unicodedata
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice

from lxml import etree

from toolkit.report.word.filled import Filled, parts_of
from toolkit.report.word.styles import properties_of, styles_by_id
from toolkit.report.word.toc_pages import squeeze
from toolkit.report.word.xml import (
    R_PR,
    W_P,
    W_T,
    W_TR,
    Element,
    ancestor,
    in_fallback,
    parser,
    q,
    switch_is_on,
)

_LONG = 12  # characters, of a text that hardly stands by chance in another one
_NEAR = 4000  # characters, within which the next text is looked for
_WHOLE = 20  # characters of a text, half of which must stand together
_UNBROKEN, _HEAD = 20, 8  # characters of one word that the end of a page may cut, and of its beginning
_FIELD = q("w:fldChar")
_TAKEN = "\0"
# Hyphens, dashes and minus signs, what has no width, and marks that are combined with a letter.
_COMES_AND_GOES = re.compile("[-\u00ad\u0300-\u036f\u200b-\u200f\u2010-\u2015\u2060\u2212\ufeff]")
# What interrupts the text of a paragraph, or is written by the program that prints it.
_BETWEEN = tuple(
    q(name)
    for name in (
        "w:tab w:ptab w:br w:cr w:sym w:noBreakHyphen w:footnoteReference w:endnoteReference w:drawing "
        "w:pict w:object w:ruby"
    ).split()
)
_UNSEEN = (q("w:fldSimple"), q("w:moveFrom"), q("w:ruby"))
_MARGINS = (q("w:hdr"), q("w:ftr"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """A paragraph or a row of a table: the part that it stands in, and its texts one after the other."""

    part: str
    texts: tuple[str, ...]
    margin: bool = False


def hard_to_extract(character: str) -> bool:
    """Tell whether a character is often read otherwise than it was printed."""
    return (
        unicodedata.bidirectional(character) in ("R", "AL", "AN")
        or unicodedata.category(character) in ("So", "Sk", "Cn", "Co", "Mn", "Me", "Cf")
        or ord(character) > 0xFFFF
    )


def unprinted(filled: Filled, hidden: set[str], readings: Sequence[str]) -> list[str]:
    """Return the texts of a Word file that its PDF does not print, each with the words that are not there.

    ``readings`` are texts of the PDF in several orders: a text must be found in one of them. Of a header or a
    footer of which nothing is found it is not known that a page shows it.
    """
    passages, unclosed = passages_of(filled, hidden)
    lost: dict[tuple[int, int], str] | None = None
    for reading in readings:
        missing = _Print(reading).without(passages)
        lost = missing if lost is None else {place: lost[place] for place in missing if place in lost}
        if not lost:
            break
    problems = [f"a field of {part} does not end" for part in unclosed]
    shown = {
        passage.part
        for number, passage in enumerate(passages)
        if any((number, place) not in (lost or {}) for place in range(len(passage.texts)))
    }
    for (number, place), words in (lost or {}).items():
        passage = passages[number]
        if passage.margin and passage.part not in shown:
            continue
        text = " ".join(passage.texts[place].split())
        problems.append(f"{words[:40]!r} of {text[:40]!r} in {passage.part}")
    return problems


def passages_of(filled: Filled, hidden: set[str]) -> tuple[list[Passage], list[str]]:
    """Return the passages of a Word file in their order, and the parts with a field that does not end."""
    passages: list[Passage] = []
    unclosed: list[str] = []
    with zipfile.ZipFile(io.BytesIO(filled.docx)) as archive:
        vanished = _vanished(archive)
        for name in parts_of(archive, filled.main_part):
            if name in hidden:
                continue
            reader = _Reader(name, vanished)
            with archive.open(name) as stream:
                passages += reader.passages(stream)
            if reader.depth:
                unclosed.append(name)
    return passages, unclosed


class _Reader:
    """The passages of one part, read piece by piece; ``depth`` of the fields that are open."""

    def __init__(self, part: str, vanished: frozenset[str]) -> None:
        self.part, self.vanished, self.depth = part, vanished, 0

    def passages(self, stream: object) -> Iterator[Passage]:
        row: list[str] = []
        margin = False
        events = etree.iterparse(
            stream, events=("start", "end"), tag=(W_P, W_TR, *_MARGINS), resolve_entities=False,
            no_network=True, load_dtd=False,
        )  # fmt: skip
        for event, element in events:
            if event == "start":
                margin = margin or element.tag in _MARGINS
            elif element.tag == W_P and not in_fallback(element):
                texts = self._texts(element)
                if ancestor(element, W_TR) is not None:
                    row += texts
                elif texts:
                    yield Passage(part=self.part, texts=tuple(texts), margin=margin)
            elif element.tag == W_TR and ancestor(element, W_TR) is None:
                if row:
                    yield Passage(part=self.part, texts=tuple(row), margin=margin)
                row = []
                element.clear()

    def _texts(self, paragraph: Element) -> list[str]:
        outer = ancestor(paragraph, W_P) is None
        depth = self.depth if outer else 0  # a text box has fields of its own
        texts = [""]
        for element in paragraph.iter(W_T, _FIELD, *_BETWEEN):
            if ancestor(element, W_P) is not paragraph:
                continue
            if element.tag == _FIELD:
                depth += {"begin": 1, "end": -1}.get(element.get(q("w:fldCharType")) or "", 0)
                texts.append("")
            elif element.tag != W_T:
                texts.append("")
            elif not depth and not self._unseen(element):
                texts[-1] += element.text or ""
        if outer:
            self.depth = depth
        return [text for text in texts if squeeze(text)]

    def _unseen(self, text: Element) -> bool:
        if any(element.tag in _UNSEEN for element in text.iterancestors()):
            return True
        paragraph = ancestor(text, W_P).find(f"{q('w:pPr')}/{q('w:pStyle')}")
        properties = text.getparent().find(q("w:rPr"))
        style = None if properties is None else properties.find(q("w:rStyle"))
        named = {one.get(q("w:val")) for one in (paragraph, style) if one is not None}
        return bool(named & self.vanished) or (properties is not None and _hides(properties))


def _hides(*properties: Element) -> bool:
    """Tell whether text is hidden by the first of these properties that say so or otherwise."""
    marks = (mark for of in properties if (mark := of.find(q("w:vanish"))) is not None)
    return any(switch_is_on(mark) for mark in islice(marks, 1))


def _vanished(archive: zipfile.ZipFile) -> frozenset[str]:
    """Return the ids of the styles whose text nobody sees, by themselves or by what they are based on."""
    hidden: set[str] = set()
    for name in archive.namelist():
        if name.endswith("/styles.xml"):
            styles = styles_by_id(etree.fromstring(archive.read(name), parser()))
            hidden |= {identity for identity in styles if _hides(*properties_of(identity, styles, R_PR))}
    return frozenset(hidden)


class _Print:
    """The text of a PDF, of which texts take their places."""

    def __init__(self, reading: str) -> None:
        words = [_plain(word) for word in reading.split()]
        self.all = self.left = "".join(words)
        # Where a word begins; the end of one is where the next one does.
        self.edges = frozenset(accumulate(map(len, words), initial=0))

    def without(self, passages: Sequence[Passage]) -> dict[tuple[int, int], str]:
        """Return the texts that find no place, by passage and number, with the words that are lost.

        The longest take theirs first, in pieces too: a short one would stand within them by chance.
        """
        waiting = sorted(self._in_order(passages), key=lambda one: -len(one[1]))
        lost: dict[tuple[int, int], str] = {}
        for long in (True, False):
            texts = [(place, text) for place, text in waiting if (len(_plain(text)) >= _LONG) == long]
            again = [(place, text) for place, text in texts if not self._take(_plain(text))]
            lost |= {place: words for place, text in again if (words := self._by_words(text))}
        return lost

    def _in_order(self, passages: Sequence[Passage]) -> Iterator[tuple[tuple[int, int], str]]:
        """Let passages take their places one after the other; yield the texts of those that cannot."""
        taken: list[tuple[int, int]] = []
        remaining: list[tuple[tuple[int, int], str]] = []
        cursor = 0
        for number, passage in enumerate(passages):
            joined = _plain("".join(passage.texts))
            at = self._near(joined, cursor)
            if at < 0 and len(passage.texts) > 1:  # a table from the right to the left
                at = self._near(_plain("".join(reversed(passage.texts))), cursor)
            if at == cursor or (at > cursor and len(joined) >= _LONG):
                cursor = at + len(joined)
                taken.append((at, cursor))
            else:
                remaining += [((number, place), text) for place, text in enumerate(passage.texts)]
        parts, end = [], 0
        for start, stop in taken:
            parts += [self.all[end:start], _TAKEN * (stop - start)]
            end = stop
        self.left = "".join([*parts, self.all[end:]])
        yield from remaining

    def _near(self, text: str, cursor: int) -> int:
        return self.all.find(text, cursor, cursor + _NEAR + len(text)) if text else -1

    def _take(self, text: str) -> bool:
        """Let a text take its place, of whole words where there is one: 1.5 stands in 21.54 by chance."""
        first = at = self.left.find(text)
        while at >= 0 and not (at in self.edges and at + len(text) in self.edges):
            at = self.left.find(text, at + 1)
        at = first if at < 0 else at
        if at < 0:
            return False
        self.left = f"{self.left[:at]}{_TAKEN * len(text)}{self.left[at + len(text) :]}"
        return True

    def _by_words(self, text: str) -> str:
        """Return the words of a text that are not printed; empty where it stands there in pieces."""
        words = [(_plain(word), word) for word in text.split()]
        words = [(plain, word) for plain, word in words if any(map(str.isalnum, plain))]
        lost: list[str] = []
        together = 0
        at = 0
        while at < len(words):
            end, fragment = at, ""
            while end < len(words) and fragment + words[end][0] in self.left:
                fragment += words[end][0]
                end += 1
            whole = len(fragment) >= _LONG or end - at > 1
            if end > at and (whole or any(map(str.isdecimal, fragment))):
                self._take(fragment)
                together += len(fragment)
            elif end == at and self._stands_in_two(words[at][0]):
                together += len(words[at][0])
            elif end == at and not self._stands(*words[at]):
                lost.append(words[at][1])
            at = max(end, at + 1)
        length = sum(len(plain) for plain, word in words if not any(map(hard_to_extract, word)))
        if not lost and length > _WHOLE and 2 * together < length:
            return text  # its words stand elsewhere, one by one
        return " ".join(lost)

    def _stands_in_two(self, plain: str) -> bool:
        """Let one long word, such as a hash, take its places before and after the end of a page."""
        if len(plain) < _UNBROKEN:
            return False
        for cut in range(len(plain) - 1, _HEAD - 1, -1):
            if plain[:cut] in self.left and plain[cut:] in self.left:
                return self._take(plain[:cut]) and self._take(plain[cut:])
        return False

    def _stands(self, plain: str, word: str) -> bool:
        """Tell whether a word that no place is left for stands on the pages, or cannot be looked for."""
        if any(map(hard_to_extract, word)):
            return True
        if any(map(str.isdecimal, plain)):
            return False
        return plain in self.all


def _plain(text: str) -> str:
    """Return a text by what every reader of a PDF gives alike.

    Ligatures and raised figures are read as letters and figures; hyphens come and go with the ends of lines,
    and the sign of a value is asked for with its value.
    """
    return _COMES_AND_GOES.sub("", squeeze(text).casefold())
