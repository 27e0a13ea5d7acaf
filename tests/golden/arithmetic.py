"""A fingerprint of the arithmetic: linear algebra and functions whose last bits depend on the processor."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import scipy
import scipy.linalg
import scipy.special

_FILE = "arithmetic.json"


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
        for part in parts:
            digest.update(np.ascontiguousarray(part, float).tobytes())
    return {"numpy": np.__version__, "scipy": scipy.__version__, "sha256": digest.hexdigest()}


def read_fingerprint(folder: Path) -> dict[str, str] | None:
    """Return the fingerprint of the frozen files; None where there is none."""
    path = folder / _FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def write_fingerprint(folder: Path) -> None:
    """Write today's fingerprint beside the frozen files."""
    (folder / _FILE).write_text(json.dumps(fingerprint(), indent=1) + "\n", encoding="utf-8")
