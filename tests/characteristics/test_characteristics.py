"""Characteristics against an independent tire, the virtual machine's truth, and what symmetry demands."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.characteristics.tire_factory import (
    C_FY,
    C_MZ,
    CONICITY,
    CRAT,
    LOAD,
    M15,
    PEAK,
    PEAK_MZ,
    PLYSTEER,
    PRAT,
    SHAPE_FY,
    SHAPE_MZ,
    curve,
    reduced_test,
)
from tests.characteristics.weighted_sums import calibration_u
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.groups import group
from toolkit.characteristics.model import Characteristics
from toolkit.characteristics.shared_errors import SharedErrors
from toolkit.estimate import Estimate
from toolkit.machine import TypeB
from toolkit.pipeline import TestResult, process, read_test
from toolkit.recording.folder import read_test_folder

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord


def characteristics(**options: Any) -> Characteristics:
    return characterise(reduced_test(**options), machine=M15, record=None)


def estimates(found: Characteristics, rotation: str = "both") -> dict[str, Estimate | None]:
    """What the one load of the tire's tests has, by name."""
    assert found.loads_N == (LOAD,)
    return {row.name: row.estimate for row in found.rows if row.rotation == rotation and row.SA_rad is None}


@pytest.mark.parametrize("offset_deg", [0.0, -0.3, 0.4])
@pytest.mark.parametrize(
    ("name", "true", "room"),
    [("conicity", CONICITY, 1e-3), ("plysteer", PLYSTEER, 1e-3), ("CRAT", CRAT, 1e-4), ("PRAT", PRAT, 1e-4)],
)
def test_pull_is_found_whatever_the_steering_zero(
    offset_deg: float, name: str, true: float, room: float
) -> None:
    (row,) = characteristics(offset_deg=offset_deg).of(name)
    assert row.estimate is not None
    assert row.estimate.value == pytest.approx(true, abs=room)


def test_the_source_documents_pair_exchanges_the_names() -> None:
    # Thesis 6.2.1 on machine-fixed values: CRAT = (MZ_F + MZ_R)/2, PRAT = (MZ_F - MZ_R)/2.
    pull = estimates(characteristics())
    assert pull["thesis_CRAT"] == pull["PRAT"]
    assert pull["thesis_PRAT"] == pull["CRAT"]


def test_a_zero_of_the_slip_angle_stays_in_plysteer_and_cancels_in_conicity() -> None:
    pull = estimates(characteristics())
    u_zero = M15.stated_uncertainty("SA").u
    assert pull["plysteer"] is not None
    assert pull["conicity"] is not None
    assert pull["plysteer"].u == pytest.approx(C_FY * u_zero, rel=1e-4)
    # What is left of conicity is the load's: one load alone, so half a per cent of the value.
    assert pull["conicity"].u == pytest.approx(0.005 * CONICITY, rel=1e-4)


@pytest.mark.parametrize("rotation", ["forward", "reverse"])
def test_stiffness_by_slope_and_secant(rotation: str) -> None:
    stiffness = estimates(characteristics(), rotation)
    one = math.radians(1)
    secant = float(curve(one, C_FY, PEAK, SHAPE_FY)) / one
    secant_MZ = float(curve(one, C_MZ, PEAK_MZ, SHAPE_MZ)) / one
    for name, true, room in (
        ("slope_cornering", C_FY, 1e-5),
        ("secant_cornering", secant, 1e-9),
        ("secant_aligning", secant_MZ, 1e-9),
    ):
        estimate = stiffness[name]
        assert estimate is not None
        assert estimate.value == pytest.approx(true, rel=room)


def test_one_direction_gives_no_pull() -> None:
    found = characteristics(directions=("forward",))
    pull = estimates(found)
    for name in ("conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero", "residual_reverse"):
        assert pull[name] is None
        assert found.of(name)[0].lacking == "no run with the drum reverse"
    assert pull["residual_forward"] is not None


def test_angles_of_one_sign_give_no_value_at_zero() -> None:
    found = characteristics(angles=(1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0))
    assert found.at("conicity", LOAD) is not None
    assert found.of("conicity")[0].estimate is None
    assert found.of("conicity")[0].lacking == "no slip angles on both sides of zero"
    assert found.of("secant_cornering")[0].lacking == "no steps at +1 and -1 deg"


def test_too_few_angles_are_a_finding_and_null() -> None:
    found = characteristics(angles=(-1.0, 0.0, 1.0))
    assert found.fits[0].FY is None
    assert found.of("slope_cornering")[0].estimate is None
    assert found.of("slope_cornering")[0].lacking == "no fitted curve of FY"
    assert found.of("secant_cornering")[0].estimate is not None
    assert [f.where for f in found.findings] == [
        f"drum {rotation}, 899 lbf (4000 N), FY and MZ" for rotation in ("forward", "reverse")
    ]


def test_the_rows_are_one_tidy_table() -> None:
    found = characteristics(directions=("forward",))
    table = found.to_dataframe()
    assert len(table) == len(found.rows)
    row = table[table.characteristic == "slope_cornering"].iloc[0]
    assert row.value == pytest.approx(C_FY, rel=1e-5)
    assert row.high_95 - row.low_95 == pytest.approx(2 * row.U)
    assert row.U == pytest.approx(row.k * row.u)
    assert (row.unit, row.channel) == ("N/rad", "FY")
    assert table[table.value.notna() & table.lacking.notna()].empty
    assert table[table.characteristic == "PRAT"].iloc[0].lacking == "no run with the drum reverse"


def test_unplanned_loads_are_grouped_by_themselves() -> None:
    reduced = reduced_test()
    moved = tuple(
        dataclasses.replace(c, step_FZ=None, FZ_common=LOAD * (1 + 0.01 * (i % 3)))
        for i, c in enumerate(reduced.conditions)
    )
    groups = group(dataclasses.replace(reduced, conditions=moved))
    assert [g.rotation for g in groups] == ["forward", "reverse"]


@pytest.fixture(scope="module")
def result(virtual_test: Path, virtual_record: CalibrationRecord) -> TestResult:
    test = read_test_folder(virtual_test)
    return process(test, read_test(test), virtual_record)


@pytest.mark.parametrize("name", ["conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero"])
def test_pull_of_the_virtual_test_covers_the_truth(
    name: str, result: TestResult, virtual_truth: dict[str, Any]
) -> None:
    """Every value within its own expanded uncertainty, k for 99.9 % because there are five of each."""
    for row, true in zip(result.characteristics.of(name), virtual_truth["per_load"], strict=True):
        assert row.estimate is not None
        U, _ = row.estimate.expanded(0.999)
        assert abs(row.estimate.value - true["at_median"]["pull"][name]) <= U


@pytest.mark.parametrize(
    ("name", "relative"),
    [
        ("slope_cornering", 0.002),
        ("slope_aligning", 0.008),
        ("secant_cornering", 0.003),
        ("secant_aligning", 0.006),
    ],
)
def test_stiffness_of_the_virtual_test(
    name: str, relative: float, result: TestResult, virtual_truth: dict[str, Any]
) -> None:
    """Within the bias that a Magic Formula of one load leaves on the 1987 tire's own form."""
    true = {
        (round(load["step_load_N"]), one["rotation"]): one[name]
        for load in virtual_truth["per_load"]
        for one in load["at_median"]["stiffness"]
    }
    steps = {g.load_N: g.conditions[0].step_FZ for g in group(result.reduced)}
    rows = result.characteristics.of(name)
    assert len(rows) == 10
    for row in rows:
        step = steps[row.load_N]
        assert step is not None
        assert row.estimate is not None
        assert row.estimate.value == pytest.approx(true[round(step), row.rotation], rel=relative)


def test_a_common_zero_of_the_cells_is_certain_in_plysteer_and_not_in_conicity(
    result: TestResult, virtual_record: CalibrationRecord
) -> None:
    # Only the intercept is uncertain, by 7 N: in machine axes the same in both directions.
    size = len(virtual_record.loads[0].terms)
    covariance = np.zeros((size, size))
    covariance[-1, -1] = 49.0
    record = dataclasses.replace(
        virtual_record,
        loads=tuple(
            dataclasses.replace(one, covariance=tuple(map(tuple, covariance.tolist())))
            for one in virtual_record.loads
        ),
    )
    none = {
        name: TypeB(symbol=name, u=0.0, relative=0.0, source="")
        for name in ("SA", "SA_scale", "FZ", "P", "zero")
    }
    shared = SharedErrors(record=record, machine_axes="machine", tared=True, **none)
    forward = next(c for c in result.reduced.conditions if c.rotation == "forward")
    reverse = next(c for c in result.reduced.conditions if c.rotation == "reverse")
    # SAE axes that follow the travel: conicity is (F - R)/2 and plysteer (F + R)/2 there.
    assert calibration_u(shared, "FY", [(forward, 0.5), (reverse, -0.5)]) == pytest.approx(7.0)
    assert calibration_u(shared, "FY", [(forward, 0.5), (reverse, 0.5)]) == pytest.approx(0.0, abs=1e-9)
