"""A worker is asked, limited and ended; what it sends past its protocol is refused."""

from __future__ import annotations

import contextlib
import os
import pickle
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.worker.probes import handlers
from toolkit.errors import ConfigError, FitError
from toolkit.worker import posix
from toolkit.worker.frames import (
    REPLY,
    FrameError,
    RaisedError,
    arrays_reply,
    error_reply,
    read_arrays,
    read_head,
)
from toolkit.worker.posix import Limits
from toolkit.worker.worker import DiedError, LateError, Worker, last_words

LIMITS = Limits(memory_bytes=1 << 30, processes=16, scratch_bytes=0)


@pytest.fixture(params=["forked", "executed"])
def worker(request, monkeypatch) -> Iterator[Worker]:
    monkeypatch.setattr(posix, "_has_threads", lambda: request.param == "executed")
    with contextlib.closing(Worker(handlers, (), LIMITS, soon())) as begun:
        yield begun


def soon(seconds: float = 60.0) -> float:
    return time.monotonic() + seconds


def test_it_answers_values_and_arrays_from_another_process(worker):
    assert worker.value("add", ("a", "b"), soon()) == "ab"
    assert worker.value("pid", (), soon()) != os.getpid()
    big = np.arange(300_000.0)
    np.testing.assert_array_equal(worker.arrays("double", (big,), soon(), {"x": big.shape})["x"], 2 * big)


def test_what_is_raised_crosses_and_the_worker_goes_on(worker):
    with pytest.raises(RaisedError, match="KeyboardInterrupt"):
        worker.value("raise", ("KeyboardInterrupt",), soon())
    with pytest.raises(RaisedError, match="MemoryError"):
        worker.value("memory", (4 << 30,), soon())
    assert worker.value("memory", (1 << 20,), soon()) == 1 << 20
    assert worker.value("add", (1, 2), soon()) == 3


def test_a_late_answer_ends_it_and_all_its_processes(worker):
    process = worker.value("pid", (), soon())
    began = time.monotonic()
    with pytest.raises(LateError):
        worker.value("child", ("import time; time.sleep(600)",), soon(0.5))
    assert time.monotonic() - began < 30
    assert not Path(f"/proc/{process}").exists()


def test_none_of_its_descriptors_is_the_tools(tmp_path):
    # A pipe of the tool's that stayed open there would keep its reader waiting for the end.
    with (tmp_path / "tools_own").open("w"):
        begun = Worker(handlers, (), LIMITS, soon())
    with contextlib.closing(begun):
        folder = Path(f"/proc/{begun.value('pid', (), soon())}/fd")
        opened = {link.readlink().name for link in folder.iterdir()}
    assert "null" in opened
    assert "tools_own" not in opened


@pytest.mark.parametrize(
    "content",
    [
        b"garbage",
        REPLY.pack(1 << 30, 0),
        REPLY.pack(0, 0),
        REPLY.pack(2, 1 << 50),
        REPLY.pack(7, 0) + b"[1,2,3]",
        REPLY.pack(4, 0) + b"\x80\x04N.",
        REPLY.pack(12, 0) + b'{"arrays":1}',
        pickle.dumps(os.getpid),
    ],
)
def test_what_comes_past_the_protocol_is_refused(content):
    with contextlib.closing(Worker(handlers, (), LIMITS, soon())) as hostile, pytest.raises(DiedError):
        hostile.value("garbage", (content,), soon(5))


@pytest.mark.parametrize(
    "head",
    [
        {"arrays": [["x", [2]], ["y", [0]]]},
        {"arrays": [["x", [1]]]},
        {"arrays": [["x", [-2]]]},
        {"arrays": [["x"]]},
        {"arrays": [[1, [2]]]},
        {"arrays": [["x", {}]]},
        {"arrays": {"x": [2]}},
        {"value": 1},
    ],
)
def test_arrays_of_another_form_are_refused(head):
    with pytest.raises(FrameError):
        read_arrays(head, struct.pack("<2d", 1, 2), {"x": (2,)})


def test_arrays_come_as_they_were_sent():
    sent = {"x": np.array([[1.0, np.nan, -0.0]]), "y": np.zeros(0)}
    reply = arrays_reply(sent)
    head, body = REPLY.unpack_from(reply)
    text, data = reply[REPLY.size : REPLY.size + head], reply[REPLY.size + head :]
    assert len(data) == body
    back = read_arrays(read_head(text), data, {"x": (1, 3), "y": (0,)})
    assert back["x"].tobytes() == sent["x"].tobytes()
    back["x"][0, 0] = 2.0  # it may be written to, as any array of ours


@pytest.mark.parametrize("error", [ConfigError("w", rule="r", got="g"), FitError("w", where="p")])
def test_an_error_comes_as_it_was_raised(error):
    with pytest.raises(type(error)) as came:
        read_head(error_reply(error)[REPLY.size :])
    assert came.value.as_dict() == error.as_dict()


def test_an_error_of_no_known_class_is_none_of_ours():
    with pytest.raises(FrameError):
        read_head(b'{"error": ["SystemExit", "w", {}]}')
    with pytest.raises(RaisedError, match="ValueError: no oil"):
        read_head(error_reply(ValueError("no oil"))[REPLY.size :])


def test_last_words_are_bounded_and_plain():
    words = last_words(b"\x1b]0;title\x07" + b"oil " * 5_000 + b"\xff end")
    assert words.endswith("end")
    assert len(words) <= 400
    assert words.isprintable()


@pytest.mark.parametrize(("name", "counts"), [("another", True), ("jemalloc_bg_thd", False)])
def test_a_thread_of_the_memory_allocator_costs_no_new_interpreter(name, counts):
    before, named, done = posix.threads(), threading.Event(), threading.Event()

    def wait() -> None:
        Path(f"/proc/self/task/{threading.get_native_id()}/comm").write_text(name)
        named.set()
        done.wait()

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        assert named.wait(60)
        assert (len(posix.threads() - before) == 1) is counts
    finally:
        done.set()
        thread.join()
