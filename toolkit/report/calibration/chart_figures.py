"""The picture of an instrument's control charts: one panel a check load, individuals above moving ranges."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.publication import write_result
from toolkit.report.figures import COLOURS, drawing_style, new_figure, picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from toolkit.calibration.control.chart import Chart, Series
    from toolkit.calibration.uncertainty.model import Budget

MOST_PANELS = 12
_COLUMNS = 3
_GREY, _RED, _BLUE = "#6b6b6b", COLOURS[1], COLOURS[0]
_SETTINGS: Any = {"font.size": 9.0, "axes.spines.top": False, "axes.spines.right": False}


def panels(chart: Chart) -> tuple[Series, ...]:
    """Return the series that are drawn: those that break a rule, then the nearest to a limit, 12 at most."""
    ranked = sorted(
        enumerate(chart.series), key=lambda entry: (-len(entry[1].breaks), -_reach(entry[1]), entry[0])
    )
    return tuple(entry for _, entry in sorted(ranked[:MOST_PANELS]))


def draw_chart(chart: Chart, kind: str) -> bytes:
    """Draw the charts as ``png`` or ``svg``."""
    drawn = panels(chart)
    columns = min(_COLUMNS, len(drawn))
    rows = -(-len(drawn) // columns)
    with drawing_style(**_SETTINGS):
        figure = new_figure((max(4.4 * columns, 7.0), 3.5 * rows + 1.1))
        height = figure.get_figheight()
        outer = figure.add_gridspec(
            rows, columns, left=0.85 / figure.get_figwidth(), right=1 - 0.55 / figure.get_figwidth(),
            top=1 - 1.1 / height, bottom=0.62 / height, hspace=0.42, wspace=0.42,
        )  # fmt: skip
        for at, series in enumerate(drawn):
            inner = outer[at // columns, at % columns].subgridspec(2, 1, height_ratios=(2.6, 1), hspace=0.12)
            upper = figure.add_subplot(inner[0])
            _individuals(upper, series)
            _ranges(figure.add_subplot(inner[1], sharex=upper), series)
        portion = "" if len(drawn) == len(chart.series) else f", {len(drawn)} of {len(chart.series)} charts"
        figure.text(
            0.5, 1 - 0.22 / height,
            f"{chart.instrument}: error of check loads by the record in force{portion}",
            ha="center", va="center", fontsize=13, fontweight="bold",
        )  # fmt: skip
        figure.text(
            0.5, 1 - 0.45 / height,
            "solid: centre; dashed: 3 sigma limits; dotted: tolerance; orange ring: a run rule is broken "
            "(Nelson's number)",
            ha="center", va="center", fontsize=9, color=_GREY,
        )  # fmt: skip
        return picture(figure, kind)


def whole_ticks(axis: Axis) -> None:
    """Label an axis with whole numbers: a power of ten apart from them is overlooked, or hits the title."""
    axis.set_major_formatter(lambda value, _at: f"{value:.6g}".replace("-", "\N{MINUS SIGN}"))


def _reach(series: Series) -> float:
    if series.limits is None:
        return abs(series.points[-1].error) / series.tolerance / 100
    return abs(series.points[-1].error - series.limits.centre) / series.limits.sigma


def _individuals(axes: Axes, series: Series) -> None:
    errors = [point.error for point in series.points]
    x = range(1, len(errors) + 1)
    axes.plot(x, errors, "-o", color=_BLUE, lw=1, ms=4, zorder=3)
    if series.limits is not None:
        axes.axhspan(series.limits.lower, series.limits.upper, color=_BLUE, alpha=0.05, lw=0)
        axes.axhline(series.limits.centre, color=_GREY, lw=1)
        for value in (series.limits.lower, series.limits.upper):
            axes.axhline(value, color=_RED, lw=1, ls=(0, (5, 3)))
            axes.annotate(
                f"{value:+.3g}", (1.01, value), xycoords=("axes fraction", "data"), va="center", fontsize=7.5
            )
    lowest, highest = axes.get_ylim()
    for side in (-1, 1):
        # A tolerance far outside would press the points into a line: it is told instead.
        if lowest - (highest - lowest) < side * series.tolerance < highest + (highest - lowest):
            axes.axhline(side * series.tolerance, color=_GREY, lw=1, ls=":")
    broken: dict[int, list[str]] = {}
    for b in series.breaks:
        broken.setdefault(b.index, []).append(str(b.rule.number))
    for index, numbers in broken.items():
        axes.plot(index + 1, errors[index], "o", ms=10, mfc="none", mec=_RED, mew=1.6, zorder=4)
        axes.annotate(
            ",".join(numbers), (index + 1, errors[index]), xytext=(0, 8), textcoords="offset points",
            ha="center", fontsize=8, color=_RED, fontweight="bold",
        )  # fmt: skip
    limits = "no limits yet" if series.limits is None else f"limits of {series.limits.points} sessions" + (
        " (provisional)" if series.limits.provisional else ""
    )  # fmt: skip
    axes.margins(y=0.18)
    axes.set_title(
        f"{series.load} at {series.check_load}\ntolerance ±{series.tolerance:.3g} {series.unit}, {limits}",
        fontsize=9,
        loc="left",
    )
    axes.set_ylabel(f"error [{series.unit}]")
    whole_ticks(axes.yaxis)
    axes.tick_params(labelbottom=False)


def _ranges(axes: Axes, series: Series) -> None:
    axes.plot(range(2, len(series.points) + 1), series.ranges, "-s", color=_BLUE, lw=1, ms=3)
    if series.limits is not None:
        axes.axhline(series.limits.mean_range, color=_GREY, lw=1)
        axes.axhline(series.limits.upper_range, color=_RED, lw=1, ls=(0, (5, 3)))
    axes.set_ylim(bottom=0)
    axes.set_ylabel("range")
    whole_ticks(axes.yaxis)
    step = -(-len(series.points) // 6)
    ticks = list(range(len(series.points) - 1, -1, -step))[::-1]
    axes.set_xticks(
        [at + 1 for at in ticks], [series.points[at].date.isoformat() for at in ticks], rotation=30,
        ha="right", fontsize=7.5,
    )  # fmt: skip
    axes.set_xlim(0.5, len(series.points) + 0.5)


# The picture of a budget: what each component adds, and U over the range of the load.


FORMATS = (".png", ".svg", ".pdf")


def write_figure(path: Path, budget: Budget, over_range: Sequence[Budget]) -> Path:
    """Draw a budget to a file, whole or not at all.

    Raises
    ------
    ConfigError
        ``output-name``: the file's ending is none of png, svg and pdf
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(
            "a picture cannot be written in this format", where=path, got=path.suffix or "no ending",
            expected=", ".join(FORMATS), next_step="choose a name with one of these endings",
            rule="output-name",
        )  # fmt: skip
    drawing = new_figure((8.0, 3.6), layout="constrained")
    left, right = drawing.subplots(1, 2, width_ratios=(1.15, 1.0))
    parts = sorted(
        (component for component in budget.components if component.stated and component.u > 0),
        key=lambda one: one.u,
    )
    names = [f"{part.name} ({part.type})" for part in parts] + ["combined"]
    colours = ["#4477aa"] * len(parts) + ["#222222"]
    left.barh(names, [*(part.u for part in parts), budget.u], color=colours)
    left.set_xlabel(f"standard uncertainty [{budget.unit}]")
    left.set_title(f"{budget.record}: {budget.load} = {budget.at:.5g} {budget.unit}", fontsize=10)
    for at, one in enumerate(parts):
        left.text(one.u, at, f" {100 * budget.share(one):.0f} %", va="center", fontsize=8)
    left.margins(x=0.14)
    if budget.not_stated:
        missing = "not stated: " + ", ".join(budget.not_stated)
        drawing.supxlabel(missing, fontsize=8, x=0.01, ha="left")
    right.plot(
        [one.at for one in over_range], [one.U for one in over_range], color="#4477aa", marker="o", ms=3
    )
    right.set_ylim(0, 1.15 * max(one.U for one in over_range))
    right.set_xlabel(f"{budget.load} [{budget.unit}]")
    right.set_ylabel(f"U, {100 * budget.probability:.0f} % [{budget.unit}]")
    for axis in (left.xaxis, right.yaxis):
        whole_ticks(axis)
    left.locator_params(axis="x", nbins=5)
    right.grid(visible=True, alpha=0.3)
    right.set_title("expanded uncertainty over the range", fontsize=10)
    write_result(path, picture(drawing, path.suffix.lower()[1:]))
    return path
