"""The workbench as an application: its pages' addresses, scripts and styles, and how each is answered."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route

from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.report.pages.kit import KIT
from toolkit.trust.people import Person
from toolkit.workbench.bench import Bench
from toolkit.workbench.guard import Keys
from toolkit.workbench.page import Instead, Page, Routes, is_part, page, refusal

STATIC = Path(__file__).with_name("static")
_SCRIPT, _STYLE = "text/javascript; charset=utf-8", "text/css; charset=utf-8"
_SERVED: dict[str, tuple[str, tuple[Path, ...]]] = {
    "htmx.js": (_SCRIPT, (STATIC / "htmx.min.js",)),
    "uPlot.js": (_SCRIPT, (STATIC / "uPlot.iife.min.js",)),
    "session.js": (_SCRIPT, (STATIC / "session.js",)),
    "workbench.js": (_SCRIPT, (STATIC / "workbench.js",)),
    "curves.js": (_SCRIPT, (STATIC / "curves.js",)),
    "workbench.css": (
        _STYLE,
        (KIT / "page.css", STATIC / "uPlot.min.css", STATIC / "workbench.css", STATIC / "work.css"),
    ),
}


def static(request: Request) -> Response:
    """Return a script or style of the table; nothing else has an address."""
    name = request.path_params["name"]
    if name not in _SERVED:
        raise HTTPException(404)
    media_type, content = _content(name)
    return Response(content, media_type=media_type, headers={"cache-control": "private, max-age=3600"})


@cache
def _content(name: str) -> tuple[str, bytes]:
    media_type, parts = _SERVED[name]
    return media_type, b"\n".join(part.read_bytes() for part in parts)


def application(home: Path, registry: Registry, keys: Keys, *, person: Person | None = None) -> Starlette:
    """Return the pages of a home below the place of its keys; `guard.Guard` stands before them."""
    routes = [Route("/static/{name}", static, name="static"), *_routes()]
    app = Starlette(routes=[Mount(keys.place, routes=routes)], exception_handlers={HTTPException: _no_page})
    app.state.bench = Bench(home, registry, keys, person=person)
    return app


def _routes() -> Iterator[Route]:
    """Yield the addresses that the pages declare: every module ``*_page`` of this package."""
    for name in sorted(path.stem for path in Path(__file__).parent.glob("*_page.py")):
        declared: Routes = import_module(f"toolkit.workbench.{name}").ROUTES
        for method, path, handler in declared:
            yield Route(path, _answering(handler), methods=[method])


def _answering(handler: Page) -> Page:
    """Return a page that tells its errors: those on purpose with their next step, a bug as one."""

    def answer(request: Request) -> Response:
        try:
            return handler(request)
        except ToolkitError as error:
            return refusal(request, error)
        except Instead as other:
            return other.answer
        except HTTPException:
            raise
        except Exception:  # noqa: BLE001  the last line of defence: a bug, told as one, and the server goes on
            traceback.print_exc()
            return page(request, "part_bug" if is_part(request) else "bug", status=500)

    return answer


def _no_page(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 404
    return page(request, "missing", status=status)
