"""Bridge output in mV with an excitation, or in counts with a scale: one physics, one calibration."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import CELLS, LOADS, UNITS, csv_text, hub_data, session_text
from toolkit.calibration.records.record import CalibrationRecord, sealed
from toolkit.calibration.registry.candidate import Candidate, calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import parse_loads, stored_check, stored_loads
from toolkit.calibration.session.statements import statements_of
from toolkit.errors import RecordError, ToolkitError

COUNT = 5e-7  # mV/V of one count: a 24-bit digitiser over +-4.2 mV/V
SCALE = 'scale = { value = 5e-7, unit = "mV/V" }'
VOLTS = 'excitation = { value = 10, unit = "V" }'


def cells(line: str) -> str:
    return "".join(f"[cells.{name}]\n{line}\n" for name in CELLS)


def write(
    folder: Path,
    unit: str,
    per_mV_V: float,
    tail: str,
    *,
    check_unit: str = "mV/V",
    check_per: float = 1.0,
    **changes: str,
) -> Path:
    """Write the hub's session with its indications in another unit: value = mV/V times ``per_mV_V``."""
    folder.mkdir(parents=True, exist_ok=True)

    def file(name: str, values: NDArray[np.float64], text: str, by: float, runs: bool) -> None:
        names = [f"{c} [{text}]" for c in CELLS] + [f"{n} [{UNITS[n]}]" for n in LOADS]
        out = values.copy()
        out[:, :3] = np.round(out[:, :3] * by, 0 if text.startswith("count") else 12)
        (folder / name).write_text(csv_text(names, out, runs=runs, digits=12))

    file("loads.csv", hub_data(60, 1), unit, per_mV_V, True)
    file("check.csv", hub_data(9, 2), check_unit, check_per, False)
    path = folder / "SESSION.toml"
    # No reading: the cells' units are what changes here.
    path.write_text(session_text(polarity="-", **changes) + tail)
    return path


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> CalibrationRecord:
    """The same session in mV/V."""
    folder = tmp_path_factory.mktemp("plain")
    return calibrate(write(folder / "s", "mV/V", 1.0, ""), Registry(folder / "cal")).record


def coefficients(record: CalibrationRecord) -> NDArray[np.float64]:
    return np.array([one.coefficients for one in record.loads])


@pytest.mark.parametrize(
    ("unit", "per_mV_V", "line"),
    [
        ("mV", 10.0, VOLTS),
        ("V", 0.01, VOLTS),
        ("uV", 1e4, "excitation = 10"),
        ("mV", 5.0, 'excitation = { value = 5000, unit = "mV" }'),
        ("count", 1 / COUNT, SCALE),
        ("count", 1 / COUNT, 'scale = { value = 5e-7, unit = "mV/V/count" }'),
        ("counts", 1 / COUNT, 'scale = { value = 5e-7, unit = "mV/V/counts" }'),
        ("count", 1 / COUNT, f'scale = {{ value = 5e-6, unit = "mV" }}\n{VOLTS}'),
        ("mV/V", 1.0, VOLTS),
        ("mV/V", 1.0, "scale = 1.0"),
    ],
)
def test_every_way_of_recording_gives_one_calibration(
    tmp_path: Path, plain: CalibrationRecord, unit: str, per_mV_V: float, line: str
) -> None:
    made = calibrate(write(tmp_path / "s", unit, per_mV_V, cells(line)), Registry(tmp_path / "cal"))
    assert made.record.indication_units == ("mV/V",) * 3
    # Rounding to whole counts moves 60 rows by at most half of 5e-7 mV/V each.
    rtol = 1e-5 if unit.startswith("count") else 1e-8
    np.testing.assert_allclose(coefficients(made.record), coefficients(plain), rtol=rtol)
    assert not [one for one in made.findings if one.level != "note"]
    assert Registry(tmp_path / "cal").load(made.record.id) == made.record


@pytest.mark.parametrize(
    ("unit", "per_mV_V", "line", "kept", "factor"),
    [
        ("mV", 10.0, "", "mV", 0.1),
        ("count", 1 / COUNT, "", "count", COUNT),
        ("count", 1 / COUNT, "scale = 5e-7", "count", COUNT),  # no unit: never guessed
        ("count", 1 / COUNT, 'scale = { value = 5e-6, unit = "mV/count" }', "mV", 0.1),
        ("count", 1 / COUNT, 'scale = { value = 2e-3, unit = "lbf" }', "lbf", COUNT / 2e-3),
        ("lbf", 1.0, VOLTS, "lbf", 1.0),
    ],
)
def test_without_a_statement_a_column_keeps_its_unit(
    tmp_path: Path, plain: CalibrationRecord, unit: str, per_mV_V: float, line: str, kept: str, factor: float
) -> None:
    path = write(
        tmp_path / "s", unit, per_mV_V, cells(line) if line else "", check_unit=unit, check_per=per_mV_V
    )
    record = calibrate(path, Registry(tmp_path / "cal")).record
    assert record.indication_units == (kept,) * 3
    expected = coefficients(plain) * [factor, factor, factor, 1.0]
    np.testing.assert_allclose(coefficients(record), expected, rtol=1e-5)


def test_the_stored_file_is_the_raw_one_and_converts_again(tmp_path: Path) -> None:
    path = write(tmp_path / "s", "count", 1 / COUNT, cells(SCALE), check_unit="mV/V")
    registry = Registry(tmp_path / "cal")
    record = calibrate(path, registry).record
    entry = record.data_file("loads")
    assert entry is not None
    assert (registry.folder / "hub" / entry.file).read_bytes() == (path.parent / "loads.csv").read_bytes()
    assert [cell.column_unit for cell in record.cells] == ["count"] * 3
    table, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    assert table is not None
    assert check is not None
    np.testing.assert_allclose(table.matrix(CELLS), hub_data(60, 1)[:, :3], atol=COUNT / 2 * 1.001)
    assert {check.unit(name) for name in CELLS} == {"mV/V"}


@pytest.mark.parametrize(("unit", "by"), [("count", 1 / COUNT), ("uV/V", 1e3), ("V/V", 1e-3), ("mV/V", 1.0)])
def test_check_loads_in_any_unit_of_the_same_bridge(tmp_path: Path, unit: str, by: float) -> None:
    """A check file is converted by its own header: counts beside data in mV/V, and the other way round."""
    found = []
    for name, data, per_unit in (("a", "mV/V", 1.0), ("b", "count", 1 / COUNT)):
        path = write(
            tmp_path / name,
            data,
            per_unit,
            cells(SCALE),
            check_unit=unit,
            check_per=by,
            instrument=f'"{name}"',
        )
        registry = Registry(tmp_path / "cal")
        made = calibrate(path, registry)
        check = stored_check(registry.folder, made.record)
        assert check is not None
        found.append(check.matrix(CELLS))
    for values in found:
        np.testing.assert_allclose(values, hub_data(9, 2)[:, :3], atol=COUNT / 2 * 1.001)


def test_resolution_and_u_follow_the_unit_that_is_written(tmp_path: Path) -> None:
    """One count of 5e-7 mV/V, said in four ways; a bare number is in the column's unit."""
    for at, entry in enumerate(
        (
            "1",
            '{ value = 1, unit = "count" }',
            '{ value = 5e-7, unit = "mV/V" }',
            '{ value = 5e-4, unit = "µV/V" }',
        )
    ):
        line = f"{SCALE}\nresolution = {entry}\nu = {entry}"
        path = write(tmp_path / f"s{at}", "count", 1 / COUNT, cells(line), instrument=f'"hub{at}"')
        made = calibrate(path, Registry(tmp_path / "cal"))
        assert made.fit.session.cells[0].resolution == pytest.approx(COUNT, rel=1e-12)
        stated = statements_of(made.record).cell("D51")
        assert (stated.resolution, stated.u) == pytest.approx((COUNT, COUNT), rel=1e-12)
        assert (stated.unit, stated.column_unit) == ("mV/V", "count")


def test_a_record_that_needed_no_conversion_keeps_its_content(plain: CalibrationRecord) -> None:
    """Hashes of records made before bridges were converted must not move."""
    from toolkit.calibration.records.record import content_of

    assert all(
        set(cell) == {"name", "unit", "minimum", "maximum", "serial"} for cell in content_of(plain)["cells"]
    )


def test_a_record_cannot_disown_its_conversion(tmp_path: Path) -> None:
    path = write(tmp_path / "s", "mV", 10.0, cells(VOLTS))
    registry = Registry(tmp_path / "cal")
    record = calibrate(path, registry).record
    folder = registry.folder / "hub"
    data = (folder / f"{record.id}.loads.csv").read_bytes()
    for text in ("V", "mV/V"):
        other = sealed(
            dataclasses.replace(
                record, cells=tuple(dataclasses.replace(cell, column_unit=text) for cell in record.cells)
            )
        )
        with pytest.raises(RecordError) as caught:
            parse_loads(other, data, folder)
        assert caught.value.rule == "data"
    from toolkit.calibration.registry.refit import check_reproduces

    bare = dataclasses.replace(
        record, cells=tuple(dataclasses.replace(cell, column_unit=None) for cell in record.cells)
    )
    with pytest.raises(RecordError, match="does not reproduce"):
        check_reproduces(bare, parse_loads(bare, data, folder))
    settings = json.loads(record.settings)
    settings["cells"]["D51"]["excitation"]["value"] = 5
    moved = dataclasses.replace(record, settings=json.dumps(settings))
    with pytest.raises(RecordError, match="does not reproduce"):
        check_reproduces(moved, parse_loads(moved, data, folder))


@pytest.mark.parametrize(
    ("line", "rule"),
    [
        ('excitation = { value = -10, unit = "V" }', "session"),
        ("excitation = 0", "session"),
        ('excitation = "10 V"', "session"),
        ('excitation = { value = 10, unit = "mA" }', "unit-dimension"),
        ("excitation = { value = 10 }", "no-unit"),
        ("scale = 0", "session"),
        ('scale = { value = -5e-7, unit = "mV/V" }', "session"),
        ('scale = { value = 0, unit = "mV/V" }', "session"),
        ('scale = { value = inf, unit = "mV/V" }', "wrong-value"),
        ('scale = { value = 5e-7, unit = "count" }', "unit-dimension"),
        ('scale = { value = 5e-7, unit = "degC" }', "unit-dimension"),
        ("scale = { value = 5e-7 }", "no-unit"),
        ('scale = { value = 5e-7, unt = "mV/V" }', "unknown-key"),
        (SCALE + '\nresolution = { value = 1, unit = "mV" }', "unit-dimension"),
        (SCALE + '\nu = { value = 1, unit = "N" }', "unit-dimension"),
        (SCALE + "\nresolution = true", "session"),
        (SCALE + "\nresolution = nan", "session"),
        ('temperature_coefficient = { span = { value = 1, unit = "N" } }', "unit-dimension"),
        ("temperature_coefficient = { spam = 1e-5 }", "unknown-key"),
        ('temperature_coefficient = "small"', "session"),
        ('temperature_coefficient = { zero = { value = 1, unit = "K" } }', "unit-dimension"),
    ],
)
def test_what_no_bridge_can_have(tmp_path: Path, line: str, rule: str) -> None:
    path = write(tmp_path / "s", "count", 1 / COUNT, f"[cells.D51]\n{line}\n", check_unit="count",
                 check_per=1 / COUNT)  # fmt: skip
    with pytest.raises(ToolkitError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert all(caught.value.as_dict().values()), caught.value.as_dict()
    assert (caught.value.exit_code, caught.value.rule) == (2, rule)
    assert not (tmp_path / "cal").exists()


def test_a_check_file_that_nothing_leads_to_is_refused(tmp_path: Path) -> None:
    for name, unit, by, line in (("a", "mV", 10.0, ""), ("b", "count", 1 / COUNT, VOLTS)):
        tail = cells(line) if line else ""
        with pytest.raises(ToolkitError) as caught:
            calibrate(write(tmp_path / name, unit, by, tail), Registry(tmp_path / "cal"))
        assert caught.value.rule == "unit-dimension"
        assert "check.csv" in str(caught.value.where)


@pytest.mark.parametrize(
    ("entry", "span", "zero"),
    [
        ("2e-5", 2e-5, None),
        ('{ value = 0.002, unit = "%/K" }', 2e-5, None),
        ('{ value = 20, unit = "ppm" }', 2e-5, None),
        ('{ span = { value = 20, unit = "ppm/degC" }, zero = 40 }', 2e-5, 40 * COUNT),
        ('{ zero = { value = 2e-5, unit = "mV/V/K" } }', None, 2e-5),
    ],
)
def test_temperature_coefficients(tmp_path: Path, entry: str, span: float | None, zero: float | None) -> None:
    line = f"{SCALE}\ntemperature_coefficient = {entry}"
    record = calibrate(
        write(tmp_path / "s", "count", 1 / COUNT, cells(line)), Registry(tmp_path / "c")
    ).record
    told = statements_of(record).cell("E5")
    assert told.span_per_K == (None if span is None else pytest.approx(span, rel=1e-12))
    assert told.zero_per_K == (None if zero is None else pytest.approx(zero, rel=1e-12))


def test_a_thousandth_of_an_excitation_shows_in_every_coefficient(
    tmp_path: Path, plain: CalibrationRecord
) -> None:
    """A property: load = c (mV / V), so that c grows with the excitation that was stated."""
    line = 'excitation = { value = 10.01, unit = "V" }'
    path = write(tmp_path / "s", "mV", 10.0, cells(line), check_unit="mV", check_per=10.0)
    made: Candidate = calibrate(path, Registry(tmp_path / "cal"))
    np.testing.assert_allclose(
        coefficients(made.record)[:, :3], coefficients(plain)[:, :3] * 1.001, rtol=1e-8
    )
