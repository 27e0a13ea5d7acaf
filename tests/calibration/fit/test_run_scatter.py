"""Variance components of a session: against statsmodels, closed forms, dense algebra, and forged records."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import hub_data
from tests.calibration.uncertainty_factory import record_of_table, table_of
from toolkit.calibration.fit.run_scatter import estimate, is_lowest, spread
from toolkit.calibration.fit.session_rows import Mean, SessionRows
from toolkit.calibration.records.scatter import RunScatter, rows_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.refit import check_reproduces
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_check, stored_loads
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.errors import RecordError, SessionError

Values = NDArray[np.float64]


def plain_rows(mean: Values, load: Values, group: Values) -> SessionRows:
    """Rows whose mean is given, with nothing else in it."""
    columns = np.linalg.qr(mean)[0]
    nothing = slice(columns.shape[1], columns.shape[1])
    relative = columns @ (columns.T @ load) / np.abs(load).max()
    return SessionRows(
        load=load, relative=relative, mean=Mean(columns=columns, misfit=nothing, direction=nothing),
        factor="run", group=group.astype(np.int64), own_zeros=False,
    )  # fmt: skip


def session(
    rng: np.random.Generator, runs: int, *, zero: float, gain: float, noise: float
) -> tuple[Values, ...]:
    """Indication [mV/V], load [N] and run of a cell of 2000 N per mV/V, loads scattered by 1 N."""
    load = np.tile(np.linspace(0.0, 4000.0, 12), runs) + rng.normal(0, 1.0, 12 * runs)
    run = np.repeat(np.arange(runs), 12)
    shift, stretch = rng.normal(0, zero, runs), rng.normal(0, gain, runs)
    read = load + shift[run] + stretch[run] * load / 4000 + rng.normal(0, noise, len(load))
    return read / 2000, load, run.astype(float)


def test_balanced_groups_have_the_estimates_of_an_analysis_of_variance() -> None:
    """One-way layout (Searle et al., 4.8): within^2 = MSW, zero^2 = (MSB - MSW) / k."""
    rng = np.random.default_rng(3)
    k, m = 10, 8
    group = np.repeat(np.arange(m), k).astype(float)
    y = 100.0 + rng.normal(0, 2.0, m).repeat(k) + rng.normal(0, 0.7, m * k)
    rows = plain_rows(np.ones((m * k, 1)), y, group)
    # The load is constant but for scatter: a gain is a zero, and takes no part.
    found = estimate(dataclasses.replace(rows, relative=np.zeros(m * k)))
    means = y.reshape(m, k).mean(axis=1)
    within = np.sum((y.reshape(m, k) - means[:, None]) ** 2) / (m * (k - 1))
    between = k * np.sum((means - means.mean()) ** 2) / (m - 1)
    assert found is not None
    assert found.correlation == 0.0
    assert found.within**2 == pytest.approx(within, rel=1e-5)
    assert found.zero**2 == pytest.approx((between - within) / k, rel=1e-4)


@pytest.mark.filterwarnings("ignore::Warning")  # the peer warns of its own convergence
def test_zeros_and_gains_are_those_of_statsmodels() -> None:
    from statsmodels.regression.mixed_linear_model import MixedLM

    for seed in (1, 2, 5):
        x, load, run = session(np.random.default_rng(seed), 6, zero=3.0, gain=4.0, noise=0.8)
        design = np.column_stack([x, np.ones(len(x))])
        rows = plain_rows(design, load, run)
        found = estimate(rows)
        assert found is not None
        assert found.correlation == 0.0
        effects = {
            "zero": (run[:, None] == np.unique(run)).astype(float),
            "gain": (run[:, None] == np.unique(run)) * rows.relative[:, None],
        }
        peer = MixedLM(
            load, design, groups=np.ones(len(x)),
            exog_vc={name: {1.0: values} for name, values in effects.items()},
        ).fit(reml=True, method=["lbfgs", "powell"])  # fmt: skip
        wanted = dict(zip(sorted(effects), peer.vcomp, strict=True))
        assert found.within**2 == pytest.approx(peer.scale, rel=5e-3)
        assert found.zero**2 == pytest.approx(wanted["zero"], rel=2e-2)
        assert found.gain**2 == pytest.approx(wanted["gain"], rel=2e-2)


def test_the_covariance_is_that_of_dense_algebra() -> None:
    rng = np.random.default_rng(4)
    x, load, run = session(rng, 3, zero=3.0, gain=2.0, noise=0.8)
    order = rng.permutation(len(x))  # rows of a run need not stand together
    x, load, run = x[order], load[order], run[order]
    design = np.column_stack([x, np.ones(len(x))])
    scatter = RunScatter(factor="run", groups=3, within=0.8, zero=3.0, gain=2.0, correlation=0.6, dof=28)
    relative = design @ np.linalg.lstsq(design, load, rcond=None)[0] / load.max()
    rows = rows_of(design, load, run.astype(np.int64))
    place = np.array([np.sum(run[:i] == run[i]) for i in range(len(run))])
    same = run[:, None] == run
    R = np.where(same, 0.6 ** np.abs(place[:, None] - place), 0.0)
    for root, part in zip(rows.roots(0.6), rows.parts(0.6), strict=True):
        np.testing.assert_allclose(root @ root.T, part, rtol=1e-12)
    V = 0.8**2 * R + 3.0**2 * same + 2.0**2 * same * np.outer(relative, relative)
    A = np.linalg.pinv(design)
    J = np.array([1.5, 1.0])
    (variance, _), (gradient, _) = rows.variance(scatter, np.array([J, 2 * J]))
    assert variance == pytest.approx(J @ A @ V @ A.T @ J, rel=1e-9)
    assert gradient[1] == pytest.approx(J @ A @ same @ A.T @ J, rel=1e-9)
    step = 1e-6
    lag = np.abs(place[:, None] - place)
    slope = (np.where(same, (0.6 + step) ** lag, 0.0) - np.where(same, (0.6 - step) ** lag, 0.0)) / (2 * step)
    assert gradient[3] == pytest.approx(0.8**2 * (J @ A @ slope @ A.T @ J), rel=1e-4)


def test_the_spread_of_balanced_estimates_is_known() -> None:
    """Var(MSW) = 2 MSW^2 / (m (k - 1)); Var(zero^2) = 2 [MSB^2 / (m - 1) + MSW^2 / (m (k - 1))] / k^2."""
    k, m = 10, 8
    rows = plain_rows(np.ones((m * k, 1)), np.linspace(99.0, 101.0, m * k), np.repeat(np.arange(m), k) * 1.0)
    rows = dataclasses.replace(rows, relative=np.zeros(m * k))
    scatter = RunScatter(factor="run", groups=m, within=0.7, zero=2.0, gain=0.0, correlation=0.0, dof=72)
    found = spread(rows, scatter)
    msb = 0.7**2 + k * 2.0**2
    # The correlation is estimated too; of independent rows it takes little of the within part.
    assert found[0, 0] == pytest.approx(2 * 0.7**4 / (m * (k - 1)), rel=0.05)
    assert found[1, 1] == pytest.approx(2 * (msb**2 / (m - 1) + 0.7**4 / (m * (k - 1))) / k**2, rel=0.01)


def test_an_optimum_holds_and_its_neighbours_do_not() -> None:
    for seed in range(6):
        x, load, run = session(np.random.default_rng(seed), 4, zero=3.0, gain=2.0, noise=0.8)
        table = table_of(x, load, run=run)
        rows = SessionRows.of(np.column_stack([x, np.ones(len(x))]), load, table, "included")
        found = estimate(rows)
        assert found is not None
        assert is_lowest(rows, found)
        changes = {"within": 1.001 * found.within, "zero": 1.5 * found.zero + 0.3, "dof": found.dof + 1,
                   "gain": 2 * found.gain + 0.5, "groups": found.groups + 1, "correlation": 0.7}  # fmt: skip
        for name, value in changes.items():
            assert not is_lowest(rows, dataclasses.replace(found, **{name: value})), name


@pytest.mark.parametrize("scatter", [0.0, 5e-6, 2.5e-4, 5e-4, 1e-3])
def test_reference_loads_that_scatter_leave_no_budget_without_degrees_of_freedom(scatter: float) -> None:
    """Loads near each other by chance gave U of 20 000 N on a 4 000 N cell, or a division by zero."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        load = np.tile(np.linspace(0.0, 4000.0, 5), 6) + rng.normal(0, 4000 * scatter, 30)
        run = np.repeat([1.0, 2.0, 3.0], 10)
        table = table_of((load + rng.normal(0, 0.8, 30)) / 2000, load, run=run)
        budget = calibration_budget(record_of_table(table), table, None, "F")
        assert budget.dof >= 1
        # The noise is 0.8 N: by chance the runs seem to differ, yet never by tens of newtons.
        assert 0.8 < budget.U < 20


def forged(scatter: RunScatter, name: str) -> RunScatter:
    value = getattr(scatter, name)
    return dataclasses.replace(scatter, **{name: value * 1.1 + (0.3 if name == "correlation" else 1e-3)})


@pytest.mark.parametrize("name", ["within", "zero", "gain", "correlation"])
def test_a_record_whose_scatter_was_changed_is_refused(
    make_session: Callable[..., Path], tmp_path: Path, name: str
) -> None:
    registry = Registry(tmp_path / "cal")
    record = registry.load(calibrate(make_session(), registry).record.id)
    table = stored_loads(registry.folder, record)
    assert table is not None
    (first, *others) = record.loads
    assert first.scatter is not None
    changed = dataclasses.replace(first, scatter=forged(first.scatter, name))
    check_reproduces(record, table)
    with pytest.raises(RecordError, match=r"scatter|covariance"):
        check_reproduces(dataclasses.replace(record, loads=(changed, *others)), table)


def drifting(values: Values) -> Values:
    """Rows whose run (twenty each) has a zero of its own."""
    moved = values.copy()
    moved[:, :3] += np.array([[0.0, 0.1, -0.2], [0.3, -0.1, 0.05], [-0.2, 0.2, 0.1]])[np.arange(60) // 20]
    return moved


def test_each_run_has_its_own_zero(make_session: Callable[..., Path], tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    check = np.vstack([np.zeros((1, 6)), hub_data(9, 2) - np.array([0.012, -0.008, 0.02, 0, 0, 0])])
    steady = calibrate(make_session(name="steady"), registry).record
    own = calibrate(
        make_session(drifting(hub_data(60, 1)), check_rows=check, name="own", zero='"run"'), registry
    )
    record = registry.load(own.record.id)
    assert record.zero == "run"
    for one, other in zip(record.loads, steady.loads, strict=True):
        # The same cells: only the zeros differ, by up to 0.3 mV/V or some 450 lbf.
        assert np.abs(np.array(one.coefficients[:3]) - other.coefficients[:3]).max() < 0.2
        assert one.scatter is not None
        assert one.scatter.zero == 0.0
    assert not [finding for finding in own.findings if finding.rule == "check-load"]
    table, stored = stored_check(registry.folder, record), stored_loads(registry.folder, record)
    assert table is not None
    assert stored is not None
    assert np.abs(table.column("D51")[0]) < 1e-12


def test_check_loads_without_their_zero_are_refused(
    make_session: Callable[..., Path], tmp_path: Path
) -> None:
    path = make_session(drifting(hub_data(60, 1)), zero='"run"')
    with pytest.raises(SessionError, match="have no zero"):
        calibrate(path, Registry(tmp_path / "cal"))
    assert not list(tmp_path.glob("cal/*/*.json"))


def test_what_one_run_cannot_tell_may_be_stated(make_session: Callable[..., Path], tmp_path: Path) -> None:
    """C = s^2 (X'X)^-1 + zero^2 C_z + gain^2 C_g: one run's zero moves the intercept, its gain the slopes."""
    tail = "[between_runs.FY]\nzero = 2.0\ngain = 3.0\nunit = 'N'\n"
    paths = [make_session(name="plain"), make_session(name="stated", tail=tail)]
    for path in paths:
        rows = (path.parent / "loads.csv").read_text()
        (path.parent / "loads.csv").write_text(re.sub(r"(?m),\d+,(up|down)$", r",1,\1", rows))
    registry = Registry(tmp_path / "cal")
    plain, stated = (registry.load(calibrate(path, registry).record.id) for path in paths)
    before, after = plain.loads[0], stated.loads[0]
    zero, gain = 2.0 / 4.4482216152605, 3.0 / 4.4482216152605
    added = np.asarray(after.covariance) - np.asarray(before.covariance)
    c = np.asarray(before.coefficients) / before.largest
    wanted = gain**2 * np.outer(c, c)
    wanted[3, 3] += zero**2
    assert added == pytest.approx(wanted, rel=1e-6, abs=1e-9 * wanted.max())
    loads = stored_loads(registry.folder, stated)
    assert loads is not None
    part = calibration_budget(stated, loads, None, "FY").component("reproducibility")
    assert (part.type, part.u) == ("B", pytest.approx(np.hypot(zero, gain), rel=1e-9))
    assert stated.loads[1].scatter is None


def test_one_run_keeps_the_covariance_of_independent_rows(
    make_session: Callable[..., Path], tmp_path: Path
) -> None:
    """s^2 (X'X)^-1, and a note that says which run would tell how runs differ."""
    path = make_session()
    rows = (path.parent / "loads.csv").read_text()
    (path.parent / "loads.csv").write_text(re.sub(r"(?m),\d+,(up|down)$", r",1,\1", rows))
    made = calibrate(path, Registry(tmp_path / "cal"))
    values = np.round(hub_data(60, 1), 7)
    X, y = np.column_stack([values[:, :3], np.ones(60)]), values[:, 3]
    (squares,) = np.linalg.lstsq(X, y, rcond=None)[1]
    one = made.record.loads[0]
    assert one.scatter is None
    assert np.asarray(one.covariance) == pytest.approx(squares / 56 * np.linalg.inv(X.T @ X), rel=1e-6)
    (note,) = [finding for finding in made.findings if finding.rule == "one-run"]
    assert (note.level, "second run" in note.message) == ("note", True)
