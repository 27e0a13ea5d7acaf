"""A small proof with a fixed seed on every run of the tests: floors below which nothing may fall.

The cases are the light ones of their kinds (a beam, a motor force); the whole proof is `make proof`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from proof import files
from proof.draw import draw_case
from proof.judge import Judgment, judge
from proof.running import answer_of, run_case
from toolkit.cli.main import run

TOOLKIT = str(Path(sys.executable).with_name("toolkit"))
SEED = 61
CASES: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("null", "beam-columns", ()),
    ("null", "beam-python", ()),
    ("null", "drive-force", ()),
    ("null", "drive-force", ()),
    ("single", "beam-columns", ("thermal_drift",)),
    ("single", "beam-python", ("zero_offset",)),
    ("single", "drive-force", ("dead_band",)),
    ("outside", "beam-columns", ("hidden_slip",)),
    ("confounded", "one speed", ("coulomb_friction",)),
)
BUDGET_S = 60.0
LARGE = 2.0
"""Single effects are drawn again until their size is at least this, in noise sd."""


def _answered(case: Path, out: Path, *, apart: bool) -> None:
    """Answer a case, in a process of its own as the proof does, or by the same words in this one."""
    if apart:
        run_case(case, out, [TOOLKIT], BUDGET_S)
        return
    words = ["diagnose", str(case / "CASE.toml"), "--out", str(out / "answer"), "--budget", f"{BUDGET_S:g}"]
    with pytest.raises(SystemExit) as ended:
        run(words)
    assert ended.value.code in (0, 1, None)


EVERY_RUN = (5,)
"""Of the cases, by their places, that of every run of the tests: a large effect, in a process of its own."""
ALL = pytest.mark.campaign(
    "every case of the small proof: where nothing is missing, and what one speed cannot tell apart, the "
    "diagnosis itself is asked in every run (tests/diagnosis)"
)


def judged(base: Path, places: Sequence[int]) -> dict[str, list[Judgment]]:
    """Return cases drawn, run through the command line and judged; the first as the proof runs it."""
    out: dict[str, list[Judgment]] = {}
    for i, (bucket, family, names) in [(i, CASES[i]) for i in places]:
        for attempt in range(40):
            drawn = draw_case(SEED + attempt, i, bucket, compare=False, picked=(family, names))
            if bucket != "single" or drawn.answer["size"] >= LARGE:
                break
        name = f"{i}-{bucket}"
        files.write_case(drawn.scenario, drawn.measured, base / "cases" / name)
        _answered(base / "cases" / name, base / "runs" / name, apart=i == places[0])
        out.setdefault(bucket, []).append(judge(name, drawn.answer, answer_of(base, name)))
    return out


@pytest.mark.parametrize(
    "places", [EVERY_RUN, pytest.param(range(len(CASES)), marks=ALL)], ids=["part", "all"]
)
def test_the_small_proof_stays_above_its_floors(tmp_path: Path, places: Sequence[int]) -> None:
    """One test, so that a parallel run draws and answers the cases once."""
    rows_of = judged(tmp_path, places)
    assert rows_of.keys() == {CASES[i][0] for i in places}
    every = [j for rows in rows_of.values() for j in rows]
    assert [j.case for j in every if j.verdict == "failed"] == []
    # Nothing is named where nothing is missing, nor from outside the catalogue; what one speed cannot tell
    # apart is not a wrong name.
    for bucket in ("null", "outside", "confounded"):
        assert [(j.case, j.reported) for j in rows_of.get(bucket, []) if j.false_name] == []
    # Of three large effects two are named at least; where there is one, it is.
    assert sum(j.right for j in rows_of["single"]) >= min(2, len(rows_of["single"])), [
        (j.case, j.truth, j.column) for j in rows_of["single"]
    ]
