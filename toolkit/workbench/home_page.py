"""The first page: what needs a decision today, and how the instruments stand.

The page itself reads ledgers alone. Each question of the agenda is asked by a request of its own, so that one
that takes seconds keeps nobody from the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starlette.exceptions import HTTPException

from toolkit.lab import agenda as questions
from toolkit.workbench.page import page

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request
    from starlette.responses import Response

    from toolkit.workbench.bench import Bench

MOST_ROWS = 50


def home(request: Request) -> Response:
    """Return the page: instruments and ledgers, and a place for each question of the agenda."""
    bench: Bench = request.app.state.bench
    return page(
        request, "home", instruments=questions.instruments_answer(bench.registry, bench.today),
        questions=tuple(_QUESTIONS), today=bench.today.isoformat(),
    )  # fmt: skip


def agenda(request: Request) -> Response:
    """Return the answer to one question of the agenda."""
    name = request.path_params["question"]
    if name not in _QUESTIONS:
        raise HTTPException(404)
    return page(request, f"part_{name}", most=MOST_ROWS, **_QUESTIONS[name](request.app.state.bench))


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
    "candidates": _candidates,
    "due": _due,
    "drift": _drift,
    "work": _work,
}
