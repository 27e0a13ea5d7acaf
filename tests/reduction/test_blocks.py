"""Load blocks: found by jumps, whatever the loads and the noise."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.reduction.blocks import Block, find_blocks, is_tare

# The ten printed rows of Figure 4.4, column "FZ load" [lbf].
FIGURE_4_4 = [
    248.8146,
    250.0319,
    587.4521,
    586.4783,
    835.0397,
    834.5528,
    1112.572,
    1111.841,
    1376.714,
    1375.496,
]


def test_the_ten_rows_of_figure_4_4_are_five_loads() -> None:
    blocks = find_blocks(np.array(FIGURE_4_4))
    assert [(b.start, b.stop) for b in blocks] == [(0, 2), (2, 4), (4, 6), (6, 8), (8, 10)]
    assert blocks[0].mean_FZ == pytest.approx(249.42325)


def test_one_row_a_load() -> None:
    assert [b.n for b in find_blocks(np.array(FIGURE_4_4[::2]))] == [1, 1, 1, 1, 1]


def test_one_load_only() -> None:
    rng = np.random.default_rng(1)
    assert len(find_blocks(2500 + rng.normal(0, 5, 300))) == 1


def test_single_row() -> None:
    assert [b.n for b in find_blocks(np.array([1000.0]))] == [1]


def test_a_tare_block_is_no_load() -> None:
    blocks = find_blocks(np.array([2.0, 1.5, 2.2, 250.0, 251.0, 567.0, 566.0]))
    assert [is_tare(b, smallest_load=250.0) for b in blocks] == [True, False, False]


@given(
    loads=st.lists(st.integers(10, 60), min_size=1, max_size=7),
    rows=st.integers(3, 120),
    noise=st.floats(0.0, 0.004),
    seed=st.integers(0, 2**32 - 1),
)
def test_blocks_cover_every_row_once_in_order(loads: list[int], rows: int, noise: float, seed: int) -> None:
    levels = [100.0 * loads[0]]
    for load in loads[1:]:
        if abs(100.0 * load - levels[-1]) >= 10.0 * max(loads):
            levels.append(100.0 * load)
    rng = np.random.default_rng(seed)
    FZ = np.concatenate([level * (1 + noise * rng.uniform(-1, 1, rows)) for level in levels])
    blocks = find_blocks(FZ)
    assert blocks[0].start == 0
    assert blocks[-1].stop == len(FZ)
    assert all(a.stop == b.start for a, b in itertools.pairwise(blocks))
    assert [b.n for b in blocks] == [rows] * len(levels)


def test_units_do_not_matter() -> None:
    FZ = np.array(FIGURE_4_4)
    lbf = [(b.start, b.stop) for b in find_blocks(FZ)]
    newton = [(b.start, b.stop) for b in find_blocks(FZ * 4.4482216152605)]
    assert lbf == newton


def test_rows_is_a_slice() -> None:
    assert Block(start=2, stop=5, mean_FZ=1.0).rows == slice(2, 5)
