"""A comparison's figures as data: characteristics against load, a series an entry (thesis 6.6 to 6.29)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import comparison_figures
from toolkit.estimate import plus_minus
from toolkit.report.content import Curve, Plot
from toolkit.report.style import Style
from toolkit.report.tags import format_number

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic, Figure
    from toolkit.comparison.model import Comparison, Entry


def comparison_plots(comparison: Comparison, style: Style) -> dict[str, Plot]:
    """Return the figures by name; one that fewer than two entries have values for is left out.

    Stiffness is drawn by the ±1 deg secant, as the source document has it, with the drum forward.
    """
    plots = (_plot(comparison, figure, drawn, style) for figure, drawn in comparison_figures().items())
    return {plot.name: plot for plot in plots if plot is not None}


def _plot(comparison: Comparison, figure: Figure, drawn: Characteristic, style: Style) -> Plot | None:
    unit, factor = style.unit(drawn.printed_unit)
    load_unit, load_factor = style.unit("N")
    scale = factor * drawn.factor
    shown_unit = str(unit).replace("*", "·")
    curves, sentences = [], []
    for place, entry in enumerate(comparison.entries):
        x, y, U = _series(entry, drawn.name)
        if not x:
            continue
        x, y, U = [a * load_factor for a in x], [b * scale for b in y], [c * scale for c in U]
        curves.append(
            Curve(
                label=entry.label, x=tuple(x), y=tuple(y), error=tuple(U), group=place, style="both",
                open=entry.kind != "test",
            )
        )  # fmt: skip
        listed = ", ".join(
            f"{plus_minus(b, c, decimal_comma=style.decimal_comma)} at {_number(a, style)}"
            for a, b, c in zip(x, y, U, strict=True)
        )
        sentences.append(f"{entry.label}: {listed} {load_unit}")
    if len(curves) < 2:
        return None
    simulated = any(entry.simulated for entry in comparison.entries)
    words = (*(use.word for use in comparison.uses), "SIMULATED" if simulated else None)
    mark = " - ".join(dict.fromkeys(word for word in words if word))
    title = figure.title + (f", {drawn.series_label}, forward" if drawn.scope == "direction" else "")
    title = title[:1].upper() + title[1:]
    return Plot(
        name=figure.name,
        x_label=f"load FZ [{load_unit}]",
        y_label=f"{figure.title} [{shown_unit}]",
        curves=tuple(curves),
        caption=f"{title} against load; bars: expanded uncertainty (95 %). SAE J670 axes.",
        alt=(f"{mark}. " if mark else "")
        + f"{title} [{shown_unit}] against load with expanded uncertainty. "
        + "; ".join(sentences)
        + ". Axis system: SAE J670.",
        watermark=mark or None,
        legend_title="compared",
    )


def _series(entry: Entry, name: str) -> tuple[list[float], list[float], list[float]]:
    """Return loads [N], values and expanded uncertainties in SI of one quantity of an entry."""
    points = sorted(
        (
            (row.load_N, row.estimate.value, row.estimate.expanded()[0])
            for row in entry.rows
            if row.estimate is not None and row.name == name and row.rotation in ("both", "forward")
        ),
        key=lambda point: point[0],
    )
    return (
        [load for load, _, _ in points],
        [value for _, value, _ in points],
        [U if math.isfinite(U) else 0.0 for _, _, U in points],
    )


def _number(value: float, style: Style) -> str:
    return format_number(value, ".0f", decimal_comma=style.decimal_comma)
