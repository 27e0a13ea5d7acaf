"""Draw a report's figures in processes of their own, while the document is read and filled.

matplotlib's import and its drawing are half of what a report costs in Python; started first, they run
beside the reduction of the test and the preparation of LibreOffice.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType

from toolkit.report.content import Plot
from toolkit.report.figures import Picture, draw


class Drawer:
    """Workers that import matplotlib at once and draw when they are asked to. A context manager."""

    def __init__(self, *, workers: int | None = None) -> None:
        """Start the workers; by default one a core, two at most."""
        count = min(2, os.cpu_count() or 1) if workers is None else workers
        # -P: a folder named toolkit where the user happens to stand must not be imported.
        command = [sys.executable, "-P", "-m", "toolkit.report.drawer"]
        self._workers = [
            subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
            for _ in range(count)
        ]
        self._pool = ThreadPoolExecutor(max_workers=max(1, count))
        self._closed = False

    def __enter__(self) -> Drawer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the workers."""
        self._closed = True
        for worker in self._workers:
            worker.kill()
        self._pool.shutdown()
        for worker in self._workers:
            worker.wait()
            for stream in (worker.stdin, worker.stdout):
                if stream is not None and not stream.closed:
                    with contextlib.suppress(OSError):  # an order that the killed worker did not take
                        stream.close()
        self._workers = []

    def pictures(self, plots: Mapping[str, Plot]) -> Mapping[str, Picture]:
        """Return the drawn figures by name; a look-up waits until its figure is there."""
        waiting: dict[str, Future[Picture]] = {name: Future() for name in plots}
        shares = [dict(list(plots.items())[i :: len(self._workers)]) for i in range(len(self._workers))]
        for worker, share in zip(self._workers, shares, strict=True):
            self._pool.submit(_ask, worker, share, waiting, lambda: self._closed)
        return _Waiting(waiting)


class _Waiting(Mapping[str, Picture]):
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
    share: dict[str, Plot],
    waiting: Mapping[str, Future[Picture]],
    closed: Callable[[], bool],
) -> None:
    """Give a worker its share; each figure is there as soon as it is drawn: filling goes on beside."""
    assert worker.stdin is not None  # noqa: S101  both are pipes
    assert worker.stdout is not None  # noqa: S101
    # A worker that could not start or was killed costs time, not the report: what is left is drawn here.
    with contextlib.suppress(Exception):
        worker.stdin.write(pickle.dumps(share))
        worker.stdin.close()
        for _ in share:
            name, picture = pickle.load(worker.stdout)  # noqa: S301  our own child wrote it
            waiting[name].set_result(picture)
    for name, plot in share.items():
        if waiting[name].done():
            continue
        if closed():
            waiting[name].cancel()
            continue
        try:
            waiting[name].set_result(draw(plot))
        except Exception as error:  # noqa: BLE001  raised again where the figure is asked for
            waiting[name].set_exception(error)


def _work() -> None:
    import matplotlib.backends.backend_agg
    import matplotlib.figure
    import matplotlib.ticker  # noqa: F401  imported before the order comes

    order = sys.stdin.buffer.read()
    if order:
        share: dict[str, Plot] = pickle.loads(order)  # noqa: S301  our own parent wrote it
        for name, plot in share.items():
            sys.stdout.buffer.write(pickle.dumps((name, draw(plot))))
            sys.stdout.buffer.flush()


if __name__ == "__main__":
    _work()
