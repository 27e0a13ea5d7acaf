"""Whole tests compared: repeats of the virtual machine, a tire of another conicity, the source's own remark.

The source document says of five repeats that conicity and plysteer of the first two differ from the rest,
because the linear actuator of the load ran at another speed on another day, while CRAT, PRAT and both
stiffnesses agree. Both halves of that remark are simulated through the whole machine, cells and files:

* A slow actuator (``load_lag``) alone does not do it here. The virtual tire answers its load at once, the
  load of every row is measured, and reduction carries each value to the common load: a block whose load still
  creeps gives the same tire. The data's findings name it (out of tolerance), the comparison names nothing.
* What another speed must leave behind is a side force that the contact has not let go, another one forward
  than reversed: no effect of the load alone has such a memory. It is put at the hub (``zero_offset.FY`` by
  direction of rotation), and then conicity and plysteer differ, and nothing else that is read at 0 deg.
* The source document's PRAT of those plots is half the difference of two moments at 0 deg (6.2.1). By its
  other definition, the moment where FY is zero (6.1.1), PRAT cannot stay: FY that is larger by dF is zero at
  an angle further out by dF / C_FY, where MZ is larger by dF C_MZ / C_FY.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.comparison.comparison_factory import conicity
from toolkit import pipeline
from toolkit.calibration.registry.registry import Registry
from toolkit.characteristics.characterise import characterise
from toolkit.comparison.compare import compare
from toolkit.comparison.compare import test_entry as entry_of
from toolkit.comparison.model import Comparison, Entry
from toolkit.errors import ConfigError
from toolkit.lab.home import packaged_home
from toolkit.machine import load_machine
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.reduction.model import ReducedTest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.characteristics.model import Characteristics
    from toolkit.simulation.plan import Plan

MACHINE = load_machine("m15-virtual")
SLOW = ("load_lag=1.5s",)
# In axes that follow the travel 70 N forward and 10 N reversed: 30 N of conicity, 40 N of plysteer.
KEPT = ("zero_offset.FY@rotation:forward=70N", "zero_offset.FY@rotation:reverse=-10N")


@pytest.fixture(scope="module")
def record() -> CalibrationRecord:
    return Registry(packaged_home() / "calibrations").load("m15-virtual-r1")


class Machine:
    """The virtual machine at three loads and nine slip angles: a seed and effects to a reduced test."""

    def __init__(self, plan: Plan, folder: Path, record: CalibrationRecord) -> None:
        keep = tuple(a for a in plan.slip_angles_rad if abs(np.degrees(a)) not in (6.0, 10.0))
        self.plan = dataclasses.replace(plan, slip_angles_rad=keep, loads_N=plan.loads_N[::2])
        self.folder, self.record = folder, record

    def test(self, seed: int, *effects: str) -> ReducedTest:
        from toolkit.simulation.plan import with_effects
        from toolkit.simulation.run import simulate
        from toolkit.simulation.write import write_test

        plan = with_effects(dataclasses.replace(self.plan, seed=seed), list(effects))
        folder = self.folder / f"{len(list(self.folder.iterdir()))}" / f"run{seed}"
        write_test(simulate(plan), folder)
        test = read_test_folder(folder)
        return process(test, read_test(test), self.record).reduced


@pytest.fixture(scope="module")
def machine(
    tmp_path_factory: pytest.TempPathFactory, virtual_plan: Plan, record: CalibrationRecord
) -> Iterator[Machine]:
    with pytest.MonkeyPatch.context() as patch:
        # Each entry is characterised by itself, see `characterised`.
        patch.setattr(pipeline, "characterise", lambda *_, **__: None)
        yield Machine(virtual_plan, tmp_path_factory.mktemp("repeats"), record)


@pytest.fixture(scope="module")
def repeats(machine: Machine) -> list[ReducedTest]:
    """Five tests of one tire on the virtual machine: only the noise and the loads differ."""
    return [machine.test(seed) for seed in range(5)]


@pytest.fixture(scope="module")
def kept(machine: Machine) -> list[ReducedTest]:
    """The first two again, with the side force that the contact has kept."""
    return [machine.test(seed, *KEPT) for seed in range(2)]


_CHARACTERISED: dict[int, tuple[ReducedTest, Characteristics]] = {}


def characterised(reduced: ReducedTest, record: CalibrationRecord) -> Characteristics:
    """Fit a test once, whatever is said of its day, surface and tire."""
    if id(reduced) not in _CHARACTERISED:
        _CHARACTERISED[id(reduced)] = reduced, characterise(reduced, machine=MACHINE, record=record)
    return _CHARACTERISED[id(reduced)][1]


def entry(reduced: ReducedTest, record: CalibrationRecord, **info: str) -> Entry:
    found = characterised(reduced, record)
    named = dataclasses.replace(reduced, info=dataclasses.replace(reduced.info, **info))
    return entry_of(named, found, machine=MACHINE, record=record, source=reduced.info.name)


def stated_common(reduced: list[ReducedTest], record: CalibrationRecord) -> list[Entry]:
    return [entry(one, record) for one in reduced]


def of_two_days(first: list[ReducedTest], second: list[ReducedTest], record: CalibrationRecord) -> Comparison:
    return compare([
        *(entry(one, record, date="2017-05-02") for one in first),
        *(entry(one, record, date="2017-05-09") for one in second),
    ])  # fmt: skip


def decided_by_day(found: Comparison) -> dict[str, set[bool]]:
    assert found.mode == "repeats"
    assert found.repeats is not None
    decided: dict[str, set[bool]] = {}
    for one in found.repeats.precisions:
        (day,) = one.factors
        assert day.factor == "day"
        decided.setdefault(one.name, set()).add(day.significant)
    return decided


def test_the_source_s_remark_on_its_five_repeats(
    kept: list[ReducedTest], repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    found = of_two_days(kept, repeats[2:], record)
    decided = decided_by_day(found)
    assert decided["conicity"] == decided["plysteer"] == {True}
    for name in ("CRAT", "PRAT", "secant_cornering", "secant_aligning", "slope_cornering", "slope_aligning"):
        assert decided[name] == {False}, name
    # The day's part is that of two levels 30 N and 40 N apart: sqrt(d^2/2) is their standard deviation.
    assert found.repeats is not None
    for one in found.repeats.precisions:
        wanted = {"conicity": 30.0, "plysteer": 40.0}.get(one.name)
        if wanted:
            assert one.factors[0].s_between == pytest.approx(wanted / np.sqrt(2), rel=0.15)


def test_a_kept_force_moves_PRAT_at_zero_force_by_the_trail(
    kept: list[ReducedTest], repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    """40 N of plysteer times the pneumatic trail of each load, by the tests' own two slopes."""
    found = of_two_days(kept, repeats[2:], record)
    assert decided_by_day(found)["PRAT_at_FY_zero"] == {True}
    assert found.repeats is not None
    slopes = {
        (one.name, one.rotation, round(one.load_N)): one.mean
        for one in found.repeats.precisions
        if one.name.startswith("slope")
    }
    seen = 0
    for one in found.repeats.precisions:
        if one.name == "PRAT_at_FY_zero":
            load = round(one.load_N)
            trail = np.mean([
                slopes["slope_aligning", way, load] / slopes["slope_cornering", way, load]
                for way in ("forward", "reverse")
            ])  # fmt: skip
            assert one.factors[0].s_between == pytest.approx(40.0 * trail / np.sqrt(2), rel=0.15)
            seen += 1
    assert seen == 3


def test_a_slow_load_alone_is_told_by_the_data_and_changes_no_characteristic(
    machine: Machine, repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    slow = [machine.test(seed, *SLOW) for seed in range(2)]
    for late, prompt in zip(slow, repeats[:2], strict=True):
        # When a block begins, 2.26 s after its step, the load still creeps to where it was told to be.
        told = {one.rule for one in late.findings} - {one.rule for one in prompt.findings}
        assert "load-tolerance" in told
    found = of_two_days(slow, repeats[2:], record)
    assert set().union(*decided_by_day(found).values()) == {False}
    assert [one.name for one in found.differences if one.significant] == []


def test_repeats_of_one_day_do_not_differ(repeats: list[ReducedTest], record: CalibrationRecord) -> None:
    found = compare([entry(one, record) for one in repeats])
    assert [one.name for one in found.differences if one.significant] == []
    assert found.repeats is not None
    for one in found.repeats.precisions:
        assert one.repeatability is not None
        assert one.repeatability.dof == 4


def test_the_scatter_of_repeats_is_what_the_budgets_say(
    repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    """Chi-squared of each quantity over five tests, by the parts that are a test's own rows and fits.

    The virtual machine draws noise anew and nothing else, so repeatability and fit must cover it: not
    smaller than the scatter, and not larger by a factor without a reason.
    """
    entries = [entry(one, record) for one in repeats]
    found = compare(entries)
    ratios = []
    assert found.repeats is not None
    for one in found.repeats.precisions:
        rows = [r for e in entries for r in e.rows if r.series == (one.name, one.rotation, None)]
        own = np.mean([
            sum(p.u**2 for p in r.number.parts if p.source in ("repeatability", "fit"))
            for r in rows if abs(r.load_N - one.load_N) < 0.1 * one.load_N
        ])  # fmt: skip
        ratios.append(one.total.value**2 / own)
    # 39 quantities at 4 degrees of freedom each, correlated in groups; rows of a drum's run-out do not
    # average as white noise does, so the stated part is the larger one.
    assert 0.02 < float(np.mean(ratios)) < 1.5


def test_a_shared_record_makes_the_difference_more_certain(
    repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    found = compare([entry(one, record) for one in repeats[:2]])
    stiffness = [one for one in found.differences if one.name == "slope_aligning"]
    # The record, the load cell and the scale of the slip angle are common; the pressure is set anew.
    assert len(stiffness) == 6
    for one in stiffness:
        shared = one.u_apart**2 - one.difference.u**2
        assert shared > 0
        row = next(
            r for r in found.reference.rows
            if (r.name, r.rotation, r.load_N) == (one.name, one.rotation, one.load_N)
        )  # fmt: skip
        common = ("calibration", "load", "slip angle scale")
        # Of two nearly equal tests, twice the variance that they have in common.
        mine = sum(p.u**2 for p in row.number.parts if p.source in common)
        assert shared == pytest.approx(2 * mine, rel=0.1)


def test_another_conicity_is_found_and_measured(
    kept: list[ReducedTest], repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    found = compare([entry(repeats[0], record), entry(kept[1], record)])
    three = [one for one in found.differences if one.name == "conicity"]
    assert all(one.significant for one in three)
    for one in three:
        U, _ = one.difference.expanded(0.999)
        assert abs(one.difference.value - 30.0) < U


def test_the_mode_follows_what_the_tests_state(repeats: list[ReducedTest], record: CalibrationRecord) -> None:
    def mode(**info: str) -> str:
        return compare([entry(repeats[0], record), entry(repeats[1], record, **info)]).mode

    assert mode() == "repeats"
    assert mode(surface="steel") == "surfaces"
    assert mode(tire_size="265/35 ZR 18") == "tires"
    assert mode(tire_size="265/35 ZR 18", surface="steel") == "tires"


def test_unlike_conditions_are_noted(repeats: list[ReducedTest], record: CalibrationRecord) -> None:
    pair = [entry(repeats[0], record), entry(repeats[1], record, surface="steel")]
    assert {one.where for one in compare(pair).findings} == set()  # the surface is what is compared
    as_repeats = compare(pair, mode="repeats")
    assert {(one.rule, one.where) for one in as_repeats.findings} == {
        ("conditions-differ", "surface"),
        ("mode", "--mode"),
    }


def test_pattern_effect_of_a_regular_and_a_reversed_belt(
    repeats: list[ReducedTest], record: CalibrationRecord
) -> None:
    """The belt's part of MZ changes its sign with the cords, the tread's does not (source, 6.1.1)."""
    body, tread = 1.5, 0.6  # N·m, put into MZ of both directions: PRAT is their mean

    def belt(reduced: ReducedTest, sign: float) -> ReducedTest:
        conditions = tuple(
            dataclasses.replace(c, MZ_common=c.MZ_common + sign * body + tread) for c in reduced.conditions
        )
        return dataclasses.replace(reduced, conditions=conditions)

    base = compare([entry(repeats[0], record), entry(repeats[1], record)])
    prat = {
        one.load_N: (one.reference.value, one.other.value) for one in base.differences if one.name == "PRAT"
    }
    found: Comparison = compare([
        entry(belt(repeats[0], 1), record, tire_belt="regular"),
        entry(belt(repeats[1], -1), record, tire_belt="reversed"),
    ])  # fmt: skip
    rows = [one for one in found.pattern if one.name == "PRAT"]
    assert len(rows) == 3
    for one in rows:
        own = sum(prat[one.load_N]) / 2
        assert one.pattern.value == pytest.approx(own + tread, abs=1e-3)
        assert one.body.value == pytest.approx(
            body + (prat[one.load_N][0] - prat[one.load_N][1]) / 2, abs=1e-3
        )
    assert base.pattern == ()


def test_the_same_recordings_twice(repeats: list[ReducedTest], record: CalibrationRecord) -> None:
    with pytest.raises(ConfigError) as caught:
        compare([entry(repeats[0], record), entry(repeats[0], record)])
    assert caught.value.rule == "same-test"


def test_equal_names_are_told_apart() -> None:
    a, b = conicity("a", 1, 2, 3), dataclasses.replace(conicity("a", 1, 2, 3), identity="other")
    assert [one.label for one in compare([a, b]).entries] == ["a (1)", "a (2)"]
    a, b = (
        dataclasses.replace(one, source=source)
        for one, source in ((a, "/x/steel/new/a.csv"), (b, "/x/sand/new/a.csv"))
    )
    assert [one.label for one in compare([a, b]).entries] == ["a (steel/new)", "a (sand/new)"]


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        ({"level": 0.0}, "wrong-value"),
        ({"level": 1.5}, "wrong-value"),
        ({"level": float("nan")}, "wrong-value"),
        ({"mode": "tyres"}, "unknown-mode"),
        ({"reproducibility": True}, "no-other-laboratory"),
    ],
)
def test_what_is_asked_wrongly_is_refused(options: dict[str, object], rule: str) -> None:
    with pytest.raises(ConfigError) as caught:
        compare([conicity("a", 1, 2, 3), conicity("b", 1, 2, 4)], **options)  # type: ignore[arg-type]
    assert caught.value.rule == rule
    assert caught.value.next_step


def test_one_is_too_few_and_a_table_is_no_repeat() -> None:
    one = conicity("a", 1, 2, 3)
    for entries, mode, rule in (
        ([one], None, "too-few-entries"),
        ([one, conicity("b", 1, 2, 3, kind="table")], "repeats", "mode"),
        ([one, conicity("b", 1, 2, 3, loads=(9e3, 10e3, 11e3))], None, "nothing-in-common"),
    ):
        with pytest.raises(ConfigError) as caught:
            compare(entries, mode=mode)  # type: ignore[arg-type]
        assert caught.value.rule == rule


def test_simulated_and_measured_are_not_mixed_in_silence() -> None:
    found = compare([conicity("a", 1, 2, 3), conicity("b", 1, 2, 3, simulated=True)])
    assert "simulated-and-measured" in {one.rule for one in found.findings}
