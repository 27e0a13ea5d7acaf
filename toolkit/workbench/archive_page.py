"""An archive that was audited: what is wrong in one line, when, and each file against the record in force."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlencode

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from toolkit.audit.model import GRADES
from toolkit.errors import ToolkitError
from toolkit.lab.desk.agenda import unfinished_audits
from toolkit.lab.desk.audited import ORDERS, Audited, Order, stamp
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.page import Routes, page

WINDOW = 200
"""Rows of the list of files that are asked for at once."""
_MOST_QUERY = 200


def audits(request: Request) -> Response:
    """Return the list's page: nothing is looked through before it stands."""
    return page(request, "audits")


def audit_list(request: Request) -> Response:
    """Return the audits that the home keeps, with whether each is finished."""
    bench: Bench = request.app.state.bench
    holdings = bench.holdings(again=True)
    unfinished = unfinished_audits(holdings)
    return page(request, "part_audits", audits=holdings.places["audit"], unfinished=unfinished)


def audit(request: Request) -> Response:
    """Return an audit's page: a place for its first line, and for its files."""
    bench, audit_id, _ = holding(request, "audit")
    place_of = bench.holdings().places["audit"][audit_id]
    return page(request, "audit", audit_id=audit_id, place_of=place_of, grades=GRADES, orders=ORDERS)


def part(request: Request) -> Response:
    """Return what the audit found: the first line, the grades, the timeline."""
    if request.path_params["part"] != "answer":
        raise HTTPException(404)
    bench, audited = _requested(request)
    timelines = bench.remembered(
        f"timelines of {request.path_params['audit']}", None,
        lambda: list(audited.timelines(bench.registry)), rests_on=stamp(audited.lines.parent),
    )  # fmt: skip
    return page(
        request, "part_audit", headline=audited.headline, grades=audited.grades,
        known_at=audited.known_at.isoformat(), audit_id=request.path_params["audit"],
        timelines=timelines,
    )  # fmt: skip


def windows(request: Request) -> Response:
    """Return the files that are asked for, as windows that are filled when they come into sight."""
    _, audited = _requested(request)
    query, places = _matching(request, audited)
    return page(
        request, "part_audit_files", total=len(places), query=query, window=WINDOW,
        starts=range(0, len(places), WINDOW), audit_id=request.path_params["audit"],
    )  # fmt: skip


def window(request: Request) -> Response:
    """Return the rows of one window."""
    _, audited = _requested(request)
    start = request.path_params["start"]
    _, places = _matching(request, audited)
    rows = [(place, audited.files[place]) for place in places[start : start + WINDOW]]
    return page(request, "part_audit_rows", rows=rows, audit_id=request.path_params["audit"])


def file(request: Request) -> Response:
    """Return one file: its answer, and its loads row by row beside those of the record in force."""
    bench, audited = _requested(request)
    number = request.path_params["number"]
    if number >= len(audited.files):
        raise HTTPException(404)
    line = audited.line(number)
    charts: dict[str, Any] = {}
    trouble, is_same = None, True
    if line["in_force"] is not None:
        try:
            charts, is_same = audited.charts(number, bench.registry)
        except ToolkitError as error:
            trouble = error.as_dict()
    return page(
        request, "audit_file", line=line, charts=charts, same=is_same, trouble=trouble,
        audit_id=request.path_params["audit"],
    )  # fmt: skip


def _matching(request: Request, audited: Audited) -> tuple[str, list[int]]:
    words = request.query_params
    text = words.get("q", "")[:_MOST_QUERY]
    grades = [grade for grade in words.getlist("grade") if grade in GRADES]
    order: Order = next((order for order in ORDERS if order == words.get("order")), "change")
    query = urlencode([("q", text), ("order", order), *(("grade", grade) for grade in grades)])
    return query, audited.found(text, grades, order)


def _requested(request: Request) -> tuple[Bench, Audited]:
    bench: Bench = request.app.state.bench
    audited = bench.audited(request.path_params["audit"])
    if audited is None:
        raise HTTPException(404)
    return bench, audited


ROUTES: Routes = (
    ("GET", "/audits", audits),
    ("GET", "/audits/list", audit_list),
    ("GET", "/audit/{audit}", audit),
    ("GET", "/audit/{audit}/part/{part}", part),
    ("GET", "/audit/{audit}/windows", windows),
    ("GET", "/audit/{audit}/window/{start:int}", window),
    ("GET", "/audit/{audit}/file/{number:int}", file),
)
