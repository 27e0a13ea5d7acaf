"""Draw a report's figures in a process of their own, while the document is read and filled.

matplotlib's import and its drawing are half of what a report costs in Python; started first, they run
beside the reduction of the test and the preparation of LibreOffice. The import is paid for once: the process
divides itself among the cores only when it has figures to draw.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import IO, TYPE_CHECKING

from toolkit.system import can_fork, processors

if TYPE_CHECKING:
    from toolkit.report.content import Plot
    from toolkit.report.figures import Picture


class Drawer:
    """A worker that imports matplotlib at once and draws when it is asked to. A context manager."""

    def __init__(self, *, hands: int | None = None) -> None:
        """Start the worker; it draws with so many processes, by default one a core, two at most."""
        count = min(2, processors()) if hands is None else hands
        count = count if can_fork() else 1
        # -P: a folder named toolkit where the user happens to stand must not be imported.
        command = [sys.executable, "-P", "-m", "toolkit.report.drawer", str(count)]
        self._worker = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._closed = False

    def __enter__(self) -> Drawer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the worker; a process that draws beside it ends where its figures are no longer taken."""
        self._closed = True
        self._worker.kill()
        self._pool.shutdown()
        self._worker.wait()
        for stream in (self._worker.stdin, self._worker.stdout):
            if stream is not None and not stream.closed:
                with contextlib.suppress(OSError):  # an order that the killed worker did not take
                    stream.close()

    def pictures(self, plots: Mapping[str, Plot]) -> Mapping[str, Picture]:
        """Return the drawn figures by name; a look-up waits until its figure is there."""
        waiting: dict[str, Future[Picture]] = {name: Future() for name in plots}
        self._pool.submit(_ask, self._worker, dict(plots), waiting, lambda: self._closed)
        return _Waiting(waiting)


class _Waiting(Mapping[str, "Picture"]):
    def __init__(self, jobs: dict[str, Future[Picture]]) -> None:
        self._jobs = jobs

    def __getitem__(self, name: str) -> Picture:
        return self._jobs[name].result()

    def __contains__(self, name: object) -> bool:
        return name in self._jobs

    def __iter__(self) -> Iterator[str]:
        return iter(self._jobs)

    def __len__(self) -> int:
        return len(self._jobs)


def _ask(
    worker: subprocess.Popen[bytes],
    plots: dict[str, Plot],
    waiting: Mapping[str, Future[Picture]],
    closed: Callable[[], bool],
) -> None:
    """Give the worker its order; each figure is there as soon as it is drawn: filling goes on beside."""
    assert worker.stdin is not None  # noqa: S101  both are pipes
    assert worker.stdout is not None  # noqa: S101
    # A worker that could not start or was killed costs time, not the report: what is left is drawn here.
    with contextlib.suppress(Exception):
        worker.stdin.write(pickle.dumps(plots))
        worker.stdin.close()
        for _ in plots:
            name, picture = pickle.load(worker.stdout)  # noqa: S301  our own child wrote it
            waiting[name].set_result(picture)
    from toolkit.report.figures import draw

    for name, plot in plots.items():
        if waiting[name].done():
            continue
        if closed():
            waiting[name].cancel()
            continue
        try:
            waiting[name].set_result(draw(plot))
        except Exception as error:  # noqa: BLE001  raised again where the figure is asked for
            waiting[name].set_exception(error)


def _work(hands: int) -> None:
    import matplotlib.backends.backend_agg
    import matplotlib.figure
    import matplotlib.ticker  # noqa: F401  imported before the order comes

    from toolkit.report.figures import draw

    order = sys.stdin.buffer.read()
    if order:
        plots: dict[str, Plot] = pickle.loads(order)  # noqa: S301  our own parent wrote it
        names = list(plots)
        # What draws beside inherits matplotlib, which a process of its own would have to import again.
        beside = [_beside({name: plots[name] for name in names[i::hands]}) for i in range(1, hands)]
        lock = threading.Lock()
        threads = [threading.Thread(target=_pass_on, args=(drawn, lock)) for drawn in beside]
        for thread in threads:
            thread.start()
        for name in names[::hands]:
            _tell(name, draw(plots[name]), lock)
        for thread in threads:
            thread.join()


def _pass_on(drawn: IO[bytes], lock: threading.Lock) -> None:
    # Taken as it comes: a pipe holds one figure or two, and its writer would stand still.
    with contextlib.suppress(EOFError):
        while True:
            name, picture = pickle.load(drawn)  # noqa: S301  a copy of this process wrote it
            _tell(name, picture, lock)


def _tell(name: str, picture: Picture, lock: threading.Lock) -> None:
    with lock:
        sys.stdout.buffer.write(pickle.dumps((name, picture)))
        sys.stdout.buffer.flush()


def _beside(share: dict[str, Plot]) -> IO[bytes]:
    """Draw a share in a copy of this process and return the stream that its figures come from."""
    from toolkit.report.figures import draw

    reading, writing = os.pipe()
    if os.fork():
        os.close(writing)
        return os.fdopen(reading, "rb")
    # The parent's end is seen by whoever reads from it only where no copy holds its output open.
    sys.stdout.close()
    os.close(reading)
    try:
        with os.fdopen(writing, "wb") as out:
            for name, plot in share.items():
                out.write(pickle.dumps((name, draw(plot))))
                out.flush()
    finally:
        os._exit(0)


if __name__ == "__main__":
    _work(int(sys.argv[1]))
