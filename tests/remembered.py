"""Answers by the content of their questions: what one worker of a run has worked out, the others read."""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

WORTH_S = 0.01  # of processor time: draws by the thousand, each asked once, are not kept

_answers: dict[bytes, bytes] = {}
_shelves: list[Path] = []


def share(folder: Path) -> None:
    """Have answers kept in a folder, where other workers of this run look for them."""
    folder.mkdir(exist_ok=True)
    _shelves[:] = [folder]


def shelves() -> list[Path]:
    """Return the folder in which answers are kept; none outside a run of the tests."""
    return _shelves[:]


def once(question: object, ask: Callable[[], Any]) -> Any:
    """Return a copy of the answer to a question of this content; what is raised is raised anew each time."""
    key = hashlib.sha256(pickle.dumps(question)).digest()
    if key not in _answers and (shelved := _shelved(key)):
        _answers[key] = shelved
    if key in _answers:
        return pickle.loads(_answers[key])  # noqa: S301  written here
    started = time.process_time()
    answer = ask()
    if time.process_time() - started > WORTH_S:
        _answers[key] = _shelve(key, pickle.dumps(answer))
        return pickle.loads(_answers[key])  # noqa: S301  written here
    return answer


def remembered(ask: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that answers the same question by a copy of its first answer.

    ``beside`` is content that the answer depends on too, and that is not among what the function is given.
    """

    @functools.wraps(ask)
    def asked(*given: Any, beside: object = None, **named: Any) -> Any:
        name = f"{ask.__module__}.{ask.__qualname__}"
        return once((name, given, sorted(named.items()), beside), lambda: ask(*given, **named))

    return asked


def _shelved(key: bytes) -> bytes | None:
    for folder in _shelves:
        path = folder / key.hex()
        if path.exists():
            return path.read_bytes()
    return None


def _shelve(key: bytes, answer: bytes) -> bytes:
    for folder in _shelves:
        part = folder / f"{key.hex()}.{os.getpid()}"
        part.write_bytes(answer)
        part.replace(folder / key.hex())  # whole or not at all: another worker may be reading
    return answer
