from __future__ import annotations

import pytest

from tests.report.report_factory import make_record, make_result
from toolkit.report.drawer import Drawer
from toolkit.report.figures import Picture, draw
from toolkit.report.test.content import build_content

OTHER = pytest.mark.campaign("another number of hands: a worker draws with two in every run")


@pytest.mark.parametrize("hands", [pytest.param(1, marks=OTHER), 2, pytest.param(5, marks=OTHER)])
def test_a_worker_draws_what_this_process_draws_with_any_number_of_hands(hands: int) -> None:
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:3])
    with Drawer(hands=hands) as drawer:
        drawn = dict(drawer.pictures(plots))
    assert drawn == {name: draw(plot) for name, plot in plots.items()}


def test_a_worker_that_died_costs_no_report() -> None:
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:1])
    with Drawer(hands=1) as drawer:
        drawer._worker.kill()
        assert drawer.pictures(plots)[next(iter(plots))].png.startswith(b"\x89PNG")


def test_what_a_dying_worker_left_is_drawn_and_nobody_waits_for_it() -> None:
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:3])
    with Drawer(hands=1) as drawer:
        drawn = drawer.pictures(plots)
        first, *rest = plots
        assert drawn[first].png.startswith(b"\x89PNG")
        drawer._worker.kill()
        assert all(drawn[name].png.startswith(b"\x89PNG") for name in rest)


@pytest.mark.campaign("many large figures: a worker draws with two hands in every run")
def test_figures_larger_than_a_pipe_come_from_both_hands() -> None:
    plots = build_content(make_result(), make_record()).plots
    with Drawer(hands=2) as drawer:
        drawn = dict(drawer.pictures(plots))
    assert list(drawn) == list(plots)
    # A pipe of Linux holds 64 kB.
    assert sum(len(one.png) for one in list(drawn.values())[1::2]) > 2**16


def test_an_error_of_a_figure_is_raised_where_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_plot: object) -> Picture:
        raise ArithmeticError("a figure that cannot be drawn")

    monkeypatch.setattr("toolkit.report.figures.draw", broken)
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:1])
    with Drawer(hands=1) as drawer:
        drawer._worker.kill()
        with pytest.raises(ArithmeticError, match="cannot be drawn"):
            drawer.pictures(plots)[next(iter(plots))]
