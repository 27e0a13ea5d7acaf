"""A model over all loads is fitted to the rows alike in all that it does not read, and reads what it says."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tires.tire_factory import CAR, Columns, cornering_stiffness, crossed, measured
from toolkit.channels import Axes
from toolkit.errors import FitError
from toolkit.tires import global_data
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import GlobalModel, make_rows
from toolkit.tires.models import find, model_names

ANGLES = np.radians(np.arange(-12.0, 12.5, 1.5))
OVER_LOADS = [name for name in model_names() if isinstance(find(name), GlobalModel)]


def _moved(model: GlobalModel) -> np.ndarray:
    # Every parameter at a place of its own, so that none is neutral.
    low, high = (np.array([getattr(entry, end) for entry in model.parameters]) for end in ("low", "high"))
    return np.clip(model.values({}) + 0.7 * np.array([entry.size for entry in model.parameters]), low, high)


@pytest.mark.parametrize("name", OVER_LOADS)
@pytest.mark.parametrize(("symbol", "moved"), [("IA", 0.05), ("KAPPA", 0.04), ("P", 240e3), ("V", 25.0)])
def test_what_a_model_reads_is_what_its_forces_follow(name: str, symbol: str, moved: float) -> None:
    model = find(name)
    assert isinstance(model, GlobalModel)
    varies = {need for parameter in model.parameters for need in parameter.needs}
    at = {"FNOMIN": 4000.0, "NOMPRES": 200e3, "LONGVL": 16.7, "IA": 0.03, "KAPPA": 0.02}

    def follows(values: np.ndarray) -> bool:
        one, other = (
            model.forces(values.tolist(), make_rows(np.radians([-6.0, 2.0, 6.0]), 3000.0, **at | change))
            for change in ({}, {symbol: moved})
        )
        return any(not np.array_equal(one[channel], other[channel]) for channel in ("FX", "FY", "MZ")
                   if getattr(one, channel) is not None)  # fmt: skip

    assert follows(_moved(model)) == (symbol in model.variables(varies))


def fitted_stiffness(name: str, columns: Columns, load: float, axes: Axes = "ISO-W") -> tuple[float, int]:
    model = find(name)
    assert isinstance(model, GlobalModel)
    fit = fit_global(model, global_data.measured(columns, axes=axes), predict=False)
    lateral = fit.fit("FY")
    assert lateral is not None
    assert len(fit.at_rows("FY")) == int(fit.selection.rows.sum())
    share = next(share for share in lateral.loads if abs(share.load_N - load) < 1.0)
    assert share.stiffness is not None
    return -share.stiffness.value, fit.selection.left_out


@pytest.mark.parametrize(
    ("name", "levels", "left_out"),
    [
        ("pacejka94", {"KAPPA": [-0.1, -0.05, 0.0, 0.05, 0.1]}, 4 / 5),
        ("tmeasy", {"P": [160e3, 220e3, 280e3]}, 2 / 3),
        ("mf52", {"P": [160e3, 220e3, 280e3]}, 2 / 3),
    ],
)
def test_a_model_over_all_loads_is_fitted_to_rows_alike_in_what_it_does_not_read(
    name: str, levels: dict[str, list[float]], left_out: float
) -> None:
    columns = measured(CAR, crossed(FZ=[2000.0, 4000.0, 6000.0], **levels, SA=ANGLES), noise=1e-3)
    stiffness, away = fitted_stiffness(name, columns, 4000.0)
    assert away == round(left_out * len(columns["SA"]))
    # 5 % is the misfit of the physical model; the slips together would give it half.
    assert stiffness == pytest.approx(cornering_stiffness(CAR, 4000.0), rel=0.05)


def test_a_parameter_that_cannot_be_fitted_reads_nothing() -> None:
    columns = measured(CAR, crossed(FZ=[2000.0, 4000.0], SA=ANGLES)) | {
        "KAPPA": np.full(2 * len(ANGLES), 0.1)
    }
    with pytest.raises(FitError) as caught:
        fitted_stiffness("mf61", columns, 4000.0)
    assert caught.value.rule == "no-pure-slip"
