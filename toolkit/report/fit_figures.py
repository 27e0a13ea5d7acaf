"""Figures of fits: curves over the measured rows, residuals, and all models side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.report.content import Curve, Plot
from toolkit.report.figures import draw, draw_svg
from toolkit.report.test.models import model_plot
from toolkit.tires.comparison import Comparison, model_curve
from toolkit.tires.evaluate import value_at
from toolkit.tires.global_data import Measured, binned

if TYPE_CHECKING:
    from toolkit.tires.global_model import ModelFit
    from toolkit.tires.model import CurveFit

_LABELS = {
    "FX": "longitudinal force FX / N",
    "FY": "lateral force FY / N",
    "MZ": "aligning moment MZ / (N·m)",
}
_POINTS = 121

Evaluate = Callable[[np.ndarray, float], "np.ndarray | None"]


def fit_figures(
    data: Measured,
    curves: Sequence[CurveFit],
    models: Sequence[ModelFit],
    comparison: Comparison,
    watermark: str | None = None,
) -> dict[str, bytes]:
    """Return the figures by file name: two a model and channel (PNG), one comparison a channel (PNG, SVG)."""
    pictures = {}
    for plot in fit_plots(data, curves, models):
        pictures[f"{plot.name}.png"] = draw(replace(plot, watermark=watermark)).png
    if len(comparison.models) > 1:
        for condition, channel in comparison.conditions:
            name = f"comparison_{condition}_{channel}"
            bars = model_plot(comparison, condition, channel, name=name, watermark=watermark)
            if bars is not None:
                pictures |= {f"{name}.png": draw(bars).png, f"{name}.svg": draw_svg(bars)}
    return pictures


def fit_plots(data: Measured, curves: Sequence[CurveFit], models: Sequence[ModelFit]) -> tuple[Plot, ...]:
    """Return curves and residuals against slip angle of every model and channel, one colour a load."""
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find

    shown, _, _ = binned(data)
    plots = []
    for name in dict.fromkeys(curve.model for curve in curves):
        for channel in ("FY", "MZ"):
            curves_of_model = [curve for curve in curves if curve.model == name and curve.channel == channel]
            if curves_of_model and channel in data.channels:
                plots += _pair(shown, name, channel, _of_loads(curves_of_model))
    for fit in models:
        model = find(fit.model)
        assert isinstance(model, GlobalModel)  # noqa: S101  only such a model has a ModelFit
        for channel_fit in fit.fits:
            if channel_fit.channel == "FX":
                continue

            def evaluate(
                SA: np.ndarray, load: float, *, fit: ModelFit = fit, channel: str = channel_fit.channel
            ) -> np.ndarray | None:
                model = find(fit.model)
                assert isinstance(model, GlobalModel)  # noqa: S101
                return model_curve(model, fit, data, channel, SA=SA, load_N=load)

            plots += _pair(shown, fit.model, channel_fit.channel, evaluate)
    return tuple(plots)


def _of_loads(fits: Sequence[CurveFit]) -> Evaluate:
    loads = np.array([fit.load_N or 0.0 for fit in fits])

    def evaluate(SA: np.ndarray, load: float) -> np.ndarray | None:
        nearest = int(np.argmin(np.abs(loads - load)))
        if abs(loads[nearest] - load) > 0.1 * load:
            return None  # that load could not be fitted
        return value_at(fits[nearest], SA)

    return evaluate


def _pair(data: Measured, name: str, channel: str, evaluate: Evaluate) -> list[Plot]:
    SA = np.degrees(data.rows.SA)
    grid = np.linspace(data.rows.SA.min(), data.rows.SA.max(), _POINTS)
    lines, points, apart = [], [], []
    for group, block in enumerate(np.unique(data.block)):
        in_block = data.block == block
        load = float(data.loads[block])
        label = f"{load:.0f} N"
        points.append(_curve(label, SA[in_block], data[channel][in_block], group, "points"))
        line, at_rows = evaluate(grid, load), evaluate(data.rows.SA[in_block], load)
        if line is not None and at_rows is not None:
            lines.append(_curve(label, np.degrees(grid), line, group, "line"))
            apart.append(_curve(label, SA[in_block], data[channel][in_block] - at_rows, group, "points"))
    x, where = "slip angle SA / deg", f"Axis system: {data.axes}."
    return [
        Plot(
            name=f"{name}_{channel}_curves", x_label=x, y_label=_LABELS[channel], curves=(*points, *lines),
            caption=f"{name}: measured {channel} (points) and fitted curves.", zero_x=True,
            alt=f"{channel} against slip angle at {len(points)} loads, measured and by {name}. {where}",
            legend_title=f"{name}, FZ",
        ),
        Plot(
            name=f"{name}_{channel}_residuals", x_label=x, y_label=f"measured - model, {_LABELS[channel]}",
            curves=tuple(apart), caption=f"{name}: measured minus fitted {channel}.", zero_x=True,
            alt=f"Residuals of {channel} against slip angle at {len(apart)} loads, {name}. {where}",
            legend_title=f"{name}, FZ",
        ),
    ]  # fmt: skip


def _curve(label: str, x: np.ndarray, y: np.ndarray, group: int, style: str) -> Curve:
    order = np.argsort(x, kind="stable")
    return Curve(
        label=label,
        x=tuple(x[order].tolist()),
        y=tuple(y[order].tolist()),
        group=group,
        style="line" if style == "line" else "points",
    )
