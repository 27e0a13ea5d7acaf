"""A fit's figures: residuals by load, fitted value and order, normal quantiles, influence, check loads.

Matplotlib's Agg and SVG without global state; the colours are those of every figure of the toolkit. Each
figure is made whole in memory first, so that a folder never holds half a set of a failed run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.report.figures import COLOURS, drawing_style, new_figure, picture
from toolkit.units import printed

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolkit.calibration.fit.report import FitReport

_SIZE = (6.3, 3.9)
_UP, _DOWN, _LIMIT, _GREY = COLOURS[0], COLOURS[1], "#B00020", "#8a8a8a"
_NAMED = 5  # rows named in the influence figure


def report_figures(report: FitReport, *, title: str) -> dict[str, bytes]:
    """Return the figures of a load by file name, PNG and SVG of each; ``title`` names record or session."""
    files: dict[str, bytes] = {}
    for name, (draw, caption) in _drawings(report).items():
        with drawing_style():
            figure = _figure(draw, f"{title}, {report.load}: {caption}")
            files |= {f"{report.load}_{name}.{kind}": picture(figure, kind) for kind in ("png", "svg")}
    return files


def open_figures(report: FitReport, *, title: str) -> dict[str, Callable[[], Figure]]:
    """Return the same figures by name, each to be drawn when it is called: for a notebook."""

    def drawing(draw: Callable[[Axes], None], what: str) -> Callable[[], Figure]:
        def open_figure() -> Figure:
            with drawing_style():
                return _figure(draw, f"{title}, {report.load}: {what}")

        return open_figure

    return {f"{report.load}_{name}": drawing(draw, what) for name, (draw, what) in _drawings(report).items()}


def _drawings(report: FitReport) -> dict[str, tuple[Callable[[Axes], None], str]]:
    fitted = report.reference - report.fit.residuals
    drawings: list[tuple[str, Callable[[Axes], None], str]] = [
        ("residuals", lambda axes: _residuals(axes, report), "residuals against load"),
        ("fitted", lambda axes: _against(axes, report, fitted, "fitted"), "residuals against fitted"),
        ("order", lambda axes: _against(axes, report, _order(report), "order"), "residuals in order"),
        ("normal", lambda axes: _normal(axes, report), "normal quantiles of the residuals"),
        ("influence", lambda axes: _influence(axes, report), "leverage and Cook's distance"),
    ]  # fmt: skip
    if report.check_percent_fs is not None:
        drawings.append(("check", lambda axes: _check(axes, report), "check loads"))
    return {name: (draw, caption) for name, draw, caption in drawings}


def _figure(draw: Callable[[Axes], None], title: str) -> Figure:
    figure = new_figure(_SIZE, layout="constrained")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=10.5, loc="left")
    axes.grid(visible=True, color="#d9d9d9", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    draw(axes)
    return figure


def _marks(report: FitReport) -> list[tuple[str | None, np.ndarray, str, str]]:
    """Return (label, rows, colour, marker): one kind, or up and down apart."""
    rows = np.arange(report.n)
    if report.direction is None:
        return [(None, rows, _UP, "o")]
    up = np.array([direction == "up" for direction in report.direction])
    kinds = (("loading", rows[up], _UP, "^"), ("unloading", rows[~up], _DOWN, "v"))
    return [kind for kind in kinds if len(kind[1])]


def _points(axes: Axes, report: FitReport, x: np.ndarray, y: np.ndarray) -> None:
    for label, rows, colour, marker in _marks(report):
        size = 4.5 if report.n <= 500 else 2.0
        axes.plot(
            x[rows], y[rows], linestyle="none", marker=marker, markersize=size, mfc="none",
            mec=colour, mew=0.9, label=label, rasterized=report.n > 2000, zorder=3,
        )  # fmt: skip
    out = np.array(report.tests.outliers, dtype=int) - 1
    if len(out):
        axes.plot(x[out], y[out], linestyle="none", marker="o", markersize=11, mfc="none", mec=_LIMIT,
                  mew=1.2, label="outlier", zorder=4)  # fmt: skip
        for row in out.tolist():
            axes.annotate(str(row + 1), (x[row], y[row]), textcoords="offset points", xytext=(8, 4),
                          fontsize=8, color=_LIMIT)  # fmt: skip


def _legend(axes: Axes) -> None:
    # Below the axes: no corner of a residual plot is sure to be empty.
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.figure.legend(
            handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=8.5
        )


def _percent(report: FitReport) -> np.ndarray:
    return 100 * report.fit.residuals / report.full_scale


def _residuals(axes: Axes, report: FitReport) -> None:
    y = _percent(report)
    axes.axhline(0.0, color="#606060", linewidth=0.8, zorder=1)
    tolerance = report.tolerance_percent_fs
    half = 100 * report.prediction_half_width / report.full_scale
    for value, style, label in (
        (tolerance, (0, (5, 3)), f"tolerance of the check loads, ±{tolerance:.3g} % FS"),
        (half, (0, (1, 2)), f"95 % prediction at full scale, ±{half:.2g} % FS"),
    ):
        # A limit far outside would flatten the residuals to a line: it is told in the legend alone.
        far = value > 8 * float(np.abs(y).max())
        legend = f"{label} (beyond the axis)" if far else label
        if far:
            axes.plot([], [], color=_LIMIT, linestyle=style, linewidth=1.0, label=legend)
        else:
            axes.axhline(value, color=_LIMIT, linestyle=style, linewidth=1.0, label=legend, zorder=2)
            axes.axhline(-value, color=_LIMIT, linestyle=style, linewidth=1.0, zorder=2)
    _points(axes, report, report.reference, y)
    _labels(axes, f"reference {report.load} [{_unit(report)}]", "reference - fitted [% of full scale]")
    _two_rows(axes)


def _against(axes: Axes, report: FitReport, x: np.ndarray, kind: str) -> None:
    axes.axhline(0.0, color="#606060", linewidth=0.8, zorder=1)
    for value in (-2.0, 2.0):
        axes.axhline(value, color=_GREY, linestyle=(0, (5, 3)), linewidth=0.9, zorder=2,
                     label="±2 standard deviations" if value > 0 else None)  # fmt: skip
    if kind == "order":
        axes.plot(x, report.tests.external, color="#c8c8c8", linewidth=0.7, zorder=2)
    _points(axes, report, x, report.tests.external)
    label = "row of the data file" if kind == "order" else f"fitted {report.load} [{_unit(report)}]"
    _labels(axes, label, "externally studentised residual")
    _legend(axes)


def _normal(axes: Axes, report: FitReport) -> None:
    from scipy.special import ndtri

    # Blom's plotting positions.
    quantile = np.empty(report.n)
    order = np.argsort(report.tests.internal, kind="stable")
    quantile[order] = ndtri((np.arange(1, report.n + 1) - 0.375) / (report.n + 0.25))
    ends = np.array([quantile.min(), quantile.max()])
    axes.plot(ends, ends, color="#606060", linewidth=1.0, label="normal distribution", zorder=2)
    _points(axes, report, quantile, report.tests.internal)
    _labels(axes, "normal quantile", "internally studentised residual")
    _legend(axes)


def _influence(axes: Axes, report: FitReport) -> None:
    p = report.n - report.fit.dof
    _points(axes, report, report.fit.leverage, report.tests.external)
    right = 1.08 * float(report.fit.leverage.max())
    edge = np.linspace(max(0.02 * right, 1e-6), min(right, 0.999), 200)
    level = 4 / report.n
    # Cook's D = r^2 h / (1 - h) / p, in the internal residual r.
    curve = np.sqrt(level * p * (1 - edge) / edge)
    top = 1.15 * max(3.0, float(np.abs(report.tests.external).max()))
    for sign in (1, -1):
        axes.plot(edge, sign * curve, color=_LIMIT, linestyle=(0, (5, 3)), linewidth=1.0, zorder=2,
                  label=f"Cook's distance 4/n = {level:.2g}" if sign > 0 else None)  # fmt: skip
    axes.axvline(2 * p / report.n, color=_GREY, linestyle=(0, (1, 2)), linewidth=1.1, zorder=2,
                 label=f"twice the mean leverage, {2 * p / report.n:.2g}")  # fmt: skip
    axes.axhline(0.0, color="#606060", linewidth=0.8, zorder=1)
    named = [i for i in np.argsort(-report.tests.cook)[:_NAMED].tolist() if report.tests.cook[i] > level]
    for row in named:
        if row + 1 not in report.tests.outliers:
            axes.annotate(str(row + 1), (report.fit.leverage[row], report.tests.external[row]),
                          textcoords="offset points", xytext=(6, 4), fontsize=8, color="#303030")  # fmt: skip
    axes.set_xlim(0, right)
    axes.set_ylim(-top, top)
    _labels(axes, "leverage", "externally studentised residual")
    _two_rows(axes)


def _check(axes: Axes, report: FitReport) -> None:
    if report.check_reference is None or report.check_percent_fs is None:
        return
    off, tolerance = report.check_percent_fs, report.tolerance_percent_fs
    rows = np.arange(1, len(off) + 1)
    axes.axhspan(-tolerance, tolerance, color="#009E73", alpha=0.10, linewidth=0, zorder=0)
    for value in (tolerance, -tolerance):
        axes.axhline(value, color=_LIMIT, linestyle=(0, (5, 3)), linewidth=1.0, zorder=2,
                     label=f"tolerance ±{tolerance:.3g} % FS" if value > 0 else None)  # fmt: skip
    axes.axhline(0.0, color="#606060", linewidth=0.8, zorder=1)
    good = np.abs(off) <= tolerance
    for rows_of, colour, label in ((good, _UP, "within"), (~good, _LIMIT, "out of tolerance")):
        if rows_of.any():
            axes.vlines(rows[rows_of], 0, off[rows_of], color=colour, linewidth=1.0, zorder=2)
            axes.plot(rows[rows_of], off[rows_of], linestyle="none", marker="D", markersize=5, color=colour,
                      label=label, zorder=3)  # fmt: skip
    # Only a few fit below the axis with their load.
    if len(rows) <= 14:
        axes.set_xticks(rows, [f"{n}\n{v:.4g}" for n, v in zip(rows, report.check_reference, strict=True)])
    axes.set_xlim(0.4, len(rows) + 0.6)
    limit = 1.2 * max(tolerance, float(np.abs(off).max()))
    axes.set_ylim(-limit, limit)
    _labels(
        axes,
        f"check row and reference {report.load} [{_unit(report)}]",
        "fitted - reference [% of full scale]",
    )
    _legend(axes)


def _two_rows(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    axes.figure.legend(
        handles, labels, loc="outside lower center", ncols=min(2, len(labels)), frameon=False, fontsize=8.5
    )


def _labels(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _order(report: FitReport) -> np.ndarray:
    return np.arange(1, report.n + 1, dtype=np.float64)


def _unit(report: FitReport) -> str:
    return printed(report.unit)
