"""One covariance for every method: what stated uncertainties hold, and what runs show beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.calibration.fit.session_fit import LoadResult, fit_session
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.read import read_session
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.calibration.uncertainty.monte_carlo import monte_carlo

SLOPE = 1250.0  # N/(mV/V)
LOADS = np.array([0, 500, 1000, 1500, 2000, 2500, 1500, 500, 0.0])
METHODS = ("ols", "wls", "odr", "gls")
U_CELL = 1e-4
NORMAL = 1.959964


def stated(method: str) -> NDArray[np.float64]:
    """What a row's reading scatters by in truth [N]: with the load where the method weighs by it."""
    return 0.2 + 2e-4 * LOADS if method == "wls" else np.full(len(LOADS), 0.3)


def drawn_session(folder: Path, method: str, seed: int, *, runs: float, u: float = 1.0) -> Path:
    """A press of six runs: zeros of 2 N and gains of 0.1 %, times ``runs``; u_ columns ``u`` of the truth."""
    rng = np.random.default_rng([77, seed])
    rows = []
    for run in range(1, 7):
        zero, gain = runs * rng.normal(0, 2.0), runs * rng.normal(0, 1e-3)
        share = rng.normal(0, 0.125) / 2500 if method == "gls" else 0.0
        for at, (load, noise) in enumerate(zip(LOADS, stated(method), strict=True)):
            force = (load * (1 + share) + rng.normal(0, noise)) * (1 + gain) + zero
            cell = force / SLOPE + (rng.normal(0, U_CELL) if method == "odr" else 0.0)
            rows.append(f"{run},{'up' if at < 6 else 'down'},{cell:.9f},{load:g},{u * noise:.6f}")
    folder.mkdir(exist_ok=True)
    (folder / "loads.csv").write_text("run,direction,A [mV/V],F [N],u_F [N]\n" + "\n".join(rows) + "\n")
    shared = 'shared_group = "run"\n' if method == "gls" else ""
    (folder / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "press"\ndate = 2026-03-02\noperator = "A"\nindications = ["A"]\n'
        f'loads = ["F"]\ndata = "loads.csv"\nmethod = "{method}"\n[reference]\nstandard = "S"\n{shared}'
        '[reference.uncertainty]\nF = { U = 0.25, k = 2, unit = "N" }\n'
        f"[cells.A]\nu = {U_CELL}\n"
    )
    return folder / "SESSION.toml"


def fitted(path: Path) -> LoadResult:
    return fit_session(read_session(path)).loads[0]


def held(folder: Path, method: str, draws: int, *, runs: float) -> NDArray[np.float64]:
    """Share of drawn sessions whose 95 % intervals hold slope, zero, and the curve at full scale."""
    inside = []
    for seed in range(draws):
        fit = fitted(drawn_session(folder, method, seed, runs=runs)).fit
        off = np.asarray(fit.coefficients) - [SLOPE, 0.0]
        vectors = np.array([[1.0, 0.0], [0.0, 1.0], [LOADS.max() / SLOPE, 1.0]])
        errors = np.sqrt(np.einsum("ij,jk,ik->i", vectors, fit.covariance, vectors))
        inside.append(np.abs(vectors @ off) <= NORMAL * errors)
    return np.asarray(np.mean(inside, axis=0))


ALIKE = pytest.mark.campaign("runs that are alike, an easier case: those that differ hold in every run")


BETWEEN = pytest.mark.campaign("further methods: the plain one and one of more scatter hold in every run")


@pytest.mark.parametrize("runs", [pytest.param(0.0, marks=ALIKE), 1.0], ids=["runs-alike", "runs-differ"])
@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=[BETWEEN] * (name in ("wls", "gls"))) for name in METHODS]
)
def test_intervals_of_every_method_hold_the_truth(tmp_path: Path, method: str, runs: float) -> None:
    # 95 % of 40 are 38; under 34 has a chance of one in a hundred.
    assert (held(tmp_path / "s", method, 40, runs=runs) >= 0.85).all()


@pytest.mark.campaign("200 sessions in place of 40")
@pytest.mark.parametrize("runs", [0.0, 1.0], ids=["runs-alike", "runs-differ"])
@pytest.mark.parametrize("method", METHODS)
def test_intervals_of_every_method_hold_the_truth_in_200(tmp_path: Path, method: str, runs: float) -> None:
    share = held(tmp_path / "s", method, 200, runs=runs)
    assert (share >= 0.90).all()
    assert (share <= 0.995).all()


@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=[BETWEEN] * (name in ("wls", "odr"))) for name in METHODS]
)
def test_the_covariance_is_that_of_the_map_from_loads_to_coefficients(tmp_path: Path, method: str) -> None:
    """Each load moved by itself gives A; A V A^T by dense algebra, V as the scatter has it."""
    path = drawn_session(tmp_path / "s", method, 3, runs=1.0)
    load = fitted(path)
    scatter, fit = load.scatter, load.fit
    assert scatter is not None
    session = read_session(path)
    rows = session.table.rows
    step, at = 0.01, session.table.names.index("F")
    A = np.empty((2, rows))
    for row in range(rows):
        # To one side: coefficients are linear in the loads, those of distances as good as over 0.01 N.
        values = session.table.values.copy()
        values[row, at] += step
        path.with_name("loads.csv").write_text(_csv(session.table.run, session.table.up, values))
        A[:, row] = (np.asarray(fitted(path).fit.coefficients) - fit.coefficients) / step
    noise = np.tile(stated(method), 6)
    noise = np.hypot(noise, SLOPE * U_CELL) if method == "odr" else noise
    size = np.sqrt(np.mean(noise**2))
    # Stated and true agree: the stated scatter stands. Five runs beyond the first tell zero and gain.
    within = scatter.within**2 * (1.9956 / NORMAL) ** 2 if method == "ols" else size**2
    widened = (2.570582 / NORMAL) ** 2
    run = np.asarray(session.table.run)
    together = (run[:, None] == run[None, :]).astype(float)
    relative = np.tile(LOADS, 6) / LOADS.max()
    profile = np.ones(rows) if method == "ols" else noise / size
    V = within * np.diag(profile**2)
    V += widened * together * (scatter.zero**2 + scatter.gain**2 * np.outer(relative, relative))
    expected = A @ V @ A.T
    assert np.diag(fit.covariance) == pytest.approx(np.diag(expected), rel=0.01)


def _csv(run: NDArray[np.float64] | None, up: NDArray[np.bool_] | None, values: NDArray[np.float64]) -> str:
    assert run is not None
    assert up is not None
    lines = ["run,direction,A [mV/V],F [N],u_F [N]"]
    for number, rises, row in zip(run.tolist(), up.tolist(), values.tolist(), strict=True):
        lines.append(f"{number:g},{'up' if rises else 'down'},{row[0]!r},{row[1]!r},{row[2]!r}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("method", ["wls", "odr", "gls"])
def test_uncertainties_that_are_stated_too_small_take_nothing_from_the_scatter(
    tmp_path: Path, method: str
) -> None:
    """A thousandth of the true uncertainty gives the covariance that plain least squares has."""
    told = fitted(drawn_session(tmp_path / "s", method, 5, runs=1.0, u=1e-3))
    text = (tmp_path / "s" / "SESSION.toml").read_text()
    (tmp_path / "s" / "SESSION.toml").write_text(text.replace(f'"{method}"', '"ols"'))
    plain = fitted(tmp_path / "s" / "SESSION.toml")
    ratio = np.diag(told.fit.covariance) / np.diag(plain.fit.covariance)
    assert ratio == pytest.approx([1.0, 1.0], rel=0.35)  # wls weighs the rows, gls the runs


@pytest.mark.parametrize("method", METHODS)
def test_record_budget_and_monte_carlo_have_the_covariance_of_the_fit(tmp_path: Path, method: str) -> None:
    path = drawn_session(tmp_path / "s", method, 8, runs=1.0)
    registry = Registry(tmp_path / "calibrations")
    record = registry.load(calibrate(path, registry).record.id)  # refitted from what is stored
    entry = record.load("F")
    assert entry.scatter is not None
    assert entry.scatter.groups == 6
    assert np.asarray(entry.covariance) == pytest.approx(np.asarray(fitted(path).fit.covariance))
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    budget = calibration_budget(record, loads, None, "F")
    at = np.array([*budget.indications, 1.0])
    # Of the mean of six runs a sixth of what one differs by is left, zero and gain each.
    runs = np.hypot(entry.scatter.zero, entry.scatter.gain) / np.sqrt(6)
    fit = budget.component("fit")
    assert fit.joint
    assert fit.u == pytest.approx(runs, rel=0.1)
    assert at @ np.asarray(entry.covariance) @ at > fit.u**2  # widened for its degrees of freedom
    drawn = monte_carlo(record, loads, budget, seed=1, trials=20_000)
    assert drawn.high - drawn.low == pytest.approx(2 * budget.U, rel=0.15)
