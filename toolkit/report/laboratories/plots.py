"""An interlaboratory comparison's figures as data: means with their U, Mandel's h and k."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from toolkit.comparison.precision import OUTLIER, STRAGGLER, h_limit, k_limit
from toolkit.report.content import Curve, Plot

if TYPE_CHECKING:
    from toolkit.comparison.laboratories import LaboratoryComparison, Measurand, Score

_BARS = 0.8  # of the room of a laboratory, for the bars of all measurands together


def laboratory_plots(comparison: LaboratoryComparison) -> dict[str, Plot]:
    """Return the figure of every measurand, and those of h and k where they can be told, by name."""
    measurands = comparison.measurands
    plots = [_means(measurand, number) for number, measurand in enumerate(measurands, start=1)]
    h = _bars(comparison, "h", lambda score: score.h, _h_lines(comparison))
    k = _bars(comparison, "k", lambda score: score.k, _k_lines(comparison))
    return {plot.name: plot for plot in (*plots, h, k) if plot is not None}


def _means(measurand: Measurand, number: int) -> Plot:
    scores = sorted(measurand.scores, key=lambda score: score.mean)
    places = tuple(float(place) for place in range(len(scores)))
    ends = (-0.5, len(scores) - 0.5)
    band = 2 * (measurand.sigma_pt or 0.0)
    lines = [
        ("assigned value", 0.0, 1),
        *([("±2 sigma_pt", off, 2) for off in (-band, band)] if band else []),
    ]
    listed = ", ".join(f"{score.laboratory} {score.mean:.5g}" for score in scores)
    return Plot(
        name=f"laboratories_{number}",
        x_label="laboratory",
        y_label=f"{measurand.name} [{measurand.unit}]",
        curves=(
            Curve(
                label="mean with U", x=places, y=tuple(score.mean for score in scores),
                error=tuple(score.U or 0.0 for score in scores), style="points",
            ),
            *(
                Curve(label=label, x=ends, y=(measurand.assigned + off,) * 2, group=group, style="line")
                for label, off, group in lines
            ),
        ),
        caption=f"{measurand.name}: laboratories against the assigned value",
        zero_y=False,
        alt=f"{measurand.name}, assigned {measurand.assigned:.5g} {measurand.unit}: {listed}",
        names=tuple(score.laboratory for score in scores),
    )  # fmt: skip


def _bars(
    comparison: LaboratoryComparison,
    name: str,
    statistic: Callable[[Score], float | None],
    limits: tuple[tuple[str, float], ...],
) -> Plot | None:
    """Return bars of a statistic, grouped by laboratory in the order of the file; None without any."""
    shown = [m for m in comparison.measurands if any(statistic(score) is not None for score in m.scores)]
    if not shown:
        return None
    laboratories = list(dict.fromkeys(score.laboratory for m in shown for score in m.scores))
    width = _BARS / len(shown)
    curves, parts = [], []
    for number, measurand in enumerate(shown):
        offset = (number - (len(shown) - 1) / 2) * width
        values = {score.laboratory: statistic(score) for score in measurand.scores}
        bars = {place: values.get(laboratory) for place, laboratory in enumerate(laboratories)}
        known = {place: value for place, value in bars.items() if value is not None}
        curves.append(
            Curve(
                label=measurand.name, x=tuple(place + offset for place in known), y=tuple(known.values()),
                group=number, style="bars", width=0.9 * width,
            )
        )  # fmt: skip
        listed = ", ".join(f"{laboratories[place]} {value:.2f}" for place, value in known.items())
        parts.append(f"{measurand.name}: {listed}")
    ends = (-0.5, len(laboratories) - 0.5)
    lines = [
        Curve(label=label, x=ends, y=(limit, limit), group=len(shown) + label.startswith("1 "), style="line",
              open=label.startswith("5 "))
        for label, limit in limits
    ]  # fmt: skip
    return Plot(
        name=f"laboratories_{name}",
        x_label="laboratory",
        y_label=f"Mandel's {name}",
        curves=(*curves, *lines),
        caption=f"Mandel's {name} of the laboratories, with its limits at 5 % and 1 %",
        alt=f"Mandel's {name} by laboratory: {'; '.join(parts)}",
        names=tuple(laboratories),
    )


def _h_lines(comparison: LaboratoryComparison) -> tuple[tuple[str, float], ...]:
    """Return the limits of the number of laboratories that most measurands have."""
    numbers = Counter(len(m.scores) for m in comparison.measurands if any(s.h is not None for s in m.scores))
    if not numbers:
        return ()
    ((p, _),) = numbers.most_common(1)
    lines = ((f"{100 * level:.0f} %", h_limit(p, level)) for level in (STRAGGLER, OUTLIER))
    return tuple((label, sign * limit) for label, limit in lines for sign in (1, -1))


def _k_lines(comparison: LaboratoryComparison) -> tuple[tuple[str, float], ...]:
    """Return the limits of the number of results that most laboratories have."""
    sizes = Counter(
        (score.n - 1, sum(other.n - 1 for other in m.scores))
        for m in comparison.measurands
        for score in m.scores
        if score.k is not None
    )
    if not sizes:
        return ()
    (((dof, total), _),) = sizes.most_common(1)
    return tuple((f"{100 * level:.0f} %", k_limit(dof, total, level)) for level in (STRAGGLER, OUTLIER))
