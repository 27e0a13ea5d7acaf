"""Which side of a disagreement is wrong: the Fy and Mz that a file holds, or its cells.

Fy and Mz that no record gives from the cells beside them were computed in another way, or one of the two was
changed since. Rows alone cannot say which: a sign turned in the equation and a sign turned in a column
give the same numbers. What needs no record can, and each side is held against it:

- what a tire can do (`toolkit.audit.weigh`), for the recorded values and for the recomputed ones;
- continuity: where the explanation changes in mid-block, load and slip angle stand still, so that whatever
  steps there was changed there;
- the curve over load, which the blocks of sound rows make and the others must lie on;
- the other files of the test (`toolkit.audit.other_files`).

What both sides pass, or both fail, is open, and stays so.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.audit.model import Columns, DisagreeingSides, Grade, Identification, Segment, Which
from toolkit.reduction.blocks import Block

_ODD: tuple[Grade, ...] = ("column_swap", "sign_variant", "unknown")
_WINDOW = 10  # rows on either side of an edge
_FEWEST = 8  # other places in the blocks that tell how far a mean moves by itself
_STEPS, _STILL = 3.0, 1.6  # times what 19 of 20 of them move
_NOISY = 95.0
_SUDDEN = 12.0  # times the row-to-row scatter
_VISIBLE = 0.03  # of the largest value: a smaller step is no finding
_OFF, _CLEARLY = 0.1, 3.0  # of the largest force over load; times what the other side lies off

WOULD_DECIDE = (
    "the other files of the test, one near zero slip, or the file as the acquisition program left it would "
    "decide"
)


def judge(
    identification: Identification,
    columns: Columns,
    blocks: Sequence[Block],
    *,
    conditions: Mapping[str, Array],
    recorded: Mapping[str, Array],
    computed: Mapping[str, Array] | None,
    impossible: tuple[bool, bool],
    by_columns: Callable[[Segment], bool] = lambda _: True,
) -> Identification:
    """Return an identification that says which side is wrong where the rows disagree.

    Parameters
    ----------
    identification : what explains the rows
    columns, blocks : of the file
    conditions : FZ [N] and, where it is there, SA [rad]
    recorded, computed : FY [N] and MZ [N·m] of the file, and of its cells by the record that explains it
    impossible : whether the recorded and the recomputed ones show what no tire can do
    by_columns : whether a changed column of cells could be what explains the rows of a segment
    """
    segments = identification.segments
    # The record of another day may be what turned cells look like: two records may differ in one sign alone.
    odd = [s for s in segments if s.grade in _ODD or s.grade == "stale"]
    if not odd or computed is None or (len(odd) == len(segments) and _unexplained(odd)):
        return identification
    if not any(map(by_columns, odd)):
        if identification.grade == "stale":
            return identification
        reason = "a changed cell column would show in the same way in Fy and Mz"
        return decided(
            identification, DisagreeingSides(side="forces", reason=reason, grade=identification.grade)
        )
    votes: list[tuple[Which, str]] = []
    if impossible == (True, False):
        votes.append(("forces", "the recorded values are impossible for a tire, those by the cells are not"))
    if impossible == (False, True):
        votes.append(
            ("cells", "the values by the cells are impossible for a tire, the recorded ones are not")
        )
    votes += _by_continuity(segments, columns, blocks, conditions, recorded)
    votes += _by_load(odd, columns.rows, blocks, recorded, computed)
    sides = {side for side, _ in votes}
    reason = "; ".join(dict.fromkeys(text for _, text in votes))
    if len(sides) == 1:
        return decided(
            identification, DisagreeingSides(side=sides.pop(), reason=reason, grade=identification.grade)
        )
    if not votes and identification.grade == "stale":
        return identification  # a record that was once in force needs no other explanation
    reason = f"the evidence speaks for both: {reason}" if votes else "both are possible for a tire"
    return decided(identification, DisagreeingSides(side="open", reason=reason, grade=identification.grade))


def decided(identification: Identification, sides: DisagreeingSides) -> Identification:
    """Return an identification under the grade that a judgement of the sides gives it."""
    return replace(identification, grade=grade_of(sides), sides=sides)


def grade_of(sides: DisagreeingSides) -> Grade:
    """Return the grade of a file by what is known of the side that is wrong.

    What explains the rows stays told where nothing says on which side it lies.
    """
    return "altered_cells" if sides.side == "cells" else sides.grade


def disputed(line: Mapping[str, Any]) -> bool:
    """Tell from a file's plain answer whether its cells are wrong, or may be: nothing is computed of such.

    >>> disputed({"sides": None}), disputed({"sides": {"side": "cells"}})
    (False, True)
    """
    sides = line.get("sides")  # answers of older versions have none
    return sides is not None and sides["side"] != "forces"


def statement(sides: DisagreeingSides, how: str | None) -> str:
    """Return in words what the side means; ``how`` is the change that explains the rows, if any does."""
    change = f" ({how})" if how else ""
    if sides.side == "cells":
        return f"the cells disagree with right forces: a cell column was changed{change}: {sides.reason}"
    if sides.side == "forces":
        return f"Fy and Mz are wrong, the cells are right{change}: {sides.reason}"
    return f"Fy and Mz or the cells are wrong{change}, and nothing says which: {sides.reason}; {WOULD_DECIDE}"


def _unexplained(odd: Sequence[Segment]) -> bool:
    # A calibration that the registry does not have is no change of anything.
    return all(segment.grade == "unknown" for segment in odd)


def _by_continuity(
    segments: Sequence[Segment],
    columns: Columns,
    blocks: Sequence[Block],
    conditions: Mapping[str, Array],
    recorded: Mapping[str, Array],
) -> list[tuple[Which, str]]:
    edges = [segment.last_row for segment in segments[:-1]]
    votes: dict[Which, list[int]] = {"forces": [], "cells": []}
    cells = columns.x.T
    for before, after in itertools.pairwise(segments):
        edge = before.last_row
        block = next((b for b in blocks if b.start < edge < b.stop), None)
        if block is None:
            continue
        wide = (
            min(_WINDOW, before.last_row - before.first_row + 1, edge - block.start),
            min(_WINDOW, after.last_row - after.first_row + 1, block.stop - edge),
        )
        places = _undisturbed(blocks, edges, wide)
        if len(places) < _FEWEST:
            continue

        def times(
            values: Array, edge: int = edge, wide: tuple[int, int] = wide, places: NDArray[np.intp] = places
        ) -> float:
            usual = float(np.percentile(np.abs(_step(values, places, wide)), _NOISY))
            floor = 1e-9 * float(np.max(np.abs(values), initial=0.0))
            return float(abs(_step(values, np.array([edge]), wide)[0]) / max(usual, floor, 1e-300))

        if max(map(times, conditions.values())) > _STEPS:
            continue  # the machine moved there
        force, cell = max(map(times, recorded.values())), max(map(times, cells))
        if force > _STEPS and cell < _STILL:
            votes["forces"].append(edge)
        elif cell > _STEPS and force < _STILL:
            votes["cells"].append(edge)
    texts: dict[Which, str] = {
        "forces": "the recorded forces step at row {} where cells, load and slip angle go on",
        "cells": "the cells step at row {} where forces, load and slip angle go on",
    }
    return [(side, texts[side].format(rows[0] + 1)) for side, rows in votes.items() if rows]


def _step(values: Array, places: NDArray[np.intp], wide: tuple[int, int]) -> Array:
    # Mean of the rows from a place on minus that of the rows before it.
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    before, after = wide
    step: Array = (sums[places + after] - sums[places]) / after - (
        sums[places] - sums[places - before]
    ) / before
    return step


def _undisturbed(blocks: Sequence[Block], edges: Sequence[int], wide: tuple[int, int]) -> NDArray[np.intp]:
    before, after = wide
    parts = [np.arange(b.start + before, b.stop - after + 1) for b in blocks if b.n >= before + after]
    places = np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)
    for edge in edges:
        places = places[(places + after <= edge) | (places - before >= edge)]
    return places.astype(np.intp)


def _by_load(
    odd: Sequence[Segment],
    rows: int,
    blocks: Sequence[Block],
    recorded: Mapping[str, Array],
    computed: Mapping[str, Array],
) -> list[tuple[Which, str]]:
    """Return what whole blocks of odd rows say beside sound ones: force over load is smooth over load."""
    marked = np.zeros(rows, dtype=bool)
    for segment in odd:
        marked[segment.first_row - 1 : segment.last_row] = True
    loaded = [block for block in blocks if block.mean_FZ > 0]
    share = np.array([float(marked[block.rows].mean()) for block in loaded])
    sound, apart = np.flatnonzero(share == 0.0), np.flatnonzero(share > 0.9)
    if len(sound) < 3 or not len(apart):
        return []
    x = np.log([block.mean_FZ for block in loaded])
    if np.ptp(x[sound]) < 1e-3:
        return []
    votes: list[tuple[Which, str]] = []
    for load in recorded:
        old, new = (
            np.array([float(values[load][block.rows].mean()) / block.mean_FZ for block in loaded])
            for values in (recorded, computed)
        )
        largest = max(float(np.max(np.abs(old))), float(np.max(np.abs(new))))
        fit = np.polynomial.Polynomial.fit(x[sound], old[sound], 1)
        off = [float(np.max(np.abs(side[apart] - fit(x[apart])))) for side in (old, new)]
        if max(off) < _OFF * largest or max(off) < _CLEARLY * min(off):
            continue
        side: Which = "forces" if off[0] > off[1] else "cells"
        what = "recorded" if side == "forces" else "by the cells"
        votes.append((side, f"{load} {what} leaves the curve over load that the other blocks make"))
    return votes


def sudden_step(
    values: Mapping[str, Array], conditions: Mapping[str, Array], blocks: Sequence[Block]
) -> tuple[str, int, float, float] | None:
    """Return where a value steps for good within a block in which load and slip angle stand still.

    The name of the value, the first row after the step (from 1), and the means before it and after it; None
    where nothing does. The largest step of all is returned.
    """
    worst: tuple[float, str, int, float, float] | None = None
    for name, series in values.items():
        largest = float(np.max(np.abs(series), initial=0.0))
        for block in blocks:
            if block.n < 3 * _WINDOW:
                continue
            part = series[block.rows]
            change = np.abs(np.diff(part))
            scatter = 1.4826 * float(np.median(change))
            inner = change[_WINDOW - 1 : -_WINDOW + 1]
            at = int(np.argmax(inner)) + _WINDOW
            if change[at - 1] <= max(_SUDDEN * scatter, _VISIBLE * largest):
                continue
            before, after = float(part[at - _WINDOW : at].mean()), float(part[at : at + _WINDOW].mean())
            step = abs(after - before)
            if step < change[at - 1] / 2 or _moved(conditions, block, at):
                continue
            if worst is None or step / largest > worst[0]:
                worst = step / largest, name, block.start + at + 1, before, after
    return None if worst is None else worst[1:]


def _moved(conditions: Mapping[str, Array], block: Block, at: int) -> bool:
    for series in conditions.values():
        part = series[block.rows]
        change = np.abs(np.diff(part))
        if change[at - 1] > 6.0 * 1.4826 * float(np.median(change)) > 0.0:
            return True
    return False
