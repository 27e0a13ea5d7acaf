"""What the files of an archive show together; none of it changes a grade or the exit code."""

from __future__ import annotations

import datetime as dt
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.audit.archive_made import FY, HEADER, dated, recording, rewrite, write, write_saved
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry
from toolkit.machine import load_machine
from toolkit.recording.labview import write_labview

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"
LBF, LBF_FT = 4.4482216152605, 1.3558179483314004
WRONG = (FY[0], FY[1], -FY[2], FY[3])


def audit(folder):
    return audit_archive(folder, Registry(CALIBRATIONS), known_at=dt.date(2026, 1, 1))


def rules(made, rule):
    return {one.where: one.message for one in made.findings if one.rule == rule}


def whole_test(folder, *, date="2019-06-01", sign=1, **given):
    dated(folder, date)
    for number, angle in enumerate((0, 1, -1, 2, -2, 4, -4, 6, -6, 8, -8, 10, -10)):
        write(folder / f"run {number}", recording(angle=sign * angle, seed=number, **given) | (
            {"SA": np.full(50, float(angle)) + np.arange(50) * 1e-5}
        ))  # fmt: skip


def test_copies_are_named_with_the_first_of_them(tmp_path):
    dated(tmp_path / "one", "2019-06-01")
    write(tmp_path / "one" / "a.xlsx", recording())
    shutil.copy(tmp_path / "one" / "a.xlsx", tmp_path / "one" / "b.xlsx")
    lines = [",".join(HEADER[name] for name in recording())]
    lines += [",".join(repr(v) for v in row) for row in np.column_stack(list(recording().values())).tolist()]
    (tmp_path / "one" / "c.csv").write_text("\n".join(lines))
    made = audit(tmp_path)
    found = rules(made, "duplicate-file")
    assert found["one/b.xlsx"] == "the same as one/a.xlsx, byte for byte"
    assert found["one/c.csv"] == "the same as one/a.xlsx, in every number"
    assert made.clean  # copies of a file that is right are right


def test_missing_slip_angles_are_told_of_each_test(tmp_path):
    whole_test(tmp_path / "whole")
    dated(tmp_path / "part", "2019-06-01")
    write(tmp_path / "part" / "a", recording(angle=0))
    write(tmp_path / "part" / "b", recording(angle=1, seed=2))
    found = rules(audit(tmp_path), "missing-condition")
    assert list(found) == ["part"]
    assert "-1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10 deg" in found["part"]


def test_a_unit_that_most_files_do_not_have(tmp_path):
    for number in range(3):
        dated(tmp_path / str(number), "2019-06-01")
        write(tmp_path / str(number) / "a", recording(seed=number))
    other = recording(seed=9)
    other["FY"] = other["FY"] * LBF
    dated(tmp_path / "other", "2019-06-01")
    write(tmp_path / "other" / "a", other, HEADER | {"FY": "Fy [N]"})
    made = audit(tmp_path)
    assert list(rules(made, "units-changed")) == ["other/a"]
    assert "FY in N for lbf" in rules(made, "units-changed")["other/a"]


def test_a_test_whose_slip_angle_has_another_sign(tmp_path):
    for number in range(3):
        whole_test(tmp_path / f"test {number}")
    whole_test(tmp_path / "test 9", sign=-1)
    assert list(rules(audit(tmp_path), "axes-changed")) == ["test 9"]


def test_a_file_saved_long_after_its_test(tmp_path):
    dated(tmp_path, "2019-06-01")
    for name, day in (("late", 20), ("next day", 2)):
        write_saved(tmp_path / f"{name}.xlsx", recording(), f"2019-06-{day:02d}T10:00:00Z")
    found = rules(audit(tmp_path), "edited-after-test")
    assert list(found) == ["late.xlsx"]
    assert "2019-06-20, 19 days after the test of 2019-06-01" in found["late.xlsx"]


def test_a_recording_that_the_toolkit_wrote_has_a_day_once_it_is_edited(tmp_path):
    dated(tmp_path, "1999-06-01")  # before the stamp that the toolkit gives its own
    for name in ("as written.xlsx", "edited.xlsx"):
        write_labview(tmp_path / name, load_machine("m15"), recording(), simulated=True)
    rewrite(tmp_path / "edited.xlsx", "2026-11-22T08:02:39Z")
    assert list(rules(audit(tmp_path), "edited-after-test")) == ["edited.xlsx"]


@pytest.fixture(scope="module")
def wrong_sign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("effects")
    whole_test(folder / "forward and reverse", FY=WRONG)
    dated(
        folder / "forward and reverse",
        "2019-06-01",
        '[rotations]\n"back" = "reverse"\n"back 2" = "reverse"\n',
    )
    for name, angle in (("back", -1), ("back 2", 1)):
        write(folder / "forward and reverse" / name, recording(angle=angle, seed=50 + angle, FY=WRONG))
    return audit(folder)


class TestEffects:
    """The accident on a whole test: what the sign of E5 does to stiffness and pull, derived here."""

    def test_conditions_tell_new_minus_old_of_each_block(self, wrong_sign):
        one = next(f for f in wrong_sign.files if f.path.endswith("run 3"))
        table = recording(angle=2, seed=3, FY=WRONG)
        E5 = table["E5"].reshape(5, 10).mean(axis=1)
        assert [(c.first_row, c.last_row) for c in one.conditions] == [
            (i * 10 + 1, i * 10 + 10) for i in range(5)
        ]
        np.testing.assert_allclose([c.FY_change_N for c in one.conditions], 2 * FY[2] * E5 * LBF, rtol=1e-5)
        np.testing.assert_allclose([c.MZ_change_Nm for c in one.conditions], 0.0, atol=1e-3)
        assert [c.step_SA_deg for c in one.conditions] == pytest.approx([2.0] * 5)

    def test_the_secant_through_one_degree(self, wrong_sign):
        (test,) = wrong_sign.tests
        got = [
            e for e in test["effects"] if e["name"] == "cornering_stiffness" and e["rotation"] == "forward"
        ]
        # -(F(+1) - F(-1)) / (a(+1) - a(-1)) of the largest load, from the columns themselves
        sides = {}
        for number, angle in ((1, 1), (2, -1)):
            table = recording(angle=angle, seed=number, FY=WRONG)
            x = np.column_stack([table[c][40:] for c in ("D51", "D52", "E5")])
            angles = np.radians(angle + np.arange(40, 50) * 1e-5)
            sides[angle] = (table["FY"][40:].mean(), (x @ FY[:3] + FY[3]).mean(), angles.mean())
        span = sides[1][2] - sides[-1][2]
        assert got[-1]["old"] == pytest.approx(-(sides[1][0] - sides[-1][0]) * LBF / span, rel=1e-5)
        assert got[-1]["new"] == pytest.approx(-(sides[1][1] - sides[-1][1]) * LBF / span, rel=1e-5)
        assert got[-1]["change"] == got[-1]["new"] - got[-1]["old"]

    def test_pull_by_symmetry(self, wrong_sign):
        (test,) = wrong_sign.tests
        got = {e["name"]: e for e in test["effects"] if e["load_N"] == pytest.approx(1372 * LBF)}
        # Values at 0 deg: forward the file at 0; the reversed drum between -1 and 1, its Fy with the other
        # sign in axes that follow the travel.
        zero = recording(angle=0, seed=0, FY=WRONG)
        back = [recording(angle=a, seed=50 + a, FY=WRONG) for a in (-1, 1)]
        a, b = (one["SA"][40:].mean() for one in back)
        R = back[0]["FY"][40:].mean() + (0 - a) / (b - a) * (
            back[1]["FY"][40:].mean() - back[0]["FY"][40:].mean()
        )
        # "run 0" stands 0.00045 deg beside zero, whose neighbour is the file at 1 deg: far below 0.1 %
        F = zero["FY"][40:].mean()
        assert got["plysteer"]["old"] == pytest.approx((F - R) / 2 * LBF, abs=2.0)
        assert got["conicity"]["old"] == pytest.approx((F + R) / 2 * LBF, abs=2.0)
        assert math.isfinite(got["PRAT"]["new"])

    def test_a_clean_test_lists_no_effects(self, tmp_path):
        whole_test(tmp_path / "right")
        (test,) = audit(tmp_path).tests
        assert (test["not_clean"], test["effects"]) == (0, [])


def test_the_new_stiffness_is_that_of_the_reduced_test_before_its_common_load(virtual_test):
    # Two ways to the same means: the audit's, and the whole reduction; a tare cancels in the difference.
    from toolkit.pipeline import process, read_test
    from toolkit.recording.folder import read_test_folder

    folder = read_test_folder(virtual_test)
    record = Registry(CALIBRATIONS).load("m15-virtual-r1")
    reduced = process(folder, read_test(folder), record).reduced
    sides = {
        (c.rotation, c.step_FZ, round(math.degrees(c.step_SA))): c
        for c in reduced.conditions
        if c.used and c.step_SA is not None
    }
    (test,) = audit(virtual_test.parent).tests
    got = [e for e in test["effects"] if e["name"] in ("cornering_stiffness", "aligning_stiffness")]
    assert len(got) == 20  # two directions, five loads
    for one in got:
        a, b = (sides[one["rotation"], one["load_N"], angle] for angle in (-1, 1))
        if one["name"] == "cornering_stiffness":
            expected = -(b.FY - a.FY) / (b.SA - a.SA)
        else:
            expected = (b.MZ - a.MZ) / (b.SA - a.SA)
        assert one["new"] == pytest.approx(expected, rel=1e-9)


def test_what_will_be_in_force_cannot_be_known(tmp_path):
    dated(tmp_path / "later", "2190-01-01")
    write(tmp_path / "later" / "a.xlsx", recording())
    made = audit(tmp_path)
    (file,) = made.files
    assert (file.grade, file.date) == ("undated", None)
    assert (file.in_force, file.repair) == (None, None)
    assert "2190-01-01, in the future" in rules(made, "test-toml")["later/a.xlsx"]
