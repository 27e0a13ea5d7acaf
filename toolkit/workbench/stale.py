"""A change that was made from an older version: refused, with both texts side by side."""

from __future__ import annotations

import difflib
import secrets
from collections.abc import Mapping
from types import MappingProxyType

from starlette.requests import Request
from starlette.responses import Response

from toolkit.lab.desk.versions import StaleError
from toolkit.workbench.page import is_part, page

Lines = list[tuple[str, bool]]
"""Lines of a text, each with whether the other text has another one in its place."""


def new_page() -> str:
    """Return the name of a page that is opened, by which its changes are told from those of others."""
    return secrets.token_hex(8)


def stale(
    request: Request,
    error: StaleError,
    *,
    look: str,
    kept: Mapping[str, str] = MappingProxyType({}),
    typed: Mapping[str, str] = MappingProxyType({}),
    again: str = "",
    hidden: Mapping[str, str] = MappingProxyType({}),
) -> Response:
    """Return the refusal of a change that was made from an older version.

    Parameters
    ----------
    kept, typed : both texts of each file, by its name
    look : the page that shows what is kept, below the place
    again : where the form goes that puts what was typed in the place of what is kept; empty: nowhere
    hidden : what that form holds, with the version that it replaces
    """
    pairs = {
        name: beside(kept.get(name, ""), typed.get(name, ""))
        for name in dict.fromkeys((*kept, *typed))
        if _plain(kept.get(name, "")) != _plain(typed.get(name, ""))
    }
    return page(
        request, "part_stale" if is_part(request) else "stale", status=409, error=error.as_dict(),
        pairs=pairs, look=look, again=again, hidden=hidden,
    )  # fmt: skip


def beside(kept: str, typed: str) -> tuple[Lines, Lines]:
    """Return two texts by lines, each line with whether it differs.

    >>> beside("a\\nb\\n", "a\\nc\\n")
    ([('a', False), ('b', True)], [('a', False), ('c', True)])
    """
    left, right = _plain(kept).split("\n"), _plain(typed).split("\n")
    same = difflib.SequenceMatcher(a=left, b=right, autojunk=False).get_matching_blocks()
    in_left = {block.a + at for block in same for at in range(block.size)}
    in_right = {block.b + at for block in same for at in range(block.size)}
    return (
        [(line, at not in in_left) for at, line in enumerate(left)],
        [(line, at not in in_right) for at, line in enumerate(right)],
    )


def _plain(text: str) -> str:
    return text.replace("\r\n", "\n").rstrip("\n")
