"""Models side by side on one data set: the form of the thesis's table 3.1, with floor and prediction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import signs
from toolkit.reduction.selection import of_one_condition
from toolkit.tires.evaluate import value_at
from toolkit.tires.global_data import CHANNELS, Measured, cell
from toolkit.tires.global_fit import undetermined
from toolkit.tires.global_model import GlobalModel, ModelFit, pooled_percent
from toolkit.tires.model import CurveFit
from toolkit.tires.models import model as find_curve_model
from toolkit.tires.quality import scatter_floor_percent

_FREE = 0.005  # longitudinal slip up to which a row is of pure side slip


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonRow:
    """One model on one channel under one condition, ``pure`` or ``combined`` slip.

    ``error_percent`` = 100 sqrt(sum(model - measured)^2 / sum(measured^2)) over ``n`` rows; curves of single
    loads are pooled. ``prediction_error_percent``: every load by a fit without it, None where there is
    none (a curve of one load predicts no other). ``parameters`` counts those that were fitted;
    ``not_determined`` names what the data, though they vary as asked, do not determine (of single loads
    with the number of loads).
    """

    model: str
    channel: str
    condition: str
    n: int
    parameters: int
    error_percent: float
    prediction_error_percent: float | None
    converged: bool
    not_determined: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All models on one data set; ``floors`` (channel, percent) is what no model could remove.

    ``seconds`` (model, time of its fits of all channels, loads left out included) is the machine's, not the
    data's: it differs from run to run and is no part of the JSON form.
    """

    rows: tuple[ComparisonRow, ...]
    floors: tuple[tuple[str, float | None], ...]
    seconds: tuple[tuple[str, float], ...] = ()

    @property
    def models(self) -> tuple[str, ...]:
        """Model names in their order."""
        return tuple(dict.fromkeys(row.model for row in self.rows))

    @property
    def conditions(self) -> tuple[tuple[str, str], ...]:
        """(condition, channel) in their order: pure before combined."""
        conditions = dict.fromkeys((row.condition, row.channel) for row in self.rows)
        return tuple(sorted(conditions, key=lambda pair: (pair[0] != "pure", CHANNELS.index(pair[1]))))

    def get(self, model: str, condition: str, channel: str) -> ComparisonRow | None:
        """Return one entry of the table, None where the model has none."""
        for row in self.rows:
            if (row.model, row.condition, row.channel) == (model, condition, channel):
                return row
        return None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "rows": [asdict(row) | {"not_determined": list(row.not_determined)} for row in self.rows],
            "scatter_floor_percent": dict(self.floors),
        }


def compare(
    data: Measured,
    curves: Sequence[CurveFit],
    models: Sequence[ModelFit],
    *,
    seconds: Mapping[str, float] | None = None,
) -> Comparison:
    """Return the table of the models that were fitted to these rows; ``curves`` are of single loads."""
    rows = []
    for name in dict.fromkeys(curve.model for curve in curves):
        fitted_curves = [curve for curve in curves if curve.model == name]
        read = rows_of_model(data, name)
        for channel in ("FY", "MZ"):
            if channel in data.channels and any(fitted.channel == channel for fitted in fitted_curves):
                rows += _of_curves(read, [fitted for fitted in fitted_curves if fitted.channel == channel])
    for fit in models:
        read = data.take(fit.selection.rows)
        for fitted in fit.fits:
            y, model = read[fitted.channel], fit.at_rows(fitted.channel)
            free = sum(p.name not in dict(fitted.fixed) for p in fitted.parameters)
            rows += _rows(
                read, fitted.model, fitted.channel, y, model, np.isfinite(y), free,
                fitted.prediction_error_percent, fitted.converged, undetermined(fitted),
            )  # fmt: skip
    floors = {
        channel: scatter_floor_percent(data.rows.SA, data[channel], cell(data)) for channel in data.channels
    }
    return Comparison(rows=tuple(rows), floors=tuple(floors.items()), seconds=tuple((seconds or {}).items()))


def rows_of_model(data: Measured, name: str) -> Measured:
    """Return the rows that the fits of a model of one load are of."""
    selection = of_one_condition(data.recorded, find_curve_model(name).reads, rows=len(data))
    return data.take(selection.rows)


def _of_curves(data: Measured, fits: Sequence[CurveFit]) -> list[ComparisonRow]:
    channel = fits[0].channel
    y, model = data[channel], np.full(len(data), np.nan)
    for fit in fits:
        if fit.load_N is not None:
            in_block = data.block == int(np.argmin(np.abs(data.loads - fit.load_N)))
            model[in_block] = value_at(fit, data.rows.SA[in_block])
    count = sum(len(fit.parameters) for fit in fits)
    converged = all(fit.converged for fit in fits)
    times = Counter(name for fit in fits for name in fit.not_determined)
    names: dict[int, list[str]] = {}
    for name, number in times.items():
        names.setdefault(number, []).append(name)
    open_ = tuple(f"{' '.join(names[number])} at {number} of {len(fits)} loads" for number in sorted(names))
    return _rows(data, fits[0].model, channel, y, model, np.isfinite(model), count, None, converged, open_)


def _rows(
    data: Measured,
    name: str,
    channel: str,
    y: Array,
    model: Array,
    known: np.ndarray,
    parameters: int,
    prediction: float | None,
    converged: bool,
    not_determined: tuple[str, ...],
) -> list[ComparisonRow]:
    pure = np.abs(data.rows.KAPPA) <= _FREE
    rows = []
    for condition, rows_of in (("pure", known & pure), ("combined", known & ~pure)):
        if rows_of.any():
            rows.append(
                ComparisonRow(
                    model=name,
                    channel=channel,
                    condition=condition,
                    n=int(rows_of.sum()),
                    parameters=parameters,
                    error_percent=pooled_percent(model[rows_of] - y[rows_of], y[rows_of]),
                    prediction_error_percent=prediction if condition == "pure" or not pure.any() else None,
                    converged=converged,
                    not_determined=not_determined,
                )
            )
    return rows


def model_curve(
    model: GlobalModel, fit: ModelFit, data: Measured, channel: str, *, SA: Array, load_N: float
) -> Array:
    """Return a fitted model at slip angles [rad] and a load [N] in the data's axes, upright, free rolling."""
    flip = signs(data.axes, model.axes)
    rows = data.rows.other(flip["SA"] * np.asarray(SA), load_N)
    with np.errstate(all="ignore"):
        predicted = model.forces(fit.values.tolist(), rows)[channel]
    return np.asarray(flip.get(channel, 1) * np.broadcast_to(predicted, len(rows)))
