"""What commands have worked out before: tests ask for the same test, its tire file and figures again.

Only commands get what is remembered, for they look their helpers up when they run: a test of a helper itself
has imported it before, and asks it anew.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.remembered import once, remembered
from toolkit import pipeline, testfile
from toolkit.inputs import RECORDING_FILE, read_input
from toolkit.lab.tire_tests import tire_files
from toolkit.report import drawer, figures
from toolkit.report.content import Plot
from toolkit.tires import global_fit, models
from toolkit.tires.global_model import GlobalModel


@contextlib.contextmanager
def remembered_work() -> Iterator[None]:
    """Have commands reduce and read a test, fit the tire of one and draw a figure once, whoever asks."""
    process = remembered(pipeline.process)

    @functools.wraps(process.__wrapped__)
    def processed(folder: Any, recordings: Any, record: Any, *, protocol: Any = None, use: Any = None) -> Any:
        # The machine's definition is a file: a test of the same name and rows may be on another machine.
        machine = pipeline.machine_of(folder, protocol)
        return process(folder, recordings, record, protocol=protocol, use=use, beside=machine)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "process", processed)
        patch.setattr(testfile, "read_test_file", _read)
        patch.setattr(tire_files, "fit_test_tire", remembered(tire_files.fit_test_tire))
        patch.setattr(global_fit, "fit_global", _fitted)
        patch.setattr(figures, "draw", remembered(figures.draw))
        patch.setattr(drawer, "Drawer", _Here)
        yield


_read_test_file = testfile.read_test_file


@functools.wraps(_read_test_file)
def _read(path: Path) -> Any:
    # A file is known by its content; what cannot be opened is refused as the command refuses it.
    return once(("read_test_file", read_input(path, RECORDING_FILE)), lambda: _read_test_file(path))


_fit = global_fit.fit_global


@remembered
def _fit_by_name(name: str, *given: Any, **named: Any) -> Any:
    return _fit(models.find(name), *given, **named)


@functools.wraps(_fit)
def _fitted(model: GlobalModel, *given: Any, **named: Any) -> Any:
    # A model is functions, which have no content: those of the catalogue are known by their names.
    known = model.name in models.model_names() and models.find(model.name) is model
    return _fit_by_name(model.name, *given, **named) if known else _fit(model, *given, **named)


class _Here:
    """A drawer without a worker, which imports matplotlib for every report: `test_drawer.py` has it."""

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def pictures(self, plots: Mapping[str, Plot]) -> dict[str, figures.Picture]:
        """Return the drawn figures by name."""
        return {name: figures.draw(plot) for name, plot in plots.items()}
