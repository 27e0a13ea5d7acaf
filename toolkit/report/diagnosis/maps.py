"""Maps of a mismatch: how large the residual is over slip angle, load, condition, revolution and time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.locate import time_unit
from toolkit.report.diagnosis.figures import BLUE, GREEN, ORANGE, binned, draw_svg
from toolkit.units import unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.diagnosis.search.search import Search

_FIRST = ("SA", "SA_CMD", "FZ", "FZ_CMD")
_TURNS = ("TIRE_ANGLE", "DRUM_ANGLE")
_PANELS, _ACROSS = 9, 3
_LEVELS = 6  # of a condition, beyond which it is the runs' own name
_BINS = 12

# Label, the values of all rows, and what they are called where they are levels of a condition.
Variable = tuple[str, "NDArray[np.float64]", tuple[str, ...]]


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
    return [one for one in listed if np.isfinite(one[1]).any() and np.nanmax(one[1]) > np.nanmin(one[1])]


def size_maps(search: Search, diagnosis: Diagnosis, channel: str, *, after: bool) -> bytes | None:
    """Return an output's root mean square residual over its noise, a panel for each variable."""
    noise = max(next((one.noise_floor for one in diagnosis.held_out if one.channel == channel), 0.0), 1e-300)
    shown_variables = variables(search)[:_PANELS]
    mask = search.problem.kept[channel]
    if not shown_variables or not mask.any():
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
                _panel(
                    axes, values[mask], fit.residual[channel][mask] / noise, levels,
                    label=name, colour=colour, at=(j - (len(fits) - 1) / 2, 0.8 / len(fits)),
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
    x: NDArray[np.float64],
    residual: NDArray[np.float64],
    levels: tuple[str, ...],
    *,
    label: str,
    colour: str,
    at: tuple[float, float],
) -> None:
    if not levels:
        centre, mean = binned(x, residual**2, bins=_BINS)
        axes.plot(centre, np.sqrt(mean), ".-", color=colour, linewidth=1.4, markersize=4, label=label)
        return
    sizes = [residual[x == i] for i in range(len(levels))]
    heights = [float(np.sqrt(np.mean(size**2))) if len(size) else 0.0 for size in sizes]
    axes.bar(np.arange(len(levels)) + at[0] * at[1], heights, width=at[1], color=colour, label=label)
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
