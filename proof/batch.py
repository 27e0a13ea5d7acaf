"""A batch on disk: drawn with workers, sealed as one."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from proof.draw import draw_case, mix
from proof.files import write_case
from proof.model import Array
from proof.proof_file import Proof
from proof.seal import SealError, opened, seal


def seed_of(text: str) -> int:
    """Return the seed: a number, or 256 bits of the operating system for "os"."""
    return secrets.randbits(256) if text == "os" else int(text, 0)


def _one(job: tuple[int, int, str, str, Path]) -> tuple[str, dict[str, Any], list[dict[str, Array]]]:
    seed, index, bucket, name, folder = job
    drawn = draw_case(seed, index, bucket)
    write_case(drawn.scenario, drawn.measured, folder / "cases" / name)
    return name, drawn.answer | {"index": index}, drawn.predicted


def draw_batch(
    folder: Path,
    *,
    seed: int,
    counts: Mapping[str, int],
    workers: int,
    progress: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Draw and seal a batch into a new folder; return what batch.json holds."""
    folder.mkdir(parents=True)
    (folder / "cases").mkdir()
    buckets = mix(counts, np.random.default_rng([seed, 2**32 - 1]))
    jobs = [(seed, i, bucket, f"case{i + 1:04d}", folder) for i, bucket in enumerate(buckets)]
    answers: dict[str, Any] = {}
    predicted: dict[str, list[dict[str, Array]]] = {}
    with ProcessPoolExecutor(max_workers=workers) as pool:
        for done, (name, answer, rows) in enumerate(pool.map(_one, jobs)):
            answers[name], predicted[name] = answer, rows
            progress(done + 1)
    return seal(folder, {"seed": hex(seed), "cases": answers}, predicted)


def redrawn(proof: Proof, folder: Path, *, workers: int, progress: Callable[[int], None]) -> None:
    """Draw a batch again from the seed that was opened, into a new folder; it must be the sealed one.

    Raises SealError where the data's hash or an answer differs; the reason may be another state of the
    generator or of its libraries, which are named.
    """
    counts = Counter(row["bucket"] for row in proof.sealed.values())
    made = draw_batch(folder, seed=proof.seed, counts=counts, workers=workers, progress=progress)
    again, _ = opened(folder)
    other = [k for k in ("generator_sha256", "versions") if made[k] != proof.batch.get(k)]
    hint = f" ({' and '.join(other)} differ from the batch's)" if other else ""
    if made["data_sha256"] != proof.batch["data_sha256"]:
        raise SealError(f"the seed does not give the data that were sealed{hint}")
    if again["cases"] != proof.sealed:
        raise SealError(f"the seed does not give the answers that were sealed{hint}")
