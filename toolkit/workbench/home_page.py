"""The first page: what needs a decision today, and how the instruments stand.

The page itself reads nothing: it stands at once, however large the home is. Each question is asked by a
request of its own, so that one that takes seconds keeps nobody from the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starlette.exceptions import HTTPException

from toolkit.lab.desk import agenda as questions
from toolkit.workbench.page import Routes, page

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request
    from starlette.responses import Response

    from toolkit.workbench.bench import Bench

MOST_ROWS = 50


def home(request: Request) -> Response:
    """Return the page: a place for each question of the agenda, and for the instruments."""
    bench: Bench = request.app.state.bench
    waiting = tuple(name for name in _QUESTIONS if name != "instruments")
    return page(request, "home", questions=waiting, today=bench.today.isoformat())


def agenda(request: Request) -> Response:
    """Return the answer to one question of the agenda."""
    name = request.path_params["question"]
    if name not in _QUESTIONS:
        raise HTTPException(404)
    return page(request, f"part_{name}", most=MOST_ROWS, **_QUESTIONS[name](request.app.state.bench))


def _instruments(bench: Bench) -> dict[str, Any]:
    return {"instruments": questions.instruments_answer(bench.registry, bench.today)}


def _requests(bench: Bench) -> dict[str, Any]:
    from toolkit.lab.desk.pending import pending_requests

    return {"rows": pending_requests(bench.home, bench.registry)}


def _drafts(bench: Bench) -> dict[str, Any]:
    from toolkit.lab.desk.drafts import drafts

    return {"rows": drafts(bench.home)}


def _candidates(bench: Bench) -> dict[str, Any]:
    rows = bench.remembered("candidates", None, lambda: questions.candidates_answer(bench.registry))
    return {"rows": rows}


def _due(bench: Bench) -> dict[str, Any]:
    return {"due": bench.remembered("due", None, lambda: questions.due_soon(bench.registry, bench.today))}


def _drift(bench: Bench) -> dict[str, Any]:
    return {"rows": bench.remembered("drift", None, lambda: questions.drifting(bench.registry))}


def _work(bench: Bench) -> dict[str, Any]:
    return {"work": questions.work_of(bench.home)}


_QUESTIONS: dict[str, Callable[[Bench], dict[str, Any]]] = {
    "instruments": _instruments,
    "requests": _requests,
    "drafts": _drafts,
    "candidates": _candidates,
    "due": _due,
    "drift": _drift,
    "work": _work,
}


ROUTES: Routes = (("GET", "/", home), ("GET", "/agenda/{question}", agenda))
