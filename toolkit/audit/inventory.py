"""The inventory of an archive: every regular file that may be a recording, and nothing else.

``test.toml`` is left out; links are not followed, so that nothing outside the archive is read and nothing
inside it twice. No file is opened here: the toolkit's own results are known by their content, in a worker.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from toolkit.errors import ConfigError
from toolkit.recording.folder import TEST_FILE


def inventory(archive: Path) -> tuple[str, ...]:
    """Return the paths of an archive's files, relative to it, with ``/``, sorted.

    Raises
    ------
    ConfigError
        ``archive``: it is no folder, or a folder in it cannot be read
    """
    if not archive.is_dir():
        raise ConfigError(
            "the archive cannot be used",
            where=archive,
            got="a file" if archive.exists() else "nothing",
            expected="a folder with recordings",
            next_step="check the path; a single file is for 'toolkit inspect'",
            rule="archive",
        )
    return tuple(sorted(_walk(archive, "")))


def _walk(folder: Path, prefix: str) -> Iterator[str]:
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError as error:
        raise ConfigError(
            "a folder of the archive cannot be read",
            where=folder,
            got=error.strerror or "an error",
            expected="a readable folder",
            next_step="check its permissions; nothing was audited",
            rule="archive",
        ) from error
    for entry in entries:
        if entry.is_symlink():
            continue
        name = prefix + entry.name
        if entry.is_dir(follow_symlinks=False):
            yield from _walk(folder / entry.name, name + "/")
        elif entry.is_file(follow_symlinks=False) and entry.name != TEST_FILE:
            yield name
