"""From indications to loads: the rows of Figure 4.4, the two kinds of zero, units, the Jacobian."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from toolkit.calibration.apply import apply_record, coefficient_jacobian
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import RecordError

LBF = 4.4482216152605
LBF_FT = LBF * 0.3048
# Thesis, Figure 4.4: D52, D51, E5, Fy, Mz as printed (lbf, lbf·ft), rows 2, 202 and 402.
FIG_4_4 = np.array([
    (86.06072, 98.59261, -182.415, 371.3554, -0.35393),
    (246.0777, 317.8654, -379.184, 950.8327, -8.31079),
    (300.6323, 495.981, -497.59, 1303.954, -27.1016),
])  # fmt: skip
CELLS = {"D52": FIG_4_4[:, 0], "D51": FIG_4_4[:, 1], "E5": FIG_4_4[:, 2]}
UNITS = dict.fromkeys(CELLS, "lbf")


@pytest.fixture(scope="module")
def records() -> tuple[CalibrationRecord, CalibrationRecord]:
    registry = Registry(Path(__file__).resolve().parents[2] / "calibrations")
    return registry.load("m15-r1"), registry.load("m15-r2")


def test_figure_4_4_was_computed_by_the_withdrawn_calibration(
    records: tuple[CalibrationRecord, CalibrationRecord],
) -> None:
    old, new = (apply_record(one, CELLS, units=UNITS) for one in records)
    # E5 is printed to 5e-4 lbf, hence 5.2e-4 lbf in Fy; in Mz the cells' 5e-5 lbf count.
    assert old["FY"] / LBF == pytest.approx(FIG_4_4[:, 3], abs=1.2e-3)
    assert old["MZ"] / LBF_FT == pytest.approx(FIG_4_4[:, 4], abs=6e-5)
    assert new["FY"][0] / LBF == pytest.approx(-1.79, abs=5e-3)


def test_the_intercept_applies_to_a_tared_record_and_cancels_in_one_with_its_zero_included(
    records: tuple[CalibrationRecord, CalibrationRecord],
) -> None:
    included = records[1]
    tared = dataclasses.replace(included, zero="tared")
    tare = {"D51": 10.0, "D52": -5.0, "E5": 2.0}
    at_tare = {name: np.array([value]) for name, value in tare.items()}
    assert apply_record(included, at_tare, units=UNITS, tare=tare)["FY"] == pytest.approx([0.0], abs=1e-12)
    assert apply_record(tared, at_tare, units=UNITS, tare=tare)["FY"] == pytest.approx([0.6473 * LBF])
    plain = apply_record(included, CELLS, units=UNITS)["FY"]
    less = apply_record(included, CELLS, units=UNITS, tare=tare)["FY"]
    offset = 0.99719 * 10 - 0.99718 * 5 + 1.0228 * 2 + 0.6473
    assert plain - less == pytest.approx(np.full(3, offset * LBF))


@pytest.mark.parametrize("tare", [None, {"D51": 10.0, "D52": -5.0, "E5": 2.0}])
@pytest.mark.parametrize("zero", ["included", "tared"])
def test_the_jacobian_times_the_coefficients_is_the_load(
    records: tuple[CalibrationRecord, CalibrationRecord], zero: str, tare: dict[str, float] | None
) -> None:
    record = dataclasses.replace(records[1], zero=zero)  # type: ignore[arg-type]
    jacobian = coefficient_jacobian(record, "MZ", CELLS, tare)
    assert jacobian.shape == (3, 4)
    load = apply_record(record, CELLS, units=UNITS, tare=tare)["MZ"]
    assert jacobian @ record.load("MZ").coefficients * LBF_FT == pytest.approx(load)


def test_units_and_missing_indications_are_refused(
    records: tuple[CalibrationRecord, CalibrationRecord],
) -> None:
    for units in ({**UNITS, "E5": "N"}, {**UNITS, "E5": "mV/V"}, {"D51": "lbf"}):
        with pytest.raises(RecordError) as caught:
            apply_record(records[1], CELLS, units=units)
        assert caught.value.rule == "units"
    with pytest.raises(RecordError):
        apply_record(records[1], {"D51": np.zeros(1)}, units=UNITS)
    with pytest.raises(RecordError):
        coefficient_jacobian(records[1], "FX", CELLS)
    same = apply_record(records[1], CELLS, units=dict.fromkeys(CELLS, "lb"))
    assert same["FY"] == pytest.approx(apply_record(records[1], CELLS, units=UNITS)["FY"])


def test_issued_coefficients_move_a_load_by_less_than_their_digits(registry: Registry) -> None:
    record = registry.load("hub-r1")
    rng = np.random.default_rng(0)
    cells = {cell.name: rng.uniform(cell.minimum or 0, cell.maximum or 0, 20) for cell in record.cells}
    units = dict(zip(record.indications, record.indication_units, strict=True))
    full = apply_record(record, cells, units=units)
    issued = apply_record(record, cells, units=units, issued=True)
    for one in record.loads:
        assert one.issued != one.coefficients
        scale = 1.3558179483314004 if one.load[0] == "M" else LBF
        # Four terms, each rounded by at most 1e-5 of the largest load.
        assert np.abs(full[one.load] - issued[one.load]).max() <= 4e-5 * one.largest * scale
