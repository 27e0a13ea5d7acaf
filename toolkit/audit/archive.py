"""The audit of an archive: every file with its grade, and what they amount to."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from toolkit.audit.inventory import inventory
from toolkit.audit.model import GRADES, TELLS
from toolkit.audit.one_file import Auditor, FileAudit, unreadable
from toolkit.audit.resume import Results
from toolkit.audit.workers import Lost, run_isolated
from toolkit.calibration.registry.registry import Refused, Registry
from toolkit.errors import ConfigError, RegistryError
from toolkit.files import sha256_bytes
from toolkit.findings import Finding

CLEAN = ("exact", "rounding")


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchiveAudit:
    """Every file of an archive, sorted by path. ``refused`` are records that may not be candidates.

    ``heads``: (instrument, head of its ledger), by which the answer can be repeated.
    """

    archive: Path
    known_at: dt.date
    files: tuple[FileAudit, ...]
    refused: tuple[Refused, ...]
    heads: tuple[tuple[str, str], ...]
    findings: tuple[Finding, ...]

    @property
    def grades(self) -> dict[str, int]:
        """How many files have each grade; every grade is there."""
        counted = Counter(one.grade for one in self.files)
        return {grade: counted[grade] for grade in GRADES}

    @property
    def undated(self) -> int:
        """Readable files without a test date, whatever their grade."""
        return sum(one.found is not None and one.date is None for one in self.files)

    @property
    def clean(self) -> bool:
        """Whether every file is exact or rounding and nothing else was found."""
        return all(one.grade in CLEAN for one in self.files) and not self.findings


def audit_archive(
    archive: Path,
    registry: Registry,
    *,
    known_at: dt.date | None = None,
    workers: int = 1,
    step: Callable[[str], None] = lambda _: None,
    names: tuple[str, ...] | None = None,
    out: Path | None = None,
) -> ArchiveAudit:
    """Audit every file of an archive; the result does not depend on the number of workers.

    Parameters
    ----------
    known_at : the day of knowledge; default today
    workers : processes; each file is read in one, behind the gate, with a memory limit and a timeout
    step : called with each path that is done
    names : the inventory where the caller has made it already
    out : folder in which results are kept as they come; those that still hold are used again

    Raises
    ------
    ConfigError
        the archive is no folder, or ``workers`` is no count
    OutputError
        ``out`` cannot be written to, or another audit writes there
    """
    from toolkit.calibration.registry.registry import today

    if workers < 1:
        raise ConfigError(
            "an audit needs a worker", where="--workers", got=workers, expected="1 or more",
            next_step="name the number of processes; the number of cores is a good one", rule="usage",
        )  # fmt: skip
    day = known_at or today()
    todo = inventory(archive) if names is None else names
    done: dict[str, FileAudit] = {}
    make = partial(Auditor, archive, registry, day)
    with ExitStack() as stack:
        kept = None
        keys: dict[str, str | None] = {}
        if out is not None:
            kept = stack.enter_context(Results(out, archive=archive, registry_hash=_hash(registry, day)))
            keys = {name: kept.key_of(name) for name in todo}
            for name, key in keys.items():
                if key is not None and kept.has(name, key):
                    reused = kept.get(name, key)
                    if reused is not None:
                        done[name] = reused
                    step(name)
            todo = tuple(name for name in todo if not kept.has(name, keys[name]))
        for name, result in run_isolated(make, todo, workers=workers):
            found = unreadable(name, result.reason) if isinstance(result, Lost) else result
            if kept is not None and not isinstance(result, Lost):
                kept.put(name, keys[name], found)
            if found is not None:
                done[name] = found
            step(name)
    files = tuple(done[name] for name in sorted(done))
    instruments = sorted({one.instrument for one in files if one.instrument is not None})
    refused: list[Refused] = []
    heads: list[tuple[str, str]] = []
    troubles: list[Finding] = []
    for instrument in instruments:
        refused += registry.usable(instrument)[1]
        try:
            heads.append((instrument, registry.head(instrument)))
        except RegistryError as error:
            troubles.append(Finding(rule="registry-damaged", where=instrument, message=error.what))
    return ArchiveAudit(
        archive=archive,
        known_at=day,
        files=files,
        refused=tuple(refused),
        heads=tuple(heads),
        findings=(*_findings(files), *_refusals(refused), *troubles),
    )


def _hash(registry: Registry, day: dt.date) -> str:
    parts = [f"{name}={registry.digest(name)}" for name in registry.instruments()]
    return sha256_bytes("|".join([day.isoformat(), *parts]).encode())


def _findings(files: tuple[FileAudit, ...]) -> list[Finding]:
    made = []
    for one in files:
        if one.context is not None:
            message = f"its test.toml cannot be used, the file counts as undated: {one.context}"
            made.append(Finding(rule="test-toml", where=one.path, message=message))
        if one.found is None:
            made.append(Finding(rule="unreadable-file", where=one.path, message=one.reason or ""))
        elif one.grade not in CLEAN:
            found = one.found
            who = f" ({found.record}{', ' + found.variant if found.variant else ''})" if found.record else ""
            text = one.reason or f"Fy and Mz were computed {TELLS[one.grade]}{who}"
            made.append(Finding(rule=f"identified-{one.grade}", where=one.path, message=text))
    return made


def _refusals(refused: list[Refused]) -> list[Finding]:
    return [
        Finding(rule="refused-record", where=one.id, message=f"left out as a candidate: {one.reason}")
        for one in refused
    ]
