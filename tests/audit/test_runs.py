"""Runs of rows: each as long as any candidate reaches, against a plain search row by row."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.audit.runs import Hit, Partition, Runs, products, reach_of, without_chance

VARIANTS = 2


def plain(fits, rows):
    """The definition, one candidate after the other: (start, stop, hits) of every part."""
    candidates = {
        (group, (("FY", a), ("MZ", b))): by_load["FY"][a] & by_load["MZ"][b]
        for group, by_load in fits.items()
        for a in range(VARIANTS)
        for b in range(VARIANTS)
    }
    parts, row = [], 0
    while row < rows:
        reach = {key: int(np.argmin(np.append(fit[row:], False))) for key, fit in candidates.items()}
        longest = max(reach.values(), default=0)
        hits = {key for key, length in reach.items() if length == longest} if longest else set()
        if not longest and parts and not parts[-1][2]:
            parts[-1] = (parts[-1][0], row + 1, set())
        else:
            parts.append((row, row + max(longest, 1), hits))
        row += max(longest, 1)
    return parts


def parted(fits, rows, size):
    partition = Partition(("FY", "MZ"), VARIANTS)
    for start in range(0, rows, size):
        stop = min(start + size, rows)
        reaches = []
        for group, by_load in fits.items():
            may = np.flatnonzero((by_load["FY"].any(0) & by_load["MZ"].any(0))[start:stop]) + start
            if len(may):
                reaches.append(reach_of(group, may, {load: fit[:, may] for load, fit in by_load.items()}))
        partition.add(stop, reaches)
    return partition.runs()


@settings(max_examples=150, deadline=None)
@given(st.integers(1, 40), st.integers(1, 12), st.floats(0.2, 0.97), st.integers(0, 10_000))
def test_runs_are_those_of_a_search_row_by_row(rows, size, share, seed):
    rng = np.random.default_rng(seed)
    fits = {
        group: {load: rng.random((VARIANTS, rows)) < share for load in ("FY", "MZ")} for group in (3, 5, 8)
    }
    runs = parted(fits, rows, size)
    expected = plain(fits, rows)
    assert [
        (start, stop, set() if place is None else {(h.group, h.signs) for h in runs.hits(place)})
        for start, stop, place in runs.bounds()
    ] == expected
    assert runs.parts == len(expected)
    assert runs.unknown == sum(stop - start for start, stop, hits in expected if not hits)
    # Equal signatures are equal candidates, and no others.
    signatures = runs.signatures()
    assert len(set(signatures)) == len({frozenset(hits) for _, _, hits in expected if hits})


def chance(rows, *runs):
    """Runs by (start, stop, group), each of one candidate."""
    table = np.array(runs, dtype=np.int64).reshape(-1, 3)
    one = np.tile([True, False], (len(table), 1))
    return Runs(
        rows=rows, starts=table[:, 0], stops=table[:, 1], run=np.arange(len(table)), group=table[:, 2],
        variants={"FY": one, "MZ": one},
    )  # fmt: skip


OFTEN = tuple((start + 49, start + 50, 7) for start in range(0, 500, 50))
KEPT = {
    "by chance": (chance(500, (209, 210, 7)), [(0, 500, None)]),
    "a fiftieth of the rows": (chance(500, *OFTEN), None),
    "too few": (chance(500, *OFTEN[:4]), [(0, 500, None)]),
    "a long run": (chance(500, (400, 404, 7)), None),
    "a file that is mostly explained": (chance(8, (0, 6, 1), (7, 8, 2)), None),
    "by chance beside a long run": (
        chance(500, (10, 11, 3), (400, 404, 7)),
        [(0, 400, None), (400, 404, 0), (404, 500, None)],
    ),
}


@pytest.mark.parametrize("name", KEPT)
def test_rows_that_a_candidate_meets_by_chance_do_not_part_an_unknown_file(name):
    runs, expected = KEPT[name]
    assert without_chance(runs).bounds() == (runs.bounds() if expected is None else expected)


def test_candidates_are_each_variant_of_a_load_with_each_of_the_other():
    masks = {"FY": np.array([True, True]), "MZ": np.array([False, True])}
    assert products(4, masks) == [
        Hit(group=4, signs=(("FY", 0), ("MZ", 1))),
        Hit(group=4, signs=(("FY", 1), ("MZ", 1))),
    ]
