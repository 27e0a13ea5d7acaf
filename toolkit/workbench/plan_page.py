"""What to measure next: the plans that the home keeps, and a form for each kind of plan."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.inputs import RESULT_FILE, read_regular
from toolkit.lab.desk.chart import Chart, Series
from toolkit.lab.desk.jobs import start_job
from toolkit.lab.desk.kept_plans import KINDS, PlanKind, fixtures_of, plan_words, read_plan, titles_of
from toolkit.lab.desk.previews import templates_of
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.page import Routes, as_file, page

_TYPES = {
    "pdf": "application/pdf", "png": "image/png", "json": "application/json",
    "csv": "text/csv; charset=utf-8", "txt": "text/plain; charset=utf-8",
    "toml": "text/plain; charset=utf-8",
    "docx": "application/vnd.openxmlformats-officedocument.wordprocessingml.document",
}  # fmt: skip


def plans(request: Request) -> Response:
    """Return the list's page: nothing is looked through before it stands."""
    return page(request, "plans")


def plan_list(request: Request) -> Response:
    """Return the plans that the home keeps, and a form for each kind of a new one."""
    bench: Bench = request.app.state.bench
    holdings = bench.holdings(again=True)
    return page(
        request, "part_plans", plans=holdings.places["plan"], instruments=bench.registry.instruments(),
        tests=holdings.places["test"], answers=holdings.places["diagnosis"],
        templates=templates_of(bench.home, "plan"), fixtures=fixtures_of(bench.home),
    )  # fmt: skip


def plan(request: Request) -> Response:
    """Return a plan's page."""
    _, plan_id, folder = holding(request, "plan")
    planned = read_plan(folder)
    return page(
        request, "plan", kept=planned, answer=planned.answer, plan_id=plan_id,
        chart=_risk_chart(planned.answer) if planned.kind == "interval" else None,
        characteristics=titles_of(planned),
        place_of=request.app.state.bench.holdings().places["plan"][plan_id],
    )  # fmt: skip


def file(request: Request) -> Response:
    """Return a file of a plan, one of those that a plan writes."""
    _, _, folder = holding(request, "plan")
    planned, name = read_plan(folder), request.path_params["name"]
    if name not in (*planned.files, *planned.pictures):
        raise HTTPException(404)
    content = read_regular(folder / name, RESULT_FILE)
    return as_file(content, _TYPES[name.rpartition(".")[2]], name, shown=name in planned.pictures)


def start(request: Request) -> Response:
    """Start a plan as a job."""
    bench: Bench = request.app.state.bench
    kind = next((kind for kind in KINDS if kind == request.path_params["kind"]), None)
    if kind is None:
        raise HTTPException(404)
    form = request.state.form
    subject = _subject(bench, kind, form)
    template = templates_of(bench.home, "plan").get(form.get("template", ""))
    fixtures = fixtures_of(bench.home).get(form.get("fixtures", ""))
    words = plan_words(bench.home, kind, form, subject, template, fixtures)
    job = start_job(bench.home, kind="plan", title=" ".join(filter(None, (kind, subject))), words=words)
    return RedirectResponse(f"{bench.keys.place}/job/{job}", 303)


def _subject(bench: Bench, kind: PlanKind, form: Mapping[str, str]) -> str | None:
    """Return what a plan is for: an instrument, or the place of a holding by its id; nothing else has one."""
    subject = form.get("subject", "")
    if not subject:
        return None
    if kind in ("session", "interval"):
        basis = subject if subject in bench.registry.instruments() else None
    else:
        bench.holdings(again=True)
        basis = bench.holdings().places["test" if kind == "test" else "diagnosis"].get(subject)
    if basis is None:
        raise HTTPException(404)
    return basis


def _risk_chart(answer: Mapping[str, Any]) -> Chart:
    """Return the risk over the days of an interval, and what is allowed."""
    points = {risk["days"]: 100 * risk["beyond"] for risk in (*answer["risks"], answer["chosen"])}
    days = sorted(points)
    risk: Series = {"label": "risk", "x": days, "y": [points[day] for day in days], "line": True}
    level = [100 * (1 - answer["reliability"])] * len(days)
    allowed: Series = {"label": "allowed", "x": days, "y": level, "line": True, "dash": True}
    return {"x_label": "interval [days]", "y_label": "beyond [%]", "series": [risk, allowed]}


ROUTES: Routes = (
    ("GET", "/plans", plans),
    ("GET", "/plans/list", plan_list),
    ("POST", "/plans/{kind}", start),
    ("GET", "/plan/{plan}", plan),
    ("GET", "/plan/{plan}/file/{name}", file),
)
