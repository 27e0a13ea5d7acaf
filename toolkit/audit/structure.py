"""How a file's rows lie in load blocks, held against its test and the loads of the protocol.

A row that was deleted, rows that changed places and a load that was edited leave Fy, Mz and the cells
beside them in agreement: nothing that computes forces sees them. The order of the rows does.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from toolkit.findings import Finding

_ALIKE = 0.03  # loads are one where they differ by less, as a part
_STRANGERS = 2  # rows that stand between two parts of a block, at most
_FEWEST_BLOCKS, _USUAL = 8, 0.9  # blocks of a test, and the share of them that have as many rows
_SHORT = 5  # blocks of fewer rows say nothing


def strangers(blocks: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield in words the rows that stand within a block of another load.

    >>> block = lambda first, last, FZ: {"first_row": first, "last_row": last, "FZ_N": FZ}
    >>> list(strangers([block(1, 49, 1000.0), block(50, 50, 2500.0), block(51, 100, 1001.0)]))
    ['row 50 has a load of 2500 N within a block of 1000 N']
    """
    for before, here, after in zip(blocks, blocks[1:], blocks[2:], strict=False):
        rows = _rows(here)
        if rows > _STRANGERS or min(_rows(before), _rows(after)) <= _STRANGERS:
            continue
        if abs(before["FZ_N"] - after["FZ_N"]) < _ALIKE * abs(before["FZ_N"]):
            first, last = here["first_row"], here["last_row"]
            named = f"row {first} has" if rows == 1 else f"rows {first} and {last} have"
            yield (f"{named} a load of {here['FZ_N']:.0f} N within a block of {before['FZ_N']:.0f} N")


def off_loads(blocks: Sequence[Mapping[str, Any]], tolerance: float) -> Iterator[str]:
    """Yield in words the blocks whose load is not the commanded one, by the protocol's tolerance.

    >>> list(off_loads([{"first_row": 1, "last_row": 9, "FZ_N": 1100.0, "step_FZ_N": 1000.0}], 0.05))
    ['rows 1 to 9: the load is 1100 N, 10.0 % off the 1000 N of the protocol']
    """
    for block in blocks:
        step = block["step_FZ_N"]
        if step and abs(block["FZ_N"] - step) > tolerance * step and _rows(block) > _STRANGERS:
            off = 100 * abs(block["FZ_N"] - step) / step
            yield (
                f"rows {block['first_row']} to {block['last_row']}: the load is {block['FZ_N']:.0f} N, "
                f"{off:.1f} % off the {step:.0f} N of the protocol"
            )


def odd_counts(files: Mapping[str, Sequence[Sequence[int]]]) -> Iterator[Finding]:
    """Yield the files with a block of more or fewer rows than nearly all blocks of their test have.

    ``files``: by path the first and last row of each block.
    """
    counts = Counter(last - first + 1 for blocks in files.values() for first, last in blocks)
    total = sum(counts.values())
    if total < _FEWEST_BLOCKS:
        return
    usual, count = counts.most_common(1)[0]
    if usual < _SHORT or count < _USUAL * total:
        return
    for path, blocks in files.items():
        odd = [(first, last) for first, last in blocks if last - first + 1 != usual]
        if odd and all(abs(last - first + 1 - usual) <= usual // 2 for first, last in odd):
            named = ", ".join(f"rows {first} to {last} are {last - first + 1}" for first, last in odd[:3])
            message = f"a load block of this test has {usual} rows; {named}: rows are missing, or were added"
            yield Finding(rule="row-count", where=path, message=message)


def structure_findings(
    blocks: Sequence[Mapping[str, Any]], tolerance: float, where: str
) -> tuple[Finding, ...]:
    """Return what the order and the loads of one file's blocks show."""
    rows = list(strangers(blocks))
    loads = list(off_loads(blocks, tolerance))
    findings = []
    if rows:
        message = "; ".join(itertools.islice(rows, 3)) + ": rows changed places, or were taken from elsewhere"
        findings.append(Finding(rule="foreign-row", where=where, message=message))
    if loads:
        more = f"; and {len(loads) - 3} more blocks" if len(loads) > 3 else ""
        message = "; ".join(loads[:3]) + more
        findings.append(Finding(rule="load-tolerance", where=where, message=message, level="note"))
    return tuple(findings)


def _rows(block: Mapping[str, Any]) -> int:
    count: int = block["last_row"] - block["first_row"] + 1
    return count
