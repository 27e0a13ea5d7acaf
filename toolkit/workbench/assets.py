"""Scripts and styles: files of this package by their names, of which there is a fixed table."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.exceptions import HTTPException
from starlette.responses import Response

from toolkit.report.pages.kit import KIT

if TYPE_CHECKING:
    from starlette.requests import Request

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
