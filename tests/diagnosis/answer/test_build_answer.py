"""When effects that were found are not named: a smooth discrepancy without a name explains more."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.cases import HEAD, TWO, write_case
from toolkit.diagnosis.answer.build_answer import _mismatches, _outliers, _parameters
from toolkit.diagnosis.answer.naming import _is_smooth
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.noise_floor import LARGE, LONG
from toolkit.diagnosis.search.unexplained import StructureFound, narrowest_line
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

ROWS = 6000
COST = 0.5 * math.log(ROWS)


def searched(gain, smooth_gain, *, columns=6, name="wear", rest=False):
    effect = effects()[name]
    active = SimpleNamespace(effect=effect, searched=effect.parameters[:1])
    smooth = StructureFound(
        output="FY", variables=("SA",), gain=2 * smooth_gain, p_value=1e-9, rest=rest, columns=columns
    )
    return SimpleNamespace(
        problem=SimpleNamespace(kept={"FY": np.ones(ROWS, dtype=bool)}, values=float(ROWS)),
        steps=(SimpleNamespace(active=active, gain=gain),),
        structure_before=(smooth,),
    )


# Six columns cost five parameters more than the effect's one, and three more are asked of them.
LEAST = 5 * COST + 3


@pytest.mark.parametrize(("more", "smooth"), [(LEAST + 1, True), (LEAST - 1, False), (0.0, False)])
def test_a_smooth_discrepancy_pays_for_its_columns(more, smooth):
    assert _is_smooth(searched(20.0, 20.0 + more)) is smooth


def test_what_is_read_off_the_digits_imitates_nothing():
    assert not _is_smooth(searched(20.0, 500.0, name="quantisation"))


def test_a_rest_and_a_line_are_no_smooth_discrepancy():
    assert not _is_smooth(searched(20.0, 500.0, rest=True))
    assert not _is_smooth(searched(20.0, 500.0, columns=0))


@pytest.fixture
def problem(tmp_path):
    case = read_case(write_case(tmp_path, HEAD + TWO))
    return problem_of(case, model_of(case, None))


def test_what_was_left_out_is_told_with_file_row_time_and_value(problem):
    kept = problem.kept["F"].copy()
    kept[[79, 80, 95]] = False  # the last row of one run, the first and the sixteenth of the other
    (finding,) = _outliers(problem.case, SimpleNamespace(problem=replace(problem, kept={"F": kept})))
    last, first = problem.observed["F"][[79, 80]]
    assert "3 in number" in finding.message
    assert (
        f"row 80 of the file r0.csv at 7.9 s ({last:.6g} N), row 1 of the file r1.csv at 0 s ({first:.6g} N)"
        in (finding.message)
    )
    assert "row 16 of the file r1.csv at 1.5 s" in finding.message
    assert "more" not in finding.message


def test_of_means_and_of_readings_in_another_order_the_rows_of_the_file_are_told(problem):
    """Means over four rows have windows of eight; a table's readings are put in the order of their inputs."""
    kept = problem.kept["F"].copy()
    kept[[2, 80]] = False
    first, other = problem.runs
    rows = 30 + 4 * np.arange(first.rows)[:, None] + np.array([0, 7])
    back = np.arange(other.rows)[::-1]
    runs = replace(first, file_rows=rows), replace(other, file_rows=np.column_stack([back, back]))
    (finding,) = _outliers(
        problem.case, SimpleNamespace(problem=replace(problem, runs=runs, kept={"F": kept}))
    )
    assert "the mean of rows 39 to 46 of the file r0.csv at 0.2 s" in finding.message
    assert f"row {other.rows} of the file r1.csv" in finding.message


def test_of_many_values_left_out_some_are_told_and_the_others_counted(problem):
    kept = problem.kept["F"].copy()
    kept[10:30] = False
    (finding,) = _outliers(problem.case, SimpleNamespace(problem=replace(problem, kept={"F": kept})))
    assert "20 in number" in finding.message
    assert finding.message.count("of the file") == 8
    assert finding.message.endswith(" and 12 more")


def left_over(problem, residual, *variables, reason="", p_value=1.0, line=None):
    fit = SimpleNamespace(residual={"F": residual}, simulated={"F": problem.observed["F"]})
    found = StructureFound(
        output="F", variables=variables, reason=reason, line=line, gain=9.0, p_value=p_value, rest=True
    )
    search = SimpleNamespace(
        problem=problem, refitted=fit, augmented=fit, steps=(), structure_before=(found,), structure=(found,)
    )
    (mismatch,) = _mismatches(search, unknown=True)
    return mismatch


def test_a_rest_that_is_only_large_has_no_chance(problem):
    noise = np.random.default_rng(2).normal(size=problem.rows)
    for reason in (LARGE, LONG):
        assert left_over(problem, noise, reason=reason).untested
    assert left_over(problem, noise, "run", p_value=0.01).p_value == 0.01


def test_a_line_has_the_share_of_its_square(problem):
    # Amplitude 2 beside noise of 1: 2 of 3 of the mean square.
    t = np.concatenate([run.t for run in problem.runs])
    rest = 2 * np.sin(2 * np.pi * 2.5 * t) + np.random.default_rng(2).normal(size=problem.rows)
    line = narrowest_line(problem, "F", rest)
    assert line is not None
    mismatch = left_over(problem, rest, "time", line=line)
    assert mismatch.share_of_variance == pytest.approx(2 / 3, abs=0.08)


def test_a_distance_below_what_the_rows_resolve_has_an_interval_up_to_there(problem):
    # The bristle acts with the shorter of the two: whatever the fit says of it, nothing below shows.
    effect, least = effects()["coulomb_friction"], 2e-5
    for presliding, high in ((1.3e-17, least), (0.5 * least, least), (0.01, None)):
        values = {"coulomb": 20.0, "presliding": presliding, "least_presliding": least}
        active = AppliedEffect(effect=effect, channel="F", values=values)
        search = SimpleNamespace(
            problem=problem,
            augmented=SimpleNamespace(active=(active,), covariance=np.eye(4)),
            variance=lambda _: 1e-34,
        )
        estimate = next(each for each in _parameters(search, active, None) if each.name == "presliding")
        assert estimate.value == presliding
        if high is None:
            assert estimate.ci95[0] > 0.009
        else:
            assert estimate.ci95 == (0.0, high)


@pytest.mark.parametrize("value", [-2.0, 2.0])
def test_a_size_of_either_sign_has_its_interval_on_both_sides(problem, value):
    """Only what the rows do not resolve reaches to none; a zero that moved down is no such size."""
    active = AppliedEffect(effect=effects()["zero_offset"], channel="F", values={"offset": value})
    search = SimpleNamespace(
        problem=problem,
        augmented=SimpleNamespace(active=(active,), covariance=np.eye(3)),
        variance=lambda _: 0.01,
    )
    (estimate,) = _parameters(search, active, None)
    # Of 160 rows and three parameters: Student's 97.5 % quantile of 157 degrees is 1.975, and sd is 0.1.
    assert estimate.ci95 == pytest.approx((value - 0.1975, value + 0.1975), abs=1e-3)
