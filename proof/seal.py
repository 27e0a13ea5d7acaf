"""The seal: answers and salt apart from the cases, their hashes printed before any case is run.

The salt stands inside the answers' file, so that its SHA-256 tells nothing about a guess of the answers.
"""

from __future__ import annotations

import hashlib
import json
import platform
import secrets
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from proof.files import sha256_of_tree
from proof.model import Array


class SealError(Exception):
    """The batch is not what was sealed."""


def generator_sha256() -> str:
    """Return one hash of the generator's sources: with them and its libraries, a seed gives the same bytes.

    What judges and shows a batch is not among them. A batch states the hash of the sources as they stood when
    it was sealed; sources of a later day are held to the data that its seed gives.
    """
    after = ("judge", "laws", "score", "page", "content", "inventory", "proof_file", "log", "real",
             "real_cases", "running", "oracle", "baselines", "intervals", "__main__")  # fmt: skip
    here = Path(__file__).parent
    total = hashlib.sha256()
    for path in sorted(here.rglob("*.py")):
        if path.stem not in after:
            total.update(path.relative_to(here).as_posix().encode() + path.read_bytes())
    return total.hexdigest()


def seal(
    folder: Path, answers: dict[str, Any], predicted: dict[str, list[dict[str, Array]]]
) -> dict[str, Any]:
    """Write sealed/answers.json and the true predictions, then batch.json with the hashes; return the
    latter."""
    sealed = folder / "sealed"
    sealed.mkdir()
    truths = {}
    for case, rows in predicted.items():
        path = sealed / f"{case}.csv"
        lines = [
            f"{i},{k},{','.join(f'{v:.9g}' for v in y)}" for i, row in enumerate(rows) for k, y in row.items()
        ]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        truths[case] = hashlib.sha256(path.read_bytes()).hexdigest()
    whole = {"schema": 1, "salt": secrets.token_hex(32), **answers, "predicted_sha256": truths}
    text = json.dumps(whole, indent=1, sort_keys=True)
    (sealed / "answers.json").write_text(text + "\n", encoding="utf-8")
    batch = {
        "schema": 1,
        "cases": len(predicted),
        "answers_sha256": hashlib.sha256((sealed / "answers.json").read_bytes()).hexdigest(),
        "data_sha256": sha256_of_tree(folder / "cases"),
        "generator_sha256": generator_sha256(),
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
    }
    (folder / "batch.json").write_text(json.dumps(batch, indent=1) + "\n", encoding="utf-8")
    return batch


def verify(folder: Path) -> dict[str, Any]:
    """Return batch.json if the cases are those that were sealed, and the answers too where they are
    present."""
    batch: dict[str, Any] = json.loads((folder / "batch.json").read_text(encoding="utf-8"))
    if sha256_of_tree(folder / "cases") != batch["data_sha256"]:
        raise SealError("the cases are not those whose hash was sealed")
    path = folder / "sealed" / "answers.json"
    if path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != batch["answers_sha256"]:
        raise SealError("the answers are not those whose hash was sealed")
    return batch


def opened(folder: Path) -> tuple[dict[str, Any], dict[str, list[dict[str, Array]]]]:
    """Return the answers and the true predictions, after every hash was compared."""
    verify(folder)
    path = folder / "sealed" / "answers.json"
    answers: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    predicted: dict[str, list[dict[str, Array]]] = {}
    for case, wanted in answers["predicted_sha256"].items():
        found = folder / "sealed" / f"{case}.csv"
        if hashlib.sha256(found.read_bytes()).hexdigest() != wanted:
            raise SealError(f"the true predictions of {case} are not those that were sealed")
        rows: list[dict[str, Array]] = []
        for line in found.read_text(encoding="utf-8").splitlines():
            i, name, *values = line.split(",")
            while len(rows) <= int(i):
                rows.append({})
            rows[int(i)][name] = np.array(values, float)
        predicted[case] = rows
    return answers, predicted
