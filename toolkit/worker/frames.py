"""What crosses between tool and worker: pickled requests to it, judged frames of numbers and texts from it.

A worker runs code of others: nothing that comes from it is unpickled, and every length, name and shape is
held against what was asked for. A reply is two lengths, a JSON head, and the doubles of its arrays.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError, FitError, ToolkitError

if TYPE_CHECKING:
    from toolkit.arrays import Array

    Arrays = Mapping[str, Array]

REQUEST = struct.Struct("<Q")
REPLY = struct.Struct("<IQ")
MOST_HEAD = 1 << 20  # bytes of a reply's JSON
_MOST_TEXT = 2_000  # characters of one part of an error
_ERRORS: dict[str, type[ToolkitError]] = {"ConfigError": ConfigError, "FitError": FitError}
_PARTS = ("where", "got", "expected", "next_step", "rule")


class FrameError(Exception):
    """A reply is none that was asked for."""


class RaisedError(Exception):
    """The code raised what is no error of the toolkit; the text names it."""


def arrays_reply(arrays: Arrays) -> bytes:
    """Return arrays of doubles by their names as a reply."""
    import numpy as np

    blocks = {name: np.ascontiguousarray(array, dtype=np.float64) for name, array in arrays.items()}
    head = json.dumps({"arrays": [[name, list(array.shape)] for name, array in blocks.items()]}).encode()
    body = b"".join(array.tobytes() for array in blocks.values())
    return REPLY.pack(len(head), len(body)) + head + body


def value_reply(value: object) -> bytes:
    """Return a JSON value as a reply."""
    head = json.dumps({"value": value}).encode()
    return REPLY.pack(len(head), 0) + head


def error_reply(error: BaseException) -> bytes:
    """Return what was raised as a reply."""
    if type(error).__name__ in _ERRORS and isinstance(error, ToolkitError):
        parts = {name: getattr(error, name) for name in _PARTS}
        head: dict[str, Any] = {"error": [type(error).__name__, error.what, parts]}
    else:
        head = {"raised": f"{type(error).__name__}: {error}"[:_MOST_TEXT]}
    text = json.dumps(head).encode()
    return REPLY.pack(len(text), 0) + text


def read_head(text: bytes) -> dict[str, Any]:
    """Return the head of a reply; an error that it tells is raised.

    Raises
    ------
    FrameError
        it is no head; ToolkitError: the worker refused; RaisedError: the code raised
    """
    try:
        head = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FrameError("an answer that is no JSON") from error
    if not isinstance(head, dict) or len(head) != 1:
        raise FrameError("an answer of another form")
    if "raised" in head:
        raise RaisedError(printable(str(head["raised"])))
    if "error" in head:
        raise _error(head["error"])
    return head


def _error(content: object) -> ToolkitError:
    if not (isinstance(content, list) and len(content) == 3 and content[0] in _ERRORS):
        raise FrameError("an error of another form")
    _, problem, parts = content
    if not (isinstance(problem, str) and isinstance(parts, dict) and set(parts) <= set(_PARTS)):
        raise FrameError("an error of another form")
    texts = {name: None if part is None else printable(str(part)) for name, part in parts.items()}
    return _ERRORS[content[0]](printable(problem), **texts)


def read_arrays(
    head: Mapping[str, Any], body: bytes, shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, Array]:
    """Return the arrays of a reply, which must have these names and shapes.

    Raises
    ------
    FrameError
        other names, shapes or bytes
    """
    import numpy as np

    expected = {name: list(shape) for name, shape in shapes.items()}
    listed = head.get("arrays")
    pairs = listed if isinstance(listed, list) else ()
    if not all(isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str) for pair in pairs):
        raise FrameError("arrays of another form")
    sizes = {name: int(np.prod(shape)) for name, shape in expected.items()}
    if dict(map(tuple, pairs)) != expected or len(body) != 8 * sum(sizes.values()):
        raise FrameError("arrays of other names or shapes")
    arrays, at = {}, 0
    for name, _ in pairs:
        block = np.frombuffer(body, dtype="<f8", count=sizes[name], offset=at)
        arrays[name] = block.reshape(shapes[name]).astype(np.float64)
        at += 8 * sizes[name]
    return arrays


def printable(text: str) -> str:
    """Return a text of others for people: bounded, and without what a terminal would obey.

    >>> printable("no \\x1b[2J oil\\n")
    'no  [2J oil'
    """
    plain = "".join(mark if mark.isprintable() or mark == "\n" else " " for mark in text[:_MOST_TEXT])
    return plain.strip()
