"""A copy of an instrument's folder in which a change can be tried: the registry itself is only read."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

from toolkit.calibration.registry import store
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError


@contextlib.contextmanager
def rehearsal(registry: Registry, instrument: str) -> Iterator[Registry]:
    """Yield a registry of one instrument that is thrown away at the end.

    What is done there meets the same gates and answers the same as in the registry; an interrupted write is
    finished in the copy alone. Errors name the places of the registry.
    """
    with tempfile.TemporaryDirectory(prefix="toolkit-rehearsal-") as place:
        copy = Path(place)
        store.copy_files(registry.folder / instrument, copy / instrument)
        try:
            yield Registry(copy)
        except ToolkitError as error:
            parts = {
                key: text.replace(place, str(registry.folder)) if text else text
                for key, text in error.as_dict().items()
                if key != "what"
            }
            raise type(error)(error.what, **parts) from error
