"""A public recording: its files by their hash, its runs, and what is known of it before the tool has run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pandas as pd

from benchmarks.records import published

Kind = Literal["named", "structure", "control"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One continuous recording as the case has it; ``conditions`` are keys of its run."""

    name: str
    table: pd.DataFrame
    conditions: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording with a text-book simulation, written down before the first diagnosis of it.

    ``kind`` says what an answer is judged by: ``named``, one of ``names`` is missing; ``structure``, the
    simulation leaves something that no effect of the catalogue is; ``control``, the simulation has the
    physics and nothing is to be named.
    """

    name: str
    published_at: str
    licence: str
    files: Mapping[str, str]
    kind: Kind
    names: tuple[str, ...] = ()
    missing: str
    """What the source says that the simulation lacks, and where it says so."""
    runs: Callable[[Mapping[str, Path]], tuple[Run, ...]]

    def read(self, data: Path) -> tuple[Run, ...]:
        """Return the runs of the publisher's files in a folder.

        Raises
        ------
        AbsentError : where a file is not there
        HashError : where it is not the published one
        """
        return self.runs({file: published(data / file, sha256) for file, sha256 in self.files.items()})
