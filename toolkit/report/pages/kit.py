"""Pages from templates that escape whatever is put into them: one file, no request, printable.

A page is a folder with ``page.html.j2``, and a ``page.css`` and ``page.js`` where it has them. Its template
extends ``base.html.j2`` of this folder and takes tables, figures and findings from ``parts.html.j2``. The
base names the SHA-256 of the page's style and script in its content security policy: no other script runs,
no attribute such as ``onclick`` or ``style`` acts, and nothing is loaded from anywhere.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from toolkit.calibration.records.use import UNSIGNED

KIT = Path(__file__).parent
_NO_BREAK = "\u00a0"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A table's column; ``kind`` says how its cells are set: numbers to the right, dates unbroken."""

    title: str
    kind: Literal["text", "number", "date", "grade"] = "text"

    @property
    def css(self) -> str:
        """The class of its cells; empty for text."""
        return {"number": "n", "date": "d"}.get(self.kind, "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns and their rows; the rows may be an iterator that is read once."""

    columns: tuple[Column, ...]
    rows: Iterable[Sequence[object]]


def table(
    titles: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    numbers: Container[int] = (),
    dates: Container[int] = (),
) -> Table:
    """Return a table of texts, with the positions of the columns that hold numbers or dates."""
    columns = tuple(
        Column(title=title, kind="number" if i in numbers else "date" if i in dates else "text")
        for i, title in enumerate(titles)
    )
    return Table(columns=columns, rows=rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A drawn SVG file, as bytes, with its text for those who do not see it."""

    svg: bytes
    alt: str

    @property
    def source(self) -> str:
        """The figure as an address that needs no network."""
        return f"data:image/svg+xml;base64,{base64.b64encode(self.svg).decode()}"


def page_parts(folder: Path, *, signature: str = UNSIGNED, **context: object) -> Iterator[str]:
    """Yield the page of a folder in parts, so that the rows of its tables are never held together.

    ``signature`` is its line of signatures.

    Raises
    ------
    jinja2.UndefinedError
        the template asks for what the context does not hold
    """
    style = Markup(_asset(KIT / "page.css") + _asset(folder / "page.css"))  # noqa: S704  files of the package
    script = Markup(_asset(folder / "page.js"))  # noqa: S704
    template = environment(folder).get_template("page.html.j2")
    policy = "; ".join(
        (
            "default-src 'none'",
            f"style-src {_source(style)}",
            f"script-src {_source(script)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
    return template.generate(policy=policy, style=style, script=script, signature=signature, **context)


def data(value: str, text: str) -> Markup:
    """Return a text whose element holds the value itself, unrounded."""
    return Markup('<data value="{}">{}</data>').format(value, text)


def drawn(text: str) -> Markup:
    """Return what a template of `environment` drew, to stand in another page as it is."""
    return Markup(text)  # noqa: S704  its writer has escaped it


def facts(title: str, texts: Mapping[str, str]) -> Markup:
    """Return named texts as a small table for a notebook; a fact without a text is left out."""
    parts: Any = environment(KIT).get_template("parts.html.j2").module
    return Markup(parts.facts(title, texts))  # noqa: S704  a template's result


def environment(folder: Path) -> Environment:
    """Return the templates of a folder and of the kit: everything is escaped, a missing name is an error."""
    templates = Environment(
        loader=FileSystemLoader([folder, KIT]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters |= {"number": number, "quantity": quantity}
    templates.policies["json.dumps_kwargs"] = {"sort_keys": False}
    return templates


def number(value: float | None, form: str, missing: str = "") -> str:
    """Return a number by a format; ``missing`` where there is none, or none that is finite.

    >>> number(0.5, ".0%"), number(None, ".2f"), number(float("nan"), ".4g", "–")
    ('50%', '', '–')
    """
    return missing if value is None or not math.isfinite(value) else format(value, form)


def quantity(value: float, form: str, unit: str) -> str:
    """Return a number with its unit, which no line break parts.

    >>> quantity(12.345, ".1f", "N") == "12.3\u00a0N"
    True
    """
    return f"{format(value, form)}{_NO_BREAK}{unit}".rstrip()


def _asset(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _source(text: str) -> str:
    """Return what a content security policy calls this text; ``'none'`` where there is none."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'" if text else "'none'"
