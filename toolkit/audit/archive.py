"""The audit of an archive: its inventory, every file with its grade, and what they amount to."""

from __future__ import annotations

import datetime as dt
import hashlib
import itertools
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from toolkit.audit.archive_findings import Across, Lines, unread_folder
from toolkit.audit.cluster import run_on_cluster
from toolkit.audit.model import CLEAN, GRADES, NOT_IDENTIFIED, TELLS, DisagreeingSides, Grade, in_words
from toolkit.audit.one_file import Auditor, unreadable
from toolkit.audit.other_files import by_other_files
from toolkit.audit.resume import Done, Files, Results, done
from toolkit.audit.sides import statement
from toolkit.audit.workers import Lost, run_isolated, time_limit
from toolkit.calibration.registry.registry import RefusedRecord, Registry
from toolkit.errors import ConfigError, RegistryError
from toolkit.files import sha256_bytes
from toolkit.findings import Finding
from toolkit.inputs import open_regular
from toolkit.publication import publication
from toolkit.recording.folder import TEST_FILE
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT
from toolkit.version import __version__

# What the results of an archive amount to: its grades, findings and tests.


SUMS = "sums.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """What all files of an archive amount to, whatever the registry says now.

    ``grades`` has every grade, ``instruments`` those of the files, sorted. ``findings`` are of single files,
    ``notes`` what informs only; ``tests`` plain values (`toolkit.audit.archive_findings.TestSums.summary`).
    """

    grades: Mapping[str, int]
    undated: int
    instruments: tuple[str, ...]
    findings: tuple[Finding, ...]
    notes: tuple[Finding, ...]
    tests: Lines


def sum_up(files: Iterable[Mapping[str, Any]]) -> Sums:
    """Return what plain answers, sorted by path, amount to."""
    across = Across()
    grades: Counter[str] = Counter()
    undated = 0
    instruments: set[str] = set()
    findings: list[Finding] = []
    notes: list[Finding] = []
    for file in files:
        grades[file["grade"]] += 1
        undated += file["grade"] not in NOT_IDENTIFIED and file["date"] is None
        if file["instrument"] is not None:
            instruments.add(file["instrument"])
        findings += _of_file(file)
        notes += across.add(file)
    notes += across.at_end()
    return Sums(
        grades={grade: grades[grade] for grade in GRADES},
        undated=undated,
        instruments=tuple(sorted(instruments)),
        findings=tuple(findings),
        notes=tuple(notes),
        tests=across.tests,
    )


def write_sums(folder: Path, sums: Sums, key: str) -> None:
    """Keep sums under a key that tells what they were made of.

    Raises
    ------
    OutputError
        the folder cannot be written to
    """
    with publication(folder) as stage, (stage / SUMS).open("wb") as stream:
        digest = hashlib.sha256()
        for line in _lines(sums, key):
            digest.update(line)
            stream.write(line)
        stream.write(digest.hexdigest().encode() + b"\n")


def read_sums(folder: Path, key: str) -> Sums | None:
    """Return the sums that were kept under a key; None where there are none, or they are damaged."""
    try:
        with open_regular(folder / SUMS) as stream:
            first = stream.readline()
            head = json.loads(first)
            if head["key"] != key:
                return None
            digest = hashlib.sha256(first)
            findings: list[Finding] = []
            for line in itertools.islice(stream, head["findings"] + head["notes"]):
                digest.update(line)
                findings.append(Finding(**json.loads(line)))
            tests = Lines()
            for line in itertools.islice(stream, head["tests"]):
                digest.update(line)
                tests.take(line)
            if stream.read() != digest.hexdigest().encode() + b"\n":
                return None
            return Sums(
                grades={grade: head["grades"][grade] for grade in GRADES},
                undated=head["undated"],
                instruments=tuple(head["instruments"]),
                findings=tuple(findings[: head["findings"]]),
                notes=tuple(findings[head["findings"] :]),
                tests=tests,
            )
    except (OSError, ValueError, KeyError, TypeError):
        return None  # none yet, of another version, or damaged: they are made again


def sentence(line: Mapping[str, Any]) -> str:
    """Return in one sentence what computed a file, from its plain answer."""
    if line["sides"] is not None and line["sides"]["side"] != "forces":
        return statement(DisagreeingSides(**line["sides"]), line["variant"])
    grade: Grade = line["grade"]
    who = in_words(line["record"], line["candidates"], line["variant"])
    return f"Fy and Mz were computed {TELLS[grade]}{f' ({who})' if who else ''}"


def _lines(sums: Sums, key: str) -> Iterator[bytes]:
    head = {
        "generator": GENERATOR,
        "marks": OWN_OUTPUT,
        "key": key,
        "grades": dict(sums.grades),
        "undated": sums.undated,
        "instruments": sums.instruments,
        "findings": len(sums.findings),
        "notes": len(sums.notes),
        "tests": len(sums.tests),
    }
    yield json.dumps(head).encode() + b"\n"
    for finding in (*sums.findings, *sums.notes):
        yield json.dumps(finding.as_dict()).encode() + b"\n"
    yield from sums.tests.raw()


def _of_file(line: Mapping[str, Any]) -> list[Finding]:
    findings = []
    path, grade, reason = line["path"], line["grade"], line["reason"]
    if line["test_toml"] is not None:
        message = f"its test.toml cannot be used, the file counts as undated: {line['test_toml']}"
        findings.append(Finding(rule="test-toml", where=path, message=message))
    if grade == "unreadable":
        # A file that met its limit of time was not judged, and may be sound.
        rule = "timeout" if (reason or "").startswith("timeout:") else "unreadable-file"
        findings.append(Finding(rule=rule, where=path, message=reason or ""))
    elif grade == "no_recording":
        findings.append(Finding(rule="no-recording", where=path, message=reason or "", level="note"))
    elif grade not in CLEAN:
        findings.append(Finding(rule=f"identified-{grade}", where=path, message=reason or sentence(line)))
    return findings


# The inventory of an archive: every regular file that may be a recording, and nothing else.


@dataclass(frozen=True, slots=True, kw_only=True)
class Inventory:
    """Paths of an archive's files, relative to it, with ``/``, sorted; ``unread`` tells of other folders."""

    files: tuple[str, ...]
    unread: tuple[Finding, ...]


def inventory(archive: Path) -> Inventory:
    """Return what an archive holds.

    Raises
    ------
    ConfigError
        ``archive``: it is no folder, or cannot be read
    """
    if not archive.is_dir():
        raise ConfigError(
            "the archive cannot be used",
            where=archive,
            got="a file" if archive.exists() else "nothing",
            expected="a folder with recordings",
            next_step="check the path; a single file is for 'toolkit inspect'",
            rule="archive",
        )
    try:
        entries = _entries(archive)
    except OSError as error:
        raise ConfigError(
            "the archive cannot be read",
            where=archive,
            got=error.strerror or "an error",
            expected="a readable folder",
            next_step="check its permissions; nothing was audited",
            rule="archive",
        ) from error
    unread: list[Finding] = []
    return Inventory(files=tuple(sorted(_walk(archive, "", entries, unread))), unread=tuple(unread))


def _entries(folder: Path) -> list[tuple[str, bool]]:
    """Return the names in a folder that may be or hold recordings, each with whether it is a folder."""
    with os.scandir(folder) as entries:
        kinds = [(e.name, e.is_dir(follow_symlinks=False), e.is_file(follow_symlinks=False)) for e in entries]
    return sorted(
        (name, is_dir) for name, is_dir, is_file in kinds if is_dir or (is_file and name != TEST_FILE)
    )


def _walk(folder: Path, prefix: str, entries: list[tuple[str, bool]], unread: list[Finding]) -> Iterator[str]:
    """Yield the files; a folder below that cannot be read, or is gone by now, stops no other."""
    for name, is_dir in entries:
        if not is_dir:
            yield prefix + name
            continue
        try:
            below = _entries(folder / name)
        except OSError as error:
            unread.append(unread_folder(prefix + name, error))
        else:
            yield from _walk(folder / name, f"{prefix}{name}/", below, unread)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchiveAudit:
    """Every file of an archive, sorted by path. ``refused`` are records that may not be candidates.

    ``files`` are read from the disk as they are asked for. ``undated`` counts readable files without a test
    date, whatever their grade. ``tests`` are plain values (`TestSums.summary`). ``heads``: (instrument, head
    of its ledger), by which the answer can be repeated. ``reused`` counts results of an earlier run.
    """

    archive: Path
    known_at: dt.date
    files: Files
    grades: Mapping[str, int]
    undated: int
    tests: Lines
    refused: tuple[RefusedRecord, ...]
    heads: tuple[tuple[str, str], ...]
    findings: tuple[Finding, ...]
    reused: int = field(compare=False)

    def shown(self, test: str) -> str:
        """Return a test's path as people read it: an archive that is one test has its folder's name."""
        return self.archive.absolute().name if test == "." else test

    @property
    def clean(self) -> bool:
        """Whether every file is exact or rounding and nothing else asks for a person's attention."""
        return all(finding.level == "note" for finding in self.findings)


def audit_archive(
    archive: Path,
    registry: Registry,
    *,
    known_at: dt.date | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    step: Callable[[str], None] = lambda _: None,
    names: Inventory | None = None,
    out: Path | None = None,
) -> ArchiveAudit:
    """Audit every file of an archive; the result does not depend on who reads it, nor on how many do.

    Parameters
    ----------
    known_at : the day of knowledge; default today
    workers : processes; each file is read in one, behind the gate, with a memory limit and a timeout
    scheduler : address of a dask cluster whose workers read the files instead; they see the archive and the
        registry under the same paths
    step : called with each path that is done
    names : the inventory where the caller has made it already
    out : folder in which results are kept as they come; those that still hold are used again

    Raises
    ------
    ConfigError
        the archive is no folder, or ``workers`` is no count; ``cluster missing-extra``: see
        `toolkit.audit.cluster`
    OutputError
        ``out`` cannot be written to, or another audit writes there
    """
    from toolkit.calibration.registry.clock import today

    if workers < 1:
        raise ConfigError(
            "an audit needs a worker", where="--workers", got=workers, expected="1 or more",
            next_step="state the number of processes, such as the number of cores", rule="usage",
        )  # fmt: skip
    day = known_at or max([today(), *(registry.ledger(name).known_on() for name in registry.instruments())])
    names = names or inventory(archive)
    todo = names.files
    digest = _hash(registry, day)
    limit = partial(_limit, archive)
    make: Callable[[], Callable[[str], Done]] = partial(_Worker, archive, registry, day)
    if scheduler is None:
        run = partial(run_isolated, make, workers=workers, timeout_s=limit)
    else:
        run = partial(
            run_on_cluster, _remote(archive, registry, day, digest), address=scheduler, timeout_s=limit
        )
    with Results(out, archive=archive, registry_hash=digest) as results:
        reused: set[str] = set()
        for name in results.known(todo):
            reused.add(name)
            step(name)
        new = tuple(name for name in todo if name not in reused)
        for name, result in run(new):
            results.put(name, done(unreadable(name, result.reason)) if isinstance(result, Lost) else result)
            step(name)
        files = results.files(todo)
        files.decide(by_other_files(files))
        sums = _sums(out, files, results.digest(todo))
        return _judged(archive, registry, day, files, sums, names.unread, reused=len(reused))


def _limit(archive: Path, name: str) -> float:
    try:
        return time_limit((archive / name).stat().st_size)
    except OSError:
        return time_limit(0)  # its worker tells what is wrong


class _Worker:
    # What crosses the border of the process is the text that is kept.
    def __init__(self, archive: Path, registry: Registry, day: dt.date) -> None:
        self.audit = Auditor(archive, registry, day)

    def __call__(self, name: str) -> Done:
        return done(self.audit(name))


def _remote(
    archive: Path, registry: Registry, day: dt.date, digest: str
) -> Callable[[], Callable[[str], Done]]:
    # Another machine has another working folder; links are kept, as the names in the archive have them.
    root = Path(os.path.abspath(archive))  # noqa: PTH100
    records = Registry(Path(os.path.abspath(registry.folder)))  # noqa: PTH100
    return partial(_same, root, records, day, digest, __version__)


def _same(archive: Path, registry: Registry, day: dt.date, digest: str, version: str) -> _Worker:
    """Return a worker on another machine, where everything that results depend on is the same.

    Raises
    ------
    ConfigError
        ``cluster``: another version of the toolkit, another registry, or no such archive
    """
    for place, got, expected in (
        ("toolkit", __version__, version),
        ("archive", str(archive) if archive.is_dir() else "nothing", str(archive)),
        ("registry", _hash(registry, day), digest),
    ):
        if got != expected:
            raise ConfigError(
                f"a worker of the cluster has another {place}", where=registry.folder, got=got,
                expected=expected, next_step="let all workers see the same installation and the same folders",
                rule="cluster",
            )  # fmt: skip
    return _Worker(archive, registry, day)


def _judged(
    archive: Path, registry: Registry, day: dt.date, files: Files, sums: Sums,
    unread: tuple[Finding, ...], *, reused: int,
) -> ArchiveAudit:  # fmt: skip
    refused: list[RefusedRecord] = []
    heads: list[tuple[str, str]] = []
    troubles: list[Finding] = []
    for instrument in sums.instruments:
        refused += registry.usable(instrument)[1]
        try:
            heads.append((instrument, registry.head(instrument)))
        except RegistryError as error:
            troubles.append(Finding(rule="registry-damaged", where=instrument, message=error.what))
        if (doubt := registry.ledger(instrument).doubt) is not None:
            message = f"of the ledger {doubt}"
            troubles.append(Finding(rule="ledger-time", where=instrument, message=message))
    return ArchiveAudit(
        archive=archive,
        known_at=day,
        files=files,
        grades=sums.grades,
        undated=sums.undated,
        tests=sums.tests,
        refused=tuple(refused),
        heads=tuple(heads),
        findings=(*sums.findings, *unread, *_refusals(refused), *troubles, *sums.notes),
        reused=reused,
    )


def _sums(out: Path | None, files: Files, key: str | None) -> Sums:
    """Return what the files amount to, and keep it where their results are kept."""
    if out is None or key is None:
        return sum_up(files.plain())
    sums = read_sums(out, key)
    if sums is None:
        sums = sum_up(files.plain())
        write_sums(out, sums, key)
    return sums


def _hash(registry: Registry, day: dt.date) -> str:
    parts = [f"{name}={registry.digest(name)}" for name in registry.instruments()]
    return sha256_bytes("|".join([day.isoformat(), *parts]).encode())


def _refusals(refused: list[RefusedRecord]) -> list[Finding]:
    return [
        Finding(rule="refused-record", where=record.id, message=f"left out as a candidate: {record.reason}")
        for record in refused
    ]
