"""Tags: ``tk:<path>`` with an optional ``|<format>``, and the formats that they may have.

The kinds are ``text number date figure chart table if row``. Values have a default format each; a number
takes one Python format spec after the bar, a figure ``width=120mm``.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass

from toolkit.errors import TemplateError

DRAWN = ("figure", "chart")  # the families of a figure: as a picture, and as a chart of Word's own


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """A tag as it stands in a template: path without ``tk:`` and the format after the bar."""

    path: str
    spec: str | None = None

    @property
    def family(self) -> str:
        """``figure``, ``chart``, ``table``, ``if``, ``row`` or ``value``."""
        head = self.path.partition(".")[0]
        return head if head in (*DRAWN, "table", "if", "row") else "value"

    @property
    def name(self) -> str:
        """The path after the family, or the whole path of a value."""
        return self.path if self.family == "value" else self.path.partition(".")[2]

    def __str__(self) -> str:
        """Return the tag as a template writes it."""
        return f"tk:{self.path}" + (f"|{self.spec}" if self.spec is not None else "")


@functools.lru_cache(maxsize=4096)
def parse_tag(text: str) -> Tag | None:
    """Read ``tk:path|format``; None where the text is no tag of the toolkit.

    >>> parse_tag("tk:calibration.FY.D51|.5g")
    Tag(path='calibration.FY.D51', spec='.5g')
    >>> parse_tag("Company") is None
    True
    """
    text = text.strip()
    if not text.startswith("tk:"):
        return None
    path, bar, spec = text[3:].partition("|")
    return Tag(path=_canonical(path.strip()), spec=spec.strip(" \t") if bar else None)


def _canonical(path: str) -> str:
    # practice and thesis write Fy and Mz; the channels are FY and MZ.
    return re.sub(r"^calibration\.([FM])([xyz])\.", lambda m: f"calibration.{m[1]}{m[2].upper()}.", path)


# A width or precision of three digits would be a denial of service, not a format.
_NUMBER_SPEC = re.compile(r"(?:[^{}]?[<>=^])?[+\- ]?z?#?0?\d{0,2}[,_]?(?:\.\d{1,2})?[eEfFgGn%d]?")
_WIDTH = re.compile(r"width=(\d{1,4}(?:\.\d{1,3})?)(mm|cm|in|pt)")
_EMU = {"mm": 36000, "cm": 360000, "in": 914400, "pt": 12700}


def format_problem(kind: str, spec: str | None) -> str | None:
    """Tell what is wrong with the format of a tag of some kind; None where it is right."""
    if spec is None:
        return None
    if kind == "number":
        return None if spec and _NUMBER_SPEC.fullmatch(spec) else "not a Python format spec of a number"
    if kind in DRAWN:
        return None if _WIDTH.fullmatch(spec) else "a figure takes width=NUMBERmm (or cm, in, pt)"
    return f"a {kind} takes no format"


def width_emu(spec: str | None) -> int | None:
    """Return the width that a figure's tag asks for, in EMU (914 400 an inch)."""
    match = _WIDTH.fullmatch(spec) if spec else None
    return round(float(match[1]) * _EMU[match[2]]) if match else None


def format_number(value: float, spec: str, *, decimal_comma: bool = False) -> str:
    """Return a finite number in a format; minus zero is zero.

    >>> format_number(-0.001, ".2f"), format_number(1234.5, ",.1f", decimal_comma=True)
    ('0.00', '1.234,5')
    """
    try:
        if spec.endswith("d"):
            if value != round(value):
                raise ValueError("a whole-number format for a number that is not whole")  # noqa: TRY301
            text = format(round(value), spec)
        else:
            text = format(float(value), spec)
            if "-" in text and not re.search(r"[1-9]", text):
                text = format(0.0, spec)
    except ValueError as error:
        raise TemplateError(
            "a number cannot be printed in the format of its tag",
            got=f"|{spec}: {error}",
            expected="one Python format spec such as .2f or .5g",
            next_step="correct the tag in the template",
            rule="bad-format",
        ) from error
    return text.translate(str.maketrans(".,", ",.")) if decimal_comma else text
