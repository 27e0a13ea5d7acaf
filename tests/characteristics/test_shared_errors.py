"""What a session states goes into characteristics: by finite differences and trials."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.characteristics.weighted_sums import calibration_u
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.uncertainty.common_errors import record_covariance
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.shared_errors import SharedErrors
from toolkit.lab.home import packaged_home
from toolkit.machine import TypeB, load_machine
from toolkit.pipeline import TestResult, process, read_test
from toolkit.recording.folder import read_test_folder

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.characteristics.groups import Group
    from toolkit.reduction.model import Condition

MACHINE = load_machine("m15-virtual")
STATED: dict[str, Any] = {
    "reference": {"uncertainty": {"FY": {"U": 4.0, "k": 2, "unit": "lbf"},
                                  "MZ": {"U": 0.5, "k": 2, "unit": "lbf*ft"}}},
    "cells": {"D51": {"u": 1e-4}, "D52": {"u": 2e-4}, "E5": {"u": 1e-4}},
}  # fmt: skip


def stating(record: CalibrationRecord, **settings: Any) -> CalibrationRecord:
    return dataclasses.replace(record, settings=json.dumps(settings))


@pytest.fixture(scope="module")
def fitted() -> CalibrationRecord:
    return Registry(packaged_home() / "calibrations").load("m15-virtual-r1")


@pytest.fixture(scope="module")
def result(virtual_test: Path, fitted: CalibrationRecord) -> TestResult:
    test = read_test_folder(virtual_test)
    return process(test, read_test(test), fitted)


def shared_errors_of(record: CalibrationRecord) -> SharedErrors:
    none = {
        name: TypeB(symbol=name, u=0.0, relative=0.0, source="")
        for name in ("SA", "SA_scale", "FZ", "P", "zero")
    }
    return SharedErrors(record=record, machine_axes=MACHINE.axes, tared=True, **none)


def weights_at_zero(group: Group) -> list[tuple[Condition, float]]:
    """The line through the two conditions on both sides of zero."""
    SA = group.SA
    right = int(np.searchsorted(SA, 0.0))
    share = -SA[right - 1] / (SA[right] - SA[right - 1])
    return [(group.conditions[right - 1], 1 - share), (group.conditions[right], share)]


def slope_weights(group: Group) -> list[tuple[Condition, float]]:
    """The least-squares slope through the conditions within 2 deg of zero."""
    near = [c for c in group.conditions if abs(c.SA) <= np.radians(2.0)]
    rest = np.array([c.SA for c in near]) - np.mean([c.SA for c in near])
    return list(zip(near, (rest / (rest @ rest)).tolist(), strict=True))


def test_a_record_that_states_nothing_has_the_covariance_of_its_fit(fitted: CalibrationRecord) -> None:
    for one in fitted.loads:
        assert np.array_equal(record_covariance(stating(fitted))[one.load], np.asarray(one.covariance))


def test_a_record_without_a_fit_has_none(virtual_record: CalibrationRecord) -> None:
    assert record_covariance(virtual_record) == {}


@pytest.mark.parametrize("channel", ["FY", "MZ"])
def test_a_weighted_sum_against_trials(channel: str, fitted: CalibrationRecord, result: TestResult) -> None:
    """Draw the reference's scale, the cells' shifts and the coefficients; compute the loads anew."""
    record = stating(fitted, **STATED)
    one = record.load(channel)
    rng = np.random.default_rng(21)
    trials = 20_000
    factor = 4.4482216152605 if channel == "FY" else 1.3558179483314004  # lbf, lbf·ft in SI
    conditions = [c for c in result.reduced.used() if c.FY_common is not None][:6]
    weights = rng.normal(size=len(conditions))
    x = np.array([c.indications for c in conditions])
    c = rng.multivariate_normal(one.coefficients, np.asarray(one.covariance), trials)
    u_reference = STATED["reference"]["uncertainty"][channel]["U"] / 2
    scale = 1 + rng.normal(0, u_reference / one.largest, trials)
    shift = rng.normal(0, [1e-4, 2e-4, 1e-4], (trials, 3))
    loads = np.einsum("tk,tik->ti", c[:, :3], x[None] + shift[:, None]) + c[:, 3:]
    # The virtual machine's cells stand in its own axes: the signs are those of the conditions' rotation.
    from toolkit.channels import signs

    sign = np.array([signs(MACHINE.axes, "SAE", one.rotation)[channel] for one in conditions])
    sums = (loads * scale[:, None]) @ (weights * sign) * factor
    found = calibration_u(
        shared_errors_of(record), channel, list(zip(conditions, weights.tolist(), strict=True))
    )
    assert found == pytest.approx(float(sums.std(ddof=1)), rel=0.02)


def test_a_scale_error_stays_in_proportion(fitted: CalibrationRecord, result: TestResult) -> None:
    """Finite difference: all loads one per cent larger move any sum by one per cent of itself."""
    record = stating(fitted, reference=STATED["reference"])
    bare = stating(fitted)
    groups_of = {g.load_N: g for g in _groups(result)}
    for group in groups_of.values():
        parts = slope_weights(group)
        value = sum(w * c.FY for c, w in parts)
        both, alone = (calibration_u(shared_errors_of(r), "FY", parts) for r in (record, bare))
        relative = 2.0 / record.load("FY").largest
        assert np.sqrt(both**2 - alone**2) == pytest.approx(abs(value) * relative, rel=1e-3)


def test_a_shift_cancels_in_a_slope_and_is_whole_at_zero(
    fitted: CalibrationRecord, result: TestResult
) -> None:
    record, bare = stating(fitted, cells=STATED["cells"]), stating(fitted)
    c = fitted.load("FY").coefficients
    shift = 4.4482216152605 * float(np.hypot.reduce([c[0] * 1e-4, c[1] * 2e-4, c[2] * 1e-4]))
    group = _groups(result)[0]
    slope, zero = slope_weights(group), weights_at_zero(group)
    assert calibration_u(shared_errors_of(record), "FY", slope) == pytest.approx(
        calibration_u(shared_errors_of(bare), "FY", slope), rel=1e-9
    )
    both, alone = (calibration_u(shared_errors_of(r), "FY", zero) for r in (record, bare))
    assert np.sqrt(both**2 - alone**2) == pytest.approx(shift, rel=1e-6)


def test_every_characteristic_holds_what_is_stated(fitted: CalibrationRecord, result: TestResult) -> None:
    few, many = (
        characterise(result.reduced, machine=MACHINE, record=stating(fitted, **settings))
        for settings in ({}, STATED)
    )
    for before, after in zip(few.rows, many.rows, strict=True):
        if before.estimate is not None:
            assert after.estimate is not None
            assert after.estimate.value == before.estimate.value
            assert after.estimate.u > before.estimate.u, before.name


def test_the_residual_torque_moves_as_its_curves_do(fitted: CalibrationRecord, result: TestResult) -> None:
    """Finite difference: shift FY and MZ of every condition and fit again."""
    shifts = {"FY": 20.0, "MZ": 0.5}  # N, N·m
    base = characterise(result.reduced, machine=MACHINE, record=None)
    for channel, size in shifts.items():
        # An intercept that is uncertain by the shift, in a load that the cells' axes give.
        moved = dataclasses.replace(
            result.reduced,
            conditions=tuple(
                dataclasses.replace(c, **{f"{channel}_common": getattr(c, f"{channel}_common") + size})
                for c in result.reduced.conditions
            ),
        )
        after = characterise(moved, machine=MACHINE, record=None)
        load = fitted.load(channel)
        cov = np.zeros((4, 4))
        cov[3, 3] = (size / (4.4482216152605 if channel == "FY" else 1.3558179483314004)) ** 2
        others = [dataclasses.replace(o, covariance=()) for o in fitted.loads if o.load != channel]
        only = dataclasses.replace(load, covariance=tuple(map(tuple, cov.tolist())))
        record = dataclasses.replace(stating(fitted), loads=(only, *others))
        wide = characterise(result.reduced, machine=MACHINE, record=record)
        name = "residual_forward"
        for rows in zip(base.of(name), after.of(name), wide.of(name), strict=True):
            one, other, u = (row.estimate for row in rows)
            assert one is not None
            assert other is not None
            assert u is not None
            assert np.sqrt(u.u**2 - one.u**2) == pytest.approx(abs(other.value - one.value), rel=0.06)


def _groups(result: TestResult) -> Any:
    from toolkit.characteristics.groups import group

    return [g for g in group(result.reduced) if g.rotation == "forward"]
