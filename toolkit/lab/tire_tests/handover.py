"""What is handed over with a report: the whole test, tire and TYDEX files, and where all of it is from."""

from __future__ import annotations

import itertools
import platform
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.recording.marks import OWN_OUTPUT
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.findings import Finding
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.lab.tire_tests.tire_files import HandedTire
    from toolkit.recording.folder import ReportDetails
    from toolkit.report.diagnosis.answer import Told

WHOLE, TYDEX, TIR = "test.xlsx", "test.tdx", "tire.tir"


def details_of(test: Path, file: Path | None) -> ReportDetails:
    """Return ``[report]`` of a folder's ``test.toml``, or what a file says in its place.

    Raises
    ------
    ConfigError
        the file cannot be read, has an unknown key or a value of the wrong type
    """
    from toolkit.files import read_toml
    from toolkit.recording.folder import TEST_FILE, ReportDetails, read_details

    if file is not None:
        table = read_toml(file)
        return read_details(table.get("report", table), where=file)
    toml = test / TEST_FILE
    return read_details(read_toml(toml).get("report", {}), where=toml) if toml.is_file() else ReportDetails()


def writers(
    resolved: Resolved, test: Path, *, xlsx: bool, tydex: bool, tire: HandedTire | None
) -> dict[str, Callable[[Path], object]]:
    """Return the functions that write the files asked for, by name; a ``tire`` is one of the test."""
    files: dict[str, Callable[[Path], object]] = {}
    if xlsx:
        files[WHOLE] = partial(_whole, resolved, test)
    if tydex:
        files[TYDEX] = partial(_tydex, resolved)
    if tire is not None:
        files[TIR] = partial(tire.write, comments=_comments(resolved))
    return files


def diagnosis_of(source: Path | None, by: str | None, tests: Sequence[Path]) -> tuple[Told, Path] | None:
    """Return the answer that a report tells, and its file.

    Raises
    ------
    ConfigError
        it is no answer; it is given for several tests; a name releases what is not given
    """
    if source is None and by is None:
        return None
    from toolkit.diagnosis.answer.reader import read_answer
    from toolkit.errors import ConfigError
    from toolkit.report.diagnosis.answer import Told

    if source is None:
        raise ConfigError(
            "there is no diagnosis to release", where="--by", got=by,
            expected="--diagnosis DIR_OR_JSON beside it", next_step="name the diagnosis, or leave --by away",
            rule="diagnosis-of-one-test",
        )  # fmt: skip
    if len(tests) > 1:
        raise ConfigError(
            "one diagnosis was given for several tests", where="--diagnosis", got=f"{len(tests)} tests",
            expected="one test", next_step="make the report of the test that was diagnosed by itself",
            rule="diagnosis-of-one-test",
        )  # fmt: skip
    answer, file = read_answer(source)
    return Told(answer=answer, by=by), file


def diagnosis_findings(answer: Diagnosis, resolved: Resolved, test: Path) -> tuple[Finding, ...]:
    """Return what stands against telling a diagnosis in a test's report: recordings that are not its own.

    Compared are the hashes of the recordings. A table that was made for the case has no counterpart in the
    test: that it belongs to it, nobody can tell from the files.

    Raises
    ------
    ConfigError
        no recording of the diagnosis is one of the test, and files of the machine are among them
    """
    from toolkit.errors import ConfigError
    from toolkit.findings import Finding

    where = f"diagnosis {answer.title}"
    if answer.recordings is None:
        return (
            Finding(
                rule="diagnosis-not-tied", where=where,
                message="the diagnosis does not say which recordings it rests on: it was made by an earlier "
                "version; run 'toolkit diagnose' again",
            ),
        )  # fmt: skip
    hashes = {entry["sha256"] for entry in provenance(resolved, test)["inputs"]}
    others = [recording for recording in answer.recordings if recording.sha256 not in hashes]
    tables = [recording.name for recording in others if not recording.own]
    foreign = [recording.name for recording in others if recording.own]
    if foreign and len(others) == len(answer.recordings):
        raise ConfigError(
            "the diagnosis is of other recordings than the test",
            where=where,
            got=_listed([recording.name for recording in others]),
            expected=f"recordings of {resolved.result.reduced.info.name}, by their SHA-256",
            next_step="give the diagnosis of this test, or diagnose its recordings",
            rule="diagnosis-of-other-recordings",
        )
    messages = []
    if foreign:
        messages.append(f"the diagnosis also rests on recordings of another test: {_listed(foreign)}")
    if tables:
        messages.append(
            f"the diagnosis rests on tables made for it ({_listed(tables)}): from the files "
            "nobody can tell that they are of this test"
        )
    return tuple(Finding(rule="diagnosis-not-tied", where=where, message=text) for text in messages)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def provenance(resolved: Resolved, test: Path, *, diagnosis: Path | None = None) -> dict[str, Any]:
    """Return inputs and software for the manifest: every recording with its hash, and the test's own file.

    ``diagnosis`` is the answer that the report tells, an input too.
    """
    from toolkit.files import sha256_file
    from toolkit.recording.folder import TEST_FILE, read_test_folder

    reduced = resolved.result.reduced
    inputs = {condition.file: condition.file_sha256 for condition in reduced.conditions}
    files = [test / TEST_FILE, read_test_folder(test).tare_file] if test.is_dir() else [test]
    inputs |= {file.name: sha256_file(file) for file in files if file is not None and file.is_file()}
    if diagnosis is not None:
        inputs[diagnosis.name] = sha256_file(diagnosis)
    return {
        "test": reduced.info.name,
        "tested": reduced.info.date,
        "simulated": reduced.info.simulated,
        "inputs": [{"name": name, "sha256": digest} for name, digest in sorted(inputs.items())],
        "software": {
            "toolkit": __version__,
            "reduced_by": reduced.code_version,
            "python": ".".join(map(str, sys.version_info[:3])),
            "platform": platform.system(),
        },
    }


def _whole(resolved: Resolved, test: Path, path: Path) -> None:
    from toolkit.testfile import write_test_file

    if test.is_file():
        # A reduced test is handed over as it is, with its raw rows, unless its record stands otherwise now.
        from toolkit.inputs import RECORDING_FILE, read_input
        from toolkit.testfile import read_test_file

        if read_test_file(test).reduced.calibration == resolved.result.reduced.calibration:
            path.write_bytes(read_input(test, RECORDING_FILE))
            return
    write_test_file(path, resolved.result, dict(resolved.recordings))


def _tydex(resolved: Resolved, path: Path) -> None:
    import numpy as np

    from toolkit.channels import signs
    from toolkit.tires.tydex import tydex_text

    conditions = resolved.result.reduced.used()
    turn = signs("SAE", "ISO-W")
    columns = {
        "SA": ("deg", np.degrees([condition.SA for condition in conditions])),
        "FZ": ("N", np.array([condition.FZ for condition in conditions])),
        "FY": ("N", np.array([condition.FY for condition in conditions])),
        "MZ": ("N*m", np.array([condition.MZ for condition in conditions])),
    }
    info = resolved.result.reduced.info
    for symbol, unit, value in (("V", "m/s", info.speed_m_s), ("P", "Pa", info.pressure_Pa)):
        if value is not None:
            columns[symbol] = (unit, np.full(len(conditions), value))
    turned = {symbol: (unit, turn.get(symbol, 1) * values) for symbol, (unit, values) in columns.items()}
    text, _ = tydex_text(
        turned, comments=[*_comments(resolved), _directions([c.rotation for c in conditions])]
    )
    path.write_text(text, encoding="utf-8")


def _directions(rotations: Sequence[str]) -> str:
    """Return which rows are of which direction: a file of the format has no channel for it."""
    parts, first = [], 1
    for rotation, run in itertools.groupby(rotations):
        last = first + len(list(run)) - 1
        parts.append(f"rows {first} to {last} {rotation}")
        first = last + 1
    return f"{', '.join(parts)}; the axes follow the travel"


def _comments(resolved: Resolved) -> list[str]:
    reduced = resolved.result.reduced
    use = reduced.calibration
    comments = [
        f"{OWN_OUTPUT}: toolkit {__version__}, test {' '.join(reduced.info.name.split())}",
        f"calibration {use.id} {use.sha256}",
    ]
    if use.mark is not None:
        comments.append(use.mark)
    return [*comments, *(["SIMULATED DATA"] if reduced.info.simulated else [])]
