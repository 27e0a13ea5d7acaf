"""Which terms the loads tell: cells of known truth under load schedules with few levels and with many."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import SENSITIVITY, ZERO, hub_data
from toolkit.calibration.fit.adequacy import NOISE_SHARE, noise_shares, noise_terms
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.read import read_session
from toolkit.calibration.terms import model_terms, term_matrix
from toolkit.errors import SessionError

Make = Callable[..., Path]
Floats = NDArray[np.float64]
CUBES = ["D51^3", "D52^3", "E5^3"]


def schedule(levels: Floats, runs: int, *, noise: float, gain: float = 0.0, seed: int = 1) -> Floats:
    """Return rows of one axis at a time: cells with noise, and a gain of each run."""
    rng = np.random.default_rng(seed)
    once = np.vstack([np.outer(levels, row) for row in np.diag([500.0, 100.0, 150.0])])
    loads = np.vstack([once] * runs)
    gains = np.repeat(1 + rng.normal(0, gain, runs), len(once))[:, None] if gain else 1.0
    cells = loads @ SENSITIVITY.T * gains + ZERO + rng.normal(0, noise, loads.shape)
    return np.column_stack([cells, loads])


def shares(values: Floats, model: str, degree: int = 1) -> dict[str, float]:
    names = ("D51", "D52", "E5")
    columns = dict(zip(names, values[:, :3].T, strict=True))
    return noise_shares(model_terms(model, names, degree=degree), columns, values[:, 3:])


def one_cell(cell: Floats, load: Floats, degree: int) -> dict[str, float]:
    return noise_shares(model_terms("polynomial", ("A",), degree=degree), {"A": cell}, load[:, None])


def test_a_cube_at_three_levels_reads_wrong_between_them() -> None:
    # By hand: f = x + b (x - x^3) goes through the levels for every b; noise is answered by the slopes there,
    # 1 + b at 0 and 1 - 2 b at +-1. The least sum of squares (1 + b)^2 + 2 (1 - 2 b)^2 is at b = 1/3, and
    # f(1/2) = 1.25 x 1/2.
    rng = np.random.default_rng(1)
    load = np.tile([-1.0, 0.0, 1.0], 400)
    cell = load + rng.normal(0, 1e-4, len(load))
    terms = model_terms("polynomial", ("A",), degree=3)
    fit = fit_terms(terms=terms, columns={"A": cell}, load=load)
    read = term_matrix(terms, {"A": np.array([0.5])}) @ np.asarray(fit.coefficients)
    assert read[0] / 0.5 == pytest.approx(1.25, abs=0.02)
    assert one_cell(cell, load, 3)["A^3"] == pytest.approx(1, abs=0.05)
    assert one_cell(cell, load, 2)["A^2"] < 0.001


LONGER = pytest.mark.campaign("longer sessions of the same three levels")


@pytest.mark.parametrize(
    ("runs", "gain"),
    [pytest.param(40, 1e-4, marks=LONGER), pytest.param(60, 0.0, marks=LONGER), (3, 0.0), (12, 1e-4)],
)
def test_three_levels_are_entered_with_no_cube(
    tmp_path: Path, make_session: Make, runs: int, gain: float
) -> None:
    values = schedule(np.array([0, 1, 0, 0, -1, 0.0]), runs, noise=5e-5, gain=gain)
    path = make_session(values, model='"polynomial"', degree="3")
    with pytest.raises(SessionError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    error = caught.value
    assert (error.rule, error.exit_code) == ("load-levels", 2)
    assert all(term in str(error) for term in CUBES)
    assert not list((tmp_path / "cal").rglob("*"))
    drop = tomllib.loads(error.next_step[error.next_step.index("drop = ") :].split(";")[0])["drop"]
    assert drop == CUBES
    made = calibrate(
        make_session(values, model='"polynomial"', degree="3", drop=str(drop).replace("'", '"')),
        Registry(tmp_path / "cal"),
    )
    assert made.record.loads[0].terms == (*model_terms("polynomial", ("D51", "D52", "E5"), degree=2),)


def test_no_model_is_recommended_that_noise_decides_about(make_session: Make) -> None:
    # Gains that differ between runs make a cube gain by the F test, whatever the cells are like.
    found = 0
    for seed in range(3):
        values = schedule(np.array([0, 1, 0, 0, -1, 0.0]), 40, noise=5e-5, gain=1e-4, seed=seed)
        fit = fit_session(read_session(make_session(values)))
        found += any("degree = 3" in one.message or "degree = 4" in one.message or "balance" in one.message
                     for one in session_findings(fit) if one.rule == "model")  # fmt: skip
    assert found == 0


def test_products_are_not_told_by_one_axis_at_a_time() -> None:
    values = schedule(np.linspace(-1, 1, 9), 4, noise=2e-5)
    found = shares(values, "balance")
    assert min(found["D51*D52"], found["D51*E5"], found["D52*E5"]) > NOISE_SHARE


@pytest.mark.parametrize("count", [5, 7, 10])
@pytest.mark.parametrize("curve", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_curved_cells_at_many_levels_pass(count: int, curve: float, degree: int) -> None:
    rng = np.random.default_rng(count)
    load = np.tile(np.linspace(-1, 1, count), 3)
    for bent in (load**2, load**3):
        cell = load + curve * bent + rng.normal(0, 5e-5, len(load))
        assert max(one_cell(cell, load, degree).values()) < 0.2 * NOISE_SHARE


@pytest.mark.parametrize("rows", [40, 120])
@pytest.mark.parametrize("bend", [0.0, 0.01])
def test_balance_sessions_of_combined_loads_pass(rows: int, bend: float) -> None:
    values = hub_data(rows, 3)
    a, b, c = (values[:, 3:] / [500.0, 100.0, 150.0]).T
    values[:, :3] += (
        bend * np.abs(values[:, :3]).max(axis=0) * np.column_stack([a * b, b * c + a**2, np.abs(c)])
    )
    assert max(shares(values, "balance").values()) < 0.3 * NOISE_SHARE


def test_loads_that_vary_a_little_tell_a_cube_where_the_cells_are_quieter() -> None:
    # Own part of the cube: 2 x deviation of load and cell. Deviations of 1 %, noise a hundredth of it.
    rng = np.random.default_rng(1)
    load = np.tile([-1.0, 0.0, 1.0], 100) + rng.normal(0, 0.01, 300)
    assert one_cell(load + rng.normal(0, 1e-4, 300), load, 3)["A^3"] == pytest.approx(0.01, rel=0.3)
    # And not where the noise is ten times the deviations.
    assert one_cell(load + rng.normal(0, 0.1, 300), load, 3)["A^3"] > NOISE_SHARE


def test_the_load_cell_of_pontius_passes_with_a_square() -> None:
    data = tomllib.loads((files("toolkit.qualification") / "data" / "pontius.toml").read_text())
    y, x = np.array(data["data"]["y"]), np.array(data["data"]["x"])
    # As a calibration: the load from the deflection.
    assert max(one_cell(y, x, 2).values()) < 0.01


def test_what_is_left_is_told(make_session: Make) -> None:
    values = schedule(np.array([-1, 0, 1.0]), 20, noise=5e-5)
    names = ("D51", "D52", "E5")
    columns = dict(zip(names, values[:, :3].T, strict=True))
    for model, degree in (("polynomial", 4), ("balance", 1)):
        terms = model_terms(model, names, degree=degree)
        found = noise_terms(terms, columns, values[:, 3:])
        left = [term for term in terms if term not in found]
        assert len(left) == 7  # three cells, three even terms, the constant: what three levels determine
        assert max(noise_shares(left, columns, values[:, 3:]).values()) < NOISE_SHARE


def test_a_recorded_session_with_such_terms_stays_readable(make_session: Make) -> None:
    values = schedule(np.array([0, 1, 0, 0, -1, 0.0]), 3, noise=5e-5)
    fit = fit_session(read_session(make_session(values, model='"polynomial"', degree="3")))
    assert fit.loads[0].fit.terms == model_terms("polynomial", ("D51", "D52", "E5"), degree=3)
