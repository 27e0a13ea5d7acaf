"""ASTM E74 on the NIST load cell (Pontius) and on constructed data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from toolkit.calibration.standards.e74 import best_degree, degree_factor, evaluate_e74
from toolkit.errors import SessionError

# NIST Statistical Reference Datasets, Pontius: deflection at 150 000 .. 3 000 000 lbf, two runs.
PONTIUS = np.array([
    .11019, .21956, .32949, .43899, .54803, .65694, .76562, .87487, .98292, 1.09146,
    1.20001, 1.30822, 1.41599, 1.52399, 1.63194, 1.73947, 1.84646, 1.95392, 2.06128, 2.16844,
    .11052, .22018, .32939, .43886, .54798, .65739, .76596, .87474, .98300, 1.09150,
    1.20004, 1.30818, 1.41613, 1.52408, 1.63159, 1.73965, 1.84696, 1.95445, 2.06177, 2.16829,
])  # fmt: skip
LBF = np.tile(150000.0 * np.arange(1, 21), 2)
RUN = np.repeat([1, 2], 20)

# Degree: s_m, LLF [lbf], lack of fit F, as published.
GOLDEN = {1: (2.171e-3, 7159.5, 214.7), 2: (2.05177e-4, 676.5, 0.811), 3: (2.046e-4, 674.8, 0.794)}


@pytest.mark.parametrize("degree", GOLDEN)
def test_the_figures_of_pontius(degree: int) -> None:
    s_m, llf, F = GOLDEN[degree]
    found = evaluate_e74(force=LBF, indication=PONTIUS, run=RUN, resolution=1e-5, degree=degree)
    assert found.requested
    assert found.degree == degree
    assert found.curve.s_m == pytest.approx(s_m, rel=3e-4)
    assert found.llf == pytest.approx(llf, abs=0.05)
    assert found.curve.lack_of_fit is not None
    assert found.curve.lack_of_fit.F == pytest.approx(F, rel=7e-4)
    assert (found.curve.lack_of_fit.dof_lack, found.curve.lack_of_fit.dof_pure) == (19 - degree, 20)


def test_the_annex_chooses_the_certified_quadratic_and_two_runs_give_no_class() -> None:
    found = evaluate_e74(force=LBF, indication=PONTIUS, run=RUN, resolution=1e-5)
    assert found.degree == 2
    assert not found.requested
    assert [step.degree for step in found.steps] == [5, 4, 3, 2]
    assert found.curve.s_m == pytest.approx(0.205177424076185e-3, rel=1e-11)
    certified = (0.673565789473684e-3, 0.732059160401003e-6, -0.316081871345029e-14)
    assert found.curve.coefficients == pytest.approx(certified, rel=1e-11)
    assert (found.points, found.levels, found.runs) == (40, 20, 2)
    assert found.class_name is None
    assert all("2 runs" in reason for one in found.classes for reason in one.reasons)
    assert [one.lower_limit for one in found.classes] == pytest.approx(
        [2000 * 676.549, 400 * 676.549], rel=1e-5
    )


def test_a_third_run_brings_the_class() -> None:
    # 676.5 lbf x 2000 = 1.35e6 lbf: within the 3e6 lbf applied.
    found = evaluate_e74(
        force=np.concatenate([LBF, LBF[:20]]), indication=np.concatenate([PONTIUS, PONTIUS[:20]]),
        run=np.repeat([1, 2, 3], 20), resolution=1e-5,
    )  # fmt: skip
    assert found.class_name == "AA"
    assert found.classes[0].lower_limit == pytest.approx(2000 * found.llf)
    assert found.classes[0].upper_limit == 3e6


@pytest.mark.parametrize(
    ("n", "m", "published"),
    [(10, 2, 1.373), (10, 3, 1.455), (10, 4, 1.582), (10, 5, 1.801), (11, 2, 1.315), (20, 2, 1.131)],
)
def test_the_factors_of_the_annex(n: int, m: int, published: float) -> None:
    # The F quantiles behind them, 8.073 for (1, 7), 8.813, 10.007, 12.218 and 7.571, 6.042, are tabulated.
    assert degree_factor(n, m) == pytest.approx(published, abs=6e-4)


def test_the_annex_is_the_f_test_of_one_more_term() -> None:
    # SSE by another solver; s_(m-1)/s_m beats C(n, m) exactly where F of the added term beats its quantile.
    rng = np.random.default_rng(7)
    force = np.arange(1.0, 12.0)
    seen = set()
    for bend in np.linspace(0, 4e-3, 9):
        indication = force + bend * force**2 + rng.normal(0, 0.02, 11)
        sse = [float(np.sum((np.polyval(np.polyfit(force, indication, m), force) - indication) ** 2))
               for m in range(6)]  # fmt: skip
        _, steps = best_degree(force=force, indication=indication)
        for step in steps:
            m, dof = step.degree, 11 - step.degree - 1
            F = (sse[m - 1] - sse[m]) / (sse[m] / dof)
            assert step.better == (F > stats.f.ppf(0.975, 1, dof))
            seen.add(step.better)
    assert seen == {True, False}


def exact(run_noise: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three runs of ten forces on a straight line, shifted by +-noise from run to run."""
    force = np.tile(100.0 * np.arange(1, 11), 3)
    run = np.repeat([1, 2, 3], 10)
    return force, 0.002 * force + run_noise * (run - 2.0), run


def test_the_lower_limit_factor_is_never_below_the_resolution() -> None:
    force, indication, run = exact()
    found = evaluate_e74(force=force, indication=indication, run=run, resolution=1e-4)
    # 1e-4 at 0.002 per unit of force is a force of 0.05.
    assert found.llf == pytest.approx(0.05)
    assert found.resolution == pytest.approx(0.05)
    assert found.degree == 1
    # 400 resolutions are 20, 2000 are 100: both at or below the smallest force, where the ranges begin.
    assert [one.lower_limit for one in found.classes] == pytest.approx([100.0, 100.0])
    assert found.class_name == "AA"


def test_the_standard_deviation_by_hand() -> None:
    # Runs at -n, 0, +n about the line: sum of squares 20 n^2, 30 - 1 - 1 degrees of freedom.
    noise = 1e-3
    force, indication, run = exact(noise)
    found = evaluate_e74(force=force, indication=indication, run=run, resolution=1e-5, degree=1)
    assert found.curve.s_m == pytest.approx(noise * (20 / 28) ** 0.5)
    assert found.curve.dof == 28


@pytest.mark.parametrize(
    ("resolution", "granted", "told"),
    [
        (1e-4, "AA", ""),
        (1.01e-4, "A", "resolutions"),
        (4.9e-4, "A", "resolutions"),
        (5.1e-4, None, "resolutions"),
        (None, None, "not stated"),
    ],
)
def test_the_smallest_force_in_resolutions(resolution: float | None, granted: str | None, told: str) -> None:
    force, indication, run = exact()
    found = evaluate_e74(force=force, indication=indication, run=run, resolution=resolution)
    assert found.class_name == granted
    assert told in " ".join(reason for one in found.classes for reason in one.reasons)


def test_few_points_and_unstated_runs_leave_figures_without_a_class() -> None:
    force, indication, _ = exact(1e-6)
    found = evaluate_e74(force=force[:29], indication=indication[:29], resolution=1e-5)
    assert found.class_name is None
    assert found.llf > 0
    assert any("29 points" in reason for reason in found.classes[0].reasons)
    assert any("runs are not stated" in reason for reason in found.classes[0].reasons)


def test_a_lower_limit_above_the_largest_force_is_no_class() -> None:
    force, indication, run = exact(0.1)
    found = evaluate_e74(force=force, indication=indication, run=run, resolution=1e-5)
    assert found.class_name is None
    assert any("above the largest force" in reason for reason in found.classes[1].reasons)


def test_rows_at_zero_force_are_counted_and_left_out() -> None:
    force, indication, run = exact(1e-4)
    with_zero = evaluate_e74(
        force=np.append(force, 0.0),
        indication=np.append(indication, 5e-4),
        run=np.append(run, 4),
        resolution=1e-5,
    )
    without = evaluate_e74(force=force, indication=indication, run=run, resolution=1e-5)
    assert with_zero.zeros == 1
    assert (with_zero.llf, with_zero.runs) == (without.llf, 3)


@given(st.floats(1e-3, 1e3), st.sampled_from([1.0, -1.0]))
def test_a_change_of_the_forces_unit_or_sense_scales_the_limit(factor: float, sense: float) -> None:
    one = evaluate_e74(force=LBF, indication=PONTIUS, run=RUN, resolution=1e-5)
    other = evaluate_e74(force=LBF * factor, indication=sense * PONTIUS, run=RUN, resolution=1e-5)
    assert other.llf == pytest.approx(factor * one.llf, rel=1e-7)
    assert other.degree == one.degree
    assert other.ratio == pytest.approx(sense * factor * one.ratio, rel=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"degree": 0}, {"degree": 6}, {"resolution": 0.0}, {"resolution": np.nan},
        {"force": np.append(-1.0, LBF[1:])}, {"indication": np.append(np.nan, PONTIUS[1:])},
        {"indication": PONTIUS[1:]}, {"indication": np.append(-0.1, PONTIUS[1:])},
        {"force": LBF * 0}, {"force": LBF * 0 + 5.0}, {"run": RUN[1:]},
    ],
)  # fmt: skip
def test_what_cannot_be_evaluated_is_an_error(change: dict[str, object]) -> None:
    given_ = {"force": LBF, "indication": PONTIUS, "run": RUN, "resolution": 1e-5, **change}
    with pytest.raises(SessionError) as caught:
        evaluate_e74(**given_)  # type: ignore[arg-type]
    assert caught.value.rule == "e74"
    assert caught.value.next_step
