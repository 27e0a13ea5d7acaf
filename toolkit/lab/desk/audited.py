"""An audit that was answered, as it is looked at: its first line, its timeline, its files in windows.

`Audited` reads the answer's lines once and keeps of each what a list shows; the rest is read when one file is
asked for. An archive of 100 000 files costs seconds the first time, and milliseconds after that.
"""

from __future__ import annotations

import datetime as dt
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

from toolkit.audit.model import GRADES
from toolkit.days import parse_day
from toolkit.errors import ConfigError, UnreadableError
from toolkit.inputs import RESULT_FILE, open_regular, unreadable
from toolkit.lab.archives.audit import LINES
from toolkit.lab.archives.audit_headline import Judged, judged_of
from toolkit.lab.desk.chart import Chart, row_chart

if TYPE_CHECKING:
    from markupsafe import Markup

    from toolkit.calibration.registry.registry import Registry

Order = Literal["path", "change", "date"]
ORDERS: tuple[Order, ...] = ("path", "change", "date")
_BLOCKS = b', "conditions": '
_NOT_JUDGED = frozenset(("no_recording", "unreadable", "undated"))


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditedFile:
    """What a list shows of a file; ``FY_N`` and ``MZ_Nm`` are the largest changes by the record in force."""

    path: str
    instrument: str | None
    date: str | None
    grade: str
    record: str | None
    variant: str | None
    in_force: str | None
    FY_N: float | None
    MZ_Nm: float | None
    place: int
    judged: Judged

    @property
    def is_wrong(self) -> bool:
        """Whether the record in force makes other numbers of its cells."""
        return self.judged == "wrong"

    @property
    def is_disputed(self) -> bool:
        """Whether its cells are changed, or may be."""
        return self.judged in ("altered", "disputed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """What the first line says: files with a wrong Fy or Mz, how far, why, and of which months.

    ``causes`` are (grade, how, files), most files first: ``how`` is the wrong sign or column, or the
    record where it is one; ``not_judged`` files are without a test date, or cannot be read.
    """

    files: int
    wrong: int
    FY_N: float
    MZ_Nm: float
    causes: tuple[tuple[str, str | None, int], ...]
    first: str | None
    last: str | None
    not_judged: int
    disputed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Audited:
    """The answer of an audit. ``archive`` is None where an older version wrote it and did not say."""

    lines: Path
    known_at: dt.date
    archive: Path | None
    files: tuple[AuditedFile, ...]

    @cached_property
    def grades(self) -> Mapping[str, int]:
        """How many files have each grade that occurs, the gravest first."""
        counts = Counter(file.grade for file in self.files)
        return {grade: counts[grade] for grade in GRADES if counts[grade]}

    @cached_property
    def headline(self) -> Headline:
        """What the first line says."""
        wrong = [file for file in self.files if file.is_wrong]
        causes = Counter((file.grade, file.variant) for file in wrong)
        records = {cause: {f.record for f in wrong if (f.grade, f.variant) == cause} for cause in causes}
        months = sorted(file.date[:7] for file in wrong if file.date)
        return Headline(
            files=len(self.files),
            wrong=len(wrong),
            FY_N=max((file.FY_N or 0.0 for file in wrong), default=0.0),
            MZ_Nm=max((file.MZ_Nm or 0.0 for file in wrong), default=0.0),
            causes=tuple(
                (grade, how or (next(iter(names)) if len(names := records[grade, how]) == 1 else None), count)
                for (grade, how), count in causes.most_common()
            ),
            first=months[0] if months else None,
            last=months[-1] if months else None,
            disputed=sum(file.is_disputed for file in self.files),
            not_judged=sum(file.grade in _NOT_JUDGED for file in self.files),
        )

    def found(self, query: str = "", grades: Sequence[str] = (), order: Order = "path") -> list[int]:
        """Return the places of the files that hold every word and have one of the grades, in an order."""
        words = query.casefold().split()
        wanted = frozenset(grades)
        places = [
            place
            for place, file in enumerate(self.files)
            if (not wanted or file.grade in wanted) and _has(file, words)
        ]
        if order == "change":
            places.sort(key=lambda place: -(self.files[place].FY_N or -1.0))
        elif order == "date":
            places.sort(key=lambda place: self.files[place].date or "")
        return places

    def line(self, place: int) -> dict[str, Any]:
        """Return the whole answer of one file."""
        with open_regular(self.lines) as stream:
            stream.seek(self.files[place].place)
            line: dict[str, Any] = json.loads(stream.readline())
        if line.get("path") != self.files[place].path:
            raise _changed(self.lines)
        return line

    def charts(self, place: int, registry: Registry) -> tuple[dict[str, Chart], bool]:
        """Return the loads of a file row by row, as it has them and by the record in force.

        The second says whether the file is still the one that was audited.

        Raises
        ------
        ToolkitError
            the file can no longer be read, or its record fails a gate
        """
        from toolkit.audit.timeline import trace_of

        line = self.line(place)
        inside = PurePosixPath(line["path"])
        if self.archive is None or inside.is_absolute() or ".." in inside.parts:
            raise ConfigError(
                "the answer does not say where its archive is", where=self.lines, got=line["path"],
                expected="an answer of this version, and a file inside its archive",
                next_step="run the audit again", rule="archive",
            )  # fmt: skip
        trace = trace_of(self.archive, line, registry)
        charts = {load: row_chart(load, trace.old.get(load), new) for load, new in trace.new.items()}
        return charts, trace.sha256 == line["sha256"]

    def timelines(self, registry: Registry) -> Iterator[tuple[str, Markup]]:
        """Yield each instrument with its drawn timeline."""
        from toolkit.audit.timeline import timelines
        from toolkit.report.audit.svg import timeline

        plain = (
            {"instrument": file.instrument, "date": file.date, "record": file.record, "grade": file.grade}
            for file in self.files
        )
        for versions in timelines(plain, registry, self.known_at):
            yield versions.instrument, timeline(versions)


def read_audited(folder: Path) -> Audited:
    """Read the answer of an audit.

    Raises
    ------
    UnreadableError
        there is none, or it is none of an audit
    """
    lines = folder / LINES
    files: list[AuditedFile] = []
    try:
        with open_regular(lines) as stream:
            head = json.loads(stream.readline())
            known_at = parse_day(head["known_at"])
            place = stream.tell()
            for line in stream:
                files.append(_file(json.loads(_head(line)), place))
                place += len(line)
    except OSError as error:
        raise unreadable(lines, RESULT_FILE, error) from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UnreadableError(
            "the answer of the audit cannot be read", where=lines, got=str(error) or type(error).__name__,
            expected="audit.jsonl as 'toolkit audit --out' writes it",
            next_step="run the audit again: results of single files are used again", rule="no-file",
        ) from error  # fmt: skip
    archive = head.get("archive")
    return Audited(
        lines=lines, known_at=known_at, archive=Path(archive) if archive else None, files=tuple(files)
    )


def stamp(folder: Path) -> tuple[int, ...] | None:
    """Return what tells one answer of a folder from the next, which replaces it; None where there is none."""
    try:
        status = (folder / LINES).stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _head(line: bytes) -> bytes:
    """Return a line without its load blocks and what follows them: a tenth of it, and all that a list shows.

    Inside a text of JSON the quotes would be escaped: what is looked for is the key itself.
    """
    end = line.find(_BLOCKS)
    return line if end < 0 else line[:end] + b"}"


def _file(plain: Mapping[str, Any], place: int) -> AuditedFile:
    repair = plain["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
    return AuditedFile(
        path=plain["path"], instrument=plain["instrument"], date=plain["date"], grade=plain["grade"],
        record=plain["record"], variant=plain["variant"], in_force=plain["in_force"],
        FY_N=repair["FY_max_abs_N"], MZ_Nm=repair["MZ_max_abs_Nm"], place=place,
        judged=judged_of(plain),
    )  # fmt: skip


def _has(file: AuditedFile, words: Sequence[str]) -> bool:
    if not words:
        return True
    text = f"{file.path} {file.record} {file.variant} {file.in_force} {file.date} {file.grade}".casefold()
    return all(word in text for word in words)


def _changed(lines: Path) -> ConfigError:
    return ConfigError(
        "the answer was written anew meanwhile", where=lines, got="another file at this place",
        expected="the answer that the list shows", next_step="load the page again", rule="no-file",
    )  # fmt: skip
