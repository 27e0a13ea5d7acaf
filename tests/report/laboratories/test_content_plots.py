"""Figures of an interlaboratory comparison: what is drawn where, and which limits."""

from __future__ import annotations

import pytest

from tests.report.laboratories.laboratories_factory import CONICITY, comparison
from toolkit.comparison.laboratories import compare_laboratories
from toolkit.report.figures import draw
from toolkit.report.laboratories.content import laboratory_plots


def test_means_stand_in_order_with_their_U_about_the_assigned_value() -> None:
    plot = laboratory_plots(comparison())["laboratories_1"]
    means, assigned, *band = plot.curves
    assert plot.names == ("C", "A", "E", "B", "D")
    assert list(means.y) == sorted(means.y)
    assert means.error == (0.3, 0.4, 0.0, 0.5, 0.5)
    measurand = comparison().measurands[0]
    assert assigned.y == (measurand.assigned,) * 2
    assert [line.y[0] for line in band] == pytest.approx(
        [
            measurand.assigned - 2 * (measurand.sigma_pt or 0),
            measurand.assigned + 2 * (measurand.sigma_pt or 0),
        ]
    )


def test_bars_of_every_measurand_stand_at_their_laboratory_and_do_not_overlap() -> None:
    plot = laboratory_plots(comparison())["laboratories_h"]
    bars = [curve for curve in plot.curves if curve.style == "bars"]
    assert [bar.label for bar in bars] == ["conicity", "plysteer"]
    assert plot.names == ("A", "B", "C", "D", "E")
    assert [round(x) for x in bars[0].x] == [0, 1, 2, 3, 4]
    assert [round(x) for x in bars[1].x] == [0, 1, 2, 4]  # D has no plysteer
    assert bars[1].x[0] - bars[0].x[0] > bars[0].width
    # Five laboratories: |h| 1.57 at 5 % and 1.72 at 1 % (ISO 5725-2, table 7).
    limits = {(curve.label, round(curve.y[0], 2)) for curve in plot.curves if curve.style == "line"}
    assert limits == {("5 %", 1.57), ("5 %", -1.57), ("1 %", 1.72), ("1 %", -1.72)}
    assert draw(plot).png.startswith(b"\x89PNG")


def test_without_repeats_there_is_no_figure_of_k() -> None:
    single = [results for results in CONICITY if len(results.values) == 1] + [
        type(CONICITY[0])(laboratory=name, values=(value,)) for name, value in (("F", 9.0), ("G", 11.0))
    ]
    plots = laboratory_plots(compare_laboratories({"x": single}, unit="N", reference=None, sigma=None))
    assert set(plots) == {"laboratories_1", "laboratories_h"}
