from __future__ import annotations

from report_factory import make_record, make_result

from toolkit.report.build import build_content
from toolkit.report.drawer import Drawer
from toolkit.report.figures import draw


def test_workers_draw_what_one_process_draws() -> None:
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:3])
    with Drawer(workers=2) as drawer:
        drawn = dict(drawer.pictures(plots))
    assert drawn == {name: draw(plot) for name, plot in plots.items()}


def test_a_worker_that_died_costs_no_report() -> None:
    plots = dict(list(build_content(make_result(), make_record()).plots.items())[:1])
    with Drawer(workers=1) as drawer:
        drawer._workers[0].kill()
        assert drawer.pictures(plots)[next(iter(plots))].png.startswith(b"\x89PNG")
