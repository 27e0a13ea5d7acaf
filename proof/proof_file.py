"""A scored batch in one small file: what is needed to check its seal and to score it again without its data.

One JSON object a line, compressed: first the batch's hashes and the sealed answers letter for letter, opened,
with their salt; then a line for each case with what the tool answered, how long it took, and what the
generator's own fits and the baselines reached. The seed in the answers draws the data again.
"""

from __future__ import annotations

import gzip
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from proof.seal import SealError

LARGEST_BYTES = 1_000_000
"""What a proof that stands in a repository may weigh."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What was observed of one case."""

    run: dict[str, Any]
    """Exit code and seconds; empty where the tool was not run."""
    answer: dict[str, Any] | None
    """The tool's answer, what of it is judged; None where none could be read."""
    extra: dict[str, Any]
    """Gaps, baselines and the generator's own fits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """A batch that was run and opened."""

    batch: dict[str, Any]
    answers: str
    """The text of the sealed answers."""
    cases: dict[str, Case]

    @property
    def sealed(self) -> dict[str, Any]:
        """Return the answers by case."""
        found: dict[str, Any] = json.loads(self.answers)["cases"]
        return found

    @property
    def seed(self) -> int:
        """Return the seed from which the batch can be drawn again."""
        return int(json.loads(self.answers)["seed"], 16)


def judged_part(answer: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return of an answer what the judge and the score read, and nothing that they do not."""
    if answer is None:
        return None
    keep = lambda row, keys: {k: row[k] for k in keys.split() if k in row}  # noqa: E731
    effects = [
        keep(e, "name channel equivalent_to")
        | {"parameters": [keep(p, "name value unit ci95 runs") for p in e.get("parameters") or []]}
        for e in answer.get("effects") or []
    ]
    laws = [keep(law, "place form acts variables memory_s") for law in answer.get("laws") or []]
    return keep(answer, "verdict remaining complete") | {
        "effects": effects,
        "laws": laws,
        "mismatch": [keep(row, "channel share_of_variance") for row in answer.get("mismatch") or []],
        "not_found": [
            keep(row, "name minimum_detectable observable") for row in answer.get("not_found") or []
        ],
    }


def path_beside(log: Path, batch: dict[str, Any]) -> Path:
    """Return where the proof of a batch stands: beside the log, under the head of its seal."""
    return log.with_name(f"proof-{batch['answers_sha256'][:16]}.jsonl.gz")


def write(path: Path, proof: Proof) -> None:
    """Write the file, the same bytes for the same proof."""
    rows: list[dict[str, Any]] = [{"schema": 1, "batch": proof.batch, "answers": proof.answers}]
    rows += [{"case": k, "run": c.run, "answer": c.answer, "extra": c.extra} for k, c in proof.cases.items()]
    text = "".join(json.dumps(row, sort_keys=True) + "\n" for row in rows)
    data = gzip.compress(text.encode(), mtime=0)
    if len(data) > LARGEST_BYTES:
        raise ValueError(f"{path.name} would weigh {len(data)} bytes, at most {LARGEST_BYTES} are allowed")
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)


def read(path: Path) -> Proof:
    """Return the proof, after its answers were compared with their seal.

    Raises SealError where the file is damaged, the answers are not those that were sealed, or cases lack.
    """
    try:
        lines = gzip.decompress(path.read_bytes()).decode().splitlines()
        head, *rows = [json.loads(x) for x in lines]
        cases = {r["case"]: Case(run=r["run"], answer=r["answer"], extra=r["extra"]) for r in rows}
        proof = Proof(batch=head["batch"], answers=head["answers"], cases=cases)
        sealed = proof.sealed
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise SealError(f"{path.name} cannot be read: {error}") from error
    if hashlib.sha256(proof.answers.encode()).hexdigest() != proof.batch["answers_sha256"]:
        raise SealError(f"the answers in {path.name} are not those whose hash was sealed")
    if sorted(sealed) != sorted(r["case"] for r in rows):
        raise SealError(f"{path.name} does not hold every case of its batch once")
    return proof
