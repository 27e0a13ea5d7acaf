"""Models over all loads between the loads that were measured: factors keep their bounds, forces do not swing.

The tires are drawn here, by equations of this file: a Magic Formula of FY and a cosine of the trail, whose
shape follows the load by straight lines. Nothing of them is taken from the toolkit's models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.channels import signs
from toolkit.tires.between_loads import Between
from toolkit.tires.global_data import Measured, measured
from toolkit.tires.global_fit import fit_global, global_findings
from toolkit.tires.global_model import GlobalModel, ModelFit, make_rows
from toolkit.tires.models import find, model_names

Array = NDArray[np.float64]
Tire = Callable[[Array, Any], tuple[Array, Array]]

FEW = ((2000.0, 4000.0, 6000.0), (-6.0, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0))
WIDE = ((2000.0, 3000.0, 6500.0), (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0))
PAIR = ((1500.0, 6000.0), (-6.0, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0))
NOMINAL = 5000.0


def tire(
    *, stiff: float = 14.0, fall: float = 0.175, mu: float = 1.05, mu_fall: float = 0.03, C: float = 1.35,
    E: float = -0.6, plysteer: float = 0.004, conicity: float = 0.006, trail: float = 0.035, Bt: float = 9.0,
    Ct: float = 1.1, Bt_fall: float = 0.0, moment: float = -5e-4,
) -> Tire:  # fmt: skip
    """Return FY [N] and MZ [N·m] of slip angles [rad] in SAE and loads [N]."""

    def forces(SA: Array, FZ: Any) -> tuple[Array, Array]:
        x, over = SA + plysteer, (FZ - 4000.0) / 4000.0
        D = (mu - 2 * mu_fall * over) * FZ
        s = FZ * stiff * (1 - fall * over) / (C * D) * x
        side = -D * np.sin(C * np.arctan(s - E * (s - np.arctan(s))))
        arm = trail * FZ / 4000.0 * np.cos(Ct * np.arctan(Bt * (1 + Bt_fall * over) * x))
        return side + conicity * FZ, -arm * side + moment * FZ

    return forces


def drawn(rng: np.random.Generator) -> Tire:
    return tire(
        stiff=rng.uniform(10, 20), fall=rng.uniform(0.1, 0.3), mu=rng.uniform(0.85, 1.15),
        mu_fall=rng.uniform(0, 0.06), C=rng.uniform(1.2, 1.5), E=rng.uniform(-2, 0.3),
        plysteer=rng.uniform(-0.005, 0.005), conicity=rng.uniform(-0.01, 0.01),
        trail=rng.uniform(0.02, 0.045), Bt=rng.uniform(6, 14), Ct=rng.uniform(1, 1.2),
        moment=rng.uniform(-1e-3, 1e-3), Bt_fall=rng.uniform(-0.3, 0.1),
    )  # fmt: skip


def rows_of(
    forces: Tire, design: tuple[tuple[float, ...], tuple[float, ...]], noise: float, rng: np.random.Generator
) -> Measured:
    """Return what a machine measures of a tire: SAE, noise as a part of each load's largest value."""
    loads, angles = design
    FZ, SA = (a.ravel() for a in np.meshgrid(loads, np.radians(angles), indexing="ij"))
    columns = {"SA": SA, "FZ": FZ}
    for name, y in zip(("FY", "MZ"), forces(SA, FZ), strict=True):
        size = np.abs(y).reshape(len(loads), -1).max(axis=1).repeat(len(angles))
        columns[name] = y + noise * size * rng.normal(size=len(y))
    return measured(columns, axes="SAE", rated_load_N=NOMINAL)


def error(model: GlobalModel, fit: ModelFit, data: Measured, forces: Tire, channel: str) -> float:
    """Return the largest error between the measured loads as a part of the largest value there."""
    turn = signs("SAE", model.axes)
    SA, worst = np.linspace(data.rows.SA.min(), data.rows.SA.max(), 33), 0.0
    for low, high in zip(data.loads[:-1], data.loads[1:], strict=True):
        for load in np.linspace(low, high, 5)[1:-1].tolist():
            truth = forces(SA, load)[channel == "MZ"]
            rows = make_rows(
                turn["SA"] * SA, load, FNOMIN=NOMINAL, NOMPRES=data.rows.NOMPRES, LONGVL=data.rows.LONGVL
            )
            made = turn[channel] * np.asarray(model.forces(fit.values.tolist(), rows)[channel])
            worst = max(worst, float(np.abs(made - truth).max() / np.abs(truth).max()))
    return worst


DRAWS = pytest.mark.campaign("further draws of the noise")


@pytest.mark.parametrize("name", ["mf52", "mf61"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=DRAWS) for seed in (1, 2))])
def test_three_loads_and_seven_angles_give_the_moment_between_them(name: str, seed: int) -> None:
    """The slope of the trail crossed zero between two loads: the cosine is even in it, no row saw it."""
    model = find(name)
    assert isinstance(model, GlobalModel)
    forces = tire()
    data = rows_of(forces, FEW, 3e-4, np.random.default_rng([11, seed]))
    fit = fit_global(model, data, predict=False)
    assert error(model, fit, data, forces, "MZ") < 0.03
    assert error(model, fit, data, forces, "FY") < 0.03
    assert "between-loads" not in {finding.rule for finding in global_findings(fit)}


OTHER = pytest.mark.campaign(
    "the other formula on the same rows: each design has one in every run, and each one"
)


@pytest.mark.parametrize(
    ("name", "design", "noise", "most"),
    [
        pytest.param("mf61", FEW, 5e-3, 0.09, marks=OTHER),
        ("pacejka94", WIDE, 5e-4, 0.09),
        ("mf61", PAIR, 5e-3, 0.2),
        pytest.param("pacejka94", FEW, 5e-3, 0.09, marks=OTHER),
        pytest.param("mf61", WIDE, 5e-4, 0.09, marks=OTHER),
        pytest.param("pacejka94", PAIR, 5e-3, 0.2, marks=OTHER),
    ],
)
def test_no_fit_is_far_from_the_tire_between_loads_without_a_finding(
    name: str, design: Any, noise: float, most: float
) -> None:
    model = find(name)
    assert isinstance(model, GlobalModel)
    for seed in range(3):
        rng = np.random.default_rng([7, len(design[1]), seed])
        forces = drawn(rng)
        data = rows_of(forces, design, noise, rng)
        fit = fit_global(model, data, predict=False)
        said = {f.where.split()[1] for f in global_findings(fit) if f.rule == "between-loads"}
        for channel in {"FY", "MZ"} - said:
            at_rows = fit.fit(channel)
            assert at_rows is not None
            # What the model's form misses at the measured loads it misses between them too.
            assert error(model, fit, data, forces, channel) < most + 0.02 * at_rows.error_percent


@pytest.mark.parametrize("name", [name for name in model_names() if name != "magic_formula"])
def test_bounded_factors_are_within_their_bounds_where_all_parameters_stand_at_their_default(
    name: str,
) -> None:
    model = find(name)
    assert isinstance(model, GlobalModel)
    assert (model.factors is None) == (not model.bounded)
    if model.factors is None:
        return
    rows = make_rows(0.0, np.array([1000.0, 4000.0]), FNOMIN=4000.0)
    at = model.factors(model.values({}).tolist(), rows)
    assert set(at) == {factor.name for factor in model.bounded}
    for factor in model.bounded:
        assert (factor.low <= at[factor.name]).all()
        assert (at[factor.name] <= factor.high).all()
        assert factor.stage in model.channels


def moment(values: dict[str, float], SA: Array, load: float) -> Array:
    model = find("mf61")
    assert isinstance(model, GlobalModel)
    MZ = model.forces(model.values(values).tolist(), make_rows(SA, load, FNOMIN=NOMINAL)).MZ
    assert MZ is not None
    return MZ


TRAP = {"QBZ1": 10.7, "QBZ2": -0.45, "QBZ3": -54.2, "QCZ1": 1.1, "QDZ1": 0.12, "QBZ10": 0.0}
"""B_t = -8.6 at 2000 N, 2.2 at 3000 N, 8.6 at 4000 N: the numbers of a fit that was handed over."""


def trapped() -> tuple[GlobalModel, Array, Measured]:
    model = find("mf61")
    assert isinstance(model, GlobalModel)
    loads, angles = FEW
    FZ, SA = (a.ravel() for a in np.meshgrid(loads, np.radians(angles), indexing="ij"))
    values = model.values(TRAP)
    made = model.forces(values.tolist(), make_rows(SA, FZ, FNOMIN=NOMINAL))
    columns = {"SA": SA, "FZ": FZ, "FY": np.asarray(made.FY), "MZ": np.asarray(made.MZ)}
    return model, values, measured(columns, axes="ISO-W", rated_load_N=NOMINAL)


def test_a_slope_of_the_other_sign_changes_no_row_and_is_seen_all_the_same() -> None:
    model, values, data = trapped()
    # At 2000 N alone the sign of B_t is nowhere: the cosine is even.
    SA = np.radians(np.array(FEW[1]))
    turned = {**TRAP, "QBZ1": 8.542, "QBZ2": 0.0, "QBZ3": 0.0}
    np.testing.assert_allclose(moment(TRAP, SA, 2000.0), moment(turned, SA, 2000.0), rtol=1e-9, atol=1e-9)
    between = Between(model, data, ("MZ",))
    assert between.left(values.tolist()) == ("B_t", "MZ")
    worst = between.departure(values.tolist(), "MZ")
    assert worst is not None
    assert (worst.low_N, worst.high_N) == (2000.0, 4000.0)
    assert worst.too_large


def test_rows_of_the_trap_are_fitted_by_a_slope_of_one_sign() -> None:
    model, _, data = trapped()
    fit = fit_global(model, data, predict=False)
    one = fit.fit("MZ")
    assert one is not None
    assert one.error_percent < 1.0
    assert Between(model, data, ("MZ",)).left(fit.values.tolist()) == ()


def test_what_no_search_could_bring_back_is_a_finding() -> None:
    model, values, data = trapped()
    fit = fit_global(model, data, predict=False)
    one = fit.fit("MZ")
    assert one is not None
    at = Between(model, data, ("MZ",)).departure(values.tolist(), "MZ")
    findings = global_findings(replace(fit, fits=(replace(one, departure=at),)))
    (swing,) = [finding for finding in findings if finding.rule == "between-loads"]
    assert swing.level == "warning"
    assert swing.where == "mf61 MZ over all loads"
    assert "between the measured loads of 2000 and 4000 N" in swing.message


def test_a_force_in_proportion_to_load_or_its_square_departs_nowhere() -> None:
    """Two loads say as much: over the load both are straight."""
    model = find("mf61")
    assert isinstance(model, GlobalModel)
    FZ, SA = (a.ravel() for a in np.meshgrid(PAIR[0], np.radians(PAIR[1]), indexing="ij"))
    data = measured(
        {"SA": SA, "FZ": FZ, "FY": -FZ * SA, "MZ": FZ**2 * SA}, axes="ISO-W", rated_load_N=NOMINAL
    )
    # PKY2 large: the stiffness is in proportion to load, so is the trail, and the moment goes as its square.
    values = model.values({"PKY1": -200.0, "PKY2": 20.0, "PDY1": 3.0, "PEY1": 0.0})
    between = Between(model, data, ("FY", "MZ"))
    for channel in ("FY", "MZ"):
        worst = between.departure(values.tolist(), channel)
        assert worst is not None
        assert worst.share < 0.01


def test_one_load_has_nothing_between() -> None:
    model = find("mf61")
    assert isinstance(model, GlobalModel)
    data = rows_of(tire(), ((4000.0,), FEW[1]), 1e-3, np.random.default_rng(1))
    fit = fit_global(model, data, predict=False)
    assert [channel.departure for channel in fit.fits] == [None, None]
