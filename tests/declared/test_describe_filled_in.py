"""New files, filled in and taken in entry by entry as they are printed, by a script."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field

import pytest

from tests.house.pages import formats
from toolkit.declared import starter
from toolkit.declared.describe import outline
from toolkit.declared.text import attempt
from toolkit.lab.starters import FORMS, form_of

HEADER = re.compile(r"#?\[\[?([^\[\]]+)\]\]?")
ENTRY = re.compile(r"#?([A-Za-z_0-9\"]+) = ")
CLASSES = {word: form_of(word) for word in FORMS} | {cls.__name__: cls for cls in formats()}


@dataclass
class Block:
    """A table of a new file, or one of the forms that it may have; entries by the number of their line."""

    table: str
    head: int
    form: bool
    entries: dict[int, str] = field(default_factory=dict)


class Lines:
    """A new file as a person sees it: tables, entries, and what the comments above them say."""

    def __init__(self, text: str) -> None:
        self.lines = text.split("\n")
        self.blocks = [Block("", -1, form=False)]
        for at, line in enumerate(self.lines):
            if (header := HEADER.match(line)) is not None:
                self.blocks.append(Block(header[1], at, form=False))
            elif line.startswith(("# either ", "# or ")):
                self.blocks.append(Block(self.blocks[-1].table, at, form=True))
            elif (entry := ENTRY.match(line)) is not None:
                self.blocks[-1].entries[at] = entry[1]

    def said(self, at: int) -> str:
        """Return the comment above a line."""
        above = at
        while above > 0 and self.lines[above - 1].startswith("# "):
            above -= 1
        return " ".join(line[2:] for line in self.lines[above:at])

    def needed(self, block: Block) -> list[Block]:
        """Return a table with those above it, and with those below any of them that are required."""
        tables = [other for other in self.blocks if other.table and not other.form]
        needed = [other for other in tables if f"{block.table}.".startswith(f"{other.table}.")]
        for other in tables:
            above = [b for b in tables if other.table.startswith(f"{b.table}.")]
            if above and above[-1] in needed and self.said(other.head).endswith("required"):
                needed.append(other)
        return needed

    def taken(self, block: Block, at: int) -> str:
        """Return the text with an entry, and all that the comments say must stand there with it."""
        lines = list(self.lines)
        if block.form:  # in place of the one that is marked
            for other in self.blocks:
                if other.form and other.table == block.table:
                    for line in other.entries:
                        lines[line] = "#" + lines[line].removeprefix("#")
        needed = self.needed(block)
        taken = {at, *(other.head for other in needed)}
        for other in [*needed, *([block] if block.form else [])]:
            taken |= {n for n in other.entries if "; required" in self.said(n)}
        if block.form:
            taken.add(min(block.entries))  # the word that chooses it
        if (match := re.search(r"together with (\w+)", self.said(at))) is not None:
            taken |= {n for n, key in block.entries.items() if key == match[1]}
        for line in taken - {-1}:
            lines[line] = lines[line].removeprefix("#")
        return "\n".join(lines)


def without_sign(text: str) -> str:
    return re.sub(r"(?m)^#(.*?)   # FILL IN$", r"\1", text)


@pytest.mark.parametrize("name", CLASSES)
def test_a_file_is_accepted_once_every_mark_is_filled_in(name: str) -> None:
    text = without_sign(outline(CLASSES[name], {}))
    instance, faults = attempt(CLASSES[name], tomllib.loads(text))
    assert instance is not None, faults


@pytest.mark.parametrize("name", CLASSES)
def test_every_other_entry_is_accepted_as_it_is_printed(name: str) -> None:
    refused = []
    lines = Lines(without_sign(outline(CLASSES[name], {})))
    for block in lines.blocks:
        for at in block.entries:
            _, faults = attempt(CLASSES[name], tomllib.loads(lines.taken(block, at)))
            refused += [(block.table, lines.lines[at], fault.text) for fault in faults]
    assert refused == []


@pytest.mark.parametrize("name", CLASSES)
def test_what_a_starter_shows_is_accepted(name: str) -> None:
    _, faults = attempt(CLASSES[name], tomllib.loads(starter(CLASSES[name])))
    assert faults == ()
