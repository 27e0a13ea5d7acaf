"""Reports of past years: which tests they rest on, by manifest, by file hash or by the test's name.

A CSV file names them: a column ``report`` and one or both of ``test`` (the name or the path of a test's
folder) and ``sha256`` (of a recording). A folder is searched: a ``manifest.json`` that the toolkit wrote
names the recordings of the report beside it; any other document is linked where its path has the name of a
test's folder as whole words.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toolkit.audit.archive_findings import unread_folder
from toolkit.audit.model import CLEAN, NOT_IDENTIFIED
from toolkit.audit.sides import disputed
from toolkit.calibration.registry.standing import overtaken
from toolkit.declared import Entry, derived
from toolkit.errors import ConfigError, UnreadableError
from toolkit.files import check_keys, parse_json, real_path
from toolkit.findings import Finding
from toolkit.inputs import LIST_FILE, RECORDING_FILE, read_input, read_regular
from toolkit.publication import ENTERING, PENDING, settle
from toolkit.recording.csvfile import read_lines
from toolkit.recording.marks import GENERATOR
from toolkit.staging import PASSING

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit

DOCUMENTS = (".docx", ".doc", ".pdf", ".odt", ".rtf", ".xlsx", ".xls", ".html", ".htm", ".txt", ".md")
_COLUMNS = ("report", "test", "sha256")
_SHA = re.compile(r"[0-9a-fA-F]{64}")


@dataclass(slots=True, kw_only=True, eq=False)
class RestingReport:
    """A report that rests on files of the archive.

    ``words`` are those in which a test's name may stand, of a document at ``path`` in a folder; ``names`` of
    tests and ``hashes`` of recordings are what it says of its origin. The rest is filled when it is linked.
    """

    report: str
    id: Annotated[str | None, Entry("of its manifest")] = None
    path: Annotated[Path | None, Entry(output=False)] = None
    words: Annotated[str | None, Entry(output=False)] = None
    names: Annotated[set[str], Entry(output=False)] = field(default_factory=set)
    hashes: Annotated[set[str], Entry(output=False)] = field(default_factory=set)
    linked_by: set[str] = field(default_factory=set)
    alike: Annotated[
        int | None,
        Entry("tests of the name that it has, where nothing says which of them it is", sparse=True),
    ] = None
    calibrations: Annotated[tuple[str, ...], Entry("that it names")] = ()
    tests: set[str] = field(default_factory=set)
    files: int = 0
    not_clean: int = 0
    disputed: Annotated[int, Entry("files whose cells were changed, or may have been")] = 0
    in_force: Annotated[set[str], Entry("records in force on the days of its tests")] = field(
        default_factory=set
    )

    @property
    @derived()
    def to_amend(self) -> bool:
        """Whether it rests on values that are not those of the records in force.

        A report with a manifest was computed from the load cells, by the calibrations that it names, whatever
        Fy and Mz stand in the files; any other is taken to rest on these.
        """
        if self.id is not None:
            return bool(self.in_force) and overtaken(self.calibrations, self.in_force)
        return self.not_clean > 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linked:
    """Every report, and the tests of the archive that no report rests on (*report unknown*)."""

    reports: tuple[RestingReport, ...]
    unknown: tuple[str, ...]

    def of_test(self, test: str | None) -> list[str]:
        """Return the reports that rest on a test."""
        return [report.report for report in self.reports if test in report.tests]


def read_reports(source: Path, unread: list[Finding]) -> tuple[RestingReport, ...]:
    """Return the reports that a folder holds, or a CSV file names; no link is followed.

    ``unread`` takes what is said of folders that cannot be read.

    Raises
    ------
    ConfigError
        there is no such folder or file, or the CSV file has other columns or a hash that is none
    """
    if source.is_dir():
        return tuple(_of_folder(source, unread))
    return tuple(_of_csv(source))


def link(audit: ArchiveAudit, reports: tuple[RestingReport, ...]) -> Linked:
    """Link reports to the tests of an audited archive, each report by all that it says."""
    reports = _but_recordings(audit, reports)
    by_hash: dict[str, list[RestingReport]] = {}
    for report in reports:
        for sha256 in report.hashes:
            by_hash.setdefault(sha256, []).append(report)
    # By test, and by report for what stands in none: files, those that are not right, those in dispute.
    tests: dict[str | int, tuple[int, int, int]] = {}
    in_force: dict[str | int, set[str]] = {}
    held: dict[int, dict[str | int, set[str]]] = {}  # by report: its recordings in each test
    for plain in audit.files.plain():
        sure = not disputed(plain)
        dirty = plain["grade"] not in CLEAN and sure
        here = by_hash.get(plain["sha256"] or "", ())
        places = [id(report) for report in here] if plain["test"] is None else [plain["test"]]
        for place in places:
            n, bad, open_files = tests.get(place, (0, 0, 0))
            tests[place] = (n + 1, bad + dirty, open_files + (not sure))
            in_force.setdefault(place, set()).update({plain["in_force"]} - {None})
        for report in here:
            report.linked_by.add("sha256" if report.id is None else "manifest")
            place = id(report) if plain["test"] is None else plain["test"]
            held.setdefault(id(report), {}).setdefault(place, set()).add(plain["sha256"])
    names: dict[str, list[str]] = {}
    for test in tests:
        if isinstance(test, str):
            names.setdefault(_words(audit.shown(test).rpartition("/")[2]), []).append(test)
    for report in reports:
        rests_on = _holding(held.get(id(report), {}))
        for test in _by_name(report, names):
            rests_on.add(test)
            report.linked_by.add("test")
        report.tests = {test for test in rests_on if isinstance(test, str)}
        for place in rests_on:
            report.files += tests[place][0]
            report.not_clean += tests[place][1]
            report.disputed += tests[place][2]
            report.in_force |= in_force[place]
    with_report = {test for report in reports for test in report.tests}
    return Linked(
        reports=reports,
        unknown=tuple(sorted({test for test in tests if isinstance(test, str)} - with_report)),
    )


def _holding(held: Mapping[str | int, set[str]]) -> set[str | int]:
    """Return the places that hold a report's recordings, without those that hold copies of some of them.

    >>> sorted(_holding({"2018/A": {"1", "2"}, "2019/A": {"2"}, "2019/B": {"3"}, 7: {"1"}}))
    ['2018/A', '2019/B']
    """
    return {place for place, hashes in held.items() if not any(hashes < others for others in held.values())}


def _but_recordings(audit: ArchiveAudit, reports: tuple[RestingReport, ...]) -> tuple[RestingReport, ...]:
    """Return the reports without the archive's own recordings, which may stand in the same folder."""
    if all(report.path is None for report in reports):
        return reports
    archive = real_path(audit.archive)
    recordings = {
        archive / plain["path"] for plain in audit.files.plain() if plain["grade"] not in NOT_IDENTIFIED
    }
    return tuple(report for report in reports if report.path is None or report.path not in recordings)


def _by_name(past_report: RestingReport, names: Mapping[str, list[str]]) -> Iterator[str]:
    if past_report.linked_by & {"manifest", "sha256"}:
        return  # what a report says of its files is better than what it is called
    texts = [_words(name) for name in past_report.names] if past_report.names else [past_report.words or ""]
    for text in texts:
        for name, tests in names.items():
            if not name or not (text == name or f" {name} " in f" {text} "):
                continue
            # Tests of the same name in different folders: those whose folders are named too, if any are.
            inside = [test for test in tests if set(_words(test).split()) <= set(text.split())]
            if len(inside or tests) > 1:
                past_report.alike = len(inside or tests)
            yield from inside or tests


def _words(text: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", text.casefold()))


def _of_csv(source: Path) -> Iterator[RestingReport]:
    try:
        lines, _ = read_lines(read_input(source, LIST_FILE), _COLUMNS.__contains__, where=source)
    except UnreadableError as error:
        raise _bad(source, str(error.got), str(error.expected)) from error
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    check_keys(dict.fromkeys(header), _COLUMNS, where=source)
    if "report" not in header or len(header) < 2:
        raise _bad(source, ", ".join(header) or "nothing", "the columns report and test, sha256, or both")
    past_reports: dict[str, RestingReport] = {}
    for number, cells in lines[1:]:
        row = dict(zip(header, cells, strict=False))
        name = (row.get("report") or "").strip()
        test, sha256 = ((row.get(key) or "").strip() for key in ("test", "sha256"))
        if not name or not (test or sha256):
            raise _bad(source, f"row {number}: no report, or neither test nor sha256", "both in every row")
        if sha256 and not _SHA.fullmatch(sha256):
            raise _bad(source, f"row {number}: {sha256[:80]!r}", "64 hexadecimal digits")
        report = past_reports.setdefault(name, RestingReport(report=name))
        report.names |= {test} - {""}
        report.hashes |= {sha256.lower()} - {""}
    yield from past_reports.values()


def _of_folder(folder: Path, unread: list[Finding]) -> Iterator[RestingReport]:
    def tell(error: OSError) -> None:
        unread.append(unread_folder(str(error.filename or folder), error))

    for place, folders, names in os.walk(folder, onerror=tell):
        if {PENDING, ENTERING} & {*folders}:
            try:
                settle(Path(place))
                names = [path.name for path in Path(place).iterdir() if path.is_file()]
            except OSError as error:
                tell(error)
                continue
        folders[:] = sorted(
            name for name in folders if not name.startswith(PASSING) and not (Path(place) / name).is_symlink()
        )
        manifests = [
            _manifest(Path(place) / name, folder) for name in sorted(names) if name.endswith(".json")
        ]
        output_names = {name for manifest in manifests if manifest is not None for name in manifest[1]}
        yield from (manifest[0] for manifest in manifests if manifest is not None)
        for name in sorted(names):
            path = Path(place) / name
            if path.suffix.lower() in DOCUMENTS and name not in output_names and not path.is_symlink():
                shown = path.relative_to(folder)
                yield RestingReport(
                    report=shown.as_posix(),
                    path=real_path(path),
                    words=_words(shown.with_suffix("").as_posix()),
                )


def _manifest(path: Path, folder: Path) -> tuple[RestingReport, set[str]] | None:
    if path.is_symlink():
        return None
    try:
        manifest = parse_json(read_regular(path, RECORDING_FILE))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(manifest, dict) or manifest.get("generator") != GENERATOR or "inputs" not in manifest:
        return None
    outputs = {output.get("name") for output in _dicts(manifest.get("outputs"))}
    past_report = RestingReport(
        report=folder.absolute().name
        if path.parent == folder
        else path.parent.relative_to(folder).as_posix(),
        id=str(manifest.get("report")),
        hashes={
            entry["sha256"].lower() for entry in _dicts(manifest["inputs"]) if _is_sha(entry.get("sha256"))
        },
        calibrations=tuple(str(entry.get("id")) for entry in _dicts(manifest.get("calibrations"))),
    )
    return past_report, {name for name in outputs if isinstance(name, str)}


def _dicts(value: Any) -> Iterator[dict[str, Any]]:
    # Every object inside, whatever the lists and objects around it.
    if isinstance(value, dict):
        yield value
        value = list(value.values())
    if isinstance(value, list):
        for entry in value:
            yield from _dicts(entry)


def _is_sha(value: object) -> bool:
    return isinstance(value, str) and _SHA.fullmatch(value) is not None


def _bad(source: Path, actual: str, expected: str) -> ConfigError:
    return ConfigError(
        "the list of reports cannot be used",
        where=source,
        got=actual,
        expected=expected,
        next_step="correct the file, or name a folder of reports",
        rule="reports",
    )
