"""The entries of the golden files: a name, how its answer is asked for, and where it is frozen."""

from __future__ import annotations

import gzip
import importlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.golden.workplace import Workplace
from toolkit.version import __version__

FROZEN = Path(__file__).with_name("frozen")
FROZEN_BY = "0.1.0"
AREAS = ("calibration", "reduction", "tires", "audit", "simulation", "diagnosis", "documents", "proof")
Question = Callable[[Workplace], Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One frozen answer; ``quick`` ones are read by the test suite, all of them by ``make golden``."""

    name: str
    quick: bool
    question: Question

    @property
    def area(self) -> str:
        """The file in which it is frozen."""
        return self.name.split("/")[0]


_ENTRIES: dict[str, Entry] = {}


def golden(name: str, *, quick: bool = False) -> Callable[[Question], Question]:
    """Register a function as the question of an entry."""

    def register(question: Question) -> Question:
        if name in _ENTRIES and _ENTRIES[name].question.__code__ != question.__code__:
            raise ValueError(f"two entries are named {name}")
        _ENTRIES[name] = Entry(name=name, quick=quick, question=question)
        return question

    return register


def entries(*, quick: bool = False, only: Iterable[str] = ()) -> list[Entry]:
    """Return the entries in their order; ``only`` are beginnings of names."""
    for area in AREAS:
        importlib.import_module(f"tests.golden.{area}")
    chosen = tuple(only)
    return [
        entry
        for entry in _ENTRIES.values()
        if (entry.quick or not quick) and (not chosen or entry.name.startswith(chosen))
    ]


def ask(entry: Entry, place: Workplace) -> Any:
    """Return today's answer as JSON would give it back, under the version that froze the others."""
    text = json.dumps(entry.question(place.room(entry.name)))
    for form in ('"{}"', "toolkit {}", ">v{}<"):
        text = text.replace(form.format(__version__), form.format(FROZEN_BY))
    return json.loads(text)


def read_frozen(folder: Path, area: str) -> dict[str, Any]:
    """Return the frozen answers of an area by name; empty where it has no file."""
    path = folder / f"{area}.json.gz"
    return json.loads(gzip.decompress(path.read_bytes())) if path.exists() else {}


def write_frozen(folder: Path, area: str, answers: dict[str, Any]) -> None:
    """Write an area's answers, the same bytes for the same answers."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(dict(sorted(answers.items())), separators=(",", ":"), ensure_ascii=False)
    (folder / f"{area}.json.gz").write_bytes(gzip.compress(text.encode(), compresslevel=9, mtime=0))
