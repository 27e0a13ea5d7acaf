"""`python -m tests.concealed draw | run | score | verify`: the proof on concealed effects, step by step."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.concealed.batch import draw_batch, seed_of
from tests.concealed.seal import SealError, verify


def main() -> int:
    """Run one step; exit 1 where a seal is broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.concealed", description=__doc__)
    steps = parser.add_subparsers(dest="step", required=True)
    draw = steps.add_parser("draw", help="draw a batch and seal its answers")
    draw.add_argument("--seed", default="os", help='a number, or "os": nobody chose it (default)')
    draw.add_argument("--cases", type=int, default=400)
    check = steps.add_parser("verify", help="compare a batch with its seal")
    for step in (draw, check):
        step.add_argument("--out", type=Path, required=True, help="the batch's folder")
        step.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    try:
        if given.step == "draw":
            show = lambda n: print(f"\r{n}/{given.cases}", end="", file=sys.stderr, flush=True)  # noqa: E731, T201
            found = draw_batch(
                given.out, seed=seed_of(given.seed), cases=given.cases, workers=given.workers, progress=show
            )
        else:
            found = verify(given.out)
    except SealError as error:
        print(f"seal broken: {error}", file=sys.stderr)  # noqa: T201
        return 1
    print(f"answers {found['answers_sha256']}\ndata    {found['data_sha256']}")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
