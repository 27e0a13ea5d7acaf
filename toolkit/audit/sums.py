"""What the results of an archive amount to: its grades, findings and tests.

With an output folder the sums are kept beside the results, in ``sums.jsonl``. They are used again only where
every result they were made of is the same, so that a second run has to read no result but those it shows.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.audit.archive_findings import Across, Lines
from toolkit.audit.model import CLEAN, GRADES, TELLS, Grade
from toolkit.files import atomic_path
from toolkit.findings import Finding
from toolkit.recording.marks import GENERATOR, OWN_OUTPUT

SUMS = "sums.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """What all files of an archive amount to, whatever the registry says now.

    ``grades`` has every grade, ``instruments`` those of the files, sorted. ``findings`` are of single files,
    ``notes`` what informs only; ``tests`` plain values (`toolkit.audit.effects.TestSums.summary`).
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
        undated += file["grade"] != "unreadable" and file["date"] is None
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
    with atomic_path(folder / SUMS) as temporary, temporary.open("wb") as stream:
        digest = hashlib.sha256()
        for line in _lines(sums, key):
            digest.update(line)
            stream.write(line)
        stream.write(digest.hexdigest().encode() + b"\n")


def read_sums(folder: Path, key: str) -> Sums | None:
    """Return the sums that were kept under a key; None where there are none, or they are damaged."""
    try:
        with (folder / SUMS).open("rb") as stream:
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
    grade: Grade = line["grade"]
    who = ""
    if line["record"]:
        who = f" ({line['record']}{', ' + line['variant'] if line['variant'] else ''})"
    elif line["candidates"]:
        who = f" ({', '.join(line['candidates'])})"
    return f"Fy and Mz were computed {TELLS[grade]}{who}"


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
        findings.append(Finding(rule="unreadable-file", where=path, message=reason or ""))
    elif grade not in CLEAN:
        findings.append(Finding(rule=f"identified-{grade}", where=path, message=reason or sentence(line)))
    return findings
