"""What a laboratory's home holds beside its registry: tests, audits, diagnoses, plans, each under an id.

An id is a hash of the place in the home. Who shows what is held, or asks for it, names no path.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from toolkit.lab.home import PLAN

Kind = Literal["test", "audit", "diagnosis", "case", "plan"]

ANSWER, CASE = "diagnosis.json", "case.toml"
_ELSEWHERE = frozenset(("calibrations", "report_templates", "trust", "jobs", "migrations", "node_modules"))

_WRITTEN = frozenset(("audits", "repaired", "reports", "diagnoses", "models", "plans"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Holdings:
    """What lies in a home, by kind and id: places relative to it, in their order.

    ``manifests`` are the places of manifests of delivered reports.
    """

    home: Path
    places: Mapping[Kind, Mapping[str, str]]
    manifests: tuple[str, ...]

    def path(self, kind: Kind, holding_id: str) -> Path | None:
        """Return the folder of a holding; None where it is not known, or no longer there."""
        place = self.places[kind].get(holding_id)
        if place is None:
            return None
        folder = self.home / place
        return folder if any((folder / name).is_file() for name in _marks()[kind]) else None


def holding_id(place: str) -> str:
    """Return the id of a place in a home.

    >>> holding_id("tests/a")
    '1eaf7c41475c3a55'
    """
    return hashlib.sha256(os.fsencode(place)).hexdigest()[:16]


def holdings_of(home: Path) -> Holdings:
    """Look through a home. Links are not followed; hidden folders, registry and templates are left out."""
    from toolkit.report.deliver import MANIFEST

    by_kind: dict[Kind, dict[str, str]] = {kind: {} for kind in _marks()}
    manifests: list[str] = []
    for place, names in home_folders(home):
        for kind, marks in _marks().items():
            if not marks.isdisjoint(names):
                by_kind[kind][holding_id(place)] = place
        if MANIFEST in names:
            manifests.append(place)
    return Holdings(
        home=home,
        places=MappingProxyType(
            {
                kind: MappingProxyType(dict(sorted(held.items(), key=lambda item: item[1])))
                for kind, held in by_kind.items()
            }
        ),
        manifests=tuple(manifests),
    )


def home_folders(home: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the folders in which work lies, relative to the home, with the names of their files."""
    for folder, below, names in os.walk(home):
        below[:] = sorted(name for name in below if not name.startswith(".") and name not in _ELSEWHERE)
        yield os.path.relpath(folder, home), names


def archives_of(home: Path) -> dict[str, str]:
    """Return the folders of a home that may be audited, by id: those in it that no command writes into."""
    try:
        entries = sorted(os.scandir(home), key=lambda entry: entry.name)
    except OSError:
        return {}
    return {
        holding_id(entry.name): entry.name
        for entry in entries
        if entry.is_dir(follow_symlinks=False)
        and not entry.name.startswith(".")
        and entry.name not in _ELSEWHERE | _WRITTEN
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """What the delivered reports of a home rest on.

    ``statements`` are the hashes of every input; ``reduced`` the inputs of each report that was made of a
    reduced test, whose file records its recordings but not the ``test.toml`` that they lay beside.
    """

    statements: frozenset[str] = frozenset()
    reduced: tuple[frozenset[str], ...] = ()

    def rests_on(self, folder: Path, statements: str | None) -> bool:
        """Tell whether a report rests on a test: on its ``test.toml``, or on all its recordings.

        ``statements`` is the hash of the ``test.toml`` in the folder; None where it cannot be read.
        """
        if statements is None:
            return False
        if statements in self.statements:
            return True
        if not self.reduced:
            return False
        hashes = _recordings_of(folder)
        return bool(hashes) and any(hashes <= inputs for inputs in self.reduced)


def _recordings_of(folder: Path) -> frozenset[str]:
    """Return the hashes of a test's recordings; empty where it cannot be read."""
    from toolkit.errors import ToolkitError
    from toolkit.recording.folder import read_test_folder

    try:
        files = read_test_folder(folder).files
        states = ((path, path.stat()) for path in files)
        return frozenset(_hash_of(path, state.st_mtime_ns, state.st_size) for path, state in states)
    except (ToolkitError, OSError):
        return frozenset()


@lru_cache(maxsize=65536)
def _hash_of(path: Path, _changed: int, _size: int) -> str:
    from toolkit.files import sha256_file

    return sha256_file(path)


def reported_inputs(holdings: Holdings) -> Reported:
    """Return what the delivered reports of a home rest on."""
    from toolkit.recording.folder import TEST_FILE
    from toolkit.report.deliver import MANIFEST

    manifests = [_inputs(holdings.home / place / MANIFEST) for place in holdings.manifests]
    return Reported(
        statements=frozenset(sha256 for inputs in manifests for _, sha256 in inputs),
        reduced=tuple(
            frozenset(sha256 for _, sha256 in inputs)
            for inputs in manifests
            if inputs and all(name != TEST_FILE for name, _ in inputs)
        ),
    )


def rows_of_tests(holdings: Holdings, ids: Iterable[str], reported: Reported) -> Iterator[dict[str, Any]]:
    """Yield what the ``test.toml`` of each test says, and its state.

    ``state`` is ``reported``, ``no report`` or ``refused``; then ``reason`` says why it cannot be read.
    """
    from toolkit.declared import read_text
    from toolkit.errors import ToolkitError
    from toolkit.files import sha256_bytes
    from toolkit.inputs import SETTINGS_FILE, read_input
    from toolkit.recording.folder import TEST_FILE, StatedTest

    for test_id in ids:
        place = holdings.places["test"][test_id]
        row: dict[str, Any] = {
            "id": test_id, "place": place, "date": None, "machine": None, "tire": None, "reason": None,
        }  # fmt: skip
        toml = holdings.home / place / TEST_FILE
        try:
            data = read_input(toml, SETTINGS_FILE)
            stated = read_text(StatedTest, data, where=toml)
        except ToolkitError as error:
            yield row | {"state": "refused", "reason": f"{error.what}: {error.got}"}
            continue
        yield row | {
            "date": stated.date,
            "machine": _name_of_machine(stated.machine, toml.parent),
            "tire": stated.tire.size if stated.tire is not None else None,
            "state": "reported" if reported.rests_on(toml.parent, sha256_bytes(data)) else "no report",
        }


def _name_of_machine(stated: str, folder: Path) -> str:
    """Return the name of a test's machine, which its definition has where ``test.toml`` names a file."""
    from toolkit.errors import ToolkitError
    from toolkit.machine import load_machine

    if not stated.endswith(".toml"):
        return stated
    try:
        return load_machine(str(folder / stated)).name
    except ToolkitError:
        return stated  # what is wrong with it is said where the test is read


def _marks() -> Mapping[Kind, frozenset[str]]:
    """Return the files by which a folder is told to hold a test, an audit, a diagnosis, a case or a plan."""
    from toolkit.audit.resume import RESULTS
    from toolkit.lab.archives.audit import LINES
    from toolkit.recording.folder import TEST_FILE

    return {
        "test": frozenset((TEST_FILE,)),
        "audit": frozenset((LINES, RESULTS)),
        "diagnosis": frozenset((ANSWER,)),
        "case": frozenset((CASE,)),
        "plan": frozenset((PLAN,)),
    }


def _inputs(path: Path) -> set[tuple[str, str]]:
    """Return names and hashes of what a manifest's report rests on; empty where it is none."""
    import json

    from toolkit.inputs import RESULT_FILE, read_regular

    try:
        manifest = json.loads(read_regular(path, RESULT_FILE))
        return {(str(entry["name"]), str(entry["sha256"])) for entry in manifest["inputs"]}
    except (OSError, ValueError, TypeError, KeyError):
        return set()
