"""The reduction as a whole: real rows, the virtual machine's truth, and departures from the protocol."""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from toolkit.calibration.records.record import CalibrationRecord, Indication
from toolkit.errors import RecordError, RecordingError
from toolkit.machine import load_machine
from toolkit.pipeline import declared_tare, process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.recording.labview import write_labview
from toolkit.recording.read import read_recording
from toolkit.reduction.model import ReducedTest
from toolkit.reduction.reduce import reduce_test
from toolkit.simulation.plan import Plan
from toolkit.simulation.run import simulate
from toolkit.simulation.write import write_test
from toolkit.units import from_si

pytestmark = pytest.mark.usefixtures("reduced_alone")

FIG = Path(__file__).resolve().parents[2] / "toolkit" / "examples" / "fig4_4" / "M15_fig4_4.xlsx"


def folder_with(tmp_path: Path, *names: str, toml: str = "") -> Path:
    folder = tmp_path / "test"
    folder.mkdir()
    (folder / "test.toml").write_text(f'schema = 1\nmachine = "m15"\n{toml}')
    for name in names:
        shutil.copy(FIG, folder / name)
    return folder


def reduce_folder(folder: Path, record: CalibrationRecord) -> ReducedTest:
    test = read_test_folder(folder)
    return process(test, read_test(test), record).reduced


@pytest.fixture(scope="module")
def few_files(tmp_path_factory: pytest.TempPathFactory, virtual_plan: Plan) -> Path:
    """A virtual test of three slip angles; read it, never write into it."""
    folder = tmp_path_factory.mktemp("few") / "test"
    write_test(simulate(dataclasses.replace(virtual_plan, slip_angles_rad=(0.0, 0.0175, -0.0175))), folder)
    return folder


@pytest.fixture(scope="module")
def few_reduced(few_files: Path, virtual_record: CalibrationRecord) -> ReducedTest:
    return reduce_folder(few_files, virtual_record)


def rules(reduced: ReducedTest) -> set[str]:
    return {finding.rule for finding in reduced.findings}


def test_figure_4_4_corrected_by_hand(tmp_path: Path, published_record: CalibrationRecord) -> None:
    reduced = reduce_folder(folder_with(tmp_path, "a"), published_record)
    assert [round(float(from_si(c.FZ, "lbf"))) for c in reduced.conditions] == [249, 587, 835, 1112, 1376]
    # Two rows a block, by hand: 0.99719 D51 + 0.99718 D52 + 1.0228 E5 + 0.6473 on the printed digits.
    D51, D52, E5 = (98.59261 + 98.59098) / 2, (86.06072 + 86.05929) / 2, (-182.415 - 182.414) / 2
    by_hand = 0.99719 * D51 + 0.99718 * D52 + 1.0228 * E5 + 0.6473
    assert from_si(reduced.conditions[0].FY, "lbf") == pytest.approx(by_hand, abs=1e-9)
    # physics.md: the corrected trail -MZ/FY is 14, 18, 24, 32 mm from 587 to 1377 lbf.
    trail = [-1000 * c.MZ / c.FY for c in reduced.conditions[1:]]
    assert trail == pytest.approx([14, 18, 24, 32], abs=0.6)
    assert {c.step_SA for c in reduced.conditions} == {0.0}
    assert all(np.degrees(c.SA) == pytest.approx(-0.303, abs=0.006) for c in reduced.conditions)


def test_figure_4_4_says_what_is_wrong_with_it(tmp_path: Path, published_record: CalibrationRecord) -> None:
    reduced = reduce_folder(folder_with(tmp_path, "a"), published_record)
    assert {"no-tare", "acquired-differs", "missing"} <= rules(reduced)
    assert "slip-angle-tolerance" not in rules(reduced)
    missing = [f for f in reduced.findings if f.rule == "missing"]
    assert {f.where for f in missing} == {"drum forward", "drum reverse"}


def test_tare_by_an_included_intercept(tmp_path: Path, published_record: CalibrationRecord) -> None:
    toml = "[tare]\nvalues = { D51 = 1.0, D52 = 2.0, E5 = -3.0 }"
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    bare = reduce_folder(folder_with(tmp_path / "a", "f"), published_record)
    tared = reduce_folder(folder_with(tmp_path / "b", "f", toml=toml), published_record)
    # The record's zero is included: load = f(x) - f(tare), and its intercept goes with the tare.
    shift = 0.99719 * 1.0 + 0.99718 * 2.0 - 1.0228 * 3.0 + 0.6473
    moved = from_si(bare.conditions[2].FY - tared.conditions[2].FY, "lbf")
    assert moved == pytest.approx(shift, abs=1e-9)
    assert "no-tare" not in rules(tared)


def test_a_doubled_condition_leaves_the_later_file_unused(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    reduced = reduce_folder(folder_with(tmp_path, "b.xlsx", "a.xlsx"), published_record)
    assert "doubled" in rules(reduced)
    assert {c.file for c in reduced.used()} == {"a.xlsx"}
    assert {c.file for c in reduced.conditions if not c.used} == {"b.xlsx"}


def test_out_of_tolerance_is_a_finding(tmp_path: Path, published_record: CalibrationRecord) -> None:
    machine = load_machine("m15")
    rows = read_recording(FIG, machine)
    columns = {s.symbol: s.values.copy() for s in rows.series}
    columns["SA"] += 0.9
    columns["FZ"] *= 1.08
    folder = folder_with(tmp_path)
    write_labview(folder / "x.xlsx", machine, columns, simulated=False)
    found = rules(reduce_folder(folder, published_record))
    assert {"load-tolerance"} <= found
    # 0.6 deg: nearest to +1, 0.4 away, within the 0.5 deg of the protocol.
    assert "slip-angle-tolerance" not in found
    columns["SA"] += 2.4
    write_labview(folder / "x.xlsx", machine, columns, simulated=False)
    assert "slip-angle-tolerance" in rules(reduce_folder(folder, published_record))


def test_no_load_block(tmp_path: Path, published_record: CalibrationRecord) -> None:
    machine = load_machine("m15")
    columns = {s.symbol: s.values.copy() for s in read_recording(FIG, machine).series}
    columns["FZ"] = np.full(10, 1.5)
    folder = folder_with(tmp_path)
    write_labview(folder / "x.xlsx", machine, columns, simulated=False)
    with pytest.raises(RecordingError) as caught:
        reduce_folder(folder, published_record)
    assert caught.value.rule == "no-load-block"


def test_a_record_in_other_units_is_refused(tmp_path: Path, published_record: CalibrationRecord) -> None:
    other = dataclasses.replace(
        published_record, cells=tuple(Indication(name=c.name, unit="mV/V") for c in published_record.cells)
    )
    with pytest.raises(RecordError) as caught:
        reduce_folder(folder_with(tmp_path, "a"), other)
    assert caught.value.rule == "record-units"


def test_names_and_order_of_files_do_not_matter(
    tmp_path: Path, few_files: Path, few_reduced: ReducedTest, virtual_record: CalibrationRecord
) -> None:
    first = few_reduced
    other = tmp_path / "renamed"
    other.mkdir()
    shutil.copy(few_files / "protocol.toml", other / "protocol.toml")
    files = sorted(few_files.glob("*.xlsx"))
    names = {path.name: f"{(i * 5) % len(files):02d} any name" for i, path in enumerate(files)}
    for path in files:
        shutil.copy(path, other / names[path.name])
    text = (few_files / "test.toml").read_text()
    for old, new in names.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    (other / "test.toml").write_text(text)
    second = reduce_folder(other, virtual_record)

    def without_names(reduced: ReducedTest) -> list[Any]:
        return [dataclasses.replace(c, file="", file_sha256="") for c in reduced.conditions]

    assert without_names(first) == without_names(second)


def test_the_virtual_machines_truth(
    virtual_test: Path, virtual_record: CalibrationRecord, virtual_truth: dict[str, Any]
) -> None:
    reduced = reduce_folder(virtual_test, virtual_record)
    assert len(reduced.used()) == 130
    assert reduced.info.simulated
    true = {
        (c["file"], c["first_row"]): c
        for c in virtual_truth["conditions"]
    }  # fmt: skip
    for c in reduced.conditions:
        truth = true[c.file, c.first_row]
        sign = 1 if c.rotation == "forward" else -1
        # Rounding to seven digits, cell noise, filter and drum run-out: no more than 0.1 % of full scale.
        assert sign * c.FY == pytest.approx(truth["FY_N"], abs=6.0)
        assert c.MZ == pytest.approx(truth["MZ_Nm"], abs=0.4)
        assert c.FZ == pytest.approx(truth["FZ_N"], abs=30.0)


def test_declared_tare_is_read(virtual_test: Path) -> None:
    tare = declared_tare(read_test_folder(virtual_test), load_machine("m15-virtual"))
    assert tare is not None
    assert dict(tare.values).keys() == {"D51", "D52", "E5"}
    assert tare.unit == "mV/V"


def test_scaling_the_loads_scales_the_result(virtual_test: Path, virtual_record: CalibrationRecord) -> None:
    twice = dataclasses.replace(
        virtual_record,
        loads=tuple(
            dataclasses.replace(one, coefficients=tuple(2 * c for c in one.coefficients))
            for one in virtual_record.loads
        ),
    )
    test = read_test_folder(virtual_test)
    recordings = read_test(test)[:3]
    machine = load_machine("m15-virtual")

    def reduced(record: CalibrationRecord) -> ReducedTest:
        pairs = [(one.name, one, test.rotation_of(one.path)) for one in recordings]
        return reduce_test(info=test.info, machine=machine, record=record, recordings=pairs,
                           tare=declared_tare(test, machine))  # fmt: skip

    for one, other in zip(reduced(virtual_record).conditions, reduced(twice).conditions, strict=True):
        assert other.FY_common == pytest.approx(2 * one.FY_common, rel=1e-12)
        assert other.u_MZ_common == pytest.approx(2 * one.u_MZ_common, rel=1e-12)


def test_files_of_one_name_in_two_folders_stay_apart(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    toml = '[rotations]\n"back/a" = "reverse"'
    folder = folder_with(tmp_path)
    for name in ("ahead", "back"):
        (folder / name).mkdir()
        shutil.copy(FIG, folder / name / "a")
    with (folder / "test.toml").open("a") as stream:
        stream.write(toml)
    reduced = reduce_folder(folder, published_record)
    assert {(c.file, c.rotation) for c in reduced.used()} == {("ahead/a", "forward"), ("back/a", "reverse")}
    assert len(reduced.used()) == 10


def with_tare_rows(source: Path, target: Path, machine_name: str, tare: dict[str, float]) -> None:
    """Copy a recording with 20 unloaded rows before its blocks."""
    machine = load_machine(machine_name)
    rows = read_recording(source, machine)
    columns = {
        s.symbol: np.concatenate([np.full(20, tare.get(s.symbol, 1.0)), s.values]) for s in rows.series
    }
    write_labview(target, machine, columns, simulated=machine.simulated)


def untared(virtual_test: Path, target: Path) -> tuple[Path, dict[str, float]]:
    """Copy a virtual test without its declared tare, and return that tare."""
    tare = declared_tare(read_test_folder(virtual_test), load_machine("m15-virtual"))
    assert tare is not None
    shutil.copytree(virtual_test, target)
    text = (target / "test.toml").read_text()
    (target / "test.toml").write_text(text[: text.index("[tare]")] + text[text.index("[rotations]") :]
                                      if text.index("[rotations]") > text.index("[tare]")
                                      else text[: text.index("[tare]")])  # fmt: skip
    return target, dict(tare.values)


def test_tare_blocks_in_every_file_do_what_the_declared_tare_does(
    tmp_path: Path, few_files: Path, few_reduced: ReducedTest, virtual_record: CalibrationRecord
) -> None:
    declared = few_reduced
    folder, tare = untared(few_files, tmp_path / "t")
    for path in sorted(folder.glob("*.xlsx")):
        with_tare_rows(path, path, "m15-virtual", tare)
    found = reduce_folder(folder, virtual_record)
    assert found.tare.source == "block"
    for one, other in zip(declared.conditions, found.conditions, strict=True):
        assert other.FY == pytest.approx(one.FY, rel=1e-9, abs=1e-6)
        assert (other.first_row, other.last_row) == (one.first_row + 20, one.last_row + 20)


def test_a_tare_block_in_one_file_serves_all(
    tmp_path: Path, few_files: Path, few_reduced: ReducedTest, virtual_record: CalibrationRecord
) -> None:
    declared = few_reduced
    folder, tare = untared(few_files, tmp_path / "t")
    first = min(folder.glob("*.xlsx"))
    with_tare_rows(first, first, "m15-virtual", tare)
    found = reduce_folder(folder, virtual_record)
    assert "tare-shared" in rules(found)
    assert "no-tare" not in rules(found)
    FY = [c.FY for c in found.conditions]
    assert FY == pytest.approx([c.FY for c in declared.conditions], rel=1e-9, abs=1e-6)


def test_without_a_tare_the_zero_of_the_cells_is_in_the_uncertainty(
    tmp_path: Path, few_files: Path, few_reduced: ReducedTest, virtual_record: CalibrationRecord
) -> None:
    declared = few_reduced
    folder, _ = untared(few_files, tmp_path / "t")
    bare = reduce_folder(folder, virtual_record)
    assert "no-tare" in rules(bare)
    # The virtual machine states the values of its tare with their u.
    assert "tare-rows" not in rules(declared)
    for one, other in zip(declared.conditions, bare.conditions, strict=True):
        assert 0.0 < one.u_FY_zero < other.u_FY_zero
        # What the tare removed is within two standard uncertainties of the stated zero.
        assert 0 < abs(other.FY - one.FY) < 2 * math.hypot(other.u_FY, other.u_FY_zero)
        assert math.hypot(other.u_MZ, other.u_MZ_zero) > math.hypot(one.u_MZ, one.u_MZ_zero)


def test_a_drum_angle_counts_tire_revolutions(tmp_path: Path, published_record: CalibrationRecord) -> None:
    # 8.5 m of drum over a tire of 2 pi 0.97 x 0.31595 m: one drum turn is 4.414 tire turns.
    machine = load_machine("m15")
    rows = read_recording(FIG, machine)
    columns = {s.symbol: np.repeat(s.values[::2], 200) for s in rows.series}
    columns["DRUM_ANGLE [deg]"] = np.arange(1000.0) * 2.0
    folder = folder_with(tmp_path, toml='[tire]\nsize = "205/55R16"')
    write_labview(folder / "x.xlsx", machine, columns, simulated=False)
    first = reduce_folder(folder, published_record).conditions[0]
    per_row = 2.0 / 360 * 8.5 / (2 * np.pi * 0.97 * 0.31595)
    assert first.first_row - 1 == pytest.approx(2.5 / per_row, abs=1)
    assert first.last_row - first.first_row + 1 == pytest.approx(1.0 / per_row, abs=1)


def test_an_angle_of_no_known_name_is_told(tmp_path: Path, published_record: CalibrationRecord) -> None:
    machine = load_machine("m15")
    rows = read_recording(FIG, machine)
    columns = {s.symbol: s.values for s in rows.series} | {"Theta [deg]": np.arange(10.0)}
    folder = folder_with(tmp_path)
    write_labview(folder / "x.xlsx", machine, columns, simulated=False)
    assert "unknown-angle" in rules(reduce_folder(folder, published_record))


def test_two_near_loads_of_every_file_stay_two(tmp_path: Path, published_record: CalibrationRecord) -> None:
    # 30 and 33 kN with a spread of 3 %: the groups nearly touch, but every file holds both.
    machine = load_machine("m15")
    folder = folder_with(tmp_path)
    for number, (angle, spread) in enumerate([(0.0, 0.97), (1.0, 1.0), (-1.0, 1.03)]):
        loads = np.repeat([30000.0 * spread, 33500.0 * spread], 20) / 4.4482216152605
        columns = {c.symbol: np.linspace(100.0, 101.0, 40) for c in machine.columns} | {"FZ": loads}
        columns["SA"] = np.full(40, angle)
        write_labview(folder / f"f{number}.xlsx", machine, columns, simulated=False)
    reduced = reduce_folder(folder, published_record)
    groups: dict[float | None, set[str]] = {}
    for c in reduced.conditions:
        groups.setdefault(c.step_FZ, set()).add(c.file)
    assert {round(step or 0.0): len(files) for step, files in groups.items()} == {30000: 3, 33500: 3}
    assert "unplanned-load" in rules(reduced)
    assert {round(c.FZ_common) for c in reduced.conditions} == {30000, 33500}


def test_cells_beyond_the_calibrated_range_are_told(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    ranged = dataclasses.replace(
        published_record,
        cells=tuple(
            Indication(name=c.name, unit=c.unit, minimum=-300.0, maximum=300.0)
            for c in published_record.cells
        ),
    )
    found = [
        f for f in reduce_folder(folder_with(tmp_path, "a"), ranged).findings if f.rule == "beyond-range"
    ]
    # Figure 4.4: D51 reaches 496 and E5 -498 lbf; D52 stays at 301, within the room of 5 % of the span.
    assert [f.message.split()[0] for f in found] == ["D51", "E5"]


def test_blocks_of_another_condition_feed_nothing(
    tmp_path: Path, few_files: Path, few_reduced: ReducedTest, virtual_record: CalibrationRecord
) -> None:
    # Every recording again, leaning, with other forces: first by name, so that the protocol would take them.
    plain = few_reduced
    folder = tmp_path / "mixed"
    shutil.copytree(few_files, folder)
    machine = load_machine("m15-virtual")
    files = {path: {s.symbol: s.values.copy() for s in read_recording(path, machine).series
                    if s.role != "covariate"}
             for path in sorted(folder.glob("*.xlsx"))}  # fmt: skip
    assert len(files) > 3
    toml = (folder / "test.toml").read_text()
    for path, columns in files.items():
        rows = len(columns["FZ"])
        write_labview(path, machine, columns | {"IA [deg]": np.zeros(rows)}, simulated=True)
        leaning = columns | {name: 1.2 * columns[name] for name in ("D51", "D52", "E5")}
        other = path.with_name(f"0 leaning {path.name}")
        write_labview(other, machine, leaning | {"IA [deg]": np.full(rows, 3.0)}, simulated=True)
        toml = "\n".join(
            f"{line}\n{line.replace(path.name, other.name)}" if path.name in line else line
            for line in toml.splitlines()
        )
    (folder / "test.toml").write_text(toml)
    mixed = reduce_folder(folder, virtual_record)
    (told,) = [finding for finding in mixed.findings if finding.rule == "other-conditions"]
    assert "IA 3 deg, kept 0 deg" in told.message
    assert [(c.file, c.first_row, c.FY, c.MZ) for c in mixed.used()] == [
        (c.file, c.first_row, c.FY, c.MZ) for c in plain.used()
    ]


def test_a_load_where_the_reach_of_a_nominal_one_ends_is_one_load(
    tmp_path: Path, virtual_plan: Plan, virtual_record: CalibrationRecord
) -> None:
    # 15 % below 833 lbf lie 708 lbf: a load of 700 lbf with a spread of 3 % lies on both sides of that.
    plan = dataclasses.replace(virtual_plan, loads_N=(700 * 4.4482216152605, 1200 * 4.4482216152605))
    folder = tmp_path / "test"
    write_test(simulate(plan), folder)
    toml = folder / "test.toml"
    toml.write_text(toml.read_text().replace('protocol = "protocol.toml"\n', ""))
    (folder / "protocol.toml").unlink()
    reduced = reduce_folder(folder, virtual_record)
    assert len({condition.step_FZ for condition in reduced.conditions}) == 2
    assert len({condition.FZ_common for condition in reduced.conditions}) == 2
    assert "unplanned-load" in rules(reduced)


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ('pressure = { value = 34, unit = "bar" }', "inflation pressure 34 bar"),
        ('rated_load = { value = 1.372, unit = "lbf" }', "rated load 1.37 lbf"),
        ('speed = { value = 7.66, unit = "km/s" }', "speed 7.66 km/s"),
        ('pressure = { value = 34, unit = "psi" }', ""),
    ],
)
def test_a_stated_condition_at_which_no_tire_is_tested_is_told(
    tmp_path: Path, published_record: CalibrationRecord, toml: str, said: str
) -> None:
    reduced = reduce_folder(folder_with(tmp_path, "a", toml=f"{toml}\n"), published_record)
    told = [finding for finding in reduced.findings if finding.rule == "unusual-condition"]
    assert [finding.where for finding in told] == ["test.toml"] * bool(said)
    assert all(finding.message.startswith(said) for finding in told)
