"""A fingerprint of the arithmetic: linear algebra and functions whose last bits depend on the processor."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import scipy
import scipy.linalg
import scipy.special
from numpy.typing import NDArray

_FILE = "arithmetic.json"
OTHER_ARITHMETIC = """error: this machine's arithmetic is not that of the frozen files
  got:      another processor, more than one thread (OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1), or other
            versions of numpy and scipy: the last bits of results differ
  expected: the fingerprint in arithmetic.json beside the files
  next:     freeze the commit that froze the files here, with its package first in PYTHONPATH
            (python -m tests.golden freeze --out DIR), then compare with it (check --frozen DIR)"""


def fingerprint() -> dict[str, str]:
    """Return the versions of the libraries and a hash of what they compute here, bit by bit."""
    rng = np.random.default_rng(20260301)
    digest = hashlib.sha256()
    for rows, columns in ((7, 3), (60, 4), (500, 12)):
        matrix, right = rng.normal(size=(rows, columns)), rng.normal(size=rows)
        square = matrix.T @ matrix
        parts = [
            square,
            np.linalg.lstsq(matrix, right, rcond=None)[0],
            np.linalg.svd(matrix)[1],
            np.linalg.eigh(square)[0],
            np.linalg.qr(matrix)[1],
            scipy.linalg.cho_solve(scipy.linalg.cho_factor(square), matrix.T @ right),
            *(function(right) for function in (np.exp, np.sin, np.arctan, np.tanh, np.cosh)),
            np.log(np.abs(right)),
            np.abs(right) ** 0.37,
            scipy.special.erf(right),
            np.fft.rfft(right).view(float),
            np.array([right.sum(), right.std(), right @ right]),
        ]
        _add(digest, *parts)
    # Large enough to be shared by threads, which sum in another order.
    matrix = rng.normal(size=(300, 300))
    _add(digest, matrix.T @ matrix, matrix @ matrix.T, np.linalg.inv(matrix))
    return {"numpy": np.__version__, "scipy": scipy.__version__, "sha256": digest.hexdigest()}


def _add(digest: hashlib._Hash, *values: NDArray[np.float64]) -> None:
    for value in values:
        digest.update(np.ascontiguousarray(value, float).tobytes())


def read_fingerprint(folder: Path) -> dict[str, str] | None:
    """Return the fingerprint of the frozen files; None where there is none."""
    path = folder / _FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def write_fingerprint(folder: Path) -> None:
    """Write today's fingerprint beside the frozen files."""
    (folder / _FILE).write_text(json.dumps(fingerprint(), indent=1) + "\n", encoding="utf-8")
