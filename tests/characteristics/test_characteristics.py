"""Characteristics against an independent tire, the virtual machine's truth, and what symmetry demands."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tire_factory import (
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
from weighted_sums import calibration_u

from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.groups import group
from toolkit.characteristics.model import Characteristics
from toolkit.characteristics.shared import Shared
from toolkit.machine import TypeB
from toolkit.pipeline import TestResult, process, read_test
from toolkit.recording.folder import read_test_folder

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord


def characteristics(**options: Any) -> Characteristics:
    return characterise(reduced_test(**options), machine=M15, record=None)


@pytest.mark.parametrize("offset_deg", [0.0, -0.3, 0.4])
def test_pull_is_found_whatever_the_steering_zero(offset_deg: float) -> None:
    (pull,) = characteristics(offset_deg=offset_deg).pull
    assert pull.conicity is not None
    assert pull.conicity.value == pytest.approx(CONICITY, abs=1e-3)
    assert pull.plysteer is not None
    assert pull.plysteer.value == pytest.approx(PLYSTEER, abs=1e-3)
    assert pull.CRAT is not None
    assert pull.CRAT.value == pytest.approx(CRAT, abs=1e-4)
    assert pull.PRAT is not None
    assert pull.PRAT.value == pytest.approx(PRAT, abs=1e-4)


def test_the_source_documents_pair_exchanges_the_names() -> None:
    # Thesis 6.2.1 on machine-fixed values: CRAT = (MZ_F + MZ_R)/2, PRAT = (MZ_F - MZ_R)/2.
    (pull,) = characteristics().pull
    assert pull.thesis_CRAT == pull.PRAT
    assert pull.thesis_PRAT == pull.CRAT


def test_a_zero_of_the_slip_angle_stays_in_plysteer_and_cancels_in_conicity() -> None:
    (pull,) = characteristics().pull
    u_zero = M15.stated_uncertainty("SA").u
    assert pull.plysteer is not None
    assert pull.conicity is not None
    assert pull.plysteer.u == pytest.approx(C_FY * u_zero, rel=1e-4)
    # What is left of conicity is the load's: one load alone, so half a per cent of the value.
    assert pull.conicity.u == pytest.approx(0.005 * CONICITY, rel=1e-4)


def test_stiffness_by_slope_and_secant() -> None:
    (forward, reverse) = characteristics().stiffness
    one = math.radians(1)
    secant = float(curve(one, C_FY, PEAK, SHAPE_FY)) / one
    secant_MZ = float(curve(one, C_MZ, PEAK_MZ, SHAPE_MZ)) / one
    for found in (forward, reverse):
        assert found.slope_cornering is not None
        assert found.slope_cornering.value == pytest.approx(C_FY, rel=1e-5)
        assert found.secant_cornering is not None
        assert found.secant_cornering.value == pytest.approx(secant, rel=1e-9)
        assert found.secant_aligning is not None
        assert found.secant_aligning.value == pytest.approx(secant_MZ, rel=1e-9)


def test_one_direction_gives_no_pull() -> None:
    (pull,) = characteristics(directions=("forward",)).pull
    assert (pull.conicity, pull.plysteer, pull.CRAT, pull.PRAT, pull.PRAT_at_FY_zero) == (None,) * 5
    assert pull.residual_forward is not None
    assert pull.residual_reverse is None


def test_angles_of_one_sign_give_no_value_at_zero() -> None:
    found = characteristics(angles=(1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0))
    assert found.pull[0].conicity is None
    assert found.stiffness[0].secant_cornering is None


def test_too_few_angles_are_a_finding_and_null() -> None:
    found = characteristics(angles=(-1.0, 0.0, 1.0))
    assert found.fits[0].FY is None
    assert found.stiffness[0].slope_cornering is None
    assert found.stiffness[0].secant_cornering is not None
    assert [f.where for f in found.findings] == [
        f"drum {rotation}, 899 lbf (4000 N), FY and MZ" for rotation in ("forward", "reverse")
    ]


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
    for pull, true in zip(result.characteristics.pull, virtual_truth["per_load"], strict=True):
        estimate = getattr(pull, name)
        U, _ = estimate.expanded(0.999)
        assert abs(estimate.value - true["at_median"]["pull"][name]) <= U


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
    for found in result.characteristics.stiffness:
        step = steps[found.load_N]
        assert step is not None
        assert getattr(found, name).value == pytest.approx(true[round(step), found.rotation], rel=relative)


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
    shared = Shared(record=record, machine_axes="machine", tared=True, **none)
    forward = next(c for c in result.reduced.conditions if c.rotation == "forward")
    reverse = next(c for c in result.reduced.conditions if c.rotation == "reverse")
    # SAE axes that follow the travel: conicity is (F - R)/2 and plysteer (F + R)/2 there.
    assert calibration_u(shared, "FY", [(forward, 0.5), (reverse, -0.5)]) == pytest.approx(7.0)
    assert calibration_u(shared, "FY", [(forward, 0.5), (reverse, 0.5)]) == pytest.approx(0.0, abs=1e-9)
