"""The refit at load time accepts sound records, and none of which any number was changed."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from tests.benchmarks.verify_records import enter_sessions
from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.refit import check_reproduces
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.registry.verify import verify_registry
from toolkit.calibration.session.table import Table
from toolkit.errors import RecordError

Pair = tuple[CalibrationRecord, Table]


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Registry:
    folder = tmp_path_factory.mktemp("many") / "calibrations"
    enter_sessions(folder, 4)
    return Registry(folder)


@pytest.fixture(scope="module")
def pairs(registry: Registry) -> list[Pair]:
    found = []
    for record_id in registry.ids("bench"):
        record = registry.load(record_id)
        table = stored_loads(registry.folder, record)
        assert table is not None
        found.append((record, table))
    return found


def test_sound_records_are_accepted(pairs: list[Pair]) -> None:
    for record, table in pairs:
        check_reproduces(record, table)


def moved(value: Any) -> Any:
    """Return a number, or a nest of them, with its first number changed by far more than rounding."""
    if isinstance(value, tuple):
        return (moved(value[0]), *value[1:])
    return value * 1.01 + 1 if isinstance(value, int) else value * 1.001 + 1e-3


def changes(record: CalibrationRecord) -> list[CalibrationRecord]:
    """Return the record with each of its numbers changed, one at a time."""
    found = []
    for at, one in enumerate(record.loads):
        names = "coefficients issued polarity covariance n dof residual_sd minimum maximum unit".split()
        for name in names:
            value = getattr(one, name)
            new = "kN" if name == "unit" else moved(value)
            loads = list(record.loads)
            loads[at] = dataclasses.replace(one, **{name: new})
            found.append(dataclasses.replace(record, loads=tuple(loads)))
    for at, cell in enumerate(record.cells):
        for name in ("minimum", "maximum", "unit"):
            cells = list(record.cells)
            value = "V/V" if name == "unit" else moved(getattr(cell, name))
            cells[at] = dataclasses.replace(cell, **{name: value})
            found.append(dataclasses.replace(record, cells=tuple(cells)))
    golden = record.golden
    for name in ("inputs", "outputs"):
        values = moved(getattr(golden, name))
        found.append(dataclasses.replace(record, golden=dataclasses.replace(golden, **{name: values})))
        short = getattr(golden, name)[1:]
        found.append(dataclasses.replace(record, golden=dataclasses.replace(golden, **{name: short})))
    return found


def test_every_changed_number_is_refused(pairs: list[Pair]) -> None:
    record, table = pairs[1]
    wrong = changes(record)
    assert len(wrong) == 2 * 10 + 3 * 3 + 4
    for one in wrong:
        with pytest.raises(RecordError):
            check_reproduces(one, table)


@pytest.mark.parametrize("at", range(4))
@pytest.mark.parametrize("load", range(2))
def test_every_small_change_of_a_coefficient_is_seen(pairs: list[Pair], load: int, at: int) -> None:
    record, table = pairs[0]
    for factor in (-1.0, 1 + 1e-5, 0.0):
        one = record.loads[load]
        c = list(one.coefficients)
        c[at] *= factor
        loads = list(record.loads)
        loads[load] = dataclasses.replace(one, coefficients=tuple(c))
        wrong = dataclasses.replace(record, loads=tuple(loads))
        with pytest.raises(RecordError):
            check_reproduces(wrong, table)


def test_other_data_than_the_record_s_are_refused(pairs: list[Pair]) -> None:
    record, table = pairs[0]
    moved_cell, dead_cell = table.values.copy(), table.values.copy()
    moved_cell[7, 0] *= 1.01
    dead_cell[:, 1] = 1.0
    for values in (moved_cell, dead_cell, table.values[:-1], pairs[1][1].values):
        with pytest.raises(RecordError):
            check_reproduces(record, dataclasses.replace(table, values=values))


def test_verify_names_the_one_bad_record_among_many(registry: Registry, tmp_path: Path) -> None:
    import shutil

    home = tmp_path / "calibrations"
    shutil.copytree(registry.folder, home)
    target = home / "bench" / "bench-r3.loads.csv"
    target.write_bytes(target.read_bytes().replace(b"up", b"UP", 1))
    rows = verify_registry(Registry(home))
    assert [(one.id, one.ok) for one in rows] == [
        ("bench-r1", True), ("bench-r2", True), ("bench-r3", False), ("bench-r4", True),
    ]  # fmt: skip
    assert str(rows[2].reason).startswith("data:")


def test_the_hash_from_the_text_is_that_of_the_content(registry: Registry) -> None:
    from toolkit.calibration.records.record import _hash_as_written, content_hash, content_of

    for record_id in registry.ids("bench"):
        path = registry.folder / "bench" / f"{record_id}.json"
        text = path.read_text(encoding="utf-8")
        record = from_bytes(path.read_bytes(), where=path)
        assert _hash_as_written(text) == content_hash(content_of(record)) == record.sha256
        # A space inside of a text is no indent.
        assert _hash_as_written(text.replace("operator ", "operator  ", 1)) != record.sha256
        assert _hash_as_written(text.replace('"operator ', '"\\" operator', 1)) is None
        assert _hash_as_written(text.replace('"operator ', '": operator', 1)) is None
        assert _hash_as_written(text.replace("\n ", "\n", 1)) is None
