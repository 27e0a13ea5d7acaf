"""A diagnosis' figures as data for Word: errors over noise, places of mismatch, one run in time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.diagnosis.answer.locate import time_unit
from toolkit.report.content import Curve, Plot
from toolkit.report.diagnosis.figures import binned, variable_of, worst_run
from toolkit.report.diagnosis.numbers import few
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import ChannelMismatch, Diagnosis
    from toolkit.diagnosis.search.search import Search
    from toolkit.report.style import Style

WHERE = 3  # figures of places at most
_STEPS = ("as declared", "refitted", "with the effects")
_MOST = 300  # points of a curve in print


def search_plots(search: Search, diagnosis: Diagnosis, style: Style) -> Iterator[Plot]:
    """Return where the mismatch of each output is, and the run with the largest one."""
    wheres = (_where(search, mismatch, diagnosis, style) for mismatch in diagnosis.mismatch)
    for i, plot in enumerate([plot for plot in wheres if plot is not None][:WHERE], start=1):
        yield replace(plot, name=f"diagnosis_where_{i}")
    if diagnosis.mismatch:
        yield _run(search, diagnosis, style)


def errors_plot(diagnosis: Diagnosis, style: Style) -> Plot:
    """Return the errors on held-out rows over the noise, before and after: the chart of ten seconds."""
    steps = _STEPS if diagnosis.effects else _STEPS[:2]
    names: list[str] = []
    bars: list[tuple[list[float], list[float]]] = [([], []) for _ in steps]
    sentences = []
    for fit in diagnosis.fit.held_out:
        errors = (fit.nominal_rmse, fit.refitted_rmse, fit.augmented_rmse)
        if not all(map(math.isfinite, (*errors, fit.noise_floor))):
            continue
        over = [value / max(fit.noise_floor, 1e-300) for value in errors][: len(steps)]
        for i, value in enumerate(over):
            bars[i][0].append(float(len(names)))
            bars[i][1].append(value)
            names.append(fit.channel if i == len(steps) // 2 else "")
        names.append("")
        listed = ", ".join(f"{s} {_number(v, style)}" for s, v in zip(steps, over, strict=True))
        sentences.append(f"{fit.channel}: {listed}")
    names = names[:-1]
    curves = [
        Curve(
            label=label, x=tuple(x), y=tuple(y), group=(6, 1, 0)[i], style="bars",
            notes=tuple(_number(value, style) for value in y),
        )
        for i, (label, (x, y)) in enumerate(zip(steps, bars, strict=True))
    ]  # fmt: skip
    ends = (-0.6, len(names) - 0.4)
    curves.append(Curve(label="noise", x=ends, y=(1.0, 1.0), group=2, style="line"))
    return Plot(
        name="diagnosis_errors",
        x_label="output",
        y_label="error over noise [1]",
        curves=tuple(curves),
        caption="Root mean square error on rows that no fit has seen, over the noise of the output. A "
        "simulation that misses nothing stands at 1.",
        alt="Error over noise: " + "; ".join(sentences) + ".",
        legend_title="simulation",
        decimal_comma=style.decimal_comma,
        names=tuple(names),
    )


def _where(search: Search, mismatch: ChannelMismatch, diagnosis: Diagnosis, style: Style) -> Plot | None:
    """Return an output's residual over the first variable that has numbers, in means of equal counts."""
    problem = search.problem
    mask = problem.kept[mismatch.channel]
    for place in mismatch.where:
        x = variable_of(search, place.variable)
        if x is None or not isinstance(place.start, float) or not isinstance(place.end, float):
            continue
        unit = _unit(search, mismatch.channel)
        series = [("refitted", 1, search.refitted.residual[mismatch.channel])]
        if diagnosis.effects:
            series.append(("with the effects", 0, search.augmented.residual[mismatch.channel]))
        curves = []
        for label, group, residual in series:
            at, mean = binned(x[mask], residual[mask])
            curves.append(
                Curve(label=label, x=tuple(at.tolist()), y=tuple(mean.tolist()), group=group, style="both")
            )
        span = f"{_number(place.start, style)} to {_number(place.end, style)} {place.unit}".rstrip()
        extent = "everywhere from" if place.whole else "mostly at"
        return Plot(
            name="",
            x_label=f"{place.variable} [{place.unit}]" if place.unit else place.variable,
            y_label=f"recorded − simulated {mismatch.channel} [{unit}]",
            curves=tuple(curves),
            caption=f"{mismatch.channel}: mean residual over {place.variable}; "
            f"the mismatch is {extent} {span}.",
            alt=f"Mean of recorded less simulated {mismatch.channel} over {place.variable}, {extent} {span}.",
            legend_title="simulation",
            decimal_comma=style.decimal_comma,
        )
    return None


def _run(search: Search, diagnosis: Diagnosis, style: Style) -> Plot:
    problem, channel = search.problem, diagnosis.mismatch[0].channel
    worst = worst_run(search, channel)
    rows, run = problem.slices[worst], problem.runs[worst]
    stride = slice(None, None, max(1, -(-run.rows // _MOST)))
    good = np.isfinite(problem.observed[channel][rows][stride])
    clock, seconds = time_unit(problem.case)
    t = run.t[stride] / seconds

    def curve(label: str, group: int, y: Array, *, points: bool = False) -> Curve:
        rows = good if points else np.ones(len(t), dtype=bool)
        return Curve(
            label=label, x=tuple(t[rows].tolist()), y=tuple(y[rows].tolist()), group=group,
            style="points" if points else "line", open=points,
        )  # fmt: skip

    curves = [
        curve("recorded", 6, problem.observed[channel][rows][stride], points=True),
        curve("refitted", 1, search.refitted.simulated[channel][rows][stride]),
    ]
    if diagnosis.effects:
        curves.append(curve("with the effects", 0, search.augmented.simulated[channel][rows][stride]))
    timed = problem.case.has_time
    return Plot(
        name="diagnosis_run",
        x_label=f"time [{clock}]" if timed else "row",
        y_label=f"{channel} [{_unit(search, channel)}]",
        curves=tuple(curves),
        caption=f"{channel} in {run.name}, the run with the largest mismatch.",
        alt=f"{channel} in {run.name}: recorded and simulated over {'time' if timed else 'rows'}.",
        legend_title="simulation",
        decimal_comma=style.decimal_comma,
    )


def _unit(search: Search, channel: str) -> str:
    text = next(output.unit for output in search.problem.model.outputs if output.name == channel)
    return printed(text)


def _number(value: float, style: Style) -> str:
    return style.decimal(few(value))
