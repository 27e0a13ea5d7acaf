"""Lines for people: a table of plain text, a number that may be missing, a name that may hold anything."""

from __future__ import annotations

from collections.abc import Sequence

from toolkit.printable import escaped


def or_dash(value: float | None, spec: str) -> str:
    """Return a number by its format; a dash where there is none.

    >>> or_dash(0.125, ".2g"), or_dash(None, ".2g")
    ('0.12', '-')
    """
    return "-" if value is None else format(value, spec)


def one_line(text: object) -> str:
    r"""Return a text with every control character escaped: the name of a file may hold any of them.

    >>> print(one_line("a\nb\x1b[2J"))
    a\nb\x1b[2J
    """
    return escaped(str(text), lines=False)


def table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    align: str = "",
    width: int | None = None,
    whole: Sequence[int] = (),
) -> str:
    """Return a plain text table; ``align`` has one of ``<`` and ``>`` a column, default ``<`` then ``>``.

    With a ``width`` [characters] the longest texts lose their middle until a line fits; numbers stay whole,
    and texts that differ still do: a line is longer where it must be. Columns that are ``whole`` lose
    nothing.
    """
    if not rows:
        return ""
    align = align or "<" + ">" * (len(header) - 1)
    rows = [[one_line(cell) for cell in row] for row in rows]
    if width is not None:
        rows = _shortened(header, [list(row) for row in rows], align, width, whole)
    widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
    lines = [
        "  ".join(
            f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True)
        ).rstrip()
        for row in [header, ["-" * width for width in widths], *rows]
    ]
    return "\n".join(lines)


def _shortened(
    header: Sequence[str], rows: Sequence[Sequence[str]], align: str, width: int, whole: Sequence[int]
) -> list[Sequence[str]]:
    columns = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    least = [
        max(len(title), _told_apart(set(column))) if side == "<" and place not in whole else size
        for place, (title, column, side, size) in enumerate(zip(header, columns, align, widths, strict=True))
    ]
    while sum(widths) + 2 * (len(widths) - 1) > width:
        room = [
            size if side == "<" and size > smallest else 0
            for size, side, smallest in zip(widths, align, least, strict=True)
        ]
        if not any(room):
            break
        widths[room.index(max(room))] -= 1
    return [[_middle_out(cell, size) for cell, size in zip(row, widths, strict=True)] for row in rows]


def _told_apart(texts: set[str]) -> int:
    """Return how many characters texts need without their middles to stay as many different ones.

    >>> _told_apart({"a/FM_run_1.xlsx", "a/FM_run_2.xlsx", "b/FM_run_1.xlsx"})
    10
    """
    low, high = 1, max(map(len, texts), default=1)
    while low < high:
        size = (low + high) // 2
        if len({_middle_out(text, size) for text in texts}) == len(texts):
            high = size
        else:
            low = size + 1
    return high


def _middle_out(text: str, size: int) -> str:
    """Return a text of so many characters at most, its end the longer part: names differ there.

    >>> _middle_out("archive/2014/FM_run_11.xlsx", 20)
    'archive…_run_11.xlsx'
    """
    if len(text) <= size:
        return text
    end = max(1, 2 * (size - 1) // 3)
    return f"{text[: max(size - 1 - end, 0)]}…{text[-end:]}"
