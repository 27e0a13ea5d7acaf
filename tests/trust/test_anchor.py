"""A document's anchor against today's log: growth holds; rollback, fork and rewriting are each named."""

from __future__ import annotations

import json
import re

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from toolkit.errors import TrustError
from toolkit.trust.anchor import MOST_BYTES, Anchor, anchor_of, compare, parse_anchor, parse_compact
from toolkit.trust.checkpoint import Checkpoint
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import leaf_hash, root_of
from toolkit.trust.ssh import public_of, sign_with

LINES = [f'{{"seq":{number}}}' for number in range(1, 14)]


def _checkpoint(lines: list[str]) -> Checkpoint:
    return Checkpoint(
        origin="m15", size=len(lines), root=root_of([leaf_hash(line.encode()) for line in lines])
    )


@pytest.mark.parametrize("index", range(len(LINES)))
def test_the_line_of_a_document_is_proved_without_the_log(index: int) -> None:
    anchor = anchor_of(LINES, index, _checkpoint(LINES))
    again = parse_anchor(json.loads(json.dumps(anchor.as_dict())))
    assert again == anchor
    assert again.proved
    assert not parse_anchor({**anchor.as_dict(), "line": '{"seq":0}'}).proved
    assert not parse_anchor({**anchor.as_dict(), "index": (index + 1) % len(LINES)}).proved


def test_a_log_that_only_grew_continues() -> None:
    checkpoint = _checkpoint(LINES[:7])
    assert compare(LINES, checkpoint).continuity == "continues"
    assert compare(LINES[:7], checkpoint).continuity == "continues"


@pytest.mark.parametrize("size", range(7))
def test_a_log_that_became_shorter_is_rolled_back(size: int) -> None:
    assert compare(LINES[:size], _checkpoint(LINES[:7])).continuity == "rolled_back"


@pytest.mark.parametrize("changed", range(11))
def test_a_rewritten_entry_is_a_fork_and_its_place_is_told(changed: int) -> None:
    checkpoint = _checkpoint(LINES[:11])
    rewritten = [*LINES[:changed], '{"seq":"rewritten"}', *LINES[changed + 1 :]]
    for index in range(11):
        comparison = compare(rewritten, checkpoint, anchor_of(LINES, index, checkpoint))
        assert comparison.continuity == "forked"
        first, last = _place(comparison.why)
        assert first <= changed + 1 <= last, "the range that is named holds the rewritten entry"
        if index == changed:
            assert first == last


@pytest.mark.parametrize("begin", range(11))
@pytest.mark.parametrize("index", range(11))
def test_of_a_fork_the_first_entry_that_differs_is_told(begin: int, index: int) -> None:
    """A rewriter who keeps the chain whole changes every entry from one on: where that begins is asked."""
    checkpoint = _checkpoint(LINES[:11])
    forked = [*LINES[:begin], *(f'{{"seq":"{number}"}}' for number in range(begin, 13))]
    comparison = compare(forked, checkpoint, anchor_of(LINES, index, checkpoint))
    first, last = _place(comparison.why)
    assert comparison.continuity == "forked"
    assert first <= begin + 1 <= last
    assert (", the document's own, differs too" in comparison.why) == (last <= index)
    shorter = compare(forked[:10], checkpoint, anchor_of(LINES, index, checkpoint))
    assert shorter.continuity == "rolled_back"
    if last <= 8:  # a subtree that is there as a whole
        assert _place(shorter.why) == (first, last)


def test_a_fork_from_a_checkpoint_alone_has_no_narrower_place() -> None:
    assert _place(compare(["{}", *LINES[1:]], _checkpoint(LINES[:7])).why) == (1, 7)


def _place(why: str) -> tuple[int, int]:
    """Return the first and the last of the entries of which one is the first that differs."""
    match = re.search(r"differs from what was issued is (?:one of the entries (\d+) to|entry) (\d+)", why)
    assert match is not None, why
    return int(match[1] or match[2]), int(match[2])


def test_a_dropped_and_a_moved_entry_are_forks() -> None:
    checkpoint = _checkpoint(LINES[:9])
    assert compare([*LINES[:3], *LINES[4:]], checkpoint).continuity == "forked"
    assert compare([LINES[1], LINES[0], *LINES[2:]], checkpoint).continuity == "forked"


@pytest.mark.parametrize(
    "entries",
    [
        {},
        {"line": 1},
        {"path": ["x"]},
        {"path": ["AAAA"]},
        {"index": "0"},
        {"checkpoint": "m15\n1\n\n"},
        {"path": None},
    ],
)
def test_a_damaged_proof_is_refused(entries: dict[str, object]) -> None:
    sound = anchor_of(LINES, 2, _checkpoint(LINES)).as_dict()
    with pytest.raises(TrustError):
        parse_anchor({**sound, **entries} if entries else {})


@pytest.mark.parametrize("index", range(len(LINES)))
def test_what_a_telephone_reads_is_the_same_proof_without_the_line(index: int) -> None:
    anchor = anchor_of(LINES, index, _checkpoint(LINES))
    again = parse_compact(anchor.compact.decode())
    assert again.proved
    assert (again.leaf, again.path, again.line) == (leaf_hash(LINES[index].encode()), anchor.path, None)
    assert compare(LINES, again.checkpoint, again).continuity == "continues"
    rewritten = [*LINES[:index], "{}", *LINES[index + 1 :]]
    assert _place(compare(rewritten, again.checkpoint, again).why) == (index + 1, index + 1)


def test_the_proof_of_a_ledger_of_a_million_entries_signed_by_three_people_fits() -> None:
    checkpoint = Checkpoint(origin="toolkit/m15-virtual", size=2**20, root=bytes(32))
    for name in ("anna", "a-person-of-long-name", "ben"):
        private = Ed25519PrivateKey.generate()
        signer = Signer(public_of(private), lambda data, private=private: sign_with(private, data))
        checkpoint = checkpoint.signed(name, signer)
    anchor = Anchor(leaf=bytes(32), index=2**20 - 1, path=(bytes(32),) * 20, checkpoint=checkpoint)
    assert len(anchor.compact) <= MOST_BYTES == 2048
    with pytest.raises(TrustError) as caught:
        _ = Anchor(leaf=bytes(32), index=0, path=(bytes(32),) * 40, checkpoint=checkpoint).compact
    assert caught.value.rule == "proof-size"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("toolkit-proof@v1", "toolkit-proof@v2"),
        ("v1 3", "v1 -3"),
        ("v1 3", "v1"),
        ("v1 3", "v1 " + "9" * 5000),
        ("v1 3", "v1 \u0663"),
        ("=\n", "\n"),
        ("m15\n", ""),
    ],
)
def test_a_damaged_text_of_a_code_is_refused(old: str, new: str) -> None:
    text = anchor_of(LINES, 3, _checkpoint(LINES)).compact.decode()
    with pytest.raises(TrustError):
        parse_compact(text.replace(old, new, 1))
