"""What commands have worked out before: tests ask for the same test, its tire file and figures again.

Only commands get what is remembered, for they look their helpers up when they run: a test of a helper itself
has imported it before, and asks it anew.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

from toolkit import pipeline
from toolkit.lab.tire_tests import tire_files
from toolkit.report import drawer, figures
from toolkit.report.content import Plot


@contextlib.contextmanager
def remembered_work() -> Iterator[None]:
    """Have commands reduce a test, fit the tire of one and draw a figure once, whoever asks."""
    process = _remembered(pipeline.process)

    @functools.wraps(process.__wrapped__)
    def processed(folder: Any, recordings: Any, record: Any, *, protocol: Any = None, use: Any = None) -> Any:
        # The machine's definition is a file: a test of the same name and rows may be on another machine.
        machine = pipeline.machine_of(folder, protocol)
        return process(folder, recordings, record, protocol=protocol, use=use, beside=machine)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "process", processed)
        patch.setattr(tire_files, "fit_test_tire", _remembered(tire_files.fit_test_tire))
        patch.setattr(figures, "draw", _remembered(figures.draw))
        patch.setattr(drawer, "Drawer", _Here)
        yield


def _remembered(ask: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that answers the same question by a copy of its first answer."""
    answers: dict[bytes, bytes] = {}

    @functools.wraps(ask)
    def asked(*given: Any, beside: object = None, **named: Any) -> Any:
        key = hashlib.sha256(pickle.dumps((given, sorted(named.items()), beside))).digest()
        if key not in answers:
            answers[key] = pickle.dumps(ask(*given, **named))
        return pickle.loads(answers[key])  # noqa: S301  written above

    return asked


class _Here:
    """A drawer without a worker, which imports matplotlib for every report: `test_drawer.py` has it."""

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def pictures(self, plots: Mapping[str, Plot]) -> dict[str, figures.Picture]:
        """Return the drawn figures by name."""
        return {name: figures.draw(plot) for name, plot in plots.items()}
