"""The worker's side: one request after the other is answered, and nothing that is raised ends the process."""

from __future__ import annotations

import os
import pickle
import socket
from collections.abc import Callable, Mapping
from typing import Any

from toolkit.worker.frames import REQUEST, arrays_reply, error_reply, value_reply

BEGIN = "begin"
CUT_OFF = 118  # exit code of a worker whose code has closed the connection
Handlers = Mapping[str, Callable[..., Any]]


class Numbers(dict[str, Any]):
    """Arrays of doubles by their names, as a handler returns them; every other answer is a JSON value."""


def serve(descriptor: int, wall: Callable[[], None] | None) -> None:
    """Answer requests until nobody asks any more.

    The first one is `BEGIN` with a function that returns the handlers of all others by their names, and its
    arguments; before that the ``wall`` is closed.
    """
    with socket.socket(fileno=descriptor) as channel:
        handlers: Handlers = {}
        while True:
            request = _received(channel)
            if request is None:
                return
            try:
                name, arguments = pickle.loads(request)  # noqa: S301  from the tool itself
                if name == BEGIN:
                    if wall is not None:
                        wall()
                    handlers = arguments[0](*arguments[1:])
                    reply = value_reply(None)
                else:
                    answer = handlers[name](*arguments)
                    reply = arrays_reply(answer) if isinstance(answer, Numbers) else value_reply(answer)
            except BaseException as error:  # noqa: BLE001  a KeyboardInterrupt of the code is no interruption
                reply = error_reply(error)
            try:
                channel.sendall(reply)
            except OSError:
                os._exit(CUT_OFF)


def _received(channel: socket.socket) -> bytes | None:
    head = _exactly(channel, REQUEST.size)
    return None if head is None else _exactly(channel, REQUEST.unpack(head)[0])


def _exactly(channel: socket.socket, size: int) -> bytes | None:
    """Return as many bytes, None at the end of the channel."""
    data = bytearray()
    while len(data) < size:
        piece = channel.recv(min(size - len(data), 1 << 20))
        if not piece:
            return None
        data += piece
    return bytes(data)
