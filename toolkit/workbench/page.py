"""How a page is drawn: templates of this folder and of the page kit, in the language of who asks.

English stands in the templates, other languages in ``messages/`` (gettext).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from functools import cache
from gettext import NullTranslations
from pathlib import Path
from typing import Any

from jinja2 import Environment, pass_context
from jinja2.runtime import Context
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from toolkit.calibration.issued import issued_text
from toolkit.errors import ToolkitError
from toolkit.estimate import plus_minus, round_uncertainty
from toolkit.lab.desk.holdings import holding_id
from toolkit.listing import one_line
from toolkit.report.pages.kit import data, drawn, environment
from toolkit.words import phrasebook as words
from toolkit.words.phrasebook import SOURCE, decimal_sign, phrasebook

Page = Callable[[Request], Response]
Routes = tuple[tuple[str, str, Page], ...]
"""Method, path and handler of each address of a page."""


class Instead(Exception):  # noqa: N818  no error: another answer than the page that was asked for
    """What is answered in the place of a page that is no longer there."""

    def __init__(self, answer: Response) -> None:
        super().__init__("another answer")
        self.answer = answer


MESSAGES = Path(__file__).with_name("messages")
TERMS = (
    "candidate", "approved", "withdrawn", "discarded", "entered", "enter", "approve", "withdraw", "discard",
)  # fmt: skip
"""Words of the ledger that pages translate: no template spells them."""


def languages() -> tuple[str, ...]:
    """Return the languages of the pages, the templates' own first."""
    return words.languages(MESSAGES)


def translations(language: str) -> NullTranslations:
    """Return the catalogue of a language; that of the templates' own is empty."""
    return words.translations(language, MESSAGES)


def preferred(accepted: str) -> str:
    """Return the language of a page, by what a browser says that its person reads.

    >>> preferred("de-AT,de;q=0.9,en;q=0.8"), preferred("it"), preferred("")
    ('de', 'en', 'en')
    """
    from babel.core import negotiate_locale

    ranked: list[tuple[float, str]] = []
    for part in accepted.split(","):
        name, _, parameter = part.strip().partition(";")
        try:
            weight = float(parameter.strip().removeprefix("q=")) if parameter else 1.0
        except ValueError:
            continue
        ranked.append((-weight, name.strip()))
    names = [name for _, name in sorted(ranked, key=lambda entry: entry[0])]
    return negotiate_locale(names, languages(), sep="-") or SOURCE


TEMPLATES = Path(__file__).with_name("templates")


@cache
def templates(language: str) -> Environment:
    """Return the templates in a language."""
    drawn = environment(TEMPLATES)
    drawn.add_extension("jinja2.ext.i18n")
    drawn.install_gettext_translations(translations(language), newstyle=False)  # type: ignore[attr-defined]
    drawn.globals |= {"language": language, "point": decimal_sign(language)}
    drawn.globals |= {"number": _number, "issued": _issued, "measured": _measured, "expanded": _expanded}
    drawn.filters |= {"chart": _chart, "one_line": one_line, "holding_id": holding_id}
    drawn.filters["said"] = phrasebook(language).say
    return drawn


def bare_page(name: str, **context: object) -> str:
    """Return a page that nobody has been let into yet: without layout, language or scripts."""
    return environment(TEMPLATES).get_template(f"{name}.html.j2").render(context)


def page(request: Request, name: str, *, status: int = 200, **context: object) -> HTMLResponse:
    """Return a page, or a part of one, by its template."""
    return HTMLResponse(fragment(request, name, **context), status, {"content-language": _language(request)})


def as_file(content: str | bytes, media_type: str, name: str, *, shown: bool = False) -> Response:
    """Return a file by its name, to be kept or, ``shown``, to stand in a page."""
    disposition = f'{"inline" if shown else "attachment"}; filename="{name}"'
    return Response(content, media_type=media_type, headers={"content-disposition": disposition})


def fragment(request: Request, name: str, **context: object) -> Markup:
    """Return the text of a page or of a part, to stand in another."""
    bench = request.app.state.bench
    shared = {"place": bench.keys.place, "form_key": bench.keys.form, "home": bench.home.name}
    template = templates(_language(request)).get_template(f"{name}.html.j2")
    text = template.render(**shared, visitor=bench.person, **context)
    return drawn(text)


def _language(request: Request) -> str:
    return preferred(request.headers.get("accept-language", ""))


def refusal(request: Request, error: ToolkitError) -> HTMLResponse:
    """Return an error as a page: what, where, got, expected, next step."""
    return page(request, "part_error" if is_part(request) else "error", status=400, error=error.as_dict())


def is_part(request: Request) -> bool:
    """Tell whether a request is for a part of a page that stands already."""
    return request.headers.get("hx-request") == "true"


@pass_context
def _number(
    context: Context, value: float | None, form: str = ".4g", unit: str = "", *, times: int = 1
) -> str:
    """Return a number with its unit; the element's ``value`` is the number itself, as the JSON has it.

    ``times``: what is read is a multiple of it, such as per cent of a share.
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    digits = _printed(context, format(times * value, form))
    text = f"{digits}\u00a0{unit}" if unit else digits
    return data(json.dumps(value), text)


@pass_context
def _issued(context: Context, value: float, method: str | None) -> str:
    """Return an issued coefficient in the digits of its issue."""
    return data(json.dumps(value), _printed(context, issued_text(value, method)))


@pass_context
def _measured(context: Context, value: float, U: float | None) -> tuple[str, str]:
    """Return a value and its U as wherever people read both: U in two digits, the value to its last place."""
    parts = plus_minus(value, math.nan if U is None else U).split(" ± ")
    U_text = data(json.dumps(U), _printed(context, parts[1])) if len(parts) > 1 else "–"
    return data(json.dumps(value), _printed(context, parts[0])), U_text


@pass_context
def _expanded(context: Context, U: float | None) -> str:
    """Return an expanded uncertainty in two digits."""
    return "–" if U is None else data(json.dumps(U), _printed(context, round_uncertainty(U)))


def _printed(context: Context, digits: str) -> str:
    return digits.replace(".", decimal_sign(context["language"])).replace("-", "\u2212")


def _chart(content: Mapping[str, Any]) -> str:
    """Return a chart's content as the text of an attribute, from which the page's script draws it."""
    return json.dumps(content, allow_nan=False)
