"""Drafts that are only tried: on a copy, so that who tries one writes nothing of it."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from toolkit.files import real_path
from toolkit.inputs import is_regular, open_regular
from toolkit.lab.desk.drafts import DRAFTS, SESSION


@contextlib.contextmanager
def copied_draft(home: Path, draft_id: str) -> Iterator[Path]:
    """Yield the session file of a copy of a draft: who only tries it writes nothing of it."""
    source = home / DRAFTS / draft_id
    with tempfile.TemporaryDirectory() as place:
        copy = real_path(Path(place)) / draft_id
        copy.mkdir()
        for path in source.iterdir():
            if is_regular(path) and not path.name.startswith("."):
                with open_regular(path) as stream, (copy / path.name).open("wb") as copied:
                    shutil.copyfileobj(stream, copied)
        yield copy / SESSION
