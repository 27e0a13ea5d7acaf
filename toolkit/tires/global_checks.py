"""Whether a model over all loads can be fitted to rows at all, and what they do not support, in words."""

from __future__ import annotations

import numpy as np

from toolkit.errors import FitError
from toolkit.tires.global_data import Measured
from toolkit.tires.global_model import GlobalModel

MIN_ROWS, MIN_ANGLES = 7, 4
LACKS = {
    "two_loads": "there is one load only",
    "three_loads": "there are fewer than three loads",
    "camber": "the camber does not vary",
    "pressure": "the pressure does not vary or was not recorded",
    "three_pressures": "there are fewer than three pressures",
    "speed": "the speed does not vary",
    "both_signs": "the slip angles have one sign",
    "kappa": "there is no longitudinal slip",
    "both_kappas": "the longitudinal slip has one sign",
    "alpha_and_kappa": "slip angle and longitudinal slip do not occur together",
}


def why_not_global(data: Measured, model: GlobalModel) -> FitError | None:
    """Return why a model cannot be fitted to these rows, None where it can."""
    channels = [name for name in data.channels if name in model.channels]

    def problem(rule: str, what: str, got: str, expected: str, next_step: str) -> FitError:
        where = f"{model.name}, {len(data)} rows"
        return FitError(what, where=where, got=got, expected=expected, next_step=next_step, rule=rule)

    if not len(data):
        return problem(
            "no-load-block", "the load is missing: FZ is zero", "no row with a load of 1 N or more",
            "the wheel load of every row, of either sign", "put the measured load into the column FZ",
        )  # fmt: skip
    if not channels or ("FY" not in channels and "FX" not in channels and not model.moment_alone):
        return problem(
            "missing-column", f"{model.name} needs FY", ", ".join(data.channels),
            "FY: the moment is its trail times FY", "add the column FY, or fit MZ by pacejka94",
        )  # fmt: skip
    for name in (*channels, "SA"):
        column = data.rows.SA if name == "SA" else data[name]
        if not np.isfinite(column).all():
            row = int(np.argmax(~np.isfinite(column))) + 1
            return problem(
                "not-finite", f"{name} is not a number", f"row {row}", "finite numbers", "mend that row"
            )
    moves = "KAPPA" if "FX" in channels and np.ptp(data.rows.KAPPA) > 0 else "SA"
    places = len(np.unique(np.rint(data.rows.SA / np.radians(0.05))))
    if moves == "SA" and places < 2:
        return problem(
            "constant-column", "the slip angle does not change", f"one slip angle in {len(data)} rows",
            f"at least {MIN_ANGLES} slip angles", "measure more slip angles",
        )  # fmt: skip
    if len(data) < MIN_ROWS or (moves == "SA" and places < MIN_ANGLES):
        return problem(
            "too-few-points", f"too few points for {model.name}",
            f"{len(data)} rows at {places} slip angles",
            f"at least {MIN_ROWS} rows and {MIN_ANGLES} slip angles", "measure more slip angles",
        )  # fmt: skip
    for name in channels:
        if np.ptp(data[name]) <= 1e-12 * np.abs(data[name]).max():
            return problem(
                "constant-column", f"{name} does not change", f"{data[name][0]:g} in every row",
                "a channel that follows the slip", "check the column and its calibration",
            )  # fmt: skip
    return None
