"""What the Magic Formula finds at each load: where every search of a model over all loads begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import FitError
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.global_data import Measured, binned
from toolkit.tires.global_model import GlobalModel, Seeds
from toolkit.tires.model import Curve, CurveFit
from toolkit.tires.models.magic_formula import slope, value

_UPRIGHT = np.radians(0.75)  # of the least camber
_FREE = 0.01  # longitudinal slip
_BEYOND = 1.5  # times the largest angle: a peak further out is the model's, not the data's
_NEAR = np.radians(2.5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeedFits:
    """Seeds with the fits they come from (upright, free rolling rows; in the data's axes)."""

    seeds: Seeds
    fits: tuple[CurveFit, ...]


def seeds_of(data: Measured) -> SeedFits:
    """Return seeds of rows that have FY, MZ or both; loads at which no curve can be fitted give a line."""
    base = data.turned("ISO-W")
    r = base.rows
    calm = (np.abs(np.abs(r.IA) - np.abs(r.IA).min()) <= _UPRIGHT) & (np.abs(r.KAPPA) <= _FREE)
    if calm.sum() >= 4:
        base = base.take(calm)
    means, _, _ = binned(base)
    curves: list[Curve] = []
    for number, load in enumerate(base.loads):
        in_block = means.block == number
        channels: tuple[Literal["FY", "MZ"], ...] = ("FY", "MZ")
        curves += [
            _curve(means, in_block, channel, float(load))
            for channel in channels
            if channel in base.channels and in_block.any()
        ]
    good = [curve for curve in curves if why_not(curve) is None]
    fits = fit_curves(good) if good else ()
    by_key = {(fit.channel, fit.load_N): fit for fit in fits}
    loads, stiffness, peak, angle, trail = [], [], [], [], []
    reach = float(np.abs(base.rows.SA).max()) if len(base) else 0.1
    for curve in curves:
        if curve.channel != "FY" or curve.load_N is None:
            continue
        fit = by_key.get(("FY", curve.load_N))
        K, top, at = _read(fit, curve, reach)
        moment = by_key.get(("MZ", curve.load_N))
        loads.append(curve.load_N)
        stiffness.append(K)
        peak.append(top)
        angle.append(at)
        trail.append(float(slope(moment.values, 0.0)) / K if moment is not None and K > 0 else np.nan)
    if not loads:  # MZ alone: the sizes of a force are then of no consequence
        loads = list(base.loads)
        stiffness, peak = [12.0 * load for load in loads], list(loads)
        angle, trail = [0.1] * len(loads), [0.03] * len(loads)
    seeds = Seeds(
        load=np.array(loads), stiffness=np.array(stiffness), peak=np.array(peak), peak_angle=np.array(angle),
        trail=np.array(trail), FNOMIN=data.rows.FNOMIN,
    )  # fmt: skip
    return SeedFits(seeds=seeds, fits=tuple(fits))


def _curve(means: Measured, in_block: NDArray[np.bool_], channel: Literal["FY", "MZ"], load: float) -> Curve:
    return Curve(
        SA=means.rows.SA[in_block], y=means[channel][in_block], channel=channel, load_N=load, axes="ISO-W"
    )


def _read(fit: CurveFit | None, curve: Curve, reach: float) -> tuple[float, float, float]:
    # Stiffness [N/rad], peak [N] and its slip angle [rad]; never zero or negative, for they are divided by.
    top = float(np.abs(curve.y).max())
    if fit is None or not np.isfinite(fit.values).all():
        near = np.abs(curve.SA) <= max(_NEAR, float(np.sort(np.abs(curve.SA))[min(2, len(curve.SA) - 1)]))
        line = np.polyfit(curve.SA[near], curve.y[near], 1) if np.ptp(curve.SA[near]) > 0 else (-top / 0.1, 0)
        return max(-float(line[0]), top), max(top, 1e-9), reach
    grid = np.linspace(-_BEYOND * reach, _BEYOND * reach, 241)
    y = np.abs(value(fit.values, grid) - fit.values[5])
    at = int(np.argmax(y))
    K = -float(slope(fit.values, 0.0))
    return max(K, 0.1 * top), max(min(float(y[at]), _BEYOND * top), 1e-9), max(abs(float(grid[at])), 0.01)


# Whether a model over all loads can be fitted to rows at all, and what they do not support, in words.


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
