"""Figures of a diagnosis: error before and after, where the mismatch is, one run in time, runs by output.

Maps show how large the residual is over slip angle, load, condition, revolution and time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.diagnosis.answer.locate import time_unit
from toolkit.report.figures import drawing_style, new_figure, picture
from toolkit.units import unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolkit.diagnosis.answer.answer import DiagnosedLaw, Diagnosis, MismatchPlace
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.search import Search

GREY, ORANGE, BLUE, GREEN, VIOLET = "#6b6b6b", "#d9822b", "#1565c0", "#2e7d32", "#6a3d9a"
_SETTINGS: Any = {
    "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#e4e4e4", "grid.linewidth": 0.6,
}  # fmt: skip
_MOST = 1200  # points of a scatter
_PIXELS = 700  # of a curve's width; in each the least and the largest value are drawn
_FEW = 300  # rows of a run whose points stand apart
_BINS = 24
_WIDE = 200.0  # errors over noise from which a chart goes by powers of ten


def error_bars(diagnosis: Diagnosis) -> bytes:
    """Return the chart of the first ten seconds: held-out error over noise, a bar for each simulation."""
    names = [fit.channel for fit in diagnosis.fit.held_out]

    def draw(figure: Figure) -> None:
        from matplotlib.patches import Rectangle

        axes = figure.add_subplot()
        steps = [("as declared", GREY, "nominal_rmse"), ("refitted", ORANGE, "refitted_rmse")]
        if diagnosis.effects:
            steps.append(("with the effect", BLUE, "augmented_rmse"))
        if any(fit.with_laws_rmse is not None for fit in diagnosis.fit.held_out):
            steps.append(("with the laws", VIOLET, "with_laws_rmse"))
        for i, (label, colour, field) in enumerate(steps):
            values = [getattr(fit, field) / max(fit.noise_floor, 1e-300) for fit in diagnosis.fit.held_out]
            at = np.arange(len(names)) + (i - (len(steps) - 1) / 2) * 0.78 / len(steps)
            bars = axes.barh(at, values, height=0.72 / len(steps), color=colour, label=label)
            axes.bar_label(
                bars, labels=[f"{v:#.3g}".rstrip(".") for v in values], padding=4, fontsize=9, color="#333333"
            )
        axes.axvline(1.0, color=GREEN, linewidth=1.6)
        lengths = [bar.get_width() for bar in axes.patches if isinstance(bar, Rectangle)]
        # Bars of a millionth of the longest could not be seen beside it.
        wide = max(lengths, default=1.0) > _WIDE
        if wide:
            axes.set_xscale("log")
            axes.set_xlim(left=0.5 * min(1.0, *lengths))
        top = axes.get_xaxis_transform()
        axes.text(1.0, 1.02, "noise", color=GREEN, transform=top, ha="center")
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel(
            f"root mean square error on held-out rows, over the noise{' (powers of ten)' if wide else ''}"
        )
        axes.margins(x=0.12)
        axes.grid(visible=False, axis="y")
        # Above the bars: the longest of them would run through a legend inside.
        figure.legend(loc="outside upper right", ncols=4, frameon=False)

    return draw_svg((8.6, 1.5 + 0.85 * max(len(names), 1)), draw)


def mismatch_map(search: Search, channel: str, place: MismatchPlace, *, after: bool) -> bytes | None:
    """Return an output's residual over the variable that holds its mismatch, before and after."""
    problem = search.problem
    x = variable_of(search, place.variable)
    if x is None:
        return None
    mask = problem.kept[channel]
    unit = next(output.unit for output in problem.model.outputs if output.name == channel)

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        series = [("refitted", ORANGE, search.refitted.residual[channel])]
        if after:
            series.append(("with the effect", BLUE, search.augmented.residual[channel]))
        for label, colour, residual in series:
            rows = np.flatnonzero(mask)
            rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _MOST)).astype(np.intp)]
            axes.plot(x[rows], residual[rows], ".", markersize=2.2, alpha=0.25, color=colour)
            centre, mean = binned(x[mask], residual[mask])
            axes.plot(centre, mean, "-", linewidth=2.0, color=colour, label=f"{label} (mean)")
        if isinstance(place.start, float) and isinstance(place.end, float):
            axes.axvspan(place.start, place.end, color="#f6e7c8", alpha=0.5, zorder=0)
        axes.axhline(0, color="#333333", linewidth=0.8)
        axes.set_xlabel(f"{place.variable} [{place.unit}]" if place.unit else place.variable)
        axes.set_ylabel(f"recorded − simulated {channel} [{unit}]")
        axes.legend(frameon=False)

    return draw_svg((8.6, 3.6), draw)


def worst_run(search: Search, channel: str) -> int:
    """Return the number of the run with the largest mismatch of an output."""
    problem = search.problem
    residual = np.where(problem.kept[channel], search.refitted.residual[channel], 0.0)
    return int(np.argmax([float(np.sum(residual[run] ** 2)) for run in problem.slices]))


def run_in_time(search: Search, channel: str, *, after: bool, laws: Laws | None = None) -> bytes:
    """Return the run with the largest mismatch of an output: recorded and simulated, residuals beneath.

    Parameters
    ----------
    after : whether effects are told, and shown
    laws : of what has no name, shown where there are any
    """
    problem = search.problem
    worst = worst_run(search, channel)
    rows, run = problem.slices[worst], problem.runs[worst]
    unit = next(output.unit for output in problem.model.outputs if output.name == channel)

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1))
        size, second = time_unit(problem.case)
        t = run.t / second
        # Large enough to be seen under a line that goes through them.
        dots = 5.0 if run.rows < _FEW else 2.5
        observed = problem.observed[channel][rows]
        upper.plot(*drawn(t, observed), ".", markersize=dots, color=GREY, label="recorded")
        fits = [("refitted", ORANGE, search.refitted)]
        if after:
            fits.append(("with the effect", BLUE, search.augmented))
        if laws is not None and laws.listed:
            fits.append(("with the laws", VIOLET, laws.fit))
        for label, colour, fit in fits:
            upper.plot(*drawn(t, fit.simulated[channel][rows]), color=colour, linewidth=1.2, label=label)
            lower.plot(*drawn(t, fit.residual[channel][rows]), color=colour, linewidth=0.8)
        upper.set_ylabel(f"{channel} [{unit}]")
        # Outside: inside it would lie on the curves of a run that rises.
        figure.legend(loc="outside upper right", ncols=3, frameon=False, markerscale=2)
        lower.axhline(0, color="#333333", linewidth=0.8)
        lower.set_ylabel(f"residual [{unit}]")
        lower.set_xlabel(f"{f'time [{size}]' if problem.case.has_time else 'row'}, {run.name}")
        figure.align_ylabels()

    return draw_svg((8.6, 4.4), draw)


def drawn(t: Array, y: Array) -> tuple[Array, Array]:
    """Return the rows of a curve that show in print: of every pixel its least and its largest value."""
    usable = np.flatnonzero(np.isfinite(y))
    if len(usable) <= 2 * _PIXELS:
        return t, y
    pixel = np.minimum((usable * _PIXELS) // len(y), _PIXELS - 1)
    order = np.lexsort((y[usable], pixel))
    starts = np.flatnonzero(np.diff(pixel[order], prepend=-1))
    ends = np.append(starts[1:], len(order)) - 1
    rows = np.unique(usable[order[np.concatenate([starts, ends])]])
    return t[rows], y[rows]


def law_curve(law: DiagnosedLaw) -> bytes | None:
    """Return a law of one signal with its 95 % band, None of one that has no curve."""
    curve, place = law.curve, law.place
    if curve is None:
        return None

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.fill_between(curve.x, *curve.band95, color=VIOLET, alpha=0.25, linewidth=0, label="95 %")
        axes.plot(curve.x, curve.y, color=VIOLET, linewidth=1.4, label=law.formula or "curve")
        axes.axhline(0, color="#333333", linewidth=0.8)
        axes.set_xlabel(law.variables[0])
        label = "factor less one" if law.acts == "multiplies" else f"added [{curve.unit}]"
        axes.set_ylabel(
            f"added to d{place.channel}/dt" if place.kind == "state" else f"{place.channel}: {label}"
        )
        axes.legend(frameon=False)

    return draw_svg((5.6, 3.0), draw)


def run_map(search: Search, diagnosis: Diagnosis, *, after: bool) -> bytes:
    """Return root mean square residuals over the noise of the first chart, by run and output."""
    problem = search.problem
    floors = {score.channel: score.noise_floor for score in diagnosis.fit.held_out}
    names = [name for name in problem.names if name in floors]
    fits = [("refitted", search.refitted)] + ([("with the effect", search.augmented)] if after else [])

    def table(fit: Any) -> Array:
        share = np.zeros((len(names), len(problem.runs)))
        for i, name in enumerate(names):
            noise = max(floors[name], 1e-300)
            at, judged = problem.judged_at(name), problem.judged(name, fit.residual[name])
            for j, run in enumerate(problem.slices):
                values = judged[(at >= run.start) & (at < run.stop)]
                share[i, j] = np.sqrt(np.mean(values**2)) / noise if len(values) else np.nan
        return share

    def draw(figure: Figure) -> None:
        shares = [table(fit) for _, fit in fits]
        largest = max(2.0, float(np.nanmax(np.stack(shares))))
        panels = figure.subplots(len(fits), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (label, _), values in zip(panels, fits, shares, strict=True):
            axes.imshow(values, aspect="auto", cmap="YlOrBr", vmin=0, vmax=largest)
            axes.set_yticks(range(len(names)), names)
            axes.set_title(label, loc="left", fontsize=10)
            axes.grid(visible=False)
            _write_cells(axes, values, largest)
        panels[-1].set_xticks(
            range(len(problem.runs)), [_short(run.name) for run in problem.runs],
            rotation=0 if len(problem.runs) < 9 else 90,
        )  # fmt: skip

    return draw_svg((8.6, 0.9 + len(fits) * (0.5 + 0.42 * len(names))), draw)


def _write_cells(axes: Axes, values: Array, largest: float) -> None:
    if values.shape[1] > 16:
        return
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if np.isfinite(values[i, j]):
                colour = "white" if values[i, j] > 0.6 * largest else "#333333"
                axes.text(j, i, f"{values[i, j]:.2g}", ha="center", va="center", color=colour, fontsize=9)


def _short(name: str) -> str:
    return name.removesuffix(".csv").removesuffix(".xlsx")


def variable_of(search: Search, name: str) -> Array | None:
    """Return the values of a place's variable over all runs (n,), None where it has no numbers."""
    problem = search.problem
    if name in problem.names:
        return search.refitted.simulated[name]
    if name == "time":
        return np.concatenate([run.t for run in problem.runs]) / time_unit(problem.case)[1]
    if all(name in run.columns for run in problem.runs):
        return np.concatenate([run.columns[name] for run in problem.runs])
    return None


def binned(x: Array, y: Array, *, bins: int = _BINS) -> tuple[Array, Array]:
    """Return means of x and y in bins of equal counts."""
    edges = np.unique(np.quantile(x, np.linspace(0, 1, bins + 1)))
    if len(edges) < 3:
        return np.array([float(np.mean(x))]), np.array([float(np.mean(y))])
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    # Values that repeat leave bins empty: these have no mean, and none is drawn.
    count = np.bincount(at, minlength=len(edges) - 1)
    filled = count > 0
    centre = np.bincount(at, weights=x, minlength=len(edges) - 1)[filled] / count[filled]
    mean = np.bincount(at, weights=y, minlength=len(edges) - 1)[filled] / count[filled]
    return centre, mean


def draw_svg(size: tuple[float, float], draw: Callable[[Figure], None]) -> bytes:
    """Return a figure that is drawn in the page's style, as SVG; the same input makes the same bytes."""
    with drawing_style(**_SETTINGS):
        figure = new_figure(size, layout="constrained")
        draw(figure)
        return picture(figure, "svg")


_FIRST = ("SA", "SA_CMD", "FZ", "FZ_CMD")
_TURNS = ("TIRE_ANGLE", "DRUM_ANGLE")
_PANELS, _ACROSS = 9, 3
_LEVELS = 6  # of a condition, beyond which it is the runs' own name
_MAP_BINS = 12

# Label, the values of all rows, and what they are called where they are levels of a condition.
Variable = tuple[str, "Array", tuple[str, ...]]


def variables(search: Search) -> list[Variable]:
    """Return what a residual is mapped over: slip angle, load, conditions, revolutions, time, the rest."""
    problem = search.problem
    drivers = {
        driver.name: driver.unit
        for driver in problem.case.drivers
        if all(driver.name in run.columns for run in problem.runs)
    }
    order = [name for name in _FIRST if name in drivers]
    other_drivers = [name for name in drivers if name not in (*_FIRST, *_TURNS)]
    listed = [_channel(search, name, drivers[name]) for name in order]
    listed += _conditions(search)
    listed += [_revolution(search, name, drivers[name]) for name in _TURNS if name in drivers]
    if problem.case.has_time:
        text, seconds = time_unit(problem.case)
        listed.append((f"time [{text}]", np.concatenate([run.t for run in problem.runs]) / seconds, ()))
    listed += [_channel(search, name, drivers[name]) for name in other_drivers]
    return [
        variable
        for variable in listed
        if np.isfinite(variable[1]).any() and np.nanmax(variable[1]) > np.nanmin(variable[1])
    ]


def size_maps(search: Search, diagnosis: Diagnosis, channel: str, *, after: bool) -> bytes | None:
    """Return an output's root mean square residual over its noise, a panel for each variable."""
    noise = max(
        next((score.noise_floor for score in diagnosis.fit.held_out if score.channel == channel), 0.0), 1e-300
    )
    shown_variables = variables(search)[:_PANELS]
    at = search.problem.judged_at(channel)
    if not shown_variables or not len(at):
        return None
    fits = [("refitted", ORANGE, search.refitted)]
    if after:
        fits.append(("with the effect", BLUE, search.augmented))
    across = 4 if len(shown_variables) == 4 else min(_ACROSS, len(shown_variables))
    down = -(-len(shown_variables) // across)

    def draw(figure: Figure) -> None:
        panels = figure.subplots(down, across, sharey=True, squeeze=False)
        for i, axes in enumerate(panels.flat):
            if i >= len(shown_variables):
                axes.axis("off")
                continue
            label, values, levels = shown_variables[i]
            for j, (name, colour, fit) in enumerate(fits):
                judged = search.problem.judged(channel, fit.residual[channel])
                _panel(
                    axes, values[at], judged / noise, levels,
                    label=name, colour=colour, beside=(j - (len(fits) - 1) / 2, 0.8 / len(fits)),
                )  # fmt: skip
            axes.axhline(1.0, color=GREEN, linewidth=1.2, label="noise")
            axes.set_xlabel(label)
        for axes in panels[:, 0]:
            axes.set_ylabel(f"{channel} over noise")
        # After the last panel, which may hold the largest of them all.
        panels[0, 0].set_ylim(bottom=0)
        figure.legend(
            *panels[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False
        )

    return draw_svg((8.6, 0.5 + 1.9 * down), draw)


def _panel(
    axes: Axes,
    x: Array,
    residual: Array,
    levels: tuple[str, ...],
    *,
    label: str,
    colour: str,
    beside: tuple[float, float],
) -> None:
    if not levels:
        centre, mean = binned(x, residual**2, bins=_MAP_BINS)
        axes.plot(centre, np.sqrt(mean), ".-", color=colour, linewidth=1.4, markersize=4, label=label)
        return
    sizes = [residual[x == i] for i in range(len(levels))]
    heights = [float(np.sqrt(np.mean(size**2))) if len(size) else 0.0 for size in sizes]
    place = np.arange(len(levels)) + beside[0] * beside[1]
    axes.bar(place, heights, width=beside[1], color=colour, label=label)
    axes.set_xticks(range(len(levels)), levels)
    axes.grid(visible=False, axis="x")


def _channel(search: Search, name: str, measure: str) -> Variable:
    return (f"{name} [{measure}]", np.concatenate([run.columns[name] for run in search.problem.runs]), ())


def _revolution(search: Search, name: str, measure: str) -> Variable:
    """Return where in its turn the tire or the drum stands [deg]: what is locked to it stands still there."""
    _, angle, _ = _channel(search, name, measure)
    return f"{name} in one turn [deg]", np.rad2deg(angle * unit(measure).factor) % 360.0, ()


def _conditions(search: Search) -> list[Variable]:
    runs = search.problem.runs
    variables: list[Variable] = []
    for key in dict.fromkeys(key for run in runs for key in run.conditions):
        levels = tuple(dict.fromkeys(run.conditions.get(key, "-") for run in runs))
        if 1 < len(levels) <= _LEVELS:
            at = [np.full(run.rows, float(levels.index(run.conditions.get(key, "-")))) for run in runs]
            variables.append((key, np.concatenate(at), levels))
    return variables
