"""ISO 376: errors computed by hand, and every limit from both sides."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from toolkit.calibration.standards.iso376 import LIMITS, Iso376Result, Iso376Run, evaluate_iso376
from toolkit.errors import SessionError

FORCE = 1000.0 * np.arange(1, 9)
LINE = tuple((FORCE / 4000).tolist())  # 2 mV/V at 8000 N


def scaled(percent: float) -> tuple[float, ...]:
    return tuple(x * (1 + percent / 100) for x in LINE)


def ideal(**change: Any) -> Iso376Result:
    """Evaluate a perfect instrument with something changed."""
    runs = [Iso376Run(rotation_deg=angle, up=LINE, down=LINE) for angle in (0, 0, 120, 240)]
    given = {"force": FORCE, "runs": runs, "force_uncertainty": 0.005, "resolution": 1e-6, **change}
    return evaluate_iso376(**given)


def test_a_perfect_instrument_is_of_class_00() -> None:
    found = ideal(creep=(2.0, 2.0))
    assert found.class_name == "00"
    assert found.reasons == ()
    assert all(abs(row.fc) < 1e-9 and row.b == row.b_same == row.v == 0 for row in found.forces)
    assert (found.f0, found.c) == (0.0, 0.0)
    assert found.coefficients == pytest.approx((0, 1 / 4000, 0, 0), abs=1e-12)
    assert [(r.class_name, r.lower, r.upper) for r in found.ranges] == [
        (name, 1000.0, 8000.0) for name in ("00", "0.5", "1", "2")
    ]


def test_the_errors_by_hand() -> None:
    # At every force: X1 = X, X2 = X + 0.01 %, X3 = X + 0.06 %, X5 = X - 0.03 %; decreasing X' of the rotated
    # runs off by +0.10, -0.05 and +0.03 % of their own X; the standard takes the turned mountings' alone.
    # The mean of X1, X3, X5 is X (1 + 0.0001).
    runs = [
        Iso376Run(rotation_deg=0, up=scaled(0), down=tuple(x * 1.0010 for x in scaled(0))),
        Iso376Run(rotation_deg=0, up=scaled(0.01), zero_before=0.001, zero_after=0.0012),
        Iso376Run(rotation_deg=120, up=scaled(0.06), down=tuple(x * 0.9995 for x in scaled(0.06))),
        Iso376Run(rotation_deg=240, up=scaled(-0.03), down=tuple(x * 1.0003 for x in scaled(-0.03))),
    ]
    found = ideal(runs=runs, creep=(2.0000, 2.0004))
    row = found.forces[3]
    assert row.force == 4000
    assert row.deflection == pytest.approx(1.0001)
    assert row.b == pytest.approx(0.09 / 1.0001)
    assert row.b_same == pytest.approx(0.01 / 1.00005)
    assert row.v == pytest.approx((0.05 + 0.03) / 2)
    assert row.fc == pytest.approx(0, abs=1e-9)
    assert found.f0 == pytest.approx(100 * 0.0002 / 2.0002)
    assert found.c == pytest.approx(100 * 0.0004 / 2.0002)
    # b = 0.09 % is above 0.05 (00) and within 0.10 (0.5); all else would be class 00.
    assert {one.class_name for one in found.forces} == {"0.5"}
    assert found.class_name == "0.5"
    assert len(found.reasons) == 8
    assert all("b = 0.08999 %, class 00 allows 0.05 %" in reason for reason in found.reasons)


def test_the_interpolation_error_of_a_kink_by_hand() -> None:
    # A straight line through 8 deflections of which one is off by e: the residual there is e (1 - h),
    # h = 1/8 + (F - mean)^2 / sum (F - mean)^2 = 1/8 + 0.5^2 / 42 at the fourth force.
    e = 0.001
    kinked = tuple(x + e * (i == 3) for i, x in enumerate(LINE))
    found = ideal(
        runs=[Iso376Run(rotation_deg=a, up=kinked, down=kinked) for a in (0, 0, 120, 240)], degree=1
    )
    row = found.forces[3]
    residual = e * (1 - 1 / 8 - 0.25 / 42)
    assert row.deflection == pytest.approx(1 + e)
    assert row.fc == pytest.approx(100 * residual / (1 + e - residual))
    assert row.interpolated == pytest.approx(1 + e - residual)


# Class: b b' fc f0 v c, uncertainty of the applied force, least force in resolutions (metrology, ISO 376).
TABLE = {
    "00": (0.05, 0.025, 0.025, 0.012, 0.07, 0.025, 0.01, 4000),
    "0.5": (0.10, 0.05, 0.05, 0.025, 0.15, 0.05, 0.02, 2000),
    "1": (0.20, 0.10, 0.10, 0.05, 0.30, 0.10, 0.05, 1000),
    "2": (0.40, 0.20, 0.20, 0.10, 0.50, 0.20, 0.10, 500),
}
NEXT = {"00": "0.5", "0.5": "1", "1": "2", "2": None}


def test_the_table_of_limits() -> None:
    assert {one.name: dataclasses.astuple(one)[1:] for one in LIMITS} == TABLE


def with_error(which: int, size: float) -> Iso376Result:
    """Evaluate an instrument whose only error is the one numbered, as in TABLE, of this size."""
    runs = [Iso376Run(rotation_deg=angle, up=LINE, down=LINE) for angle in (0, 0, 120, 240)]
    if which == 0:  # X5 below, X3 above by the same: the mean stays
        for i, part in ((2, size / 2), (3, -size / 2)):
            runs[i] = Iso376Run(rotation_deg=runs[i].rotation_deg, up=scaled(part), down=scaled(part))
    elif which == 1:  # X2 - X1 relative to their mean
        x2 = 100 * ((1 + size / 200) / (1 - size / 200) - 1)
        runs[1] = Iso376Run(rotation_deg=0, up=scaled(x2))
    elif which == 3:
        runs[2] = dataclasses.replace(runs[2], zero_after=-2.0 * size / 100)
    elif which == 4:
        runs = [dataclasses.replace(one, down=scaled(size)) for one in runs]
    elif which == 5:
        return ideal(creep=(2.0, 2.0 - 2.0 * size / 100))
    elif which == 6:
        return ideal(force_uncertainty=size)
    elif which == 7:  # the smallest force is 1000 N, 0.25 mV/V
        return ideal(resolution=0.25 / size)
    return ideal(runs=runs)


@pytest.mark.parametrize("which", [0, 1, 3, 4, 5, 6, 7])
@pytest.mark.parametrize("name", TABLE)
def test_each_limit_from_both_sides(name: str, which: int) -> None:
    limit = TABLE[name][which]
    worse = 0.999 if which == 7 else 1.001
    assert with_error(which, limit).forces[0].class_name == name
    assert with_error(which, limit / worse).forces[0].class_name == name
    beyond = with_error(which, limit * worse)
    assert beyond.forces[0].class_name == NEXT[name]
    assert beyond.class_name == NEXT[name]
    assert beyond.forces[0].reasons


def test_the_limits_of_the_interpolation_error() -> None:
    residual = 1 - 1 / 8 - 0.25 / 42
    for name, values in TABLE.items():
        for share, expected in ((0.999, name), (1.001, NEXT[name])):
            # fc = r / (1 + e - r) at the fourth force, r = e (1 - h): solved for e.
            f = share * values[2] / 100
            e = f / (residual - f * (1 - residual))
            kinked = tuple(x + e * (i == 3) for i, x in enumerate(LINE))
            runs = [Iso376Run(rotation_deg=a, up=kinked, down=kinked) for a in (0, 0, 120, 240)]
            assert ideal(runs=runs, degree=1).forces[3].class_name == expected


def test_a_small_force_lowers_its_own_class_and_the_ranges_say_where_the_better_one_begins() -> None:
    # 1000 N are 3000 resolutions (class 0.5), 2000 N are 6000 (class 00).
    found = ideal(resolution=0.25 / 3000)
    assert [row.class_name for row in found.forces] == ["0.5"] + ["00"] * 7
    assert found.class_name == "0.5"
    assert found.reasons == ("1000: the force is 3000 resolutions, class 00 needs 4000",)
    assert [(one.class_name, one.lower) for one in found.ranges][:2] == [("00", 2000.0), ("0.5", 1000.0)]
    assert found.resolution == pytest.approx(1 / 3)


@pytest.mark.parametrize(("least", "class_name"), [(0.02, "00"), (0.0199, None)])
def test_no_class_holds_below_two_percent_of_the_largest_force(least: float, class_name: str | None) -> None:
    # ISO 376, minimum force: not below 0.02 of the transducer's largest force, beside 4000 r for class 00.
    force = 50_000.0 * np.array([least, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0])
    line = tuple((force / 25_000).tolist())
    runs = [Iso376Run(rotation_deg=angle, up=line, down=line) for angle in (0, 0, 120, 240)]
    found = ideal(force=force, runs=runs, resolution=1e-7)
    assert found.forces[0].class_name == found.class_name == class_name
    assert {row.class_name for row in found.forces[1:]} == {"00"}
    # The forces above it keep their class, and the ranges begin there.
    assert {one.lower for one in found.ranges} == {force[0] if class_name else force[1]}
    if class_name is None:
        assert found.reasons == ("995: the force is 1.99 % of the largest, a class needs 2 %",)


def test_a_class_that_does_not_reach_half_of_the_largest_force_is_no_range() -> None:
    uncertainty = np.where(FORCE < 5000, 0.015, 0.005)
    found = ideal(force_uncertainty=uncertainty)
    assert [one.class_name for one in found.ranges] == ["0.5", "1", "2"]


def test_no_class_at_all_says_why() -> None:
    found = ideal(force_uncertainty=0.2)
    assert found.class_name is None
    assert found.ranges == ()
    assert "U = 0.2 %, class 2 allows 0.1 %" in found.reasons[0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"preloads": 2}, "2 preloads"),
        ({"force": FORCE[:7], "runs": [Iso376Run(rotation_deg=a, up=LINE[:7], down=LINE[:7])
                                       for a in (0, 0, 120, 240)]}, "7 forces"),
        ({"runs": [Iso376Run(rotation_deg=a, up=LINE, down=LINE) for a in (0, 0, 90, 240)]}, "0, 90, 240"),
        ({"runs": [Iso376Run(rotation_deg=a, up=LINE) for a in (0, 0, 120, 240)]}, "neither"),
    ],
)  # fmt: skip
def test_another_procedure_leaves_figures_without_an_overall_class(change: dict[str, Any], told: str) -> None:
    found = ideal(**change)
    assert found.class_name is None
    assert found.ranges == ()
    assert any(told in reason for reason in found.procedure)
    assert {row.class_name for row in found.forces} == {"00"}


def test_creep_stands_in_for_decreasing_forces() -> None:
    runs = [Iso376Run(rotation_deg=a, up=LINE) for a in (0, 0, 120, 240)]
    found = ideal(runs=runs, creep=(2.0, 2.0))
    assert found.class_name == "00"
    assert found.forces[0].v is None


@pytest.mark.parametrize(
    ("change", "told", "empty"),
    [
        (
            {"runs": [Iso376Run(rotation_deg=a, up=LINE, down=LINE) for a in (0, 120, 240)]},
            "repeated",
            "b_same",
        ),
        ({"runs": [Iso376Run(rotation_deg=0, up=LINE, down=LINE)] * 2}, "mounted at 0 deg", "b"),
        ({"runs": [Iso376Run(rotation_deg=a, up=LINE) for a in (0, 0, 120, 240)]}, "decreasing", "v"),
        ({"force_uncertainty": None}, "uncertainty is not stated", None),
        ({"resolution": None}, "resolution is not stated", None),
        ({"preloads": None}, "preloads are not stated", None),
        ({"preloads": 2}, "2 preloads", None),
    ],
)
def test_what_the_procedure_lacks_costs_the_class_and_not_the_figures(
    change: dict[str, Any], told: str, empty: str | None
) -> None:
    found = ideal(**change)
    assert found.class_name is None
    assert found.ranges == ()
    assert any(told in reason for reason in found.procedure)
    row = found.forces[0]
    assert row.deflection == pytest.approx(0.25)
    assert [name for name in ("b", "b_same", "v") if getattr(row, name) is None] == ([empty] if empty else [])


def test_a_zero_that_nobody_read_is_no_zero_error() -> None:
    runs = [
        Iso376Run(rotation_deg=a, up=LINE, down=LINE, zero_before=0.0, zero_after=None)
        for a in (0, 0, 120, 240)
    ]
    found = ideal(runs=runs)
    assert found.f0 is None
    assert found.class_name is None
    assert any("zero was not read" in reason for reason in found.procedure)


def test_decreasing_forces_at_the_first_mounting_alone_give_a_figure_and_no_class() -> None:
    runs = [Iso376Run(rotation_deg=a, up=LINE) for a in (0, 0, 120, 240)]
    runs[0] = dataclasses.replace(runs[0], down=scaled(0.02))
    found = ideal(runs=runs)
    assert found.forces[2].v == pytest.approx(0.02)
    assert found.class_name is None


def test_compression_with_negative_deflections_has_the_same_class() -> None:
    runs = [
        Iso376Run(rotation_deg=a, up=tuple(-x for x in LINE), down=tuple(-x for x in LINE))
        for a in (0, 0, 120, 240)
    ]
    assert ideal(runs=runs).class_name == "00"


@pytest.mark.parametrize(
    "change",
    [
        {"degree": 0}, {"degree": 4}, {"resolution": 0.0}, {"force": FORCE[::-1]}, {"force": FORCE - 1000},
        {"force": FORCE[:3]}, {"force_uncertainty": -1.0}, {"force_uncertainty": np.array([0.1, 0.2])},
        {"creep": (np.nan, 1.0)}, {"runs": []},
        {"runs": [Iso376Run(rotation_deg=a, up=LINE[1:]) for a in (0, 0, 120, 240)]},
        {"runs": [Iso376Run(rotation_deg=a, up=(0.0, *LINE[1:])) for a in (0, 0, 120, 240)]},
        {"runs": [Iso376Run(rotation_deg=a, up=LINE, zero_after=np.nan) for a in (0, 0, 120, 240)]},
    ],
)  # fmt: skip
def test_what_cannot_be_evaluated_is_an_error(change: dict[str, Any]) -> None:
    with pytest.raises(SessionError) as caught:
        ideal(**change)
    assert caught.value.rule == "iso376"
