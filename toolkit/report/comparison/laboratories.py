"""An interlaboratory comparison's figures as data: every laboratory's mean with its U, in order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.report.content import Curve, Plot

if TYPE_CHECKING:
    from toolkit.comparison.laboratories import LaboratoryComparison, Measurand


def laboratory_plots(comparison: LaboratoryComparison) -> dict[str, Plot]:
    """Return a figure for every measurand by its name."""
    plots = (_plot(measurand, number) for number, measurand in enumerate(comparison.measurands, start=1))
    return {plot.name: plot for plot in plots}


def _plot(measurand: Measurand, number: int) -> Plot:
    scores = sorted(measurand.scores, key=lambda score: score.mean)
    places = tuple(float(place) for place in range(len(scores)))
    ends = (-0.5, len(scores) - 0.5)
    band = 2 * (measurand.sigma_pt or 0.0)
    lines = [("assigned value", 0.0), *([("+2 sigma_pt", band), ("-2 sigma_pt", -band)] if band else [])]
    told = ", ".join(f"{score.laboratory} {score.mean:.5g}" for score in scores)
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
                Curve(
                    label=label, x=ends, y=(measurand.assigned + off,) * 2, group=place, style="line"
                )
                for place, (label, off) in enumerate(lines, start=1)
            ),
        ),
        caption=f"{measurand.name}: laboratories against the assigned value",
        alt=f"{measurand.name}, assigned {measurand.assigned:.5g} {measurand.unit}: {told}",
        names=tuple(score.laboratory for score in scores),
    )  # fmt: skip
