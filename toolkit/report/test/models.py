"""Tire models side by side: the table in the form of the thesis's table 3.1, curves, residuals, scores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from toolkit.report.content import Cell, Curve, Plot
from toolkit.report.document import Rows
from toolkit.report.figures import draw, draw_svg
from toolkit.report.style import Style
from toolkit.report.tags import format_number
from toolkit.report.test.content import REPORT, ReportedTest
from toolkit.tires.comparison import Comparison, ComparisonRow, model_curve, rows_of_model
from toolkit.tires.evaluate import value_at
from toolkit.tires.global_data import Measured, binned
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

    plots = []
    for name in dict.fromkeys(curve.model for curve in curves):
        points, _, _ = binned(rows_of_model(data, name))
        for channel in ("FY", "MZ"):
            curves_of_model = [curve for curve in curves if curve.model == name and curve.channel == channel]
            if curves_of_model and channel in data.channels:
                plots += _pair(points, name, channel, _of_loads(curves_of_model))
    for fit in models:
        model = find(fit.model)
        assert isinstance(model, GlobalModel)  # noqa: S101  only such a model has a ModelFit
        points, _, _ = binned(data.take(fit.selection.rows))
        for channel_fit in fit.fits:
            if channel_fit.channel == "FX":
                continue

            def evaluate(
                SA: np.ndarray, load: float, *, fit: ModelFit = fit, channel: str = channel_fit.channel
            ) -> np.ndarray | None:
                model = find(fit.model)
                assert isinstance(model, GlobalModel)  # noqa: S101
                return model_curve(model, fit, data, channel, SA=SA, load_N=load)

            plots += _pair(points, fit.model, channel_fit.channel, evaluate)
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


_SYMBOLS = {"FX": "longitudinal force FX", "FY": "lateral force FY", "MZ": "aligning moment MZ"}
_NAMED = 5
_WIDTH = 0.38  # of a bar; two stand side by side at a model


_CHANNEL = """
    {0}_parameters|parameters fitted for {0}, all loads|1|d
    {0}_error|error of {0} over the rows fitted|%|.2f
    {0}_floor|scatter of {0} about its bin means|%|.2f
    {0}_left_out|error of {0} where every load is predicted by a fit without it|%|.2f
    """


@REPORT.table(
    "models",
    "tire models side by side, one row a model and condition; of the forward run, asked for by --models",
    f"""
    model|tire model; magic_formula has one curve a load, the others are over all loads
    condition|pure or combined slip
    {_CHANNEL.format("FY").strip()}
    {_CHANNEL.format("MZ").strip()}
    seconds|time of all fits of the model|s|.2f|run
    converged|yes where several starts ended at every lowest cost, else no
    not_determined|parameters that the data do not determine, by channel
    """,
)
def models(report: ReportedTest, _style: Style) -> Rows:
    """Return the models that were asked for."""
    return model_rows(report.comparison)


@REPORT.figures(
    {
        "models_fy": "error of each tire model in lateral force, fitted and with each load left out",
        "models_mz": "error of each tire model in aligning moment, fitted and with each load left out",
    },
    charts=False,
)
def error_charts(report: ReportedTest, style: Style) -> Iterable[Plot]:
    """Return the errors of the models in both channels."""
    return model_plots(
        report.comparison, watermark=report.watermark, decimal_comma=style.decimal_comma
    ).values()


def model_rows(comparison: Comparison | None) -> list[dict[str, Cell]]:
    """Return the table's rows, one a model and condition; none without a comparison."""
    if comparison is None:
        return []
    floors, seconds = dict(comparison.floors), dict(comparison.seconds)
    cellses: list[dict[str, Cell]] = []
    for condition in dict.fromkeys(name for name, _ in comparison.conditions):
        for model in comparison.models:
            channels = {name: comparison.get(model, condition, name) for name in ("FY", "MZ")}
            rows = [row for row in channels.values() if row is not None]
            if not rows:
                continue
            row: dict[str, Cell] = {
                "model": model,
                "condition": condition,
                "seconds": seconds.get(model),
                "converged": "yes" if all(row.converged for row in rows) else "no",
                "not_determined": _open(rows),
            }
            for name, fit in channels.items():
                row[f"{name}_floor"] = floors.get(name)
                if fit is not None:
                    row[f"{name}_parameters"] = fit.parameters
                    row[f"{name}_error"] = fit.error_percent
                    row[f"{name}_left_out"] = fit.prediction_error_percent
            cellses.append(row)
    return cellses


def _open(rows: Sequence[ComparisonRow]) -> str:
    # More names than that would make the row a list: the JSON of `toolkit fit` has them all.
    parts = []
    for row in rows:
        count = len(row.not_determined)
        if count:
            parameters = ", ".join(row.not_determined)
            parts.append(
                f"{row.channel}: {parameters if count <= _NAMED else f'{count} of {row.parameters}'}"
            )
    return "; ".join(parts) or "-"


def model_plots(
    comparison: Comparison | None, *, watermark: str | None = None, decimal_comma: bool = False
) -> dict[str, Plot]:
    """Return the figures ``models_fy`` and ``models_mz`` of pure side slip, where there are two models."""
    if comparison is None or len(comparison.models) < 2:
        return {}
    plots = (
        model_plot(
            comparison, "pure", channel, name=f"models_{channel.lower()}", watermark=watermark,
            decimal_comma=decimal_comma,
        )
        for channel in ("FY", "MZ")
    )  # fmt: skip
    return {plot.name: plot for plot in plots if plot is not None}


def model_plot(
    comparison: Comparison,
    condition: str,
    channel: str,
    *,
    name: str,
    watermark: str | None = None,
    decimal_comma: bool = False,
) -> Plot | None:
    """Return bars of all models' errors [%] in one channel, fitted and predicted, over the scatter floor."""
    fits = [comparison.get(model, condition, channel) for model in comparison.models]
    rows = [fit for fit in fits if fit is not None]
    if not rows:
        return None
    places = range(len(rows))
    errors = [format_number(row.error_percent, ".2f", decimal_comma=decimal_comma) for row in rows]
    curves = [
        Curve(
            label="fitted",
            x=tuple(place - _WIDTH / 2 for place in places),
            y=tuple(row.error_percent for row in rows),
            style="bars",
            notes=tuple(errors),
        )
    ]
    away = [(place, row.prediction_error_percent) for place, row in zip(places, rows, strict=True)]
    if predicted := [(place, value) for place, value in away if value is not None]:
        x, y = zip(*predicted, strict=True)
        curves.append(
            Curve(label="load left out", x=tuple(p + _WIDTH / 2 for p in x), y=y, group=4, style="bars")
        )
    floor = dict(comparison.floors).get(channel)
    if floor is not None:
        curves.append(
            Curve(
                label="scatter floor", x=(-0.5, len(rows) - 0.5), y=(floor, floor), group=1, style="line",
                open=True,
            )
        )  # fmt: skip
    listed = ", ".join(f"{row.model} {text} %" for row, text in zip(rows, errors, strict=True))
    mark = f"{watermark}. " if watermark else ""
    symbol = _SYMBOLS[channel]
    return Plot(
        name=name,
        x_label="",
        y_label=f"error of {symbol} / %",
        curves=tuple(curves),
        caption=f"Error of each tire model in {symbol}, fitted and where each load is predicted without it.",
        alt=f"{mark}Error of the tire models in {symbol}, {condition} slip: {listed}.",
        watermark=watermark,
        decimal_comma=decimal_comma,
        names=tuple(row.model for row in rows),
    )
