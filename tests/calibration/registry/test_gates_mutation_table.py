"""Which gate refuses what: every number of every record in calibrations/, mutated, by two attackers.

*By hand*: the record's file is edited, and nothing else. *With hashes*: record, ledger and head are
recomputed, so that only what the record is compared with can tell. What none refuses has to be smaller
than the gates' own rounding. The table of gates is the message of the test that fails, and
`test_what_no_gate_can_see` has the two attacks that only a head printed earlier betrays.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_refit_mutations import forge
from toolkit.calibration.records.record import CalibrationRecord, content_of, sealed, to_bytes
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.ledger import head_bytes, next_line
from toolkit.calibration.registry.refit import polarity
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RecordError
from toolkit.files import sha256_bytes

PROJECT = Path(__file__).resolve().parents[3] / "calibrations"
RECORDS = sorted(path.stem for path in PROJECT.glob("*/*-r*.json"))
FIELDS = ("coefficients", "issued", "covariance", "golden inputs", "golden outputs")
Numbers = tuple[float, ...]


def changes(values: Numbers, at: int) -> Iterator[tuple[str, Numbers]]:
    """Yield a row of numbers with one of them mutated, each way that changes it."""
    value, beside = values[at], (at + 1) % len(values)
    told = {
        "flipped": -value, "scaled by 1.0001": value * 1.0001, "dropped": 0.0,
        "rounded to 3 digits": float(f"{value:.3g}"), "rounded to 9 digits": float(f"{value:.9g}"),
    }  # fmt: skip
    for name, other in told.items():
        if other != value:
            yield name, (*values[:at], other, *values[at + 1 :])
    if values[beside] != value:
        swapped = list(values)
        swapped[at], swapped[beside] = swapped[beside], swapped[at]
        yield "swapped with the next", tuple(swapped)


def mutants(record: CalibrationRecord, field: str) -> Iterator[tuple[str, CalibrationRecord, float]]:
    """Yield name, mutated record and the size of the change against what the gates resolve.

    The size is that of a load over the largest load, or of a covariance over the product of the errors.
    """
    for load, one in enumerate(record.loads):

        def with_load(load: int = load, **change: Any) -> CalibrationRecord:
            changed = dataclasses.replace(record.loads[load], **change)
            changed = dataclasses.replace(changed, polarity=polarity(changed.coefficients))
            return dataclasses.replace(
                record, loads=(*record.loads[:load], changed, *record.loads[load + 1 :])
            )

        if field in ("coefficients", "issued"):
            values: Numbers = getattr(one, field)
            for at, term in enumerate(one.terms):
                for name, row in changes(values, at):
                    yield (
                        f"{one.load} {term} {name}",
                        with_load(**{field: row}),
                        reach(record, load, row, values),
                    )
        if field == "covariance":
            for i, line in enumerate(one.covariance):
                for j, term in enumerate(one.terms):
                    for name, row in changes(line, j):
                        matrix = (*one.covariance[:i], row, *one.covariance[i + 1 :])
                        errors = one.standard_errors
                        size = max(
                            abs(a - b) / (errors[i] * e) for a, b, e in zip(row, line, errors, strict=True)
                        )
                        yield f"{one.load} {one.terms[i]}, {term} {name}", with_load(covariance=matrix), size
    golden = record.golden
    if field.startswith("golden"):
        part = field.split()[1]
        lines: tuple[Numbers, ...] = getattr(golden, part)
        for i, line in enumerate(lines):
            for at in range(len(line)):
                for name, row in changes(line, at):
                    changed = dataclasses.replace(golden, **{part: (*lines[:i], row, *lines[i + 1 :])})
                    if part == "outputs":
                        size = float(np.abs(np.subtract(row, line)).max()) / record.loads[i].largest
                    else:
                        size = max(moved(record, load, row, line) for load in range(len(record.loads)))
                    yield f"{part} {i}, {at} {name}", dataclasses.replace(record, golden=changed), size


def reach(record: CalibrationRecord, load: int, values: Numbers, before: Numbers) -> float:
    """Return how far other coefficients of a linear load move it over the golden inputs, of the largest."""
    if not record.golden.inputs:
        return np.inf
    inputs = np.asarray(record.golden.inputs)
    assert record.loads[load].terms == (*record.indications, "intercept")
    terms = np.column_stack([inputs, np.ones(len(inputs))])
    return float(np.abs(terms @ np.subtract(values, before)).max()) / record.loads[load].largest


def moved(record: CalibrationRecord, load: int, point: Numbers, before: Numbers) -> float:
    one = record.loads[load]
    return abs(float(np.dot(one.coefficients[:-1], np.subtract(point, before)))) / one.largest


def verdict(registry: Registry, record_id: str) -> str:
    try:
        registry.load(record_id)
    except RecordError as error:
        part = {"refit": "transcription" if "source" in str(error.expected) else "refit"}
        return part.get(error.rule or "", error.rule or "")
    return "none"


@pytest.fixture
def copied(tmp_path: Path, request: pytest.FixtureRequest) -> tuple[Registry, CalibrationRecord]:
    """A copy of a project's registry, and one record of it."""
    instrument = request.param.rsplit("-r", 1)[0]
    shutil.copytree(PROJECT / instrument, tmp_path / instrument)
    registry = Registry(tmp_path)
    return registry, registry.load(request.param)


MANY = pytest.mark.campaign(
    "the most numbers of a record: its coefficients and golden values are mutated in every run"
)


@pytest.mark.parametrize(
    "field", [pytest.param(field, marks=[MANY] * (field == "covariance")) for field in FIELDS]
)
@pytest.mark.parametrize("copied", RECORDS, indirect=True)
def test_every_mutation_is_refused_and_by_which_gate(
    copied: tuple[Registry, CalibrationRecord], field: str
) -> None:
    registry, record = copied
    path = registry.folder / record.instrument / f"{record.id}.json"
    whole, table, faults = path.read_bytes(), collections.Counter[tuple[str, str]](), []
    # A legacy import has neither covariance nor golden vectors: there is nothing to mutate.
    has = bool(record.golden.inputs) or field in ("coefficients", "issued")
    for name, mutant, _size in mutants(record, field):
        document = json.loads(whole)
        document["content"] = content_of(mutant)
        path.write_text(json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n")
        gate = verdict(registry, record.id)
        table["by hand", gate] += 1
        if gate != "hash":
            faults.append(f"by hand: {name}: {gate}")
    for name, mutant, size in mutants(record, field):
        forge(registry, mutant)
        gate = verdict(registry, record.id)
        table["with hashes", gate] += 1
        # 1e-9 is what the refit's covariance, 1e-12 what the golden vectors resolve, of the largest value.
        finest = {"covariance": 1e-9}.get(field, 1e-12)
        if gate not in ("refit", "golden", "transcription") and not size <= finest:
            faults.append(f"with hashes: {name}: {gate}, a change of {size:.1e}")
    told = "\n".join(
        f"{record.id} {field}, {by}: {gate} refused {n}" for (by, gate), n in sorted(table.items())
    )
    assert not faults, "\n".join([told, *faults[:20]])
    assert bool(table) == has, told


@pytest.mark.parametrize("copied", RECORDS, indirect=True)
def test_a_hash_recomputed_in_the_record_alone_is_refused_by_the_ledger(
    copied: tuple[Registry, CalibrationRecord],
) -> None:
    registry, record = copied
    for _name, mutant, _size in mutants(record, "coefficients"):
        forge(registry, mutant)
        for name in ("ledger.jsonl", "head.json"):
            (registry.folder / record.instrument / name).write_bytes(
                (PROJECT / record.instrument / name).read_bytes()
            )
        assert verdict(registry, record.id) == "ledger"


@pytest.mark.parametrize("record_id", RECORDS)
def test_an_edited_ledger_line_is_refused_for_every_record(tmp_path: Path, record_id: str) -> None:
    instrument = record_id.rsplit("-r", 1)[0]
    shutil.copytree(PROJECT / instrument, tmp_path / instrument)
    path = tmp_path / instrument / "ledger.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    for at, line in enumerate(lines):
        body = json.loads(line)
        body["by"] += "x"
        edited = (json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False) + "\n").encode()
        path.write_bytes(b"".join([*lines[:at], edited, *lines[at + 1 :]]))
        assert verdict(Registry(tmp_path), record_id) == "ledger"


def rewritten(folder: Path, record: CalibrationRecord) -> None:
    """Write the record and a ledger of the same lines, chained anew around the record's new hashes."""
    (folder / f"{record.id}.json").write_bytes(data := to_bytes(record))
    lines, prev = [], "0" * 64
    for seq, line in enumerate((folder / "ledger.jsonl").read_bytes().splitlines(), start=1):
        event = {k: v for k, v in json.loads(line).items() if k not in ("seq", "prev", "sha256")}
        if (event["event"], event["id"]) == ("entered", record.id):
            event |= {"record": record.sha256, "file": sha256_bytes(data)}
        new, prev = next_line(seq, prev, event)
        lines.append(new)
    (folder / "ledger.jsonl").write_bytes(b"".join(lines))
    (folder / "head.json").write_bytes(head_bytes(len(lines), prev))


def forged_source(place: Path, coefficient: str) -> Registry:
    """Rewrite source, record and ledger of the project's legacy record with another third coefficient."""
    shutil.copytree(PROJECT / "m15", place / "m15")
    source = (place / "m15" / "m15-r2.source.toml").read_text().replace("E5 = 1.0228", f"E5 = {coefficient}")
    (place / "changed.toml").write_text(source)
    changed, _existing = import_legacy(place / "changed.toml", Registry(place / "aside"))
    aside = place / "aside" / "m15" / "m15-r1.source.toml"
    forged = dataclasses.replace(
        changed, id="m15-r2", data=(dataclasses.replace(changed.data[0], file="m15-r2.source.toml"),)
    )
    shutil.copy(aside, place / "m15" / "m15-r2.source.toml")
    shutil.rmtree(place / "aside")
    (place / "changed.toml").unlink()
    rewritten(place / "m15", sealed(forged))
    return Registry(place)


def test_what_no_gate_can_see_a_legacy_source_rewritten_with_everything(tmp_path: Path) -> None:
    # A legacy record has no data: its source file, its hash and the ledger are all that it is compared
    # with. Who rewrites all of them leaves no contradiction behind, save in a head that was printed.
    head = Registry(PROJECT).head("m15")
    registry = forged_source(tmp_path, "1.1228")
    assert registry.load("m15-r2").load("FY").coefficients[2] == 1.1228
    assert all(row.ok for row in verify_registry(registry))
    rows = verify_registry(registry, head)
    assert not any(row.ok for row in rows)
    assert all(head in (row.reason or "") for row in rows)


def test_a_sign_that_the_machine_contradicts_is_seen_in_a_rewritten_legacy_record(tmp_path: Path) -> None:
    # Thesis 4.1: the third coefficient of FY is positive, and was taken with the wrong sign for years.
    registry = forged_source(tmp_path, "-1.0228")
    with pytest.raises(RecordError, match="no command writes its line 5") as caught:
        registry.load("m15-r2")
    assert caught.value.rule == "approval"
    assert "polarity (FY, E5" in str(caught.value.got)
    (bad,) = [row for row in verify_registry(registry) if not row.ok]
    assert bad.id == "m15-r2"
    # The record of the accident itself was withdrawn on every day: it makes no number, and audits know it.
    assert registry.load("m15-r1").load("FY").coefficients[2] < 0


def test_what_no_gate_can_see_data_forged_with_the_record(registry: Registry, make_session: Any) -> None:
    # Data, session, record, ledger and head that were all made anew from falsified reference loads are a
    # calibration like any other. Only a head printed before tells that the registry is another one.
    head = registry.head("hub")
    loads, check = hub_data(60, 1), hub_data(9, 2)
    loads[:, 2] *= -1
    check[:, 2] *= -1
    session = make_session(loads, check_rows=check, name="forged")
    shutil.rmtree(registry.folder / "hub")
    calibrate(session, registry)
    assert all(row.ok for row in verify_registry(registry))
    assert not any(row.ok for row in verify_registry(registry, head))
