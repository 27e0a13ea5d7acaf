"""The addresses of the workbench, and what answers each."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Mount, Route

from toolkit.errors import ToolkitError
from toolkit.workbench import assets, home_page, record_page
from toolkit.workbench.bench import Bench
from toolkit.workbench.page import is_part, page, refusal

if TYPE_CHECKING:
    from starlette.requests import Request

    from toolkit.calibration.registry.registry import Registry
    from toolkit.workbench.guard import Keys

Page = Callable[["Request"], Response]


def application(home: Path, registry: Registry, keys: Keys) -> Starlette:
    """Return the pages of a home below the place of its keys; `guard.Guard` stands before them."""
    routes = [
        Route("/static/{name}", assets.static, name="static"),
        *(Route(path, _answering(handler), methods=methods) for path, handler, methods in _PAGES),
    ]
    app = Starlette(
        routes=[Mount(keys.place, routes=routes)],
        exception_handlers={HTTPException: _no_page},
    )
    app.state.bench = Bench(home, registry, keys)
    return app


_PAGES: tuple[tuple[str, Page, list[str]], ...] = (
    ("/", home_page.home, ["GET"]),
    ("/agenda/{question}", home_page.agenda, ["GET"]),
    ("/records", record_page.records, ["GET"]),
    ("/record/{record}", record_page.record, ["GET"]),
    ("/record/{record}/part/{part}", record_page.part, ["GET"]),
    ("/record/{record}/decide/{decision}", record_page.decide, ["POST"]),
)


def _answering(handler: Page) -> Page:
    """Return a page that tells its errors: those on purpose with their next step, a bug as one."""

    def answer(request: Request) -> Response:
        try:
            return handler(request)
        except ToolkitError as error:
            return refusal(request, error)
        except HTTPException:
            raise
        except Exception:  # noqa: BLE001  the last line of defence: a bug, told as one, and the server goes on
            traceback.print_exc()
            return page(request, "part_bug" if is_part(request) else "bug", status=500)

    return answer


def _no_page(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 404
    return page(request, "missing", status=status)
