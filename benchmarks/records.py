"""Records of a set in its published split, and files that are taken by their hash alone."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import ToolkitError

Array = NDArray[np.float64]


class HashError(ToolkitError):
    """A file is not the published one."""


class AbsentError(ToolkitError):
    """A file of a set is not in the data folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One continuous record: time [s], input and output, (rows,) each.

    ``warm_up`` is how many rows of a test record may start a model: they are not scored. ``lead_in`` is how
    many rows of input precede the test in the same file: a model may run through them, and their outputs
    are not handed on.
    """

    name: str
    t: Array
    u: Array
    y: Array
    warm_up: int = 0
    lead_in: int = 0

    def scored(self) -> slice:
        """Return the rows that count."""
        return slice(self.lead_in + self.warm_up, None)

    def error_of(self, simulated: Array) -> float:
        """Return the root mean square error of a free simulation, in the output's unit."""
        with np.errstate(over="ignore", invalid="ignore"):
            difference = (np.asarray(simulated) - self.y)[self.scored()]
            mean_square = float(np.mean(difference**2))
        return float(np.sqrt(mean_square)) if np.isfinite(mean_square) else float("inf")

    def start(self) -> tuple[float, float]:
        """Return output and its rate [1/s] at the first row, a parabola through the rows that may start a
        model.
        """
        rows = slice(0, max(3, min(self.warm_up, 5)))
        _, rate, value = np.polyfit(self.t[rows] - self.t[0], self.y[rows], 2)
        return float(value), float(rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """What may be fitted, and what is opened once."""

    train: tuple[Record, ...]
    test: tuple[Record, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A published figure: the error of a free simulation on each test record, and where it was read."""

    who: str
    errors: tuple[float | None, ...]
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PublicSet:
    """A published set: files by their hash, unit, split, figures and aims.

    ``scale`` turns the record's output into ``unit``; ``aims`` are errors in it, one for each test record.
    """

    name: str
    title: str
    published_at: str
    licence: str
    files: Mapping[str, str]
    unit: str
    scale: float = 1.0
    figures: tuple[Figure, ...] = ()
    aims: tuple[float | None, ...] = ()
    missing: tuple[str, ...] = ()
    """Effects of which one must be named: what the publisher says that a text-book model leaves out."""
    split: Callable[[Mapping[str, Path]], Split]

    def read(self, data: Path) -> Split:
        """Return the split of the set's files in a folder.

        Raises
        ------
        AbsentError : where a file is not there
        HashError : where it is not the published one
        """
        return self.split({file: published(data / file, sha256) for file, sha256 in self.files.items()})


def published(path: Path, sha256: str) -> Path:
    """Return the path of a file that has the hash of the published one.

    Raises
    ------
    AbsentError : where it is not there
    HashError : where its content is another
    """
    if not path.is_file():
        raise AbsentError(
            "a file of a public set is not there", where=path, expected=f"the file with SHA-256 {sha256}",
            next_step="docs/benchmarks.md or docs/recordings.md says where it is published",
        )  # fmt: skip
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != sha256:
        raise HashError(
            "a file is not the published one",
            where=path,
            got=f"SHA-256 {digest}",
            expected=f"SHA-256 {sha256}",
            next_step="take the publisher's own file, unconverted; docs/benchmarks.md or docs/recordings.md "
            "says where it is",
        )
    return path
