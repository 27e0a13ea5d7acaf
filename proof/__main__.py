"""`python -m proof draw | run | score | verify | real`: the proof on concealed effects, step by
step."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from proof import log, proof_file
from proof.batch import draw_batch, redrawn, seed_of
from proof.draw import counts_of
from proof.real import run_real
from proof.running import run_batch
from proof.score import open_batch, score_of
from proof.seal import SealError, verify

TOOL = Path(sys.executable).with_name("toolkit")


def _say(text: str) -> None:
    print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)  # noqa: T201


def _score(given: argparse.Namespace) -> None:
    from proof import page

    proof = open_batch(given.out, workers=given.workers, progress=_say)
    batch, score = proof.batch, score_of(proof)
    small = proof_file.path_beside(given.log or given.out / "log", batch)
    proof_file.write(small, proof)
    if given.log:
        score["log"] = log.scored(given.log, batch, score, dict(given.reason))
    real = given.out / "real" / "real.json"
    if real.exists():
        score["real"] = json.loads(real.read_text(encoding="utf-8"))
    target = given.proof or given.out
    target.mkdir(parents=True, exist_ok=True)
    (target / "PROOF.md").write_text(page.markdown(score, batch), encoding="utf-8")
    (target / "proof.html").write_text(page.page(score, batch), encoding="utf-8")
    _bars(score)
    print(f"{small} holds the opened answers and what was answered")  # noqa: T201


def _bars(score: dict[str, Any]) -> None:
    for bar in score["bars"]:
        state = {True: "met    ", False: "NOT MET", None: "too few"}[bar.met]
        print(f"{state}  {bar.title}: {bar.observed} ({bar.asked})")  # noqa: T201


def _draw(given: argparse.Namespace) -> None:
    found = draw_batch(
        given.out,
        seed=seed_of(given.seed),
        counts=counts_of(given.cases),
        workers=given.workers,
        progress=lambda n: _say(f"{n} drawn"),
    )
    if given.log:
        log.drawn(given.log, found, given.changed)
    print(f"answers {found['answers_sha256']}\ndata    {found['data_sha256']}")  # noqa: T201


def _run(given: argparse.Namespace) -> None:
    run_batch(given.out, tool=[given.tool], workers=given.workers, budget=given.budget, progress=_say)


def _real(given: argparse.Namespace) -> None:
    run_real(given.data, given.out / "real", tool=[given.tool], budget=given.budget, progress=_say)


def _verify(given: argparse.Namespace) -> None:
    """Compare a batch, or a proof's small file, with its seal; score the file again; draw its data again."""
    if given.answers is None and given.out is None:
        raise SealError("nothing to verify: give --out DIR, or --answers FILE")
    if given.answers is None:
        found = verify(given.out)
    else:
        proof = proof_file.read(given.answers)
        found = proof.batch
        _bars(score_of(proof))
        if given.out:
            redrawn(proof, given.out, workers=given.workers, progress=lambda n: _say(f"{n} drawn"))
            print("drawn again from the seed: the same data and answers")  # noqa: T201
    print(f"answers {found['answers_sha256']}\ndata    {found['data_sha256']}")  # noqa: T201


def _all(given: argparse.Namespace) -> None:
    """Do what of a proof is not yet done; a batch that was drawn is never drawn again."""
    if not (given.out / "batch.json").exists():
        _draw(given)
    _run(given)
    _real(given)
    _score(given)


STEPS = {"draw": _draw, "run": _run, "real": _real, "score": _score, "verify": _verify, "all": _all}
_HELP = {
    "draw": "draw a batch and seal its answers",
    "run": "run the tool once on every case; resumable",
    "real": "make and run the cases of public recordings",
    "score": "open, score and write PROOF.md and proof.html",
    "verify": "compare a batch with its seal",
    "all": "whatever of these is not done yet",
}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m proof", description=__doc__)
    steps = parser.add_subparsers(dest="step", required=True)
    for name, text in _HELP.items():
        step = steps.add_parser(name, help=text)
        step.add_argument("--out", type=Path, required=name != "verify", help="the batch's folder")
        step.add_argument("--workers", type=int, default=2)
        if name == "verify":
            step.add_argument(
                "--answers", type=Path,
                help="a scored batch's small file: compared with its seal and scored again; with --out DIR"
                " (new) its data are drawn again from the opened seed and compared too",
            )  # fmt: skip
        if name in ("draw", "all"):
            step.add_argument("--seed", default="os", help='a number, or "os": nobody chose it (default)')
            step.add_argument("--cases", type=int, default=400, help="controls, 6 %% more, not counted")
        if name in ("run", "real", "all"):
            step.add_argument(
                "--tool", default=str(TOOL), help="the command (default: the one of this Python)"
            )
            step.add_argument("--budget", type=float, default=600.0, help="seconds for one case")
        if name in ("real", "all"):
            step.add_argument(
                "--data", type=Path, default=Path("../shared/data"), help="the public recordings"
            )
        if name in ("score", "all"):
            step.add_argument("--proof", type=Path, help="folder of PROOF.md and proof.html (default: --out)")
            step.add_argument(
                "--reason", nargs=2, action="append", default=[], metavar=("BAR", "TEXT"),
                help="why a bar is not met, for the log and the page; with the bar's name as it is printed",
            )  # fmt: skip
        if name in ("draw", "score", "all"):
            step.add_argument("--log", type=Path, help="file of batches to append to, one JSON object a line")
            step.add_argument(
                "--changed", default="", help="what changed since the batch before, for the log"
            )
    return parser


def main(argv: list[str] | None = None) -> int:
    """Do one step; exit 1 where a seal is broken."""
    given = _parser().parse_args(argv)
    try:
        STEPS[given.step](given)
    except SealError as error:
        print(f"seal broken: {error}", file=sys.stderr)  # noqa: T201
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
