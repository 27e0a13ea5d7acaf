"""Rounding of readings that replicates share: against figures worked by hand, and against drawn sessions."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.fit.test_readings import single
from toolkit.calibration.fit.rounding import Rounding
from toolkit.calibration.records.record import ROUNDING
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.uncertainty.common_errors import record_covariance, standard_errors

STEP, SLOPE = 0.01, 500.0


def slope_u(reading: np.ndarray) -> float:
    """Return the standard uncertainty of a slope through zero by the rounding of its readings."""
    operator = (reading / (reading @ reading))[None, :]
    rounding = Rounding(terms=("S",), coefficients=(SLOPE,), columns={"S": reading}, resolutions={"S": STEP})
    return math.sqrt(rounding.covariance(operator)[0, 0])


@pytest.mark.parametrize("replicates", [1, 3, 50])
def test_replicates_share_their_rounding_however_many_there_are(replicates: int) -> None:
    # F = c x at one size of reading X: x off by e makes c off by -c e / X, e = STEP / sqrt(12).
    one = SLOPE * STEP / math.sqrt(12) / 2.0
    assert slope_u(np.full(replicates, 2.0)) == pytest.approx(one)
    # The reading of the opposite load is rounded to the opposite side, and tells no more.
    assert slope_u(np.tile([2.0, -2.0], replicates)) == pytest.approx(one)


def test_readings_of_different_size_round_independently() -> None:
    # dc = -c sum(x_i e_i) / sum(x_i^2): two sizes of 1 and 2 leave c u sqrt(1 + 4) / 5.
    assert slope_u(np.array([1.0, 2.0])) == pytest.approx(SLOPE * STEP / math.sqrt(12) * math.sqrt(5) / 5)


def drawn(folder: Path, seed: int, stated: bool) -> tuple[Path, np.ndarray]:
    """Write a session of two cells whose readings are rounded far above their noise; return the truth."""
    rng = np.random.default_rng(seed)
    truth = np.array([[3000.0, 3000.0], [300.0, -300.0]]) * (1 + rng.uniform(-0.05, 0.05, (2, 2)))
    response = np.linalg.inv(truth)
    lines = ["run,direction,A [mV/V],B [mV/V],F [N],M [N*m]"]
    for run in (1, 2, 3):
        for axis, largest in ((0, 2000.0), (1, 200.0)):
            for share in (0.0, 0.25, 0.5, 0.75, 1.0, -0.25, -0.5, -0.75, -1.0):
                load = np.zeros(2)
                load[axis] = share * largest
                read = np.round((response @ load + rng.normal(0, 1e-5, 2)) / 1e-3) * 1e-3
                lines.append(f"{run},up,{read[0]:.3f},{read[1]:.3f},{load[0]},{load[1]}")
    folder.mkdir()
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    cells = "".join(f'[cells.{name}]\nresolution = {{ value = 0.001, unit = "mV/V" }}\n' for name in "AB")
    (folder / "SESSION.toml").write_text(
        'instrument = "two"\ndate = 2026-01-05\noperator = "A"\nindications = ["A", "B"]\n'
        'loads = ["F", "M"]\ndata = "loads.csv"\n' + (cells if stated else "")
    )
    return folder / "SESSION.toml", truth


@pytest.mark.campaign(
    "hundreds of drawn sessions: what rounding adds stands against its formula in every run"
)
def test_coefficients_lie_within_their_standard_errors_as_often_as_they_say(tmp_path: Path) -> None:
    inside = dict.fromkeys((True, False), 0)
    for seed in range(30):
        for stated in inside:
            path, truth = drawn(tmp_path / f"{seed}{stated}", seed, stated)
            record = calibrate(path, Registry(tmp_path / f"r{seed}{stated}")).record
            off = np.abs(np.array(record.load("F").coefficients[:2]) - truth[0])
            inside[stated] += int((off <= 1.96 * np.array(standard_errors(record, "F")[:2])).sum())
    # Of 60 intervals of 95 %, 53 or more in all but one case of a hundred, the step stated or seen.
    assert min(inside.values()) >= 53


def test_a_record_with_a_stated_resolution_holds_it_and_loads_again(tmp_path: Path) -> None:
    tail = '[cells.S]\nresolution = { value = 0.001, unit = "mV/V" }\n'
    registry = Registry(tmp_path / "cal")
    record = calibrate(single(tmp_path / "a", tail), registry).record
    plain = calibrate(single(tmp_path / "b", instrument='"plain"'), registry).record
    assert (record.loads[0].rounding, plain.loads[0].rounding) == (ROUNDING, None)
    assert registry.load(record.id).sha256 == record.sha256
    assert standard_errors(record, "F")[0] > 3 * standard_errors(plain, "F")[0]


def test_printed_standard_errors_are_those_that_tests_inherit(tmp_path: Path) -> None:
    # U = 0.1 % of the load, k = 2, is an error that all rows share: 0.05 % of the coefficient, however many.
    tail = '[reference.uncertainty]\nF = { U = 0.1, k = 2, unit = "%" }\n'
    record = calibrate(single(tmp_path / "a", tail), Registry(tmp_path / "cal")).record
    (load,) = record.loads
    errors = standard_errors(record, "F")
    assert errors == pytest.approx(np.sqrt(np.diag(record_covariance(record)["F"])))
    assert errors[0] == pytest.approx(5e-4 * load.coefficients[0], rel=0.01)
    assert errors[0] > 20 * load.standard_errors[0]
