"""Axes of charts and budgets carry whole numbers: no power of ten stands apart from them."""

from __future__ import annotations

import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from toolkit.report.calibration.chart_figures import whole_ticks
from toolkit.report.content import Curve, Plot
from toolkit.report.figures import _RC, _figure


@pytest.mark.parametrize("size", [6e-5, 0.0125, 3.0, 4.2e6])
def test_ticks_say_their_values(size: float) -> None:
    figure = Figure()
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot([0, 1], [-size, size])
    whole_ticks(axes.yaxis)
    canvas.draw()
    assert axes.yaxis.get_offset_text().get_text() == ""
    said = [float(label.get_text().replace("\N{MINUS SIGN}", "-")) for label in axes.get_yticklabels()]
    assert said == pytest.approx(list(axes.get_yticks()))


@pytest.mark.parametrize(
    "label",
    [
        "table_simulated",
        "CONTINENTAL_SPORT_2019",
        "report-2019-06-04.xlsx",
        "reifenpruefstandsmessung",
        "x" * 60,
    ],
)
def test_a_legend_of_one_long_word_ends_inside_the_picture(label: str) -> None:
    curves = tuple(
        Curve(label=one, group=i, x=(0.0, 1.0), y=(0.0, 1.0), style="both")
        for i, one in enumerate((label, "b"))
    )
    plot = Plot(
        name="n", caption="c", alt="a", x_label="x", y_label="y", curves=curves, legend_title="compared"
    )
    with rc_context(_RC):
        figure = _figure(plot)
        figure.canvas.draw()
    assert figure.legends[0].get_window_extent().x1 <= figure.bbox.x1
    said = [text.get_text().replace("\n", "") for text in figure.legends[0].get_texts()]
    assert said == [label, "b"]
