"""A characteristic at a load between those that were measured, with its parts.

Two tests never have quite the same loads. Inside the measured loads the value is that of the parabola
through the three nearest (of the line through two); it is a weighted sum, so its parts are too. What the
choice of the curve leaves is the difference of parabola and line, taken as the half-width of a rectangle
(JCGM 100:2008, 4.3.7). Beyond the outermost load nothing is read, but for 5 % of that load.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Part, Uncertain, weighted

REACH = 0.05  # of the outermost load


def at_load(rows: Sequence[Row], load_N: float, *, owner: str) -> Uncertain | None:
    """Return a series' value at a load [N]; None where its loads do not reach there.

    Parameters
    ----------
    rows : one series, any order, each load once
    owner : what the series belongs to; the way between its loads is its own
    """
    ordered = sorted(rows, key=lambda row: row.load_N)
    first, last = ordered[0].load_N, ordered[-1].load_N
    if not first * (1 - REACH) <= load_N <= last * (1 + REACH):
        return None
    near = sorted(ordered, key=lambda row: abs(row.load_N - load_N))
    if near[0].load_N == load_N:
        return near[0].number
    key = f"load interpolation/{owner}/{ordered[0].series}/{load_N:.6g}"
    if len(ordered) == 1:
        # One load tells no slope: the value stands, and proportion to the load is its uncertainty.
        only = near[0]
        bend = only.number.value * (load_N / only.load_N - 1)
        return _with(only.number, bend, key)
    # The two around it, or the outermost two; the third is the nearer neighbour of these.
    below = [row for row in ordered if row.load_N <= load_N]
    start = min(max(len(below) - 1, 0), len(ordered) - 2)
    pair = ordered[start : start + 2]
    line = _through(pair, load_N)
    if len(ordered) == 2:
        steep = (pair[1].number.value - pair[0].number.value) / (pair[1].load_N - pair[0].load_N)
        return _with(line, steep * (load_N - near[0].load_N) / 2, key)
    third = min((row for row in ordered if row not in pair), key=lambda row: abs(row.load_N - load_N))
    parabola = _through(sorted([*pair, third], key=lambda row: row.load_N), load_N)
    return _with(parabola, parabola.value - line.value, key)


def _through(rows: Sequence[Row], load_N: float) -> Uncertain:
    """Return Lagrange's polynomial through the rows at a load."""
    terms = []
    for row in rows:
        weight = math.prod(
            (load_N - node.load_N) / (row.load_N - node.load_N) for node in rows if node is not row
        )
        terms.append((weight, row.number))
    return weighted(terms)


def _with(number: Uncertain, half_width: float, key: str) -> Uncertain:
    return number.with_parts(Part(source="load interpolation", key=key, u=half_width / math.sqrt(3.0)))
