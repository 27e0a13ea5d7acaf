"""The tool's side of a worker: it is asked, waited for as long as allowed, listened to, and ended."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import select
import shutil
import socket
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.worker.frames import (
    MOST_HEAD,
    REPLY,
    REQUEST,
    FrameError,
    printable,
    read_arrays,
    read_head,
)
from toolkit.worker.posix import Limits, begin, end_of, finish
from toolkit.worker.serve import BEGIN, CUT_OFF, Handlers

if TYPE_CHECKING:
    from toolkit.arrays import Array

_LAST = 8_192  # bytes of output that are remembered: the report of a crash fits in
_WORDS = 400  # characters of them that a message has
_PIECE = 1 << 16
_FAREWELL_S = 2.0  # from the end of the channel to the guardian's report
_FATAL = "Fatal Python error"  # begins the interpreter's own report of a crash


class DiedError(Exception):
    """The worker's process is no more; the text tells how it ended and what it said last."""


class LateError(Exception):
    """No answer came in time; the worker was ended."""


class Worker:
    """Handlers in a process of their own.

    Parameters
    ----------
    make : function of a module that returns the handlers by their names, called in the worker
    arguments : of ``make``; they must pickle
    until : time of `time.monotonic` at which waiting ends

    Raises
    ------
    DiedError, LateError, RaisedError, ToolkitError
        as `value` does; ConfigError: ``no-isolation``: the kernel cannot isolate it
    """

    def __init__(
        self, make: Callable[..., Handlers], arguments: tuple[Any, ...], limits: Limits, until: float
    ) -> None:
        self._scratch = tempfile.mkdtemp(prefix="toolkit-") if limits.isolated else ""
        self._last = b""
        self._channel, theirs = socket.socketpair()
        for end in (self._channel, theirs):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self._channel.setblocking(False)
        self._output, output = os.pipe()
        self._status, status = os.pipe()
        os.set_blocking(self._output, False)
        try:
            self._pid = begin(limits, (theirs.fileno(), output, status), self._scratch)
        finally:
            theirs.close()
            os.close(output)
            os.close(status)
        self._poll = select.poll()
        for descriptor in (self._channel.fileno(), self._output, self._status):
            self._poll.register(descriptor, select.POLLIN)
        self._open = True
        try:
            self.value(BEGIN, (make, *arguments), until)
        except BaseException:
            self.close()
            raise

    def value(self, name: str, arguments: tuple[Any, ...], until: float) -> Any:
        """Return the JSON value that a handler answers.

        Raises
        ------
        DiedError
            the process ended, or answered what was not asked for; LateError: it did not answer in time;
            RaisedError: the handler raised; ToolkitError: it refused
        """
        head, _ = self._answer(name, arguments, until, 0)
        if "value" not in head:
            raise self._killed(FrameError("arrays in the place of a value"))
        return head["value"]

    def arrays(
        self, name: str, arguments: tuple[Any, ...], until: float, shapes: Mapping[str, tuple[int, ...]]
    ) -> dict[str, Array]:
        """Return the arrays that a handler answers; all that `value` raises, and arrays of these shapes."""
        import math

        most = 8 * sum(math.prod(shape) for shape in shapes.values())
        head, body = self._answer(name, arguments, until, most)
        try:
            return read_arrays(head, body, shapes)
        except FrameError as error:
            raise self._killed(error) from error

    def close(self) -> None:
        """End the worker and all that came of it; what lay in its temporary folder goes as well."""
        if not self._open:
            return
        self._open = False
        finish(self._pid)
        self._channel.close()
        os.close(self._output)
        os.close(self._status)
        if self._scratch:
            shutil.rmtree(self._scratch, ignore_errors=True)

    def _answer(
        self, name: str, arguments: tuple[Any, ...], until: float, most: int
    ) -> tuple[dict[str, Any], bytes]:
        request = pickle.dumps((name, arguments), protocol=pickle.HIGHEST_PROTOCOL)
        try:
            reply = self._exchanged(REQUEST.pack(len(request)) + request, until, most)
        except FrameError as error:
            raise self._killed(error) from error
        except BaseException:  # late, dead or interrupted: what would come later answers no question
            self.close()
            raise
        try:
            return read_head(reply[0]), reply[1]
        except FrameError as error:
            raise self._killed(error) from error

    def _exchanged(self, request: bytes, until: float, most: int) -> tuple[bytes, bytes]:
        """Send a request and return head and body of the reply; output is taken up meanwhile."""
        unsent = memoryview(request)
        reply = bytearray()
        size, body = REPLY.size, 0
        while True:
            if unsent:
                unsent = unsent[self._sent(unsent) :]
                mask = select.POLLIN | (select.POLLOUT if unsent else 0)
                self._poll.modify(self._channel.fileno(), mask)
            seconds = until - time.monotonic()
            if seconds <= 0:
                raise LateError
            ready = dict(self._poll.poll(min(seconds, 3600.0) * 1000))
            if self._output in ready:
                self._listen()
            if ready.get(self._channel.fileno(), 0) & ~select.POLLOUT:
                piece = self._received()
                if not piece:
                    raise DiedError(self._farewell("it closed its connection to the tool"))
                reply += piece
                if size == REPLY.size and len(reply) >= size:
                    head, body = REPLY.unpack_from(reply)
                    if not 0 < head <= MOST_HEAD or body > most:
                        raise FrameError("an answer of another length")
                    size += head + body
                if len(reply) > size:
                    raise FrameError("more than one answer")
                if size > REPLY.size and len(reply) == size:
                    at = size - body
                    return bytes(reply[REPLY.size : at]), bytes(reply[at:])
            elif self._status in ready:
                raise DiedError(self._farewell(""))

    def _sent(self, unsent: memoryview) -> int:
        try:
            return self._channel.send(unsent, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return 0
        except OSError:  # the end of the channel is read, and tells more
            return len(unsent)

    def _received(self) -> bytes:
        try:
            return self._channel.recv(_PIECE)
        except OSError:
            return b""

    def _listen(self) -> None:
        """Take up what the worker printed, and remember the end of it."""
        try:
            piece = os.read(self._output, _PIECE)
        except OSError:
            return
        if not piece:
            self._poll.unregister(self._output)
        self._last = (self._last + piece)[-_LAST:]

    def _farewell(self, cause: str) -> str:
        """Return how the worker ended, by its guardian's report, and its last words."""
        until = time.monotonic() + _FAREWELL_S
        while not select.select([self._status], [], [], 0.05)[0]:
            self._listen_out()
            if time.monotonic() > until:
                break
        else:
            report = os.read(self._status, _PIECE)
            cause = _cause(report) if report else "its guardian was killed"
        self._listen_out()
        words = last_words(self._last)
        return f"the process of the simulator: {cause}" + (f"; its last words: {words}" if words else "")

    def _listen_out(self) -> None:
        """Take up what still stands in the pipe; a process that goes on printing is not waited for."""
        for _ in range(64):
            if not select.select([self._output], [], [], 0)[0]:
                return
            before = self._last
            with contextlib.suppress(KeyError):
                self._listen()
            if self._last == before:
                return

    def _killed(self, error: FrameError) -> DiedError:
        self.close()
        return DiedError(f"the process of the simulator: {error}; it was ended")


def _cause(report: bytes) -> str:
    """Return a cause of death from a guardian's report.

    Raises
    ------
    ConfigError
        the guardian refused to begin
    """
    content = json.loads(report)
    if "refused" in content:
        problem, parts = content["refused"]
        names = {"where", "got", "expected", "next_step", "rule"}
        raise ConfigError(problem, **{name: part for name, part in parts.items() if name in names})
    if "failed" in content:
        return f"it could not be started: {content['failed']}"
    if content["reason"]:
        return f"it had {content['reason']} and was ended"
    status = content["status"]
    if status is not None and os.WIFEXITED(status) and os.WEXITSTATUS(status) == CUT_OFF:
        return "it closed its connection to the tool"
    return "it was ended" if status is None else end_of(status)


def last_words(output: bytes) -> str:
    """Return the end of an output for people; of a crash what the interpreter reports of its cause.

    >>> last_words(b"step 1\\nFatal Python error: Aborted\\n\\nThread 0x1:\\n  File 'sim.py'\\n")
    "step 1 / Fatal Python error: Aborted / Thread 0x1: / File 'sim.py'"
    """
    text = output.decode("utf-8", "replace")
    printed, fatal, report = text.rpartition(_FATAL)
    lines = [line for line in printable(printed[-_WORDS:] if fatal else text[-_WORDS:]).splitlines() if line]
    if fatal:
        lines += [line for line in printable(fatal + report).splitlines() if line.strip()][:3]
    return " / ".join(line.strip() for line in lines)
