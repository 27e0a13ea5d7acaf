"""Control charts over sessions of known check-load errors."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from tests.calibration.control_factory import CHECKS, enter, put_in_force, write_session
from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.control.chart import chart_findings, control_chart
from toolkit.calibration.registry.registry import Registry

# Errors [N] at the three check loads, year by year, well inside the tolerance of 1 N.
QUIET = [0.10, -0.10, 0.05, -0.05, 0.10, -0.10]


def years(registry: Registry, tmp_path: Path, errors: list[float]) -> list[tuple[str, ...]]:
    """Enter one session a year under the first one's record; return each session's chart findings."""
    put_in_force(registry, enter(registry, tmp_path / "first", dt.date(2010, 3, 1)))
    told = []
    for at, error in enumerate(errors):
        made = enter(
            registry, tmp_path / f"y{at}", dt.date(2011 + at, 3, 1), check_errors=(error, -error, 0.02 * at)
        )
        told.append(tuple(f.where for f in made.findings if f.rule == "chart"))
    return told


def test_a_point_is_the_error_of_the_record_in_force(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    years(registry, tmp_path, QUIET)
    chart = control_chart(registry, "cell")
    assert [str(one.check_load) for one in chart.series] == [f"FY {force:g} N" for force in CHECKS]
    first = chart.series[0]
    assert [point.error for point in first.points] == pytest.approx(QUIET, abs=2e-3)
    assert {point.record for point in first.points} == {"cell-r1"}
    assert first.ranges == pytest.approx((0.2, 0.15, 0.1, 0.15, 0.2), abs=3e-3)
    # Baseline: all but the newest. Mean range (0.2 + 0.15 + 0.1 + 0.15) / 4.
    assert first.limits is not None
    assert first.limits.points == 5
    assert first.limits.sigma == pytest.approx(0.15 / 1.128, abs=2e-3)
    assert first.breaks == ()
    assert chart.left_out == (("cell-r1", "no record was in force before it"),)
    assert first.tolerance == 1.0


def test_a_jump_is_a_finding_of_the_session_that_made_it(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    told = years(registry, tmp_path, [*QUIET, 0.9])
    assert told[:-1] == [()] * 6 or all("950" in where for one in told[:-1] for where in one)
    assert {"FY at FY 150 N", "FY at FY 450 N"} <= set(told[-1])
    chart = control_chart(registry, "cell", load="FY")
    assert [b.rule.number for b in chart.series[0].breaks] == [1]
    found = chart_findings(chart, chart.series[0].points[-1].session_record)
    assert all("rule" in one.message and one.level == "warning" for one in found)
    assert control_chart(registry, "cell", load="MZ").series == ()


def test_a_steady_drift_breaks_the_rule_of_six(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    years(registry, tmp_path, QUIET)
    third = control_chart(registry, "cell").series[2]
    # 0.00, 0.02 .. 0.10 N: six rising points. The zero of the scatter is the record's own small residual.
    assert 3 in [b.rule.number for b in third.breaks if b.index == 5]


def test_a_fixed_baseline_keeps_its_limits(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    years(registry, tmp_path, [*QUIET, 0.3])
    one = control_chart(registry, "cell", baseline=4).series[0]
    assert one.baseline == 4
    assert one.limits is not None
    assert one.limits.centre == pytest.approx(0.0, abs=2e-3)
    assert one.limits.sigma == pytest.approx(0.15 / 1.128, abs=2e-3)


def test_few_sessions_have_points_and_no_limits(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    told = years(registry, tmp_path, [0.1, 0.9, -0.9])
    assert told == [(), (), ()]
    assert [one.limits for one in control_chart(registry, "cell").series] == [None] * 3


def test_near_reference_loads_are_one_check_load_and_an_as_left_session_has_no_point(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    years(registry, tmp_path, QUIET)
    enter(registry, tmp_path / "left", dt.date(2020, 3, 1), span=1.01, phase="as_left")
    chart = control_chart(registry, "cell")
    assert {len(one.points) for one in chart.series} == {6}
    assert chart.left_out[-1] == ("cell-r8", "as left: measured after an adjustment")
    path = tmp_path / "near"
    made = enter(registry, path, dt.date(2021, 3, 1))
    assert made.record.id == "cell-r9"
    assert {len(one.points) for one in control_chart(registry, "cell").series} == {7}
    # With a tolerance of nothing each session's own loads still agree: they are the same to the last digit.
    assert len(control_chart(registry, "cell", same_percent=0.0).series) == 3
    # Within 35 % of full scale 150 N and 450 N are one load, whose rows are averaged session by session.
    wide = control_chart(registry, "cell", same_percent=35.0).series
    assert {point.rows for point in wide[0].points} == {2}


def test_a_chart_goes_on_where_the_unit_changes(tmp_path: Path) -> None:
    # The same six sessions in N, and with the last two written in lbf: physically one chart.
    lbf = 0.45359237 * 9.80665
    charts = []
    for name, units in (("plain", "NNNNNN"), ("mixed", "NNNNLL")):
        registry = Registry(tmp_path / name / "cal")
        for at, unit in enumerate(units):
            path = write_session(
                tmp_path / name / f"s{at}",
                dt.date(2020, 1, 1 + at),
                check_errors=(0.1 * (-1) ** at, 0.0, 0.0),
            )
            if unit == "L":
                for file in (path.parent / "loads.csv", path.parent / "check.csv"):
                    header, *rows = file.read_text().strip().split("\n")
                    cells = [row.split(",") for row in rows]
                    for row in cells:
                        row[1] = repr(float(row[1]) / lbf)
                    body = [",".join(row) for row in cells]
                    file.write_text("\n".join([header.replace("FY [N]", "FY [lbf]"), *body]) + "\n")
            made = calibrate(path, registry)
            if at == 0:
                put_in_force(registry, made)
        charts.append(control_chart(registry, "cell"))
    plain, mixed = charts
    assert len(plain.series) == len(mixed.series) == 3
    for one, other in zip(plain.series, mixed.series, strict=True):
        assert (one.unit, other.unit) == ("N", "lbf")
        assert len(one.points) == len(other.points) == 5
        for a, b in zip(one.points, other.points, strict=True):
            assert b.error * lbf == pytest.approx(a.error, abs=1e-6)
