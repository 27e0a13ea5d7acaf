"""Zero, shunt, creep and reversibility readings: figures worked by hand, findings, bad entries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import SENSITIVITY, hub_data
from toolkit.calibration.fit.readings import SessionReadings, readings_json, readings_of
from toolkit.calibration.registry.candidate import Candidate, calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.errors import ToolkitError

Make = Callable[..., Path]

# One cell: 2 mV/V at 1000 N, zero 0.02 mV/V, 10 V; three runs up and down, 10 to 100 %.
SENS, ZERO = 2e-3, 0.02
LEVELS = (0.0, *(100.0 * i for i in range(1, 11)), *(100.0 * i for i in range(9, 0, -1)))


def single(
    folder: Path, tail: str = "", *, unit: str = "mV/V", by: float = 1.0, hysteresis: float = 0.0, **more: str
) -> Path:
    """Write a session of one cell; ``hysteresis`` [mV/V] is added to every reading going down."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(11)
    lines = [f"S [{unit}],F [N],run,direction"]
    for run in (1, 2, 3):
        for at, force in enumerate(LEVELS):
            up = at <= 10
            value = (ZERO + SENS * force + rng.normal(0, 1e-6) + (0.0 if up else hysteresis)) * by
            lines.append(f"{value!r},{force!r},{run},{'up' if up else 'down'}")
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    entries = {
        "instrument": '"cell"', "date": "2026-01-05", "operator": '"operator one"',
        "indications": '["S"]', "loads": '["F"]', "data": '"loads.csv"',
        "temperature": '{ value = 21, unit = "degC" }',
    } | more  # fmt: skip
    path = folder / "SESSION.toml"
    path.write_text("\n".join(f"{key} = {value}" for key, value in entries.items()) + "\n" + tail)
    return path


def run(tmp_path: Path, path: Path) -> Candidate:
    return calibrate(path, Registry(tmp_path / "cal"))


def found(made: Candidate, rule: str) -> list[str]:
    return [f"{one.level} {one.where}: {one.message}" for one in made.findings if one.rule == rule]


def zeros(before: object, after: object) -> str:
    return f'[[zero]]\nwhen = "before"\nvalues = {before}\n[[zero]]\nwhen = "after"\nvalues = {after}\n'


def test_a_zero_that_moved(tmp_path: Path) -> None:
    """0.004 mV/V of 2 mV/V is 0.2 % of full scale and 2 N of 1000 N; the tolerance is 1 N."""
    made = run(tmp_path, single(tmp_path / "s", zeros(0.02, 0.024)))
    zero, load = made.readings.zero[0], made.readings.zero_loads[0]
    assert (zero.before, zero.after, zero.unit) == ("before", "after", "mV/V")
    assert zero.drift == pytest.approx(0.004)
    assert zero.percent_fs == pytest.approx(0.2, rel=1e-4)
    assert load.drift == pytest.approx(2.0, rel=1e-4)
    assert load.percent_fs == pytest.approx(0.2, rel=1e-4)
    assert load.tolerance == pytest.approx(1.0)
    assert len(found(made, "zero-drift")) == 1
    assert "warning F: the zeros of S moved by +2 N" in found(made, "zero-drift")[0]
    quiet = run(tmp_path, single(tmp_path / "t", zeros(0.02, 0.0216), instrument='"other"'))
    assert quiet.readings.zero_loads[0].drift == pytest.approx(0.8, rel=1e-4)
    assert not found(quiet, "zero-drift")


@pytest.mark.parametrize(
    ("unit", "by", "line", "before", "after"),
    [
        ("mV", 10.0, 'excitation = { value = 10, unit = "V" }', "0.2", "0.24"),
        ("mV", 10.0, "excitation = 10", '{ value = 20, unit = "uV/V" }', '{ value = 0.24, unit = "mV" }'),
        ("count", 2e6, 'scale = { value = 5e-7, unit = "mV/V" }', "[40000]", "{ S = 48000 }"),
        ("mV/V", 1.0, "", "{ S = 0.02 }", '{ S = { value = 24e-6, unit = "V/V" } }'),
    ],
)
def test_readings_are_in_the_columns_unit_or_in_their_own(
    tmp_path: Path, unit: str, by: float, line: str, before: str, after: str
) -> None:
    tail = zeros(before, after) + (f"[cells.S]\n{line}\n" if line else "")
    made = run(tmp_path, single(tmp_path / "s", tail, unit=unit, by=by))
    assert made.readings.zero[0].drift == pytest.approx(0.004, rel=1e-9)
    assert made.readings.zero_loads[0].drift == pytest.approx(2.0, rel=1e-4)


def test_zeros_of_several_cells_are_told_as_loads(tmp_path: Path, make_session: Make) -> None:
    drift = np.array([0.01, -0.02, 0.005])
    tail = zeros("[0, 0, 0]", list(drift.tolist()))
    made = run(tmp_path, make_session(tail=tail))
    expected = np.linalg.solve(SENSITIVITY, drift)
    assert [one.drift for one in made.readings.zero_loads] == pytest.approx(expected, rel=2e-3)
    # One cell alone: the others count as not moved.
    tail = zeros("{ D52 = 0 }", "{ D52 = -0.02 }")
    made = run(tmp_path, make_session(tail=tail, name="other"))
    expected = np.linalg.solve(SENSITIVITY, [0, -0.02, 0])
    assert [one.drift for one in made.readings.zero_loads] == pytest.approx(expected, rel=2e-3)
    assert made.readings.zero_loads[0].cells == ("D52",)


def test_a_list_is_in_the_order_of_the_indications_not_of_the_file(
    tmp_path: Path, make_session: Make
) -> None:
    tail = zeros("[1, 2, 3]", "[1.5, 2.25, 3.125]")
    made = run(tmp_path, make_session(indications='["E5", "D51", "D52"]', tail=tail))
    assert {one.name: one.drift for one in made.readings.zero} == {"E5": 0.5, "D51": 0.25, "D52": 0.125}


def test_readings_and_a_tared_fit_can_both_be_said(tmp_path: Path, make_session: Make) -> None:
    tail = (
        '[zero]\nfit = "tared"\n[[zero.readings]]\nwhen = "before"\nvalues = [0, 0, 0]\n'
        '[[zero.readings]]\nwhen = "after"\nvalues = [0.001, 0, 0]\n'
    )
    made = run(tmp_path, make_session(tail=tail))
    assert made.record.zero == "tared"
    assert made.readings.zero[0].drift == 0.001
    assert Registry(tmp_path / "cal").load(made.record.id) == made.record
    assert (
        run(tmp_path, make_session(tail=zeros("[0, 0, 0]", "[0, 0, 0]"), name="b")).record.zero == "included"
    )


def shunt(measured: str, tolerance: str = "", expected: str = '{ value = 1.0021, unit = "mV/V" }') -> str:
    return f"[cells.S]\nshunt_expected = {expected}\n{measured}\n{tolerance}\n"


@pytest.mark.parametrize(
    ("measured", "tolerance", "percent", "rule"),
    [
        ("1.0026", "", 0.0499, False),  # 0.0005 / 1.0021
        ("1.0036", "", 0.1497, True),
        ("1.0036", "shunt_tolerance = 0.2", 0.1497, False),
        ("1.0036", 'shunt_tolerance = { value = 0.05, unit = "%" }', 0.1497, True),
        ("-1.0021", "", -200.0, True),
        ('{ value = 1002.1, unit = "µV/V" }', "", 0.0, False),
    ],
)
def test_a_shunt_step(tmp_path: Path, measured: str, tolerance: str, percent: float, rule: bool) -> None:
    made = run(tmp_path, single(tmp_path / "s", shunt(f"shunt_measured = {measured}", tolerance)))
    (one,) = made.readings.shunts
    assert one.difference_percent == pytest.approx(percent, abs=1e-3)
    assert one.within is not rule
    assert bool(found(made, "shunt")) is rule


def test_a_shunt_reading_among_the_zeros_is_a_step_from_the_zero_before(tmp_path: Path) -> None:
    entry = '[[zero]]\nwhen = "shunt after"\nvalues = 1.0301\n'
    made = run(tmp_path, single(tmp_path / "s", zeros(0.02, 0.028) + entry + shunt("")))
    (one,) = made.readings.shunts
    assert (one.source, one.zero) == ("shunt after", 0.028)
    assert one.measured == pytest.approx(1.0021)
    assert one.within
    # It is no zero: the drift is that of the other two.
    assert made.readings.zero[0].drift == pytest.approx(0.008)
    alone = run(tmp_path, single(tmp_path / "t", entry + shunt(""), instrument='"other"'))
    assert "no zero reading before it" in found(alone, "shunt")[0]
    lone = run(tmp_path, single(tmp_path / "u", entry, instrument='"third"'))
    assert found(lone, "shunt")[0].startswith("note")


def test_a_shunt_told_as_the_bridges_output_beside_a_column_in_newtons(tmp_path: Path) -> None:
    tail = shunt('shunt_measured = { value = 1.0021, unit = "mV/V" }')
    made = run(tmp_path, single(tmp_path / "s", tail, unit="N", by=500.0))
    assert made.readings.shunts[0].difference_percent == pytest.approx(0.0)
    entry = '[[zero]]\nwhen = "shunt"\nvalues = 501\n'
    made = run(tmp_path, single(tmp_path / "t", entry + shunt(""), unit="N", by=500.0, instrument='"b"'))
    assert made.readings.shunts[0].within is None
    assert found(made, "shunt")[0].startswith("note")


def creeps(*entries: tuple[str, float, str]) -> str:
    return "".join(
        f"[[creep]]\nload = {load}\nseconds = {seconds}\nvalue = {value}\n"
        for load, seconds, value in entries
    )


def test_creep_and_its_recovery(tmp_path: Path) -> None:
    """ISO 376: c = |i300 - i30| / X_N; 0.001 of 2 mV/V is 0.05 %."""
    tail = creeps(
        ('"F"', 0, "2.015"), ('"F"', 30, "2.0200"), ('"F"', 300, "2.0210"), ('"F"', 600, "2.0212"),
        ("0", 30, "0.0206"), ('{ value = 0, unit = "kN" }', 60, "0.0205"), ("0", 300, "0.0202"),
    )  # fmt: skip
    made = run(tmp_path, single(tmp_path / "s", tail))
    loaded, recovery = made.readings.creep
    assert (loaded.load, loaded.unloaded, loaded.from_s, loaded.to_s) == ("F", False, 30.0, 300.0)
    assert loaded.change == pytest.approx(0.001)
    assert loaded.percent_fs == pytest.approx(0.05, rel=1e-4)
    assert (recovery.load, recovery.unloaded) == ("0 N", True)
    assert recovery.change == pytest.approx(-0.0004)
    assert recovery.percent_fs == pytest.approx(0.02, rel=1e-4)
    # The single reading "0 kN" is another label, with nothing to compare.
    assert made.readings.creep_left_out == ("0 kN",)
    assert len(found(made, "creep")) == 1


@pytest.mark.parametrize(
    ("first", "second", "percent"),
    [
        ("2.02", "2.022", 0.1),
        ('{ value = 20.2, unit = "mV" }', "{ S = 2.022 }", 0.1),
        ('{ value = 1000, unit = "N" }', '{ value = 1.0005, unit = "kN" }', 0.05),  # as an indicator shows it
    ],
)
def test_creep_readings_in_any_form(tmp_path: Path, first: str, second: str, percent: float) -> None:
    tail = creeps(("1000", 30, first), ("1000", 300, second)) + "[cells.S]\nexcitation = 10\n"
    (one,) = run(tmp_path, single(tmp_path / "s", tail)).readings.creep
    assert one.percent_fs == pytest.approx(percent, rel=1e-4)


def test_creep_of_several_cells(tmp_path: Path, make_session: Make) -> None:
    tail = creeps(
        ('"FY"', 30, "{ D51 = 1.0, E5 = 0.5 }"), ('"FY"', 300, "[1.001, 0.1, 0.5]"),
        ('"MZ"', 30, "100.0"), ('"MZ"', 300, "100.1"), ('{ value = 5, unit = "lbf" }', 30, "1.0"),
    )  # fmt: skip
    made = run(tmp_path, make_session(tail=tail))
    by = {(one.load, one.of): one for one in made.readings.creep}
    assert set(by) == {("FY", "D51"), ("FY", "E5"), ("MZ", "MZ")}
    assert by["FY", "D51"].change == pytest.approx(0.001)
    assert by["MZ", "MZ"].percent_fs == pytest.approx(100 * 0.1 / made.record.load("MZ").largest)
    assert made.readings.creep_left_out == ("5 lbf",)


def test_reversibility_at_equal_loads(tmp_path: Path) -> None:
    """Every reading down is 0.002 mV/V high: 1 N of 1000 N, at 9 levels of each of 3 runs."""
    (one,) = run(tmp_path, single(tmp_path / "s", hysteresis=0.002)).readings.reversibility
    assert one.pairs == 27
    assert one.rms == pytest.approx(1.0, rel=2e-3)
    assert one.worst == pytest.approx(1.0, rel=3e-3)
    assert one.rms_percent_fs == pytest.approx(0.1, rel=2e-3)


def test_without_equal_loads_or_a_way_down_there_is_no_reversibility(
    tmp_path: Path, make_session: Make
) -> None:
    assert run(tmp_path, make_session()).readings.reversibility == ()
    path = single(tmp_path / "s")
    data = path.parent / "loads.csv"
    data.write_text(data.read_text().replace("down", "up"))
    assert run(tmp_path, path).readings.reversibility == ()


def test_full_scale_is_the_largest_deflection_with_and_without_unloaded_rows(tmp_path: Path) -> None:
    found = []
    for name in ("with", "without"):
        path = single(tmp_path / name, instrument=f'"{name}"')
        if name == "without":
            data = path.parent / "loads.csv"
            lines = data.read_text().splitlines()
            data.write_text("\n".join(line for line in lines if ",0.0," not in line) + "\n")
        found.append(dict(run(tmp_path, path).readings.full_scale)["S"])
    assert found == pytest.approx([2.0, 2.0], rel=1e-5)


def test_the_record_alone_tells_the_same(tmp_path: Path) -> None:
    tail = zeros("0.2", "0.24") + creeps(('"F"', 30, "20.2"), ('"F"', 300, "20.21"))
    tail += "[cells.S]\nexcitation = 10\nshunt_expected = 10.02\nshunt_measured = 10.03\n"
    made = run(tmp_path, single(tmp_path / "s", tail, unit="mV", by=10.0, hysteresis=1e-4))
    registry = Registry(tmp_path / "cal")
    record = registry.load(made.record.id)
    table = stored_loads(registry.folder, record)
    assert table is not None
    again: SessionReadings = readings_of(record, table)
    assert again == made.readings
    told = readings_json(again)
    assert told["shunt"][0]["difference_percent"] == pytest.approx(100 * 0.01 / 10.02)
    assert told["zero"]["S"]["drift"] == pytest.approx(0.004)


def test_an_output_that_no_bridge_gives(tmp_path: Path) -> None:
    made = run(tmp_path, single(tmp_path / "s", by=10.0))  # mV at 10 V called mV/V
    assert "20.2 mV/V" in found(made, "bridge-range")[0]
    assert not found(
        run(tmp_path, single(tmp_path / "t", unit="uV/V", by=1e3, instrument='"b"')), "bridge-range"
    )


def test_a_scale_without_a_unit_is_told(tmp_path: Path) -> None:
    made = run(tmp_path, single(tmp_path / "s", "[cells.S]\nscale = 5e-7\n", unit="count", by=2e6))
    assert found(made, "scale-unit")[0].startswith("note S")
    assert made.record.indication_units == ("count",)


@pytest.mark.parametrize(("degC", "told"), [("17.9", True), ("18", False), ("28", False), ("28.1", True)])
def test_a_session_in_the_cold(tmp_path: Path, degC: str, told: bool) -> None:
    path = single(tmp_path / "s", temperature=f'{{ value = {degC}, unit = "degC" }}')
    made = run(tmp_path, path)
    assert bool(found(made, "temperature")) is told
    assert all(one.level == "note" for one in made.findings if one.rule == "temperature")


BEFORE = '[[zero]]\nwhen = "before"\nvalues = {}\n'
CREEP = "[[creep]]\nload = {}\nseconds = {}\nvalue = {}\n"


@pytest.mark.parametrize(
    ("tail", "rule"),
    [
        (BEFORE.format("{ D53 = 0 }"), "unknown-key"),
        (BEFORE.format("{ FY = 0 }"), "unknown-key"),
        (BEFORE.format("[0, 0]"), "session"),
        (BEFORE.format("0"), "session"),
        (BEFORE.format("{}"), "session"),
        (BEFORE.format("[]"), "session"),
        (BEFORE.format('"none"'), "session"),
        (BEFORE.format("[0, 0, nan]"), "session"),
        (BEFORE.format("[0, 0, true]"), "session"),
        (BEFORE.format('{ D51 = { value = 0, unit = "N" } }'), "unit-dimension"),
        (BEFORE.format('{ D51 = { value = 0, unit = "mV" } }'), "unit-dimension"),  # no excitation
        (BEFORE.format("{ D51 = { value = 0 } }"), "no-unit"),
        ("[[zero]]\nvalues = [0, 0, 0]\n", "session"),
        ('[[zero]]\nwhen = " "\nvalues = [0, 0, 0]\n', "session"),
        ('[[zero]]\nwhen = "before"\n', "session"),
        ('[[zero]]\nwhen = "before"\nvalue = [0, 0, 0]\n', "unknown-key"),
        ('[zero]\nfit = "half"\n', "session"),
        ("[zero]\nreading = []\n", "unknown-key"),
        (CREEP.format('"FZ"', 30, "{ D51 = 0 }"), "session"),
        (CREEP.format("true", 30, "{ D51 = 0 }"), "session"),
        (CREEP.format("nan", 30, "{ D51 = 0 }"), "session"),
        (CREEP.format('{ value = 5, unit = "K" }', 30, "{ D51 = 0 }"), "unit-dimension"),
        (CREEP.format("{ value = 5 }", 30, "{ D51 = 0 }"), "no-unit"),
        (CREEP.format('"FY"', -1, "{ D51 = 0 }"), "session"),
        (CREEP.format('"FY"', '"30"', "{ D51 = 0 }"), "session"),
        (CREEP.format('"FY"', '{ value = 30, unit = "m" }', "{ D51 = 0 }"), "unit-dimension"),
        (CREEP.format('"FY"', 30, "{ D53 = 0 }"), "unknown-key"),
        (CREEP.format('"FY"', 30, "inf"), "session"),
        (CREEP.format('"FY"', 30, "{ D51 = 0 }") * 2, "session"),
        ('[[creep]]\nload = "FY"\nvalue = 1\n', "session"),
        ('[[creep]]\nload = "FY"\nseconds = 30\n', "session"),
        ("[cells.D51]\nshunt_measured = 1.0\n", "session"),
        ("[cells.D51]\nshunt_tolerance = 1.0\n", "session"),
        ("[cells.D51]\nshunt_expected = 0\n", "session"),
        ("[cells.D51]\nshunt_expected = 1\nshunt_tolerance = 0\n", "session"),
        ("[cells.D51]\nshunt_expected = 1\nshunt_tolerance = nan\n", "session"),
        ('[cells.D51]\nshunt_expected = 1\nshunt_measured = { value = 1, unit = "N" }\n', "unit-dimension"),
    ],
)  # fmt: skip
def test_bad_entries_are_refused_whole(tmp_path: Path, make_session: Make, tail: str, rule: str) -> None:
    with pytest.raises(ToolkitError) as caught:
        run(tmp_path, make_session(hub_data(60, 1), tail=tail))
    assert all(caught.value.as_dict().values()), caught.value.as_dict()
    assert (caught.value.exit_code, caught.value.rule) == (2, rule)
    assert not (tmp_path / "cal").exists()
