"""Budgets of weighted and generalised fits and of errors in both variables, against published figures and
dense algebra: from a session on disk to the record in the registry to the budget."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.uncertainty.budget import Prediction, calibration_budget, expanded_of_rows, predict
from toolkit.calibration.uncertainty.model import Budget

Values = Sequence[float] | NDArray[np.float64]


class Case:
    """A session of one cell S under one force F, entered in a registry of its own."""

    def __init__(
        self, folder: Path, x: Values, y: Values, *, method: str, u: Values | None = None, tail: str = "",
        run: Sequence[int] | None = None,
    ) -> None:  # fmt: skip
        folder.mkdir(parents=True, exist_ok=True)
        rows = ["S [mV/V],F [N],run,direction" + ("" if u is None else ",u_F [N]")]
        for i, (a, b) in enumerate(zip(x, y, strict=True)):
            number = 1 if run is None else run[i]
            rows.append(f"{float(a)!r},{float(b)!r},{number},up" + ("" if u is None else f",{float(u[i])!r}"))
        (folder / "loads.csv").write_text("\n".join(rows) + "\n")
        path = folder / "SESSION.toml"
        path.write_text(
            'schema = 1\ninstrument = "cell"\ndate = 2026-02-01\noperator = "A"\nindications = ["S"]\n'
            f'loads = ["F"]\ndata = "loads.csv"\nmethod = "{method}"\n{tail}'
        )
        registry = Registry(folder / "cal")
        self.record = registry.load(calibrate(path, registry).record.id)
        loads = stored_loads(registry.folder, self.record)
        assert loads is not None
        self.loads = loads

    def at(self, x: float) -> Prediction:
        """Return the load that a reading means."""
        return predict(self.record, self.loads, None, "F", {"S": x})

    def budget(self, value: float) -> Budget:
        """Return the budget at a load."""
        return calibration_budget(self.record, self.loads, None, "F", value)


def line_u(u_a: float, u_b: float, cov: float, x: float) -> float:
    return math.sqrt(u_a**2 + (x * u_b) ** 2 + 2 * x * cov)


@pytest.mark.parametrize("x", [1.0, 3.5, 6.0])
def test_a_weighted_line_of_iso_ts_28037(tmp_path: Path, x: float) -> None:
    """ISO/TS 28037:2010, unequal weights: u_a 0.5297081, u_b 0.1778920, cov -0.08227848."""
    case = Case(
        tmp_path, [1, 2, 3, 4, 5, 6], [3.2, 4.3, 7.6, 8.6, 11.7, 12.8],
        method="wls", u=[0.5, 0.5, 0.5, 1.0, 1.0, 1.0],
    )  # fmt: skip
    found = case.at(x)
    assert found.budget.at == pytest.approx(0.8852 + 2.0570 * x, abs=4e-4)
    fit = found.budget.component("fit")
    assert fit.u == pytest.approx(line_u(0.5297081, 0.1778920, -0.08227848, x), rel=1e-6)
    # It follows from what is stated of the loads alone: no residual, no degrees of freedom.
    assert (fit.type, fit.distribution, fit.dof) == ("B", "normal", math.inf)


@pytest.mark.parametrize("x", [1.2, 4.0, 5.9])
def test_a_line_with_errors_in_both_of_iso_ts_28037(tmp_path: Path, x: float) -> None:
    """ISO/TS 28037:2010, clause 7: a 0.5788, b 2.1597, u_a 0.4764, u_b 0.1355, cov -0.0577."""
    case = Case(
        tmp_path, [1.2, 1.9, 2.9, 4.0, 4.7, 5.9], [3.4, 4.4, 7.2, 8.5, 10.8, 13.5],
        method="odr", u=[0.2, 0.2, 0.2, 0.4, 0.4, 0.4], tail="[cells.S]\nu = 0.2\n",
    )  # fmt: skip
    found = case.at(x)
    assert found.budget.at == pytest.approx(0.5788 + 2.1597 * x, abs=4e-4)
    variance = 0.4764**2 + (x * 0.1355) ** 2 - 2 * x * 0.0577
    # What the printed digits leave open of that sum: half a unit of each last one.
    slack = 5e-5 * (2 * 0.4764 + 2 * x**2 * 0.1355 + 2 * x)
    assert found.budget.component("fit").u ** 2 == pytest.approx(variance, abs=slack)
    # A reading in use has the indication's error once more: the slope carries it to the load.
    assert found.budget.component("indication").u == pytest.approx(2.1597 * 0.2, rel=1e-4)


@pytest.mark.parametrize("error", ["constant", "proportional"])
def test_a_shared_standard_by_dense_algebra(tmp_path: Path, error: str) -> None:
    rng = np.random.default_rng(5)
    run = np.repeat([1, 2, 3], 8)
    y = np.tile(np.linspace(100.0, 800.0, 8), 3)
    u = rng.uniform(0.2, 0.6, 24).round(3)
    x = (y / 400 + rng.normal(0, 0.4, 24) / 400).round(6)
    tail = (
        f'[reference]\nshared_group = {{ column = "run", error = "{error}" }}\n'
        '[reference.uncertainty]\nF = { U = 3.0, k = 2, unit = "N" }\n'
    )
    case = Case(tmp_path, x, y, method="gls", u=u, tail=tail, run=run.tolist())
    X = np.column_stack([x, np.ones(24)])
    acts = np.ones(24)
    if error == "proportional":
        fitted = X @ np.linalg.lstsq(X, y, rcond=None)[0]
        acts = fitted / y.max()
    v = 1.5 * acts
    V = np.diag(u**2) + (run[:, None] == run[None, :]) * np.outer(v, v)
    covariance = np.linalg.inv(X.T @ np.linalg.inv(V) @ X)
    for at in (0.25, 1.0, 2.0):
        J = np.array([at, 1.0])
        found = case.at(at).budget
        assert found.component("fit").u == pytest.approx(math.sqrt(J @ covariance @ J), rel=1e-9)
        # The standard's error is in that covariance, and is not counted twice.
        reference = found.component("reference")
        assert (reference.u, reference.stated) == (0.0, True)
        assert "held by the fit's covariance" in reference.description


def test_rows_state_their_own_reference_around_a_load(tmp_path: Path) -> None:
    y = np.tile(np.linspace(0.0, 800.0, 9), 3)
    x = (y / 400 + np.random.default_rng(6).normal(0, 1e-3, 27)).round(6)
    u = np.where(y < 400, 0.2, 0.4)  # the lower range of the standard is the better one
    case = Case(tmp_path, x, y, method="ols", u=u, run=np.repeat([1, 2, 3], 9).tolist())
    parts = [case.budget(at).component("reference").u for at in (0.0, 200.0, 350.0, 600.0)]
    assert parts == pytest.approx([0.2, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(("method", "tail"), [("wls", ""), ("odr", "[cells.S]\nu = 1e-4\n")])
def test_the_parts_of_such_a_budget_add_up(tmp_path: Path, method: str, tail: str) -> None:
    """u^2 is the sum of the parts, U = k u, and the type B fit adds no degrees of freedom."""
    from scipy.stats import t

    rng = np.random.default_rng(6)
    y = np.tile(np.linspace(100.0, 800.0, 8), 3)
    x = (y / 400 + rng.normal(0, 1e-3, 24)).round(6)
    tail += '[reference.uncertainty]\nF = { U = 0.8, k = 2, unit = "N" }\n'
    case = Case(
        tmp_path, x, y, method=method, u=np.full(24, 0.4), tail=tail, run=np.repeat([1, 2, 3], 8).tolist()
    )
    budget = case.budget(600.0)
    parts = [one for one in budget.components if one.u > 0]
    assert {"reference", "fit", "repeatability"} <= {one.name for one in parts}
    # U = 0.8 N with k = 2 holds at 600 N as at the largest load of 800 N.
    assert budget.component("reference").u == pytest.approx(0.4)
    total = math.sqrt(sum(one.u**2 for one in parts))
    assert budget.u == pytest.approx(total, rel=1e-12)
    # What the rows' scatter gives together is one estimate, with degrees of freedom of its own.
    joint = sum(one.u**2 for one in parts if one.joint)
    apart = sum(one.u**4 / one.dof for one in parts if not one.joint)
    dof = total**4 / (joint**2 / budget.scatter_dof + apart)
    assert budget.dof == pytest.approx(dof, rel=1e-9)
    # GUM G.6.4 takes the next lower whole number; between the two lies Student's t by interpolation.
    assert t.ppf(0.975, math.ceil(dof)) - 1e-9 <= budget.k <= t.ppf(0.975, math.floor(dof)) + 1e-9
    assert budget.U == pytest.approx(budget.k * budget.u, rel=1e-12)


def test_half_the_stated_uncertainty_is_half_of_the_fit_s_part(tmp_path: Path) -> None:
    y = np.linspace(100.0, 800.0, 8)
    x = y / 400 + 1e-4 * (-1.0) ** np.arange(8)
    one, half = (Case(tmp_path / n, x, y, method="wls", u=np.full(8, u)) for n, u in (("a", 0.4), ("b", 0.2)))
    assert half.at(1.0).budget.component("fit").u == pytest.approx(
        one.at(1.0).budget.component("fit").u / 2, rel=1e-12
    )
    # By the plain formula of a straight line: u^2 (1/n + (x - mean)^2 / Sxx).
    wanted = 0.4 * math.sqrt(1 / 8 + (1.0 - x.mean()) ** 2 / np.sum((x - x.mean()) ** 2))
    assert one.at(1.0).budget.component("fit").u == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("method", "tail"),
    [
        ("ols", 'model = "polynomial"\ndegree = 5\nzero = "tared"\n'),
        ("wls", ""),
        ("gls", '[reference]\nshared_group = { column = "run", error = "proportional" }\n'),
        ("odr", "[cells.S]\nu = 1e-4\nresolution = 1e-4\n"),
    ],
)
def test_rows_of_a_file_have_the_budgets_of_their_points(tmp_path: Path, method: str, tail: str) -> None:
    """Any number of rows at once, beyond what is computed together, with a row that is no number."""
    rng = np.random.default_rng(8)
    y = np.tile(np.linspace(0.0, 800.0, 9), 3)
    x = (y / 400 + np.repeat(rng.normal(0, 1e-3, 3), 9) + rng.normal(0, 1e-4, 27) * (1 + y / 100)).round(6)
    tail += '[reference.uncertainty]\nF = { U = 0.8, k = 2, unit = "N" }\n'
    case = Case(
        tmp_path, x, y, method=method, u=None if method == "ols" else np.full(27, 0.4), tail=tail,
        run=np.repeat([1, 2, 3], 9).tolist(),
    )  # fmt: skip
    points = np.append(rng.uniform(-0.5, 2.5, 5000), [0.0, np.nan])
    told: list[int] = []
    U = expanded_of_rows(case.record, case.loads, None, "F", points[:, None], step=told.append)
    assert np.isnan(U[-1])
    assert told == [4096, 5002]
    for at in (0, 1, 4095, 4096, 5000):
        assert U[at] == pytest.approx(case.at(points[at]).budget.U, rel=1e-12)
