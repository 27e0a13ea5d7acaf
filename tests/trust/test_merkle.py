"""The tree over a log: the published roots of the reference tree, and every proof up to 20 lines."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.trust.merkle import (
    EMPTY,
    Growing,
    consistency_proof,
    consistent,
    included,
    inclusion_proof,
    leaf_hash,
    node_hash,
    root_of,
)

# Leaves and roots of the reference tree of RFC 6962's own implementation (merkle_tree_test).
LINES = [
    bytes.fromhex(text)
    for text in (
        "",
        "00",
        "10",
        "2021",
        "3031",
        "40414243",
        "5051525354555657",
        "606162636465666768696a6b6c6d6e6f",
    )
]
ROOTS = (
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328",
)


@pytest.mark.parametrize("size", range(1, 9))
def test_the_published_roots(size: int) -> None:
    assert root_of([leaf_hash(line) for line in LINES[:size]]).hex() == ROOTS[size - 1]


def test_an_empty_log_has_the_hash_of_nothing() -> None:
    assert Growing().root() == EMPTY
    assert EMPTY.hex() == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"


def _leaves(count: int) -> list[bytes]:
    return [leaf_hash(bytes([number])) for number in range(count)]


@pytest.mark.parametrize("size", range(1, 21))
def test_every_line_is_proved_and_no_other_place_or_root(size: int) -> None:
    leaves = _leaves(size)
    root = root_of(leaves)
    for index in range(size):
        path = inclusion_proof(leaves, index)
        assert included(leaves[index], index, size, path, root)
        for other in range(size + 1):
            assert other == index or not included(leaves[index], other, size, path, root)
        assert not included(leaf_hash(b"another"), index, size, path, root)
        assert not included(leaves[index], index, size, path, node_hash(root, root))
        assert not included(leaves[index], index, size, [*path, root], root)
        assert size == 1 or not included(leaves[index], index, size, path[:-1], root)


@pytest.mark.parametrize("size", range(1, 21))
def test_every_beginning_is_proved_and_no_fork(size: int) -> None:
    leaves = _leaves(size)
    root = root_of(leaves)
    for old in range(size + 1):
        path = consistency_proof(leaves, old)
        old_root = root_of(leaves[:old])
        assert consistent(old, old_root, size, root, path)
        if old:
            forked = root_of([*leaves[: old - 1], leaf_hash(b"rewritten")])
            assert not consistent(old, forked, size, root, path)
            assert not consistent(old, old_root, size, forked, path)
        if old not in (0, size):
            assert not consistent(old, old_root, size, root, path[:-1])
            assert not consistent(old, old_root, size, root, [*path, root])
    assert not consistent(size + 1, root, size, root, [])


@given(st.integers(1, 300), st.data())
def test_proofs_hold_at_any_size(size: int, data: st.DataObject) -> None:
    leaves = [leaf_hash(number.to_bytes(2, "big")) for number in range(size)]
    index, old = data.draw(st.integers(0, size - 1)), data.draw(st.integers(0, size))
    root = root_of(leaves)
    assert included(leaves[index], index, size, inclusion_proof(leaves, index), root)
    assert consistent(old, root_of(leaves[:old]), size, root, consistency_proof(leaves, old))
