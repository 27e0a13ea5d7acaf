"""Parameters that a fit over all loads holds at their defaults: what that costs, what stays uncertain."""

import numpy as np
import pytest

from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import GlobalModel, Responses, parameters

SA = np.radians(np.arange(-12.0, 12.25, 0.25))
LOADS = (2000.0, 4000.0)
ROWS = np.tile(SA, len(LOADS))


def toy(table, forces):
    return GlobalModel(
        name="toy", title="", reference="", valid="", axes="SAE", channels=("FY",),
        parameters=parameters(table), forces=forces, starts=lambda _seeds: ({},),
    )  # fmt: skip


def rows(FY):
    return measured({"SA": ROWS, "FZ": np.repeat(LOADS, len(SA)), "FY": FY}, axes="SAE")


def test_a_stiffness_is_uncertain_by_what_was_held():
    # C bends the curve within 0.1 deg of zero, where no row is: the data say nothing about it.
    far = np.abs(ROWS) > np.radians(0.2)
    rng = np.random.default_rng(3)
    data = rows(-50_000 * ROWS + rng.normal(0, 20.0, len(ROWS))).take(far)
    width = np.radians(0.03)

    def forces(values, rows):
        K, C = values
        return Responses(FY=-K * rows.SA - C * rows.SA * np.exp(-((rows.SA / width) ** 2)))

    model = toy("K N/rad 4e4 1e3 1e6 1e3 FY - slope\nC N/rad 0 -6000 6000 50 FY - at zero", forces)
    fit = fit_global(model, data).fit("FY")
    assert dict(fit.fixed).keys() == {"C"}
    own = fit.parameters[0].standard_error
    assert own == pytest.approx(20.0 / np.sqrt(np.sum(data.rows.SA**2)), rel=0.2)
    # A uniform spread over the bounds; at zero slip C adds to the slope as it is.
    expected = np.hypot(own, 12_000 / np.sqrt(12))
    assert fit.slope_at_zero.u == pytest.approx(expected, rel=0.01)
    assert "contain what the parameters held at their default may be" in fit.message


def test_defaults_together_cost_no_more_than_a_thousandth():
    # Five shapes at right angles, each of which holds six tenths of a thousandth of what is left.
    rng = np.random.default_rng(4)
    n, many = len(ROWS), 5
    basis = np.linalg.qr(np.column_stack([ROWS, np.ones(n), rng.normal(size=(n, many))]))[0]
    noise = rng.normal(0, 20.0, n)
    noise -= basis @ (basis.T @ noise)
    left = float(noise @ noise)
    shapes = basis[:, 2:].T * np.sqrt(6e-4 * left)
    place = {round(angle, 9): index for index, angle in enumerate(SA)}

    def forces(values, rows):
        index = np.array([place.get(round(angle, 9), 0) for angle in rows.SA.tolist()])
        index = index + len(SA) * (rows.FZ > 3000)
        slope, *sizes = values
        return Responses(FY=-slope * rows.SA + sum(b * s[index] for b, s in zip(sizes, shapes, strict=True)))

    table = "K N/rad 4e4 1e3 1e6 1e3 FY - slope\n"
    table += "\n".join(f"b{i} 1 0 -90 90 0.01 FY - size of shape {i}" for i in range(many))
    data = rows(-50_000 * ROWS + noise + shapes.sum(axis=0))
    made = fit_global(toy(table, forces), data, predict=False)
    rest = data["FY"] - made.at_rows("FY")
    # The whole model leaves `left` (its shapes and the slope are at right angles to it).
    assert float(rest @ rest) <= 1.001 * left
    assert len(made.fit("FY").fixed) == 1
