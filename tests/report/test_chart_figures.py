"""Axes of charts and budgets carry whole numbers: no power of ten stands apart from them."""

from __future__ import annotations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from toolkit.report.calibration.chart_figures import whole_ticks


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
